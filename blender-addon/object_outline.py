# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines the selected objects in viewports of which Pumice draws the overlays (`true_overlays`), where its picture shows their edges.

    label film: instance numbers ─┐
                                  ├──► mask: pixels at an edge of a selected object ──► rectangles, as the outline of labels
    selected and active object ───┘         numpy, once for each change of either

Colors are the theme's for the active object and for other selected ones. As in Blender, what an instancer makes has the outline of the instancer,
two selected objects have an edge between them, and an object in another mode than Object Mode has none. Unlike in Blender, what is behind
another object has none either: the film tells what is seen.
"""

import weakref

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from . import label_film, true_overlays, viewport
from .label_outline import rectangles

SELECTED, ACTIVE = 1, 2

_handle = None
# The last outline of each viewport.
_outlines = weakref.WeakKeyDictionary()


def states(owners, selected, active):
    """{number: SELECTED or ACTIVE} of the instances of selected objects: `owners` are session uids by number, `selected` a set of them, `active` the
    one of the active object."""
    return {number: ACTIVE if uid == active else SELECTED for number, uid in owners.items() if uid in selected}


def mask(instance, chosen):
    """Which pixels are at an edge of a selected object, on either side: (height, width) of SELECTED, ACTIVE or 0, rows from the top.

    `instance` are the numbers of a label film, `chosen` as `states` gives them. A pixel of a selected object has the color of that object, one
    beside it the color of its neighbor, where there are several that of the active one."""
    table = np.zeros(int(instance.max(initial=0)) + 1, dtype=np.uint8)
    for number, state in chosen.items():
        if number < len(table):
            table[number] = state
    edges, seen, width = np.zeros(instance.size, dtype=np.uint8), instance.reshape(-1), instance.shape[1]
    # Neighbors that differ are few, so all else is done for these pairs alone.
    across, down = np.flatnonzero(seen[:-1] != seen[1:]), np.flatnonzero(seen[:-width] != seen[width:])
    across = across[(across + 1) % width > 0]
    first, second = np.concatenate([across, down]), np.concatenate([across + 1, down + width])
    pairs = [(first, second), (second, first)]
    for state in (SELECTED, ACTIVE):
        for here, there in pairs:
            edges[here[table[seen[there]] == state]] = state
    for here, _ in pairs:
        own = table[seen[here]]
        edges[here[own > 0]] = own[own > 0]
    return edges.reshape(instance.shape)


class Outline:
    """The outline of one viewport, as rectangles on the graphics processor."""

    def __init__(self):
        self._pixels, self._chosen = None, {}
        self._batches = {}

    def update(self, pixels, chosen):
        """Makes the rectangles anew if film or selection differ."""
        if self._pixels is not None and np.shares_memory(pixels, self._pixels) and chosen == self._chosen:
            return
        self._pixels, self._chosen, self._batches = pixels, chosen, {}
        edges = mask(np.ascontiguousarray(pixels[..., 0]), chosen)
        for state in (SELECTED, ACTIVE):
            corners, triangles = rectangles(edges == state)
            if len(triangles):
                shader = gpu.shader.from_builtin("UNIFORM_COLOR")
                self._batches[state] = batch_for_shader(shader, "TRIS", {"pos": corners}, indices=triangles)

    def draw(self, colors):
        """Draws it over the whole region, in the colors by state."""
        if not self._batches:
            return
        height, width = self._pixels.shape[:2]
        clip_from_pixel = Matrix(((2.0 / width, 0.0, 0.0, -1.0), (0.0, 2.0 / height, 0.0, -1.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
        gpu.state.depth_test_set("NONE")
        shader = gpu.shader.from_builtin("UNIFORM_COLOR")
        with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            gpu.matrix.load_identity()
            gpu.matrix.load_projection_matrix(clip_from_pixel)
            shader.bind()
            for state, batch in self._batches.items():
                shader.uniform_float("color", (*colors[state], 1.0))
                batch.draw(shader)


def selection(context):
    """(session uids of the objects that have an outline if they are seen, the uid of the active one)."""
    active = context.view_layer.objects.active
    chosen = {obj.session_uid for obj in context.view_layer.objects.selected if obj.mode == "OBJECT"}
    return chosen, active.session_uid if active is not None else None


def draw_outline():
    """Draws it in the region of the context."""
    context = bpy.context
    shown, space = viewport.of_region(context.region), context.space_data
    if shown is None or not space.overlay.show_overlays:
        return
    wishes = true_overlays.wishes_of(space)
    if wishes is None or not wishes.show_outline_selected:
        return
    chosen = states(label_film.owners_of(shown), *selection(context))
    film = shown.labels() if chosen else None
    if film is None:
        return
    outline = _outlines.setdefault(shown, Outline())
    outline.update(film.pixels, chosen)
    theme = context.preferences.themes[0].view_3d
    outline.draw({SELECTED: theme.object_selected, ACTIVE: theme.object_active})


def _draw():
    draw_outline()


def register():
    global _handle
    _handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")


def unregister():
    global _handle
    bpy.types.SpaceView3D.draw_handler_remove(_handle, "WINDOW")
    _handle = None
    _outlines.clear()
