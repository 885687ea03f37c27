#!/usr/bin/env bash
# Unpacks the system libraries that Blender's module needs, and this machine lacks, into a private folder. Nothing is installed and
# nobody needs to be root.
#
#   private-libraries.sh FOLDER FILE.so…    FOLDER/lib gets what the files' dynamic linker does not find; nothing when it finds all
#
#   /etc/apt (mirrors, proxy) ─► FOLDER/apt: lists of packages ─► the packages below ─► their *.so* in FOLDER/lib
#
# Debian and Ubuntu only: elsewhere it fails and names what is missing. The C library is never among what is unpacked: a process has
# one, and it must be the machine's.
set -euo pipefail
export LC_ALL=C
# What Blender's module links, and what that links in turn; names that this system's release does not know are passed over, and
# whether they sufficed is asked of the dynamic linker at the end.
PACKAGES=(libx11-6 libxcb1 libxau6 libxdmcp6 libbsd0 libmd0 libxrender1 libxfixes3 libxi6 libxext6 libxkbcommon0 xkb-data libsm6 libice6
    libuuid1 libgl1 libglvnd0 libglx0 libegl1 libxxf86vm1)
INSTALL="install them (Debian and Ubuntu: apt install libgl1 libegl1 libsm6 libice6 libxext6 libxfixes3 libxi6 libxrender1 libxxf86vm1 libxkbcommon0)"

fail() {
    printf 'private-libraries: %s\n' "$*" >&2
    exit 1
}
# lacking FILE…: the libraries that the dynamic linker does not find, on one line.
lacking() {
    LD_LIBRARY_PATH="$folder/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" ldd "$@" | awk '/not found/ && !seen[$1]++ { printf " %s", $1 }'
}

[ $# -ge 2 ] || fail "usage: private-libraries.sh FOLDER FILE.so…"
for file in "${@:2}"; do
    [ -f "$file" ] || fail "$file is missing"
done
command -v ldd >/dev/null || fail "ldd is missing, which asks the dynamic linker: this works on Linux with the GNU C library"
mkdir -p "$1"
folder=$(cd "$1" && pwd -P)
shift
exec 9>"$folder/.lock"
flock 9 # two at once: the second finds all there
missing=$(lacking "$@")
[ -n "$missing" ] || exit 0
for tool in apt-get apt-cache dpkg-deb; do
    command -v "$tool" >/dev/null || fail "Blender's module lacks$missing, and without $tool they cannot be unpacked: $INSTALL"
done

# An apt of our own: the machine's mirrors, proxy and certificates; none of its hooks, and not its list of what is installed, so that
# what comes depends on the release alone.
work=$folder/apt
rm -rf "$work"
mkdir -p -m 700 "$work" # the settings may hold a proxy's password
mkdir -p "$work"/{lists/partial,archives/partial,none,root}
trap 'rm -rf "$work"' EXIT
: >"$work/status"
{
    apt-config dump | grep -E '^Acquire::' | grep -vE '^Acquire::(IndexTargets|Changelogs)' || true
    cat <<END
Dir::Etc::Main "/dev/null";
Dir::Etc::Parts "$work/none";
Dir::State::Lists "$work/lists";
Dir::State::status "$work/status";
Dir::Cache "$work";
Dir::Cache::Archives "$work/archives";
Dir::Log "$work";
Debug::NoLocking "1";
APT::Sandbox::User "root";
Acquire::Languages { "none"; };
Acquire::Retries "3";
END
} >"$work/apt.conf"
export APT_CONFIG=$work/apt.conf

# A mirror of somebody else's that does not answer is no matter as long as the release's own does.
apt-get --quiet update >"$work/log" 2>&1 || true
known=()
for package in "${PACKAGES[@]}"; do
    if apt-cache show "$package" >/dev/null 2>&1; then known+=("$package"); fi
done
if [ ${#known[@]} = 0 ]; then
    grep -E '^[EW]:' "$work/log" | head -n 3 >&2 || true
    fail "Blender's module lacks$missing, and no mirror of /etc/apt gave a list of packages (no network?): $INSTALL"
fi
(cd "$work/archives" && apt-get --quiet download "${known[@]}") >"$work/log" 2>&1 || {
    grep -E '^[EW]:' "$work/log" | head -n 3 >&2 || true
    fail "Blender's module lacks$missing, and their packages could not be fetched: $INSTALL"
}

for package in "$work"/archives/*.deb; do
    dpkg-deb -x "$package" "$work/root"
done
rm -rf "$folder/lib"
mkdir "$folder/lib"
find "$work/root" -name '*.so*' -exec cp -a -t "$folder/lib" {} +
missing=$(lacking "$@")
[ -z "$missing" ] || fail "Blender's module still lacks$missing: $INSTALL"
printf 'private-libraries: %s packages unpacked into %s\n' "${#known[@]}" "$folder/lib"
