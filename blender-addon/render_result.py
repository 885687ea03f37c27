# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies pictures of a final render into Blender's passes: frames while it renders, and the picture at its end.

    Combined    RGBA    scene-linear, times coverage; Noisy Image likewise, where Combined is denoised
    others      as `passes` lists them; rows from the bottom, as Blender's are

A frame has Combined alone; the other passes arrive with the picture. Pixels are copied with `foreach_set`, which takes 0.02 s for a full-HD
picture; assigning `rect` takes 1.5 s.
"""

import numpy as np

from . import passes
from .reports import Refused


def leave_empty(engine, view_layer, size):
    """Ends a render that has no sample. Blender 5.0.1 crashes when it writes passes that an engine never ended."""
    engine.end_result(engine.begin_result(0, 0, *size, layer=view_layer.name))


def show_frame(engine, view_layer, frame, size):
    """Fills Combined with a frame of a picture of `size` pixels; a coarse one's pixels become squares."""
    width, height = size
    pixels = np.asarray(frame)
    if frame.coarse:
        rows, columns = (np.arange(many) * few // many for many, few in ((height, frame.height), (width, frame.width)))
        # Columns first: then whole rows are copied.
        pixels = pixels[:, columns][rows]
    result = engine.begin_result(0, 0, width, height, layer=view_layer.name)
    try:
        _fill(result.layers[0], "Combined", pixels[::-1])
    finally:
        engine.end_result(result)


def hand_over(engine, view_layer, picture, metadata):
    """Fills all passes with a picture, and notes what is said of it, texts by key."""
    height, width = picture.color.shape[:2]
    # A pass of our own must be added before the result is begun, or the result lacks it.
    result = engine.begin_result(0, 0, width, height, layer=view_layer.name)
    try:
        layer = result.layers[0]
        for name, color in (("Combined", picture.color), (passes.NOISY, picture.noisy)):
            if color is None or name not in layer.passes:
                continue
            pixels = np.ones((height, width, 4), dtype=np.float32)
            pixels[..., :3] = color
            if picture.alpha is not None:
                pixels[..., 3] = picture.alpha
            _fill(layer, name, pixels)
        for one in passes.wanted(view_layer):
            pixels = one.pixels(picture)
            if not pixels:
                engine.report({"WARNING"}, f"The picture has no pass {one.in_blender}; it is left empty")
            for name, plane in zip(one.names(view_layer), pixels):
                if name in layer.passes:
                    _fill(layer, name, plane)
    finally:
        engine.end_result(result)
    for key, value in metadata.items():
        # On the result of `begin_result` it would be lost.
        engine.get_result().stamp_data_add_field(key, value)


def _fill(layer, name, pixels):
    """Copies pixels, rows from the top, into a pass."""
    target = layer.passes[name]
    flat = np.ascontiguousarray(pixels[::-1], dtype=np.float32).ravel()
    expected = len(target.rect) * target.channels
    if flat.size != expected:
        raise Refused(f"Pass {name}: Blender expects {expected} values, the picture has {flat.size}")
    target.rect.foreach_set(flat)
