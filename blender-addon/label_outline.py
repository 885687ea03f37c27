# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines the selected labels over a viewport's picture, in the theme's color of the active object.

    label film ─┐
                ├──► mask: pixels at an edge of a selected label ──► texture ──► stretched over the region like the picture
    selection ──┘         numpy, once for each change of either

Blender gives no pass of outlines to a render engine, so they are drawn as an overlay; *Overlays* off hides them. While the view moves there
is no film, and so no outline.
"""

import weakref

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from . import label_film, label_table, viewport

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
    """The outline of one viewport, as a texture of the part of the film that it covers."""

    def __init__(self):
        self._pixels, self._selections = None, []
        self._texture, self._part = None, None

    def update(self, pixels, selections):
        """Makes the texture anew if film or selection differ."""
        same_film = self._pixels is not None and np.shares_memory(pixels, self._pixels)
        if same_film and _same(selections, self._selections):
            return
        self._pixels, self._selections = pixels, selections
        edges = mask(pixels, selections)
        self._part = covered(edges)
        self._texture = upload(edges, self._part) if self._part is not None else None

    def draw(self, region_size, color):
        """Draws it over a region."""
        if self._texture is None:
            return
        height, width = self._pixels.shape[:2]
        x0, y0, x1, y1 = self._part
        left, right = (x * region_size[0] / width for x in (x0, x1))
        top, bottom = ((height - y) * region_size[1] / height for y in (y0, y1))
        shader = gpu.shader.from_builtin("IMAGE_COLOR")
        corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
        batch = batch_for_shader(shader, "TRI_FAN", {"pos": corners, "texCoord": [(0, 0), (1, 0), (1, 1), (0, 1)]})
        gpu.state.blend_set("ALPHA")
        shader.bind()
        shader.uniform_sampler("image", self._texture)
        shader.uniform_float("color", color)
        batch.draw(shader)
        gpu.state.blend_set("NONE")


def covered(edges):
    """x0, y0, x1, y1 of the smallest rectangle with all set flags, the last two outside; None where none is set."""
    columns, rows = np.flatnonzero(edges.any(axis=0)), np.flatnonzero(edges.any(axis=1))
    return (int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1) if len(columns) else None


def upload(edges, part):
    """A texture of a part of a mask: white, as opaque as the mask says; rows from the bottom."""
    x0, y0, x1, y1 = part
    values = np.ones((y1 - y0, x1 - x0, 4), dtype=np.float32)
    values[..., 3] = edges[y0:y1, x0:x1][::-1]
    pixels = gpu.types.Buffer("FLOAT", values.shape, values)
    return gpu.types.GPUTexture((x1 - x0, y1 - y0), format="RGBA8", data=pixels)


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
    # The shader for pictures takes linear colors, while those of the theme are as the screen shows them.
    color = label_table.linear_from_srgb(tuple(context.preferences.themes[0].view_3d.object_active))
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
