# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles in the viewport of the selected object that cuts: arrows that move it, dials that turn it.

    plane   an arrow along its normal; dials about its x and y axes
    box     an arrow along each of its axes; a dial about each

Each handle starts Blender's own Move or Rotate, along one local axis: so a drag is one undo step, snaps with Ctrl and takes typed numbers.
"""

import bpy
from mathutils import Matrix

from .sync import cuts

COLORS = ((0.96, 0.21, 0.31), (0.55, 0.86, 0.0), (0.17, 0.56, 1.0))
# (kind, axis) of each handle.
HANDLES = {
    "PLANE": (("MOVE", 2), ("TURN", 0), ("TURN", 1)),
    "BOX": (("MOVE", 0), ("MOVE", 1), ("MOVE", 2), ("TURN", 0), ("TURN", 1), ("TURN", 2)),
}
KINDS = {"MOVE": ("GIZMO_GT_arrow_3d", "transform.translate"), "TURN": ("GIZMO_GT_dial_3d", "transform.rotate")}


def place(obj, axis):
    """The matrix of a handle: at the object's origin, its z along the object's axis, without scale."""
    turn = obj.matrix_world.to_quaternion().to_matrix()
    along = turn.col[axis].to_track_quat("Z", "Y").to_matrix()
    return Matrix.Translation(obj.matrix_world.translation) @ along.to_4x4()


class PUMICE_GGT_cut(bpy.types.GizmoGroup):
    """Handles of the active object that cuts."""

    bl_idname = "PUMICE_GGT_cut"
    bl_label = "Pumice Cut"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT", "SHOW_MODAL_ALL"}

    @classmethod
    def poll(cls, context):
        obj = context.object
        return obj is not None and obj.select_get() and obj.mode == "OBJECT" and cuts.is_cut(obj)

    def setup(self, context):
        self.handles, self.shape = [], None
        self.refresh(context)

    def refresh(self, context):
        obj = context.object
        if obj is None or obj.pumice.cut not in HANDLES:
            return
        if obj.pumice.cut != self.shape:
            self._make(obj.pumice.cut)
        for gizmo, axis in self.handles:
            gizmo.matrix_basis = place(obj, axis)

    def draw_prepare(self, context):
        self.refresh(context)

    def _make(self, shape):
        self.gizmos.clear()
        self.handles, self.shape = [], shape
        for kind, axis in HANDLES[shape]:
            name, operator = KINDS[kind]
            gizmo = self.gizmos.new(name)
            gizmo.color, gizmo.alpha = COLORS[axis], 0.6
            gizmo.color_highlight, gizmo.alpha_highlight = (1.0, 1.0, 1.0), 1.0
            gizmo.use_draw_modal = True
            if kind == "TURN":
                gizmo.draw_options = {"CLIP"}
            started = gizmo.target_set_operator(operator)
            started.orient_type, started.release_confirm = "LOCAL", True
            started.constraint_axis = tuple(one == axis for one in range(3))
            if kind == "TURN":
                started.orient_axis = "XYZ"[axis]
            self.handles.append((gizmo, axis))


def register():
    bpy.utils.register_class(PUMICE_GGT_cut)


def unregister():
    bpy.utils.unregister_class(PUMICE_GGT_cut)
