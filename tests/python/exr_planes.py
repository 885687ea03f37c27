"""Reads OpenEXR files with scan lines, uncompressed or ZIP (openexr.com, *File Layout*), with numpy and zlib only."""

import struct
import zlib

import numpy as np

TYPES = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}
LINES = {0: 1, 2: 1, 3: 16}


def attributes_of(data):
    """(attributes as bytes by name, offset of their end)."""
    assert data[:8] == b"\x76\x2f\x31\x01\x02\x00\x00\x00" or data[4] == 2, "expected a file with one part of scan lines"
    at, attributes = 8, {}
    while data[at]:
        name, at = text(data, at)
        _, at = text(data, at)
        (size,) = struct.unpack_from("<i", data, at)
        attributes[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def planes(path):
    """All channels by name: (height, width), row 0 at the top."""
    data = path.read_bytes()
    attributes, at = attributes_of(data)
    channels, place, listed = [], 0, attributes["channels"]
    while listed[place]:
        name, place = text(listed, place)
        channels.append((name, TYPES[struct.unpack_from("<i", listed, place)[0]]))
        place += 16
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    width, height, compression = x1 - x0 + 1, y1 - y0 + 1, attributes["compression"][0]
    lines = LINES[compression]
    out = {name: np.zeros((height, width), kind) for name, kind in channels}
    row_bytes = sum(width * kind.itemsize for _, kind in channels)
    for offset in struct.unpack_from(f"<{-(-height // lines)}Q", data, at):
        y, size = struct.unpack_from("<2i", data, offset)
        rows = min(lines, y1 + 1 - y)
        block = data[offset + 8 : offset + 8 + size]
        if compression and size < rows * row_bytes:
            block = unpacked(block)
        assert len(block) == rows * row_bytes
        place = 0
        for row in range(y - y0, y - y0 + rows):
            for name, kind in channels:
                out[name][row] = np.frombuffer(block, kind, width, place)
                place += width * kind.itemsize
    return out


def unpacked(block):
    """Decodes a ZIP block: deflated differences of bytes, those at even positions before those at odd ones."""
    differences = np.frombuffer(zlib.decompress(block), np.uint8).astype(np.int64)
    differences[1:] -= 128
    values = (np.cumsum(differences) & 255).astype(np.uint8)
    half = (len(values) + 1) // 2
    woven = np.empty(len(values), np.uint8)
    woven[0::2], woven[1::2] = values[:half], values[half:]
    return woven.tobytes()


def text(data, at):
    end = data.index(b"\0", at)
    return data[at:end].decode("latin-1"), end + 1
