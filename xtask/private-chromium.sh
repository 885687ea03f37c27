#!/usr/bin/env bash
# Unpacks a browser without a window into a private folder: Chromium's headless shell, with the libraries and fonts that it needs. It installs
# nothing and needs no root.
#
#   private-chromium.sh FOLDER      unpacks packages into FOLDER/root; FOLDER/browser is a program that starts the browser
#
#   /etc/apt (mirrors, proxy) ─► FOLDER/apt: lists of packages ─► chromium-headless-shell and what it needs ─► FOLDER/root
#
# Debian only, since Ubuntu's package of Chromium is not a program; elsewhere it fails and says what to set. The version is that of the
# release, which gets the browser's security updates. It never unpacks the C and C++ libraries, because a process can have only one of each,
# the machine's.
set -euo pipefail
export LC_ALL=C
umask 022
PACKAGE=chromium-headless-shell
INSTALL="set CHROMIUM to the path of a Chromium or Chrome that starts without a window (Debian: apt install chromium-headless-shell)"

fail() {
    printf 'private-chromium: %s\n' "$*" >&2
    exit 1
}

[ $# = 1 ] || fail "usage: private-chromium.sh FOLDER"
mkdir -p "$1"
folder=$(cd "$1" && pwd -P)
stamp="1 $folder $PACKAGE" # includes the folder's path, because FOLDER/browser holds it
exec 9>"$folder/.lock"
flock 9 # of two processes at once, the second waits and then finds everything in place
[ "$(cat "$folder/.done" 2>/dev/null)" != "$stamp" ] || exit 0
rm -f "$folder/.done"
for tool in apt-get apt-cache dpkg-deb ldd; do
    command -v "$tool" >/dev/null || fail "without $tool no packages can be unpacked: $INSTALL"
done
# shellcheck source=private-apt.sh
. "$(dirname "$0")/private-apt.sh"
work=$folder/apt
trap 'rm -rf "$work"' EXIT
private_apt "$work"
private_update "$work" || {
    private_why "$work"
    fail "no mirror of /etc/apt gave a list of packages (no network?): $INSTALL"
}
apt-cache show "$PACKAGE" >/dev/null 2>&1 || fail "this release has no package $PACKAGE: $INSTALL"
apt-get --quiet --yes --download-only install "$PACKAGE" >"$work/log" 2>&1 || {
    private_why "$work"
    fail "the packages could not be fetched: $INSTALL"
}

# Drivers of real devices stay out: the browser brings SwiftShader.
private_unpack "$folder" 'sysvinit-utils|lsb-base|libgl1-mesa-dri|libllvm.*|libz3-.*'
root=$folder/root
shell=$(find "$root/usr" -type f \( -name headless_shell -o -name "$PACKAGE" \) -size +1M)
[ -x "$shell" ] || fail "$PACKAGE of this release has no program chromium-headless-shell or headless_shell: $INSTALL"
libraries=$(find "$root" -name '*.so*' -printf '%h\n' | sort -u | paste -sd :)
rm -rf "$root"/usr/share/{doc,man,locale}
# Only the unpacked fonts, so that pages look alike on every machine.
cat >"$folder/fonts.conf" <<END
<?xml version="1.0"?>
<!DOCTYPE fontconfig SYSTEM "fonts.dtd">
<fontconfig><dir>$root/usr/share/fonts</dir><cachedir>$folder/fonts</cachedir></fontconfig>
END
cat >"$folder/browser" <<END
#!/bin/sh
LD_LIBRARY_PATH=$libraries FONTCONFIG_FILE=$folder/fonts.conf exec "$shell" "\$@"
END
chmod +x "$folder/browser"
missing=$(LD_LIBRARY_PATH=$libraries ldd "$shell" | awk '/not found/ && !seen[$1]++ { printf " %s", $1 }')
[ -z "$missing" ] || fail "the browser needs libraries that are missing:$missing: $INSTALL"
printf '%s\n' "$stamp" >"$folder/.done"
version=$(sed -n "s/^$PACKAGE //p" "$folder/packages.txt")
printf 'private-chromium: Chromium %s and %s more packages unpacked into %s\n' "$version" "$(($(wc -l <"$folder/packages.txt") - 1))" "$root"
