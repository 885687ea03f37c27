# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the exports to other programs have in common: the form of volumes, and the work in the background.

An operator that mixes in `ExportsSurfaces` says which files it writes; the compiled module chooses the format by the name's ending.
"""

import os

import bpy
from bpy.props import BoolProperty, EnumProperty
from bpy_extras.io_utils import ExportHelper

from . import native
from .background import InBackground, Work
from .export_scene import SURFACES
from .frame_file import saved_frame

FORMS = (
    *SURFACES,
    ("instances", "Instances", "A scaled cube for each box: the least to write", 3),
    ("smooth", "Smoothed Surface", "A closed surface of each label with smooth normals, not exact: corners move by up to 0.4 of a voxel", 4),
)


class ExportsSurfaces(InBackground, ExportHelper):
    """Exports the current frame with its volumes as surfaces or boxes."""

    # ExportHelper would replace the ending of another format by the default.
    check_extension = None
    form: EnumProperty(name="Form", description="How volumes are written", items=FORMS, default="voxels")
    plain: BoolProperty(
        name="A Square for Each Face",
        description="Do not merge neighboring faces into rectangles. Takes two to four times the space",
        default=False,
    )

    def export_options(self):
        """Keywords of `pumice.export` for this operator's properties."""
        return dict(form=self.form, plain=self.plain)

    def invoke(self, context, event):
        self._interactive = True
        return ExportHelper.invoke(self, context, event)

    def begin(self, context):
        pumice = native.require()
        path = os.path.abspath(bpy.path.abspath(self.filepath))
        folder, scene = saved_frame(self, context)
        options = self.export_options()

        def call(job):
            with folder:
                return pumice.export(scene, path, job=job, **options)

        return Work(f"Exporting {os.path.basename(path)}", call)

    def finish(self, context, report):
        if report["left_out"]:
            self.report({"WARNING"}, f"Left out: {', '.join(report['left_out'])}")
        count = f"{report['boxes']} boxes" if report["boxes"] else f"{report['faces']} faces"
        self.report({"INFO"}, f"{os.path.basename(self.filepath)}: {count}, {report['bytes'] / 1e6:.1f} MB")
