# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Export > Pumice USD: the scene with its volumes as surfaces or boxes, for other programs.

The frame goes out as a scene file in a temporary folder, which the compiled module exports as the command does.
"""

import os
import tempfile

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from . import export_scene, native
from .background import InBackground, Work

FORMS = (
    ("voxels", "Exact Surface", "The surface of the voxels, as it is drawn", 0),
    ("cells4", "Cells", "The surface of cells of 4³ voxels: a fiftieth of the faces", 1),
    ("boxes", "Boxes", "The surface of the boxes: the fewest faces", 2),
    ("instances", "Instances", "A scaled cube for each box: the least to write", 3),
    ("smooth", "Smoothed Surface", "A closed surface of each label with smooth normals, not exact: corners move by up to 0.4 of a voxel", 4),
)


class PUMICE_OT_export_usd(InBackground, bpy.types.Operator, ExportHelper):
    """Export the volumes with their materials and labels as Universal Scene Description. Exact surfaces of many labels take time and space"""

    bl_idname = "pumice.export_usd"
    bl_label = "Export USD"

    filename_ext = ".usdc"
    filter_glob: StringProperty(default="*.usdc;*.usda;*.usdz", options={"HIDDEN"})
    # ExportHelper would replace .usda by the default.
    check_extension = None
    form: EnumProperty(name="Form", description="How volumes are written", items=FORMS, default="voxels")
    plain: BoolProperty(
        name="A Square for Each Face",
        description="Do not merge neighboring faces into rectangles. Takes two to four times the space",
        default=False,
    )
    for_blender: BoolProperty(
        name="For Blender",
        description="Write suns, spots and orthographic cameras as Blender's importer takes them; other programs read these wrong then",
        default=False,
    )

    def invoke(self, context, event):
        self._interactive = True
        return ExportHelper.invoke(self, context, event)

    def begin(self, context):
        pumice = native.require()
        path = os.path.abspath(bpy.path.abspath(self.filepath))
        parts, left_out = export_scene.parts_to_export(context.evaluated_depsgraph_get())
        for line in left_out:
            self.report({"WARNING"}, line)
        folder = tempfile.TemporaryDirectory(prefix="pumice-")
        scene = os.path.join(folder.name, "scene.json")
        export_scene.save(parts, scene)
        wishes = dict(form=self.form, plain=self.plain, for_blender=self.for_blender)

        def call(job):
            with folder:
                return pumice.export(scene, path, job=job, **wishes)

        return Work(f"Exporting {os.path.basename(path)}", call)

    def finish(self, context, report):
        if report["left_out"]:
            self.report({"WARNING"}, f"Left out: {', '.join(report['left_out'])}")
        count = f"{report['boxes']} boxes" if report["boxes"] else f"{report['faces']} faces"
        self.report({"INFO"}, f"{os.path.basename(self.filepath)}: {count}, {report['bytes'] / 1e6:.1f} MB")


def _menu(self, _context):
    self.layout.operator(PUMICE_OT_export_usd.bl_idname, text="Pumice USD (.usdc, .usda, .usdz)")


def register():
    bpy.utils.register_class(PUMICE_OT_export_usd)
    bpy.types.TOPBAR_MT_file_export.append(_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(_menu)
    bpy.utils.unregister_class(PUMICE_OT_export_usd)
