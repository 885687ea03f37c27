# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Render > Verify against Cycles: whether Cycles draws what Pumice draws, with a page that says how sure that is.

A second Blender draws the frame in the background, so that this one stays free. The verdict stands in the scene's panel; from there the
page opens in a browser, and its pictures and maps in an Image Editor.
"""

import os
import sys

import bpy
from bpy.props import FloatProperty, StringProperty

from . import native, preferences, verify_maps
from .background import InBackground, Work
from .frame_file import saved_frame


def blender_program():
    """The program to draw with: this Blender, or the interpreter that has it as a module."""
    return bpy.app.binary_path or sys.executable


class PUMICE_OT_verify(InBackground, bpy.types.Operator):
    """Compare the picture of Pumice with that of Cycles, until every tile is known to agree within 1 % or to differ. Takes minutes, and the memory that Cycles needs for the exact surface"""

    bl_idname = "pumice.verify"
    bl_label = "Verify against Cycles"

    filepath: StringProperty(
        name="Page", description="HTML file for the result; empty for one in Blender's temporary folder", subtype="FILE_PATH"
    )
    seconds: FloatProperty(
        name="Time Limit", description="Begin no further picture after this time; 0 for no limit", min=0.0, default=600.0, unit="TIME_ABSOLUTE"
    )

    def invoke(self, context, event):
        self._interactive = True
        return context.window_manager.invoke_props_dialog(self)

    def begin(self, context):
        pumice = native.require()
        page = self.filepath or os.path.join(bpy.app.tempdir, "verify.html")
        page = os.path.abspath(bpy.path.abspath(page))
        folder, scene = saved_frame(self, context)
        program, seconds = blender_program(), self.seconds or None
        backend = preferences.backend(context.scene.pumice)

        def call(job):
            with folder:
                report = pumice.verify_render(
                    scene, blender=program, page=page, seconds=seconds, backend=backend, maps=True, job=job
                )
            return page, report

        return Work("Verifying against Cycles", call)

    def finish(self, context, result):
        page, report = result
        wishes = context.scene.pumice
        wishes.verdict, wishes.verdict_page = report["sentence"], page
        verify_maps.keep(report["maps"])
        kind = "INFO" if report["agreement"]["verdict"] == "agrees" else "WARNING"
        self.report({kind}, report["sentence"])


def _menu(self, context):
    if context.engine == "PUMICE":
        self.layout.separator()
        self.layout.operator(PUMICE_OT_verify.bl_idname)


def register():
    bpy.utils.register_class(PUMICE_OT_verify)
    bpy.types.TOPBAR_MT_render.append(_menu)


def unregister():
    bpy.types.TOPBAR_MT_render.remove(_menu)
    bpy.utils.unregister_class(PUMICE_OT_verify)
