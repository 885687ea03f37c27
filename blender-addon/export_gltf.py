# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Export > Pumice glTF: the scene with its volumes as surfaces or boxes, for web viewers, engines and most other programs."""

import bpy
from bpy.props import StringProperty

from .export_surfaces import ExportsSurfaces


class PUMICE_OT_export_gltf(ExportsSurfaces, bpy.types.Operator):
    """Export the volumes with their materials and labels as glTF 2.0. Exact surfaces of many labels take time and space"""

    bl_idname = "pumice.export_gltf"
    bl_label = "Export glTF"

    filename_ext = ".glb"
    filter_glob: StringProperty(default="*.glb;*.gltf", options={"HIDDEN"})


def _menu(self, _context):
    self.layout.operator(PUMICE_OT_export_gltf.bl_idname, text="Pumice glTF (.glb, .gltf)")


def register():
    bpy.utils.register_class(PUMICE_OT_export_gltf)
    bpy.types.TOPBAR_MT_file_export.append(_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(_menu)
    bpy.utils.unregister_class(PUMICE_OT_export_gltf)
