#!/usr/bin/env bash
# Unpacks the system libraries that Blender's module needs and this machine lacks into a private folder. It installs nothing and needs no
# root.
#
#   private-libraries.sh FOLDER FILE.so…    puts libraries into FOLDER/lib until the dynamic linker finds all that the files need
#
#   /etc/apt (mirrors, proxy) ─► FOLDER/apt: lists of packages ─► the packages below ─► their *.so* in FOLDER/lib
#
# Debian and Ubuntu only; elsewhere it fails and names what is missing. It never unpacks the C library, because a process can have only
# one, the machine's.
set -euo pipefail
export LC_ALL=C
# Packages with the libraries that Blender's module links, directly or indirectly. Names that this release does not know are skipped; in
# the end the dynamic linker tells whether the rest suffices.
PACKAGES=(libx11-6 libxcb1 libxau6 libxdmcp6 libbsd0 libmd0 libxrender1 libxfixes3 libxi6 libxext6 libxkbcommon0 xkb-data libsm6 libice6
    libuuid1 libgl1 libglvnd0 libglx0 libegl1 libxxf86vm1)
INSTALL="install them (Debian and Ubuntu: apt install libgl1 libegl1 libsm6 libice6 libxext6 libxfixes3 libxi6 libxrender1 libxxf86vm1 libxkbcommon0)"

fail() {
    printf 'private-libraries: %s\n' "$*" >&2
    exit 1
}
# lacking FILE…: prints the libraries that the dynamic linker does not find, on one line.
lacking() {
    LD_LIBRARY_PATH="$folder/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" ldd "$@" | awk '/not found/ && !seen[$1]++ { printf " %s", $1 }'
}

[ $# -ge 2 ] || fail "usage: private-libraries.sh FOLDER FILE.so…"
for file in "${@:2}"; do
    [ -f "$file" ] || fail "$file is missing"
done
command -v ldd >/dev/null || fail "ldd is missing, which lists needed libraries: this script works on Linux with the GNU C library"
mkdir -p "$1"
folder=$(cd "$1" && pwd -P)
shift
exec 9>"$folder/.lock"
flock 9 # of two processes at once, the second waits and then finds everything in place
missing=$(lacking "$@")
[ -n "$missing" ] || exit 0
for tool in apt-get apt-cache dpkg-deb; do
    command -v "$tool" >/dev/null || fail "Blender's module lacks$missing, and without $tool they cannot be unpacked: $INSTALL"
done

# shellcheck source=private-apt.sh
. "$(dirname "$0")/private-apt.sh"
work=$folder/apt
private_apt "$work"
trap 'rm -rf "$work"' EXIT
private_update "$work" || true
known=()
for package in "${PACKAGES[@]}"; do
    if apt-cache show "$package" >/dev/null 2>&1; then known+=("$package"); fi
done
if [ ${#known[@]} = 0 ]; then
    private_why "$work"
    fail "Blender's module lacks$missing, and no mirror of /etc/apt gave a list of packages (no network?): $INSTALL"
fi
(cd "$work/archives" && apt-get --quiet download "${known[@]}") >"$work/log" 2>&1 || {
    private_why "$work"
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
