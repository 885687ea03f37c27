# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Provides an image of Blender as an OpenEXR file for the scene.

    an .exr file that is linear Rec. 709 already                  itself
    other files and packed images (.hdr, .png, other spaces)      written once as OpenEXR into the extension's folder `skies`

Blender gives the pixels of a float image as scene-linear, and those of a byte image as they are stored. Cycles interpolates a picture in
sRGB, of bytes or of floats, by its codes, and then makes it linear; Pumice interpolates light. So such a picture is written with more
pixels, between which the two are the same (`_finer`). The name of the written file is a hash of the image's source, its size and its
modification time, so another image has another file. While these stay the same, nothing is read again. Where light was below 0 or
no number, the written file has 0, and its name says so.

The layout of the written file, with a single part of scan lines (OpenEXR file layout, openexr.com/en/latest/OpenEXRFileLayout.html):

    magic, version 2   header: name\\0 type\\0 size value …\\0   offset of each row   rows: y, bytes, B… G… R… as floats
"""

import hashlib
import os
import struct

import bpy
import numpy as np

LINEAR = {"Linear Rec.709", "Linear", "Non-Color", "Raw"}
# Cycles interpolates pictures of this space by their codes.
ENCODED = "sRGB"
# A picture in sRGB gets at most this many pixels across, and this many times as many: a straight line between two codes is then off by at
# most 1/16² of what it was.
MOST_ACROSS, MOST_TIMES = 4096, 16
# Ends the name of a written file some of whose light was below 0 or no number.
CLIPPED = "-clipped"
# The file is written in bands of this many rows, so that a large picture is not copied as a whole.
BAND_ROWS = 256


class NotDrawn(Exception):
    """The image cannot be read; the text says which and why."""


def path_of(image):
    """(path of the picture as OpenEXR, what of it is not drawn, a list of lines); raises NotDrawn."""
    if image.source != "FILE" or image.is_dirty:
        raise NotDrawn(f"{image.name} is not an image of one saved file")
    space = image.colorspace_settings.name
    packed = image.packed_file
    path = os.path.abspath(bpy.path.abspath(image.filepath, library=image.library))
    if packed is None and not os.path.exists(path):
        raise NotDrawn(f"{image.name}: {path} is missing")
    if packed is None and path.lower().endswith(".exr") and space in LINEAR:
        return path, []
    if packed is None:
        status = os.stat(path)
        state = (path, status.st_size, status.st_mtime_ns, space, image.alpha_mode)
    else:
        state = (image.session_uid, image.name_full, packed.size, space, image.alpha_mode, os.getpid())
    name = hashlib.sha256(repr(state).encode()).hexdigest()[:24]
    whole, clipped = (os.path.join(_folder(), f"{name}{ending}.exr") for ending in ("", CLIPPED))
    if not os.path.exists(whole) and not os.path.exists(clipped):
        light = _linear(image, space)
        is_light = np.isfinite(light) & (light >= 0.0)
        if is_light.all():
            _write(whole, light)
        else:
            _write(clipped, np.where(is_light, light, np.float32(0.0)))
    if os.path.exists(whole):
        return whole, []
    return clipped, [f"{image.name} has light below 0 or no number, of colors that Rec. 709 lacks; 0 is drawn in its place"]


def _folder():
    """The extension's own folder for skies; above this package is the extension's."""
    package = __package__.rsplit(".", 1)[0]
    return bpy.utils.extension_path_user(package, path="skies", create=True)


def _linear(image, space):
    """Scene-linear pixels (height, width, 3), the first row at the bottom."""
    width, height = image.size
    if not image.has_data or width == 0 or height == 0:
        raise NotDrawn(f"{image.name} has no pixels")
    if image.channels < 3:
        raise NotDrawn(f"{image.name} has {image.channels} channels instead of three colors")
    pixels = np.empty(width * height * image.channels, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, image.channels)
    color = pixels[..., :3]
    if space == ENCODED:
        alpha = pixels[..., 3:] if image.channels == 4 and image.alpha_mode in {"STRAIGHT", "PREMUL"} else None
        return _decoded(_finer(_codes(color, alpha, image.is_float)))
    if not image.is_float and space not in LINEAR:
        raise NotDrawn(f"{image.name}: the color space {space} of 8 bit images is not read")
    return color


def _codes(color, alpha, is_float):
    """Codes of sRGB as Cycles interpolates them: those of the color times alpha, in bytes for an image of bytes. Blender gives the colors of a
    float image as light times alpha, and those of bytes as codes without alpha."""
    if alpha is None:
        return _encoded(color) if is_float else color
    if is_float:
        return _encoded(color / np.where(alpha > 0.0, alpha, np.float32(1.0))) * alpha
    of_bytes = np.rint(color * 255.0) * np.rint(alpha * 255.0) // 255.0
    return (of_bytes / 255.0).astype(np.float32)


def _finer(codes):
    """The codes with more pixels, by linear interpolation between the middles of theirs: around the horizon, and up to the poles."""
    height, width = codes.shape[:2]
    times = min(MOST_TIMES, MOST_ACROSS // width)
    if times < 2:
        return codes
    for axis, size in ((1, width), (0, height)):
        at = ((np.arange(size * times) + 0.5) / times - 0.5).astype(np.float32)
        before = np.floor(at).astype(int)
        share = (at - before).reshape((-1, 1) if axis else (-1, 1, 1))
        pair = [place % size if axis else np.clip(place, 0, size - 1) for place in (before, before + 1)]
        codes = (1 - share) * codes.take(pair[0], axis) + share * codes.take(pair[1], axis)
    return codes


def _encoded(linear):
    """Codes of sRGB (IEC 61966-2-1), which may be above 1."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055).astype(np.float32)


