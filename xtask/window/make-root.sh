#!/usr/bin/env bash
# make-root.sh SUITE FOLDER: makes a Debian root with Blender, Xvfb and software OpenGL and Vulkan. Needs root and mmdebstrap. Keeps a
# root that was made from the same list of packages.
#
#   trixie   Blender 4.3.2, Python 3.13      sid   Blender 5.2 or newer, Python 3.14
#
# Fetches about 365 MB and takes 1.3 GB on disk. Debian builds Blender without USD.
set -euo pipefail
suite=$1 folder=$2
# Blender and its extension tool import python3-*; xdotool sends input, and xwd (x11-apps) takes screenshots.
packages=blender,xvfb,xauth,x11-apps,xdotool,libgl1,libegl1,libglx-mesa0,libegl-mesa0,libgl1-mesa-dri,mesa-vulkan-drivers
packages+=,python3-numpy,python3-cattr,python3-requests,ca-certificates
made_from="$suite $packages"
[ "$(cat "$folder/made-from.txt" 2>/dev/null)" != "$made_from" ] || exit 0
fail() {
    printf 'make-root: %s\n' "$*" >&2
    exit 1
}
[ "$(id -u)" = 0 ] || fail "making a Debian root needs root: run this with sudo"
command -v mmdebstrap >/dev/null || fail "mmdebstrap is missing: install it (Debian and Ubuntu: apt install mmdebstrap)"

# Builds under another name, so that an interrupted build is never taken for a complete one.
rm -rf "$folder" "$folder.part"
mmdebstrap --mode=root --variant=apt --components=main --keyring=/usr/share/keyrings/debian-archive-keyring.gpg \
    --aptopt='APT::Install-Recommends "0"' --aptopt='Acquire::Languages "none"' --aptopt='Acquire::Check-Valid-Until "false"' \
    --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/locale/*' \
    --include="$packages" "$suite" "$folder.part" ||
    fail "mmdebstrap did not make a Debian $suite: it says why above (no network?)"
printf '%s\n' "$made_from" >"$folder.part/made-from.txt"
mv "$folder.part" "$folder"
