"""Converts screenshots of an X server (X Window Dump, version 7) to PNG: `xwd2png.py FILE.xwd…`

    header: 25 big-endian words: [0] header length, [4] width, [5] height, [11] bits per pixel, [12] bytes per line, [19] colours
    then 12 bytes per colour, then the lines, whose pixels are B G R and, at 32 bits, an unused byte
"""

import struct
import sys
from pathlib import Path

import numpy as np
from PIL import Image

for name in sys.argv[1:]:
    path = Path(name)
    data = path.read_bytes()
    words = struct.unpack(">25I", data[:100])
    width, height, pixel_bytes, line_bytes = words[4], words[5], words[11] // 8, words[12]
    start = words[0] + 12 * words[19]
    lines = np.frombuffer(data, np.uint8, line_bytes * height, start).reshape(height, line_bytes)
    pixels = lines[:, : width * pixel_bytes].reshape(height, width, pixel_bytes)[..., 2::-1]
    Image.fromarray(np.ascontiguousarray(pixels)).save(path.with_suffix(".png"))
    path.unlink()
    print(path.with_suffix(".png"))
