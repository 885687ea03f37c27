# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tool *Pick Labels* of the 3D viewport's toolbar, and what the status bar says of the label under the mouse.

    click, Shift click, drag      labels_pick, labels_select_box
    H, Shift H, Alt H             hide the selected labels, hide the others, show all: only while the tool is active
    mouse moves                   labels_hover reads the label film and asks no renderer

The status line belongs to the workspace and stays until someone takes it away, so a timer does when another tool becomes active.
"""

import bpy

from . import label_film, label_pick, viewport

IDNAME = "pumice.pick"
# How soon the status line of another tool is free again.
LOOK_SECONDS = 0.25

# What the status bar says now.
_said = None


class PickTool(bpy.types.WorkSpaceTool):
    bl_space_type = "VIEW_3D"
    bl_context_mode = "OBJECT"
    bl_idname = IDNAME
    bl_label = "Pick Labels"
    bl_description = "Select labels in the picture. Drag to select all that are seen in a box.\nIn Rendered shading with the render engine Pumice"
    bl_icon = "ops.generic.select"
    # All properties are set: those that are not would be the ones of the last call.
    bl_keymap = (
        ("pumice.labels_pick", {"type": "LEFTMOUSE", "value": "CLICK"}, None),
        ("pumice.labels_pick", {"type": "LEFTMOUSE", "value": "CLICK", "shift": True}, None),
        ("pumice.labels_select_box", {"type": "LEFTMOUSE", "value": "CLICK_DRAG"}, None),
        ("pumice.labels_select_box", {"type": "LEFTMOUSE", "value": "CLICK_DRAG", "shift": True}, None),
        ("pumice.labels_hide", {"type": "H", "value": "PRESS"}, {"properties": [("unselected", False)]}),
        ("pumice.labels_hide", {"type": "H", "value": "PRESS", "shift": True}, {"properties": [("unselected", True)]}),
        ("pumice.labels_show_all", {"type": "H", "value": "PRESS", "alt": True}, None),
        ("pumice.labels_hover", {"type": "MOUSEMOVE", "value": "ANY", "any": True}, None),
    )


class PUMICE_OT_labels_hover(bpy.types.Operator):
    """Say in the status bar which label is under the mouse"""

    bl_idname = "pumice.labels_hover"
    bl_label = "Label under the Mouse"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context):
        return viewport.of_region(context.region) is not None

    def invoke(self, context, event):
        region = context.region
        text = said_of(viewport.of_region(region), event.mouse_region_x, event.mouse_region_y, (region.width, region.height))
        say(context.workspace, text)
        return {"PASS_THROUGH"}


def said_of(shown, x, y, region_size):
    """The line about the label under a pixel of a viewport's region; None where there is none, or it is not known yet."""
    film = label_film.of_viewport(shown)
    if film is None or not (0 <= x < region_size[0] and 0 <= y < region_size[1]):
        return None
    height, width = film.pixels.shape[:2]
    seen = film.at(*label_film.film_from_region(x, y, region_size, (width, height)))
    return label_pick.line(seen[0].pumice.table, seen[1]) if seen is not None else None


def say(workspace, text):
    """Shows a text in the status bar, or Blender's own again."""
    global _said
    if text == _said:
        return
    _said = text
    workspace.status_text_set(text)
    if text is not None and not bpy.app.timers.is_registered(_look):
        bpy.app.timers.register(_look, first_interval=LOOK_SECONDS, persistent=True)


def _look():
    """Frees the status bar once no window has the tool active."""
    if _said is None:
        return None
    windows = bpy.context.window_manager.windows
    if any(_is_active(window) for window in windows):
        return LOOK_SECONDS
    say(windows[0].workspace, None)
    return None


def _is_active(window):
    tool = window.workspace.tools.from_space_view3d_mode("OBJECT", create=False)
    return tool is not None and tool.idname == IDNAME and any(area.type == "VIEW_3D" for area in window.screen.areas)


def register():
    bpy.utils.register_class(PUMICE_OT_labels_hover)
    # A button of its own below the tools that select objects, not one more behind theirs.
    bpy.utils.register_tool(PickTool, after={"builtin.select_lasso"}, separator=True, group=True)


def unregister():
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
    bpy.utils.unregister_tool(PickTool)
    bpy.utils.unregister_class(PUMICE_OT_labels_hover)
