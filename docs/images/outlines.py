"""Makes outlines.png: a corner of a denoised live picture of the shipped mouse cortex, as the coarse frame of half the width, as the same frame along
the first surfaces of the whole film, and as the picture after 128 samples.

    python docs/images/outlines.py     half a minute; needs pumice, numpy and Pillow

A frame comes when its samples are there: which samples that are does not depend on the machine, but a machine that is busy may not show each frame.
"""

import time
from pathlib import Path

import numpy as np
import pumice
from PIL import Image

WIDTH, HEIGHT = 960, 540
# The corner: left, top, across, down; and by how much its pixels are enlarged.
CORNER, SCALE = (390, 180, 160, 120), 2
GAP = 8


def frames(scene, volume):
    """The frame of half the width, and the enlarged one: rows from the top, linear."""
    found = {}
    with pumice.Session(scene, [volume], denoise=True, backend="cpu") as session:
        serial, end = 0, time.monotonic() + 120
        while time.monotonic() < end:
            frame = session.latest(serial)
            if frame is None:
                time.sleep(0.0005)
                continue
            serial = frame.serial
            if not frame.coarse:
                break
            found[frame.width] = np.array(frame)[::-1, :, :3]
    return found[WIDTH // 2], found[WIDTH]


def shown(pixels):
    """The corner as bytes of sRGB."""
    left, top, across, down = CORNER
    linear = np.clip(pixels[top : top + down, left : left + across], 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return Image.fromarray((255 * encoded + 0.5).astype(np.uint8)).resize((SCALE * across, SCALE * down), Image.Resampling.NEAREST)


here = Path(__file__).parent
volume = pumice.compress(here / "../../data/connectomics_32x32x40nm.nrrd")
scene = pumice.figure(volume, size=(WIDTH, HEIGHT), pick=14)
half, enlarged = frames(scene, volume)
squares = half[np.arange(HEIGHT) // 2][:, np.arange(WIDTH) // 2]
tiles = [shown(pixels) for pixels in (squares, enlarged, pumice.render(scene, volume, spp=128).color)]
row = Image.new("RGB", (sum(tile.width for tile in tiles) + GAP * (len(tiles) - 1), tiles[0].height), "white")
left = 0
for tile in tiles:
    row.paste(tile, (left, 0))
    left += tile.width + GAP
row.save(here / "outlines.png", optimize=True)
