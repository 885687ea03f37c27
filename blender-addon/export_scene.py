# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Export > Pumice Scene: the current frame as the scene's JSON form, for `pumice render`.

It is exactly the scene that F12 draws: the same samples on the same device give the same pixels. Meshes become PLY files beside it.
"""

import dataclasses
import os

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from . import final_render, mesh_file, native
from .reports import log, one_line


def parts_to_export(depsgraph):
    """(Parts, what was left out) of the frame that F12 draws; triangles are `mesh_file.Arrays`."""
    return final_render.parts_of_frame(depsgraph, as_rendered=True, make_mesh=mesh_file.Arrays)


def save(parts, path):
    """Writes the scene, and a PLY file beside it for each mesh; a mesh with several instances is one file."""
    stem = os.path.splitext(os.path.basename(path))[0]
    names, placed = {}, {}
    for key in sorted(parts.meshes):
        mesh = parts.meshes[key]
        name = names.get(id(mesh.geometry))
        if name is None:
            plain = "".join(c if c.isalnum() or c in "-_" else "_" for c in mesh.name)
            name = names[id(mesh.geometry)] = f"{stem}-{len(names) + 1}-{plain}.ply"
            mesh_file.write(os.path.join(os.path.dirname(path), name), mesh.geometry)
        placed[key] = dataclasses.replace(mesh, name=name)
    native.require().Scene.from_dict(dataclasses.replace(parts, meshes=placed).scene()).save(path)


class PUMICE_OT_export_scene(bpy.types.Operator, ExportHelper):
    """Export the current frame, as the active camera sees it, for the command `pumice render`"""

    bl_idname = "pumice.export_scene"
    bl_label = "Export Pumice Scene"

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def execute(self, context):
        try:
            # Blender offers only this graph outside a render; `as_rendered` applies the visibility of renders.
            parts, left_out = parts_to_export(context.evaluated_depsgraph_get())
            save(parts, self.filepath)
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
