# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Export > Pumice USD: the scene with its volumes as surfaces or boxes, for programs that read Universal Scene Description."""

import bpy
from bpy.props import BoolProperty, StringProperty

from .export_surfaces import ExportsSurfaces


class PUMICE_OT_export_usd(ExportsSurfaces, bpy.types.Operator):
    """Export the volumes with their materials and labels as Universal Scene Description. Exact surfaces of many labels take time and space"""

    bl_idname = "pumice.export_usd"
    bl_label = "Export USD"

    filename_ext = ".usdc"
    filter_glob: StringProperty(default="*.usdc;*.usda;*.usdz", options={"HIDDEN"})
    for_blender: BoolProperty(
        name="For Blender",
        description="Write suns, spots and orthographic cameras as Blender's importer takes them; other programs read these wrong then",
        default=False,
    )

    def export_options(self):
        return dict(super().export_options(), for_blender=self.for_blender)


def _menu(self, _context):
    self.layout.operator(PUMICE_OT_export_usd.bl_idname, text="Pumice USD (.usdc, .usda, .usdz)")


def register():
    bpy.utils.register_class(PUMICE_OT_export_usd)
    bpy.types.TOPBAR_MT_file_export.append(_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(_menu)
    bpy.utils.unregister_class(PUMICE_OT_export_usd)
