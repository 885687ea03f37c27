# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Selects all labels that are seen in a rectangle of the picture, which the user drags with the mouse or a script names."""

import bpy
import gpu
from bpy.props import BoolProperty, IntProperty
from gpu_extras.batch import batch_for_shader

from . import label_film, viewport
from .label_operators import counted
from .label_pick import OnPicture, choose, make_active
from .properties import is_volume

COLOR = (1.0, 1.0, 1.0, 1.0)


class PUMICE_OT_labels_select_box(OnPicture, bpy.types.Operator):
    """Select all labels that are seen in a rectangle. Shift adds to the selection"""

    bl_idname = "pumice.labels_select_box"
    bl_label = "Box Select Labels"

    x0: IntProperty(name="Left", description="First column of pixels of the last picture, counted from the left", options={"SKIP_SAVE"})
    y0: IntProperty(name="Top", description="First line of pixels, counted from the top", options={"SKIP_SAVE"})
    x1: IntProperty(name="Right", description="First column of pixels that is outside", options={"SKIP_SAVE"})
    y1: IntProperty(name="Bottom", description="First line of pixels that is outside", options={"SKIP_SAVE"})
    extend: BoolProperty(name="Extend", description="Keep what is selected", default=False, options={"SKIP_SAVE"})

    _corners = None
    _handle = None

    def invoke(self, context, event):
        region = context.region
        if viewport.of_region(region) is None:
            self.report({"WARNING"}, "Labels are picked in Rendered shading with the render engine Pumice")
            return {"PASS_THROUGH"}
        self.extend = event.shift
        # The mouse has already moved by the distance that makes a drag of a click.
        start = (event.mouse_prev_press_x - region.x, event.mouse_prev_press_y - region.y)
        self._corners = [start, (event.mouse_region_x, event.mouse_region_y)]
        self._handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (self._corners, region), "WINDOW", "POST_PIXEL")
        context.window_manager.modal_handler_add(self)
        region.tag_redraw()
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "MOUSEMOVE":
            self._corners[1] = (event.mouse_region_x, event.mouse_region_y)
            context.region.tag_redraw()
        elif event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS":
            self.cancel(context)
            return {"CANCELLED"}
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            self.cancel(context)
            shown = viewport.of_region(context.region)
            if shown is None or shown.sent is None:
                self.report({"WARNING"}, "The viewport has no picture any more")
                return {"CANCELLED"}
            self.x0, self.y0, self.x1, self.y1 = rectangle(
                *self._corners, (context.region.width, context.region.height), label_film.size_of(shown)
            )
            return self.execute(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        """Takes the rectangle off the screen; Blender calls it too when it ends the operator."""
        if self._handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handle, "WINDOW")
            self._handle = None
        if context.region is not None:
            context.region.tag_redraw()

    def change(self, context, _table):
        film = label_film.of_last_picture(context)
        found = film.inside(self.x0, self.y0, self.x1, self.y1)
        if found and not (context.object is not None and is_volume(context.object)):
            make_active(context, found[0][0])
        choose(context, film, found, self.extend)
        return f"{counted(sum(len(rows) for _, rows in found))} seen in the box"


def rectangle(start, end, region_size, film_size):
    """x0, y0, x1, y1 in pixels of a film, the last two outside, of a rectangle between two pixels of a region, both inside."""
    corners = [label_film.film_from_region(*corner, region_size, film_size) for corner in (start, end)]
    (x0, x1), (y0, y1) = (sorted(values) for values in zip(*corners))
    return x0, y0, x1 + 1, y1 + 1


def _draw(corners, region):
    """The rectangle, in the region in which it is dragged."""
    if bpy.context.region != region:
        return
    (x0, y0), (x1, y1) = corners
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINE_LOOP", {"pos": [(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0)]})
    shader.bind()
    shader.uniform_float("color", COLOR)
    batch.draw(shader)


def register():
    bpy.utils.register_class(PUMICE_OT_labels_select_box)


def unregister():
    bpy.utils.unregister_class(PUMICE_OT_labels_select_box)
