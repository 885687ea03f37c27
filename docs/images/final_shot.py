"""Makes final_shot.png from the page of `pumice verify-render`: a scene drawn by Pumice, by Cycles, and the difference by tile.

    target/venv-bpy/bin/python docs/images/final_shot.py [PUMICE]     1,300 CPU seconds

`cargo xtask test --only blender` makes that Python, which is also the Blender that draws. The seconds that the programs take decide how many
pictures they draw, so another run gives other noise.
"""

import base64
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import dendrites
import numpy as np
import OpenImageIO

WIDTH, HEIGHT = 240, 160
# On the page each of these images comes before what says what it is.
PICTURES = [r'alt="by Pumice" src="data:image/png;base64,([^"]*)"', r'alt="by Cycles" src="data:image/png;base64,([^"]*)"']
MAP = r'src="data:image/png;base64,([^"]*)"><figcaption>Difference by tile'


def pixels(page, pattern, file):
    """The one image that a pattern finds in the page, as sRGB: height × width × 3."""
    (found,) = re.findall(pattern, page)
    file.write_bytes(base64.b64decode(found))
    return OpenImageIO.ImageBuf(str(file)).get_pixels(OpenImageIO.FLOAT)[..., :3]


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        scene = dendrites.scene(folder, WIDTH, HEIGHT)
        page = folder / "page.html"
        size = ["--size", f"{WIDTH}x{HEIGHT}", "--backend", "cpu"]
        verify = [dendrites.command(), "verify-render", scene, "--with-blender", sys.executable, "-o", page, *size]
        done = subprocess.run(verify)
        assert done.returncode in (0, 1), f"no verdict: exit code {done.returncode}"
        text = page.read_text()
        tiles = [pixels(text, pattern, folder / "image.png") for pattern in [*PICTURES, MAP]]
    gap = np.ones((HEIGHT, 6, 3))
    dendrites.write_png(Path(__file__).with_suffix(".png"), [tiles[0], gap, tiles[1], gap, tiles[2]])


if __name__ == "__main__":
    main()
