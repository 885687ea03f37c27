#!/usr/bin/env bash
# Unpacks the system libraries that Blender's module needs, and this machine lacks, into a private folder. Nothing is installed and
# nobody needs to be root.
#
#   private-libraries.sh FOLDER FILE.so…    FOLDER/lib gets what the files' dynamic linker does not find; nothing when it finds all
#
# Debian and Ubuntu only: elsewhere it fails and names what is missing. The lists of packages are fetched into the folder, from the
# mirrors that this machine's apt is set up with.
set -euo pipefail
export LC_ALL=C
PACKAGES=(libx11-6 libxcb1 libxau6 libxdmcp6 libbsd0 libmd0 libxrender1 libxfixes3 libxi6 libxext6 libxkbcommon0 xkb-data libsm6 libice6
    libuuid1 libgl1 libglvnd0 libglx0 libegl1 libxxf86vm1)

fail() {
    printf 'private-libraries: %s\n' "$*" >&2
    exit 1
}
missing() { # FILE…: libraries that the dynamic linker does not find
    LD_LIBRARY_PATH="$folder/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" ldd "$@" 2>/dev/null | awk '/not found/ { print $1 }' | sort -u
}

mkdir -p "$1"
folder=$(cd "$1" && pwd -P)
shift
exec 9>"$folder/.lock"
flock 9 # two at once: the second finds all there
lacking=$(missing "$@")
[ -n "$lacking" ] || exit 0
wanted="Blender's module lacks $(tr '\n' ' ' <<<"$lacking")"
install="Install them (Debian and Ubuntu: apt install libgl1 libegl1 libsm6 libice6 libxext6 libxfixes3 libxi6 libxrender1 libxxf86vm1 libxkbcommon0)"
command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null || fail "$wanted. $install"

work=$folder/apt
rm -rf "$work"
mkdir -p "$work"/{lists/partial,archives/partial}
: >"$work/status" # empty: what comes does not depend on what this machine has installed
apt=(apt-get --quiet --yes -o "Dir::State::Lists=$work/lists" -o "Dir::State::status=$work/status" -o "Dir::Cache=$work"
    -o "Dir::Cache::Archives=$work/archives" -o Debug::NoLocking=1 -o APT::Sandbox::User="$(id -un)" -o APT::Install-Recommends=0
    -o Acquire::Languages=none -o Acquire::Retries=3)
"${apt[@]}" -o APT::Update::Error-Mode=any update >"$work/log" 2>&1 || {
    tail -n 3 "$work/log" >&2
    fail "$wanted, and the mirrors of /etc/apt could not be read. $install"
}
known=()
for package in "${PACKAGES[@]}"; do
    apt-cache -o "Dir::State::Lists=$work/lists" -o "Dir::State::status=$work/status" -o "Dir::Cache=$work" show "$package" >/dev/null 2>&1 &&
        known+=("$package")
done
(cd "$work/archives" && "${apt[@]}" download "${known[@]}") >"$work/log" 2>&1 || {
    tail -n 3 "$work/log" >&2
    fail "$wanted, and the packages could not be fetched. $install"
}

rm -rf "$folder/lib" "$work/root"
mkdir -p "$folder/lib" "$work/root"
for package in "$work"/archives/*.deb; do
    dpkg-deb -x "$package" "$work/root"
done
find "$work/root" -name '*.so*' ! -path '*/dri/*' -exec cp -a -t "$folder/lib" {} +
rm -rf "$work"
lacking=$(missing "$@")
[ -z "$lacking" ] || fail "Blender's module still lacks $(tr '\n' ' ' <<<"$lacking"). $install"
printf 'private-libraries: %s libraries unpacked into %s\n' "$(find "$folder/lib" -name '*.so*' | wc -l)" "$folder/lib"
