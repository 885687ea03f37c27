# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies pictures of a final render into Blender's passes: frames while it renders, and the picture at its end.

    Combined    RGBA    scene-linear, times coverage; Noisy Image likewise, where Combined is denoised
    others      as `passes` lists them; rows from the bottom, as Blender's are

A frame has Combined alone; now and then a picture so far brings the other passes. Pixels are copied with `foreach_set`, which takes 0.02 s for
a full-HD picture; assigning `rect` takes 1.5 s.
"""

import time

import numpy as np

from . import passes
from .reports import Refused


def leave_empty(engine, view_layer, size):
    """Ends a render that has no sample. Blender 5.0.1 crashes when it writes passes that an engine never ended."""
    engine.end_result(engine.begin_result(0, 0, *size, layer=view_layer.name))


class Growing:
    """The picture in Blender while it renders. Blender takes all passes of a result, also those that an engine has not filled, so each frame
    fills the passes again with what they had last."""

    # Filling them takes a fiftieth of the time at most, and a picture so far a hundredth: then the next one has to wait.
    RESTS_AFTER_FRAME, RESTS_AFTER_PASSES = 50.0, 100.0

    def __init__(self, engine, view_layer, size):
        """`size`: pixels of the picture, which coarse frames have fewer of."""
        self._engine, self._view_layer, self._size = engine, view_layer, size
        self._passes, self._serial = {}, 0
        self._frame_due = self._passes_due = 0.0
        self.is_empty = True

    def look(self, renderer):
        """Shows what a `pumice.Renderer` has that is new; may be called often."""
        began = time.monotonic()
        if began >= self._passes_due and (picture := renderer.take_so_far()) is not None:
            self.show_passes(picture)
            self._passes_due = time.monotonic() + self.RESTS_AFTER_PASSES * (time.monotonic() - began)
        if time.monotonic() >= self._frame_due and (frame := renderer.latest(self._serial)) is not None:
            self._serial = frame.serial
            self.show_frame(frame)

    def show_frame(self, frame):
        """Fills Combined with a frame; a coarse one's pixels become squares."""
        width, height = self._size
        pixels = np.asarray(frame)
        if frame.coarse:
            rows, columns = (np.arange(many) * few // many for many, few in ((height, frame.height), (width, frame.width)))
            # Columns first: then whole rows are copied.
            pixels = pixels[:, columns][rows]
        self._fill(pixels[::-1])

    def show_passes(self, picture):
        """Fills all passes with a picture so far."""
        planes = [(name, plane) for one in passes.wanted(self._view_layer) for name, plane in _planes(one, self._view_layer, picture)]
        # Copies, rows from the bottom: the picture itself is given back.
        self._passes = {name: np.array(plane[::-1], dtype=np.float32)[::-1] for name, plane in planes}
        self._fill(_combined(picture, picture.color))

    def _fill(self, combined):
        result = self._engine.begin_result(0, 0, *self._size, layer=self._view_layer.name)
        try:
            layer = result.layers[0]
            _fill(layer, "Combined", combined)
            began = time.monotonic()
            for name, plane in self._passes.items():
                if name in layer.passes:
                    _fill(layer, name, plane)
            self._frame_due = time.monotonic() + self.RESTS_AFTER_FRAME * (time.monotonic() - began)
        finally:
            self._engine.end_result(result)
        self.is_empty = False


def hand_over(engine, view_layer, picture, metadata):
    """Fills all passes with a picture, and notes what is said of it, texts by key."""
    height, width = picture.color.shape[:2]
    # A pass of our own must be added before the result is begun, or the result lacks it.
    result = engine.begin_result(0, 0, width, height, layer=view_layer.name)
    try:
        layer = result.layers[0]
        for name, color in (("Combined", picture.color), (passes.NOISY, picture.noisy)):
            if color is not None and name in layer.passes:
                _fill(layer, name, _combined(picture, color))
        for one in passes.wanted(view_layer):
            planes = _planes(one, view_layer, picture)
            if not planes:
                engine.report({"WARNING"}, f"The picture has no pass {one.in_blender}; it is left empty")
            for name, plane in planes:
                if name in layer.passes:
                    _fill(layer, name, plane)
    finally:
        engine.end_result(result)
    for key, value in metadata.items():
        # On the result of `begin_result` it would be lost.
        engine.get_result().stamp_data_add_field(key, value)


def _combined(picture, color):
    """This color and the alpha of a picture, rows from the top."""
    combined = np.ones((*color.shape[:2], 4), dtype=np.float32)
    combined[..., :3] = color
    if picture.alpha is not None:
        combined[..., 3] = picture.alpha
    return combined


def _planes(one, view_layer, picture):
    """(Blender's name, pixels from the top) of a pass; none where the picture lacks it."""
    return list(zip(one.names(view_layer), one.pixels(picture)))


def _fill(layer, name, pixels):
    """Copies pixels, rows from the top, into a pass."""
    target = layer.passes[name]
    flat = np.ascontiguousarray(pixels[::-1], dtype=np.float32).ravel()
    expected = len(target.rect) * target.channels
    if flat.size != expected:
        raise Refused(f"Pass {name}: Blender expects {expected} values, the picture has {flat.size}")
    target.rect.foreach_set(flat)
