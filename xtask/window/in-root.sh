#!/usr/bin/env bash
# in-root.sh ROOT SHARED COMMAND…: runs a command inside a Debian root, with the folder SHARED as /w. Mounts are in their own namespace
# and vanish with the command.
set -euo pipefail
root=$1 shared=$2
shift 2
exec unshare --mount --propagation private bash -euc '
    root=$1 shared=$2
    shift 2
    mount -t proc proc "$root/proc"
    mount --rbind /sys "$root/sys"
    mount --rbind /dev "$root/dev"
    mkdir -p "$root/w" "$root/tmp/.X11-unix"
    chmod 1777 "$root/tmp" "$root/tmp/.X11-unix"
    mount --bind "$shared" "$root/w"
    exec chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 TERM=dumb \
        XDG_RUNTIME_DIR=/tmp LIBGL_ALWAYS_SOFTWARE=1 "$@"
' in-root "$root" "$shared" "$@"
