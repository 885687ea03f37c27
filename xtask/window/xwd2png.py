"""Screenshots of an X server (X Window Dump, version 7) as PNG: `xwd2png.py FILE.xwd…`

    header: 25 big-endian words, [0] its length, [4] width, [5] height, [11] bits a pixel, [12] bytes a line, [19] colours
    then 12 bytes a colour, then the lines: B G R and, of 32 bits, one byte of nothing
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