def _decoded(codes):
    """Light of codes of sRGB."""
    return np.where(codes <= 0.04045, codes / 12.92, ((np.maximum(codes, 0.04045) + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _write(path, pixels):
    """Writes an OpenEXR file of three float channels without compression; it appears whole or not at all."""
    height, width = pixels.shape[:2]
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(name + b"\0" + struct.pack("<iB3xii", 2, 0, 1, 1) for name in (b"B", b"G", b"R")) + b"\0"
    header = struct.pack("<ii", 20000630, 2)
    for name, kind, value in (
        (b"channels", b"chlist", channels),
        (b"compression", b"compression", b"\0"),
        (b"dataWindow", b"box2i", box),
        (b"displayWindow", b"box2i", box),
        (b"lineOrder", b"lineOrder", b"\0"),
        (b"pixelAspectRatio", b"float", struct.pack("<f", 1.0)),
        (b"screenWindowCenter", b"v2f", struct.pack("<2f", 0.0, 0.0)),
        (b"screenWindowWidth", b"float", struct.pack("<f", 1.0)),
    ):
        header += name + b"\0" + kind + b"\0" + struct.pack("<i", len(value)) + value
    header += b"\0"
    row_bytes = 12 * width
    first = len(header) + 8 * height
    row = np.dtype([("y", "<i4"), ("bytes", "<i4"), ("values", "<f4", (3, width))])
    partial = f"{path}.{os.getpid()}.partial"
    with open(partial, "wb") as file:
        file.write(header)
        file.write((first + np.arange(height, dtype="<u8") * row.itemsize).tobytes())
        for begin in range(0, height, BAND_ROWS):
            band = np.arange(begin, min(begin + BAND_ROWS, height))
            rows = np.empty(len(band), dtype=row)
            rows["y"], rows["bytes"] = band, row_bytes
            # Rows from the top, channels by name.
            rows["values"] = pixels[height - 1 - band][..., ::-1].transpose(0, 2, 1)
            file.write(rows.tobytes())
    os.replace(partial, path)
