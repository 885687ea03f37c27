# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures and maps of the last comparison with Cycles, as images that an Image Editor shows.

All are float images with scene-linear values, so an editor shows the maps in the colours of the page. Another comparison replaces the
images of the last one, also where an editor shows them. They are packed, so Blender does not ask for files to save them to.
"""

import bpy
import numpy as np
from bpy.props import EnumProperty

PREFIX = "Pumice verify: "
# Name in the report of `pumice.verify_render`, name in Blender, description.
MAPS = (
    ("pumice", "Pumice", "The mean of all pictures by Pumice"),
    ("cycles", "Cycles", "The mean of all pictures by Cycles"),
    ("difference", "difference", "Pumice less Cycles, as numbers: what an editor shows black may be negative"),
    ("difference_color", "difference in color", "Red where Pumice is brighter, blue where it is darker; full at 5 % of the picture's mean"),
    ("tile_difference_color", "difference by tile", "The difference of each tile of 8 × 8 pixels; full color at the margin of 1 %"),
    ("tile_t_color", "t by tile", "How sure the difference of each tile is, however small; full color at a Welch's t of 6"),
    ("flip_color", "FLIP", "What an eye sees when flipping between the two pictures; black is nothing"),
)


def keep(maps):
    """Makes the images of the arrays that `pumice.verify_render(…, maps=True)` returns."""
    for key, title, _ in MAPS:
        name = PREFIX + title
        height, width, _ = maps[key].shape
        old = bpy.data.images.get(name)
        image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True, is_data=key == "difference")
        # Row 0 of Blender's images is at the bottom.
        rgba = np.ones((height, width, 4), np.float32)
        rgba[..., :3] = maps[key][::-1]
        image.pixels.foreach_set(rgba.ravel())
        image.pack()
        if old is not None:
            old.user_remap(image)
            bpy.data.images.remove(old)
            image.name = name


def are_kept():
    """Whether this file has an image of a comparison."""
    return any(PREFIX + title in bpy.data.images for _, title, _ in MAPS)


class PUMICE_OT_show_verify_map(bpy.types.Operator):
    """Show a picture or map of the last comparison with Cycles in an Image Editor, in a new window if none is open"""

    bl_idname = "pumice.show_verify_map"
    bl_label = "Show Map"

    which: EnumProperty(
        name="Map",
        description="Picture or map to show",
        items=[(key, title, about, place) for place, (key, title, about) in enumerate(MAPS)],
        default="difference_color",
    )

    def execute(self, context):
        title = next(title for key, title, _ in MAPS if key == self.which)
        image = bpy.data.images.get(PREFIX + title)
        if image is None:
            self.report({"ERROR"}, f"{PREFIX}{title}: this file has no such image; Verify against Cycles makes it")
            return {"CANCELLED"}
        area = image_editor(context.window_manager)
        if area is None and bpy.app.background:
            self.report({"ERROR"}, "no Image Editor is open, and without a window none can be opened")
            return {"CANCELLED"}
        if area is None:
            bpy.ops.wm.window_new()
            area = context.window_manager.windows[-1].screen.areas[0]
            area.ui_type = "IMAGE_EDITOR"
        area.spaces.active.image = image
        return {"FINISHED"}


def image_editor(manager):
    """The area of the first open Image Editor; None without one."""
    areas = (area for window in manager.windows for area in window.screen.areas)
    # The UV Editor is an Image Editor too, for whoever asks for `type`.
    return next((area for area in areas if area.ui_type == "IMAGE_EDITOR"), None)


def register():
    bpy.utils.register_class(PUMICE_OT_show_verify_map)


def unregister():
    bpy.utils.unregister_class(PUMICE_OT_show_verify_map)
