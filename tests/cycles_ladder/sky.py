"""Generates sky images and writes them as OpenEXR, with numpy only."""

import struct

import numpy as np


def picture(width, bright, size, floor):
    """An equirectangular sky of width × width / 2 pixels: a gradient over a dim ground, and lights `bright` [azimuth, elevation, RGB
    radiance] whose radiance falls off over `size` radians. It is smooth, so that interpolation between pixels hardly matters."""
    height = width // 2
    z = np.cos((np.arange(height) + 0.5) / height * np.pi)[:, None, None]
    azimuth = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi
    flat = np.sqrt(1 - z**2)
    turn = azimuth[None, :, None]
    directions = np.concatenate([flat * np.cos(turn), flat * np.sin(turn), z + 0 * turn], axis=2)
    up = np.clip(z, 0, 1)
    out = np.where(z > 0, (1 - up) * [0.5, 0.45, 0.4] + up * [0.2, 0.35, 0.7], floor) + np.zeros(directions.shape)
    for around, elevation, radiance in bright:
        towards = [np.cos(elevation) * np.cos(around), np.cos(elevation) * np.sin(around), np.sin(elevation)]
        angle = np.arccos(np.clip(directions @ np.array(towards), -1, 1))[..., None]
        out = out + np.exp(-0.5 * (angle / size) ** 2) * radiance
    return out.astype(np.float32)


def write(path, rgb):
    """Writes an OpenEXR file with scan lines of 32-bit floats, uncompressed (the file layout of openexr.com, version 2)."""
    height, width, _ = rgb.shape
    attribute = lambda name, kind, data: name + b"\0" + kind + b"\0" + struct.pack("<i", len(data)) + data  # noqa: E731
    channels = b"".join(c + b"\0" + struct.pack("<iiii", 2, 0, 1, 1) for c in (b"B", b"G", b"R")) + b"\0"
    window = struct.pack("<iiii", 0, 0, width - 1, height - 1)
    header = b"".join(
        [
            attribute(b"channels", b"chlist", channels),
            attribute(b"compression", b"compression", b"\0"),
            attribute(b"dataWindow", b"box2i", window),
            attribute(b"displayWindow", b"box2i", window),
            attribute(b"lineOrder", b"lineOrder", b"\0"),
            attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1)),
            attribute(b"screenWindowCenter", b"v2f", struct.pack("<ff", 0, 0)),
            attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1)),
            b"\0",
        ]
    )
    begin = b"\x76\x2f\x31\x01" + struct.pack("<i", 2) + header
    line = 8 + 12 * width
    offsets = struct.pack(f"<{height}Q", *(len(begin) + 8 * height + y * line for y in range(height)))
    with open(path, "wb") as file:
        file.write(begin + offsets)
        for y in range(height):
            file.write(struct.pack("<ii", y, 12 * width))
            file.write(np.ascontiguousarray(rgb[y, :, ::-1].T, dtype="<f4").tobytes())
