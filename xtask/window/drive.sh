#!/usr/bin/env bash
# drive.sh GPU SECONDS: runs inside the Debian root. Installs /w/pumice.zip as a user would, then runs /w/drive.py on /w/volume.tif in a
# real Blender window without a screen. Results go to /w/out.
set -euo pipefail
gpu=$1 seconds=$2
export BLENDER_USER_RESOURCES=/w/user
blender --command extension install-file --repo user_default --enable /w/pumice.zip
exec timeout --kill-after=10 "$seconds" xvfb-run --auto-servernum --server-args='-screen 0 1280x800x24 +extension GLX' \
    blender --factory-startup --window-geometry 0 0 1280 800 --gpu-backend "$gpu" --python-exit-code 1 \
    --python /w/drive.py -- /w/out /w/volume.tif
