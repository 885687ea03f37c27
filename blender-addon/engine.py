# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine PUMICE: forwards Blender's calls.

It defines neither `__init__` nor `__del__` (their signatures differ between Blender 4.2 and 5.0) and keeps no state in itself.
"""

import bpy

from . import final_render, passes, viewport
from .reports import log, one_line


class PumiceRenderEngine(bpy.types.RenderEngine):
    """Path traces label volumes in their compressed form."""

    bl_idname = "PUMICE"
    bl_label = "Pumice"
    bl_use_preview = False
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False
    bl_use_postprocess = True

    def view_update(self, context, depsgraph):
        viewport.of(self).sync(context, depsgraph)

    def view_draw(self, context, depsgraph):
        viewport.of(self).draw(context, depsgraph)

    def render(self, depsgraph):
        try:
            final_render.render(self, depsgraph)
        except Exception as error:
            log(error)
            said = one_line(error)
            if self.is_animation:
                said = f"Frame {depsgraph.scene.frame_current}: {said}"
            # The report ends an animation, with exit status 1 in `blender -b`, and reaches scripts as an exception; the error, which alone would do
            # none of that, stands in the window of the picture.
            self.report({"ERROR"}, said)
            self.error_set(said)

    def update_render_passes(self, scene=None, renderlayer=None):
        for name, channels, channel_ids, kind in passes.registered(renderlayer, scene.pumice.use_denoise):
            self.register_pass(scene, renderlayer, name, channels, channel_ids, kind)


def register():
    bpy.utils.register_class(PumiceRenderEngine)


def unregister():
    viewport.close_all()
    bpy.utils.unregister_class(PumiceRenderEngine)
