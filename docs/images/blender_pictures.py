"""Takes the pictures blender-*.png of `docs/blender.md` in a real Blender window without a screen.

    xtask/window/make-root.sh trixie target/window/root-trixie                                (once; `cargo xtask test-window` makes it too)
    target/venv/bin/python docs/images/blender_pictures.py ROOT ZIP                           (as root; some minutes, all in software)

ROOT is that Debian root with Blender, ZIP the extension as `cargo xtask extension` packs it. `blender_window.py` has the steps in the window.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
VOLUME = REPOSITORY / "data/connectomics_32x32x40nm.nrrd"
SIZE = (1400, 900)
COMMAND = """
set -e
export BLENDER_USER_RESOURCES=/w/user
blender --command extension install-file --repo user_default --enable /w/pumice.zip
exec xvfb-run --auto-servernum --server-args='-screen 0 {0}x{1}x24 +extension GLX' blender --factory-startup --window-geometry 0 0 {0} {1} \
    --gpu-backend opengl --python-exit-code 1 --python /w/blender_window.py -- /w/out /w/{2}
"""


def main(root, extension, folder):
    out = folder / "out"
    out.mkdir()
    for source, name in ((extension, "pumice.zip"), (HERE / "blender_window.py", "blender_window.py"), (VOLUME, VOLUME.name)):
        shutil.copyfile(source, folder / name)
    inside = REPOSITORY / "xtask/window/in-root.sh"
    driven = subprocess.run([inside, root, folder, "/bin/bash", "-c", COMMAND.format(*SIZE, VOLUME.name)])
    # Screenshots are converted also after a failure, when they help most.
    dumps = sorted(out.glob("*.xwd"))
    subprocess.run([sys.executable, REPOSITORY / "xtask/window/xwd2png.py", *dumps], check=True)
    crops = json.loads((out / "crops.json").read_text())
    for path in sorted(out.glob("*.png")):
        picture = Image.open(path).convert("RGB")
        save(picture.crop(crops.get(path.stem, (0, 0, *picture.size))), HERE / path.name)
    return driven.returncode


def save(picture, path):
    """Saves with a palette, which takes a seventh of the bytes. Median cut would spend its colors on shades of gray."""
    picture.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE).save(path, optimize=True)
    print(path.name, picture.size, path.stat().st_size, "bytes")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        sys.exit(main(sys.argv[1], sys.argv[2], Path(made)))
