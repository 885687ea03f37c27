# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines the selected labels over a viewport's picture, in the theme's color of the active object.

    label film ─┐
                ├──► mask: pixels at an edge of a selected label ──► rectangles ──► stretched over the region like the picture
    selection ──┘         numpy, once for each change of either

Blender gives no pass of outlines to a render engine, so they are drawn as an overlay; *Overlays* off hides them. While the view moves there
is no film, and so no outline.
"""

import weakref

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from . import label_film, viewport

_handle = None
# The last outline of each viewport.
_outlines = weakref.WeakKeyDictionary()


def mask(pixels, selections):
    """Which pixels of a label film are at an edge of a selected label, on either side; (height, width) flags, rows from the top.

    `selections` are [(numbers of instances, which labels are selected)]. Two pixels are apart if they see another label or instance.
    """
    instance, label = pixels[..., 0], pixels[..., 1]
    table = np.zeros(int(instance.max(initial=0)) + 1, dtype=np.int64)
    chosen = np.zeros(label.shape, dtype=bool)
    most = int(label.max(initial=0))
    for place, (numbers, flags) in enumerate(selections, start=1):
        table[[number for number in numbers if number < len(table)]] = place
        selected = np.zeros(most + 1, dtype=bool)
        selected[1 : len(flags) + 1] = flags[:most]
        chosen |= (table[instance] == place) & selected[label]
    # Instance and label as one number: half the comparisons.
    seen, edges = np.ascontiguousarray(pixels).view(np.uint64)[..., 0], np.zeros(label.shape, dtype=bool)
    for before, after in (((slice(None), slice(None, -1)), (slice(None), slice(1, None))), (np.s_[:-1, :], np.s_[1:, :])):
        apart = (seen[before] != seen[after]) & (chosen[before] | chosen[after])
        edges[before] |= apart
        edges[after] |= apart
    return edges


class Outline:
    """The outline of one viewport, as rectangles on the graphics processor."""

    def __init__(self):
        self._pixels, self._selections = None, []
        self._batch = None

    def update(self, pixels, selections):
        """Makes the rectangles anew if film or selection differ."""
        same_film = self._pixels is not None and np.shares_memory(pixels, self._pixels)
        if same_film and _same(selections, self._selections):
            return
        self._pixels, self._selections = pixels, selections
        corners, triangles = rectangles(mask(pixels, selections))
        shader = gpu.shader.from_builtin("UNIFORM_COLOR")
        self._batch = batch_for_shader(shader, "TRIS", {"pos": corners}, indices=triangles) if len(triangles) else None

    def draw(self, region_size, color):
        """Draws it over a region of this width and height in pixels, in a color as the screen shows it."""
        if self._batch is None:
            return
        height, width = self._pixels.shape[:2]
        shader = gpu.shader.from_builtin("UNIFORM_COLOR")
        with gpu.matrix.push_pop():
            gpu.matrix.scale((region_size[0] / width, region_size[1] / height))
            shader.bind()
            shader.uniform_float("color", color)
            self._batch.draw(shader)


def rectangles(edges):
    """The set pixels of a mask as rectangles, one for each run in a row: corners (4 n, 3), from the lower left, and triangles (2 n, 3)."""
    height, width = edges.shape
    found = np.flatnonzero(edges)
    rows, columns = np.divmod(found, max(1, width))
    # A run begins where no set pixel of the same row is before it, and ends where the next one begins.
    begins = np.flatnonzero(np.concatenate([[True], (np.diff(found) != 1) | (columns[1:] == 0)])[: len(found)])
    last = np.append(begins[1:], len(found))[: len(begins)] - 1
    rows, starts, ends = rows[begins], columns[begins], columns[last] + 1
    corners = np.zeros((len(rows), 4, 3), dtype=np.float32)
    corners[:, :, 0] = np.stack([starts, ends, ends, starts], axis=1)
    tops = height - rows
    corners[:, :, 1] = np.stack([tops - 1, tops - 1, tops, tops], axis=1)
    first = 4 * np.arange(len(rows), dtype=np.int32)
    triangles = first[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return corners.reshape(-1, 3), triangles.reshape(-1, 3)


def _same(some, others):
    return len(some) == len(others) and all(
        numbers == more and np.array_equal(flags, flags_too) for (numbers, flags), (more, flags_too) in zip(some, others)
    )


def _draw():
    context = bpy.context
    shown = viewport.of_region(context.region)
    if shown is None or not context.space_data.overlay.show_overlays:
        return
    selections = label_film.selections(label_film.uids_of(shown))
    film = shown.labels() if selections else None
    if film is None:
        return
    outline = _outlines.setdefault(shown, Outline())
    outline.update(film.pixels, selections)
    color = context.preferences.themes[0].view_3d.object_active
    outline.draw((context.region.width, context.region.height), (*color, 1.0))


@bpy.app.handlers.persistent
def _redraw(*_):
    """Undo and redo change the selection, and with it the outline."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


HANDLERS = (bpy.app.handlers.undo_post, bpy.app.handlers.redo_post)


def register():
    global _handle
    _handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL")
    for handlers in HANDLERS:
        handlers.append(_redraw)


def unregister():
    global _handle
    for handlers in HANDLERS:
        handlers.remove(_redraw)
    bpy.types.SpaceView3D.draw_handler_remove(_handle, "WINDOW")
    _handle = None
    _outlines.clear()
