# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Export > Pumice Scene: the current frame as the scene's JSON form, for `pumice render`.

It is the very scene that F12 draws: the same samples on the same device give the same pixels.
"""

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from . import final_render, native
from .reports import log, one_line


def scene_of_frame(depsgraph):
    """(pumice.Scene, what was left out) of the frame that F12 draws."""
    parts, left_out = final_render.parts_of_frame(depsgraph, as_rendered=True)
    return native.require().Scene.from_dict(parts.scene()), left_out


class PUMICE_OT_export_scene(bpy.types.Operator, ExportHelper):
    """Export the current frame, as the active camera sees it, for the command `pumice render`"""

    bl_idname = "pumice.export_scene"
    bl_label = "Export Pumice Scene"

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def execute(self, context):
        try:
            # Blender gives no other graph outside a render; what a render hides or shows instead is looked after.
            scene, left_out = scene_of_frame(context.evaluated_depsgraph_get())
            scene.save(self.filepath)
        except Exception as error:
            log(error)
            self.report({"ERROR"}, one_line(error))
            return {"CANCELLED"}
        for line in left_out:
            self.report({"WARNING"}, line)
        wishes = context.scene.pumice
        self.report({"INFO"}, f"F12's picture: pumice render {self.filepath} --spp {wishes.samples} -o picture.exr")
        return {"FINISHED"}


def _menu(self, _context):
    self.layout.operator(PUMICE_OT_export_scene.bl_idname, text="Pumice Scene (.json)")


def register():
    bpy.utils.register_class(PUMICE_OT_export_scene)
    bpy.types.TOPBAR_MT_file_export.append(_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(_menu)
    bpy.utils.unregister_class(PUMICE_OT_export_scene)
