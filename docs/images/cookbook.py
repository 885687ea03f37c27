"""Makes the pictures of docs/cookbook.md, cookbook-NAME.png, by running the page's own samples: what they draw, with more samples a pixel, in
256 colours.

    PATH=target/debug:$PATH target/venv/bin/python docs/images/cookbook.py     ten CPU minutes at most

Samples are those of the processor's renderer, so another machine gives the same pictures.
"""

import os
import sys
import tempfile
from pathlib import Path

from PIL import Image

HERE = Path(__file__).resolve()
ROOT = HERE.parents[2]
PAGE = "docs/cookbook.md"
# Samples a pixel: of the page, which readers and tests run, and of its pictures.
FEW, MANY = 16, 32
sys.path.insert(0, str(ROOT / "tests/python"))
from run_docs_samples import run_page  # noqa: E402


def main(folder):
    (folder / "data").symlink_to(ROOT / "data")
    os.chdir(folder)
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    # Commands that draw another picture than those of the page keep few.
    for few in (f"spp={FEW}", f"--spp {FEW} -o cookbook-"):
        text = text.replace(few, few.replace(str(FEW), str(MANY)))
    run_page(PAGE, text)
    for path in sorted(folder.glob("cookbook-*.png")):
        # Noise costs most of a picture's bytes, and fewer colours take most of the noise. Without dithering, which is noise again. On
        # white, maximum coverage keeps the colours of swatches to 7 of 255, where median cut made two of them one; of a backdrop it makes bands.
        rgb = Image.open(path).convert("RGB")
        is_white = rgb.getpixel((0, 0)) == (255, 255, 255)
        method, rounds = (Image.Quantize.MAXCOVERAGE, 2) if is_white else (Image.Quantize.MEDIANCUT, 0)
        fewer = rgb.quantize(256, method=method, kmeans=rounds, dither=Image.Dither.NONE)
        fewer.save(HERE.parent / path.name, optimize=True)
        print(f"{path.name}: {(HERE.parent / path.name).stat().st_size} bytes")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        main(Path(made))
