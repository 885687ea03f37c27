"""Makes the pictures of docs/cookbook.md, cookbook-NAME.png, by running the page's own samples: what they draw, in 160 colours.

    PATH=target/debug:$PATH target/venv/bin/python docs/images/cookbook.py     a minute or two

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
sys.path.insert(0, str(ROOT / "tests/python"))
from run_docs_samples import run_page  # noqa: E402


def main(folder):
    (folder / "data").symlink_to(ROOT / "data")
    os.chdir(folder)
    run_page(PAGE, (ROOT / PAGE).read_text(encoding="utf-8"))
    for path in sorted(folder.glob("cookbook-*.png")):
        # Noise costs most of a picture's bytes, and fewer colours take most of the noise. Without dithering, which is noise again.
        fewer = Image.open(path).convert("RGB").quantize(160, dither=Image.Dither.NONE)
        fewer.save(HERE.parent / path.name, optimize=True)
        print(f"{path.name}: {(HERE.parent / path.name).stat().st_size} bytes")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        main(Path(made))
