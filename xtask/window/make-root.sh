#!/usr/bin/env bash
# make-root.sh SUITE FOLDER: a Debian root with Blender, Xvfb and software OpenGL and Vulkan. As root.
#
#   trixie   Blender 4.3.2, Python 3.13      sid   Blender 5.2 or newer, Python 3.14
#
# About 365 MB to fetch, 1.3 GB on disk. Debian builds Blender without USD.
set -euo pipefail
suite=$1 folder=$2
fail() {
    printf 'make-root: %s\n' "$*" >&2
    exit 1
}
[ "$(id -u)" = 0 ] || fail "a Debian root is made as root: run this with sudo"
command -v mmdebstrap >/dev/null || {
    command -v apt-get >/dev/null || fail "mmdebstrap is missing, and this system has no apt to get it with"
    apt-get update --quiet --quiet && apt-get install --quiet --yes --no-install-recommends mmdebstrap
}
rm -rf "$folder.part"
packages=blender,xvfb,xauth,x11-apps,libgl1,libegl1,libglx-mesa0,libegl-mesa0,libgl1-mesa-dri,mesa-vulkan-drivers
mmdebstrap --mode=root --variant=apt --components=main --keyring=/usr/share/keyrings/debian-archive-keyring.gpg \
    --aptopt='APT::Install-Recommends "0"' --aptopt='Acquire::Languages "none"' --aptopt='Acquire::Check-Valid-Until "false"' \
    --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/locale/*' \
    --include="$packages,python3-numpy,python3-cattr,python3-requests,xdotool,ca-certificates" "$suite" "$folder.part"
mv "$folder.part" "$folder"
