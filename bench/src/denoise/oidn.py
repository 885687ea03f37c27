"""Denoises a picture with Open Image Denoise, for `pumice bench denoise`.

    standard input    width, height (two int32), then color, albedo and normal: height × width × 3 float32 each; nothing for a check
    standard output   CPU seconds (float64), then the picture: float32; for a check the version as text
"""

import sys
import time
from importlib.metadata import version

import numpy as np
import pyoidn

data = sys.stdin.buffer.read()
if not data:
    print(version("pyoidn"))
    sys.exit()
width, height = np.frombuffer(data, np.int32, 2)
color, albedo, normal = np.frombuffer(data, np.float32, offset=8).reshape(3, height, width, 3).copy()
# The first call makes a device and reads weights.
pyoidn.denoise(color[:16, :16].copy(), hdr=True)
start = time.process_time()
smooth = pyoidn.denoise(color, albedo=albedo, normal=normal, hdr=True)
seconds = time.process_time() - start
sys.stdout.buffer.write(np.float64(seconds).tobytes() + np.ascontiguousarray(smooth, dtype=np.float32).tobytes())
