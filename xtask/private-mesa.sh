#!/usr/bin/env bash
# Unpacks Vulkan on the CPU into a private folder: Mesa's lavapipe with ray tracing, the loader, the Khronos validation layer, the
# shader compiler and validator. It installs nothing and needs no root.
#
#   private-mesa.sh FOLDER      unpacks packages into FOLDER/root; FOLDER/env lists the environment variables of processes that use them
#
# Mesa's driver for AMD cards comes along as a compiler: without a card it compiles shaders for any of them, and draws nothing. No Vulkan
# loader finds it by itself: FOLDER/env has its file as PUMICE_SHADER_COMPILER.
#
#   /etc/apt (mirrors, proxy) ─► FOLDER/apt: lists of packages ─► the packages below and what they need ─► FOLDER/root
#
# Debian and Ubuntu only; elsewhere it fails and says what to install. Mesa can trace rays on the CPU since 24.1, which Debian 12 has
# only in its backports. It never unpacks the C and C++ libraries, because a process can have only one of each, the machine's.
set -euo pipefail
export LC_ALL=C
umask 022
PACKAGES=(mesa-vulkan-drivers libvulkan1 vulkan-validationlayers glslang-tools spirv-tools)
INSTALL="install a Vulkan driver with VK_KHR_ray_tracing_pipeline and VK_KHR_ray_query, the validation layer and the loader (Debian 13, Ubuntu 24.04: apt install mesa-vulkan-drivers vulkan-validationlayers), and set VK_DRIVER_FILES to the driver's file"

fail() {
    printf 'private-mesa: %s\n' "$*" >&2
    exit 1
}

[ $# = 1 ] || fail "usage: private-mesa.sh FOLDER"
mkdir -p "$1"
folder=$(cd "$1" && pwd -P)
stamp="2 $folder ${PACKAGES[*]}" # includes the folder's path, because the unpacked files hold it
exec 9>"$folder/.lock"
flock 9 # of two processes at once, the second waits and then finds everything in place
[ "$(cat "$folder/.done" 2>/dev/null)" != "$stamp" ] || exit 0
rm -f "$folder/.done"
for tool in apt-get apt-cache dpkg-deb ldd; do
    command -v "$tool" >/dev/null || fail "without $tool no packages can be unpacked: $INSTALL"
done
here=$(dirname "$0")
# shellcheck source=private-apt.sh
. "$here/private-apt.sh"
work=$folder/apt
trap 'rm -rf "$work"' EXIT

# On Debian 12, also uses the backports of the same mirrors, and prefers them. The second option is for mirrors that are signed with a
# key of the machine's own.
codename=$(. /etc/os-release && echo "${VERSION_CODENAME:-}")
if [ "$codename" = bookworm ]; then
    suites=(bookworm bookworm-backports)
    mapfile -t mirrors < <(apt-get update --print-uris 2>/dev/null |
        sed -nE "s#^'(.*)/dists/bookworm/(In)?Release' .*#\1#p" | sort -u)
    keyring=/usr/share/keyrings/debian-archive-keyring.gpg
    found=
    for attempt in 1 2 3; do
        for mirror in "${mirrors[@]}"; do
            for option in "[signed-by=$keyring]" ""; do
                [ -z "$option" ] || [ -r "$keyring" ] || continue
                private_apt "$work"
                for suite in "${suites[@]}"; do
                    echo "deb $option $mirror $suite main"
                done >"$work/sources.list"
                printf 'Dir::Etc::SourceList "%s";\nDir::Etc::SourceParts "%s";\nAPT::Default-Release "bookworm-backports";\n' \
                    "$work/sources.list" "$work/none" >>"$work/apt.conf"
                private_update "$work" || continue
                # Not `grep -q`, which would close the pipe early and make apt-cache fail.
                if apt-cache show mesa-vulkan-drivers 2>/dev/null | grep '^Version: .*~bpo12' >/dev/null; then
                    found=1
                    break 3
                fi
            done
        done
        # A mirror may be incomplete for a moment, so wait and try again.
        sleep $((attempt * 3))
    done
    [ -n "$found" ] || {
        [ ! -f "$work/log" ] || private_why "$work"
        fail "no mirror of /etc/apt gave the packages of bookworm-backports (no network?): $INSTALL"
    }
else
    private_apt "$work"
    private_update "$work" || {
        private_why "$work"
        fail "no mirror of /etc/apt gave a list of packages (no network?): $INSTALL"
    }
fi
apt-get --quiet --yes --download-only install "${PACKAGES[@]}" >"$work/log" 2>&1 || {
    private_why "$work"
    fail "the packages could not be fetched: $INSTALL"
}

private_unpack "$folder" 'python3.*|libpython3.*|adduser|passwd'
root=$folder/root
driver=$(find "$root/usr/lib" -name libvulkan_lvp.so)
[ -f "$driver" ] || fail "lavapipe is not among the packages of this release: $INSTALL"
lib=$(dirname "$driver")
triplet=$(basename "$lib")
# Moves libraries that are still in /lib. Removes drivers of real devices, so that tests do not depend on the machine.
if [ -d "$root/lib/$triplet" ]; then cp -a "$root/lib/$triplet/." "$lib/"; fi
find "$lib" -name 'libvulkan_*.so' ! -name libvulkan_lvp.so ! -name libvulkan_radeon.so -delete
vulkan=$root/usr/share/vulkan
mkdir -p "$vulkan/compilers"
mv "$vulkan"/icd.d/radeon_icd*.json "$vulkan/compilers/radeon.json"
find "$vulkan/icd.d" -name '*.json' ! -name 'lvp_icd*' -delete
rm -rf "$vulkan/implicit_layer.d" "$root"/usr/share/{doc,man,locale}
icd=$(echo "$vulkan"/icd.d/lvp_icd*.json)
for file in "$icd" "$vulkan"/compilers/*.json "$vulkan"/explicit_layer.d/*.json; do
    sed -i -E "s#(\"library_path\"[^\"]*\")([^\"]*/)?([^\"/]+\")#\1$lib/\3#" "$file"
done
cat >"$folder/env" <<END
VK_DRIVER_FILES=$icd
VK_ICD_FILENAMES=$icd
VK_LAYER_PATH=$vulkan/explicit_layer.d
VK_LOADER_LAYERS_DISABLE=~implicit~
MESA_SHADER_CACHE_DIR=$folder/cache
PUMICE_SHADER_COMPILER=$vulkan/compilers/radeon.json
LD_LIBRARY_PATH=$lib
END
missing=$(LD_LIBRARY_PATH=$lib ldd "$driver" "$lib/libvulkan_radeon.so" "$lib/libvulkan.so.1" "$lib/libVkLayer_khronos_validation.so" | awk '/not found/ && !seen[$1]++ { printf " %s", $1 }')
[ -z "$missing" ] || fail "the driver needs libraries that are missing:$missing: $INSTALL"
mesa=$(sed -n 's/^mesa-vulkan-drivers //p' "$folder/packages.txt")
major=${mesa#*:}
dpkg --compare-versions "$major" ge 24.1 || fail "Mesa $mesa of this release cannot trace rays on the CPU (24.1 or newer can): $INSTALL"
printf '%s\n' "$stamp" >"$folder/.done"
printf 'private-mesa: Mesa %s and %s more packages unpacked into %s\n' "$mesa" "$(($(wc -l <"$folder/packages.txt") - 1))" "$root"
