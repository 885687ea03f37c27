"""Decodes Cryptomatte (specification 1.2.0) from the channels and attributes of a file, with numpy only."""

import json

import numpy as np
from exr_planes import attributes_of, planes


def murmur3(text):
    """MurmurHash3_x86_32 of the text's UTF-8 bytes with seed 0, in Python's unbounded integers."""
    data = text.encode()
    h = 0
    for at in range(0, len(data), 4):
        word = int.from_bytes(data[at : at + 4].ljust(4, b"\0"), "little") * 0xCC9E2D51 % 2**32
        word = (word * 2**15 | word >> 17) % 2**32 * 0x1B873593 % 2**32
        h ^= word
        if at + 4 <= len(data):
            h = ((h * 2**13 | h >> 19) % 2**32 * 5 + 0xE6546B64) % 2**32
    h ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35), (16, 1)):
        h = (h ^ h >> shift) * factor % 2**32
    return h


def id_of(text):
    """The id of a name as a float; exponents 0 and 255 are replaced by 1 and 254."""
    h = murmur3(text)
    sign, exponent, mantissa = h >> 31, h >> 23 & 255, h & 0x7FFFFF
    exponent = {0: 1, 255: 254}.get(exponent, exponent)
    return np.array(sign << 31 | exponent << 23 | mantissa, np.uint32).view(np.float32)[()]


class Mattes:
    """The Cryptomatte layers with one name in a file."""

    def __init__(self, path, layers):
        attributes, _ = attributes_of(path.read_bytes())
        self.attributes = {name: value.decode() for name, value in attributes.items() if name.startswith("cryptomatte/")}
        key = f"cryptomatte/{murmur3(layers):08x}"[:19]
        self.said = {name.split("/")[2]: v for name, v in self.attributes.items() if name.startswith(f"{key}/")}
        self.manifest = {name: int(digits, 16) for name, digits in json.loads(self.said["manifest"]).items()}
        channels = planes(path)
        pairs = []
        number = 0
        while f"{layers}{number:02}.r" in channels:
            r, g, b, a = (channels[f"{layers}{number:02}.{c}"] for c in "rgba")
            pairs += [(r, g), (b, a)]
            number += 1
        self.ids = np.stack([p[0] for p in pairs], axis=-1)
        self.coverages = np.stack([p[1] for p in pairs], axis=-1)

    def matte(self, *names):
        """The coverage by these names together: (height, width)."""
        wanted = [id_of(name).view(np.uint32) for name in names]
        return np.where(np.isin(self.ids.view(np.uint32), wanted), self.coverages, 0.0).sum(axis=-1)
