# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a Blender camera object: its lens for a render, and its depth of field for a render and for a viewport in camera view."""

from ..reports import Refused
from . import camera as camera_math
from . import matrix


def read(obj, depsgraph=None):
    """The scene's camera from an evaluated camera object; the object's scale does not count, as in Blender."""
    data = require_flat(obj)
    return camera_math.from_lens(
        _place(obj)[0],
        kind=data.type,
        lens_mm=data.lens,
        ortho_scale=data.ortho_scale,
        sensor_fit=data.sensor_fit,
        sensor_mm=(data.sensor_width, data.sensor_height),
        shift=(data.shift_x, data.shift_y),
        clip=(data.clip_start, data.clip_end),
        aperture=aperture(obj, depsgraph),
    )


def is_sheared(obj):
    """Whether a parent that is scaled unevenly shears a turned camera."""
    return _place(obj)[1]


def _place(obj):
    """(the matrix of a camera object with unit axes at right angles, whether they were not)."""
    world = matrix.unit_axes(obj.matrix_world)
    try:
        return matrix.without_shear(world)
    except ZeroDivisionError:
        # Its axes lie in a plane: the compiled module names what is wrong with them.
        return world, False


def require_flat(obj):
    """The camera's data; raises Refused for a panoramic camera."""
    if obj.data.type not in {"PERSP", "ORTHO"}:
        raise Refused(f"Camera {obj.name}: panoramas are not drawn; set its type to Perspective or Orthographic")
    return obj.data


def aperture(obj, depsgraph=None):
    """The scene's aperture of a camera object; None if everything is sharp. `depsgraph` gives the position of the focus object."""
    dof = obj.data.dof
    if not dof.use_dof:
        return None
    return camera_math.aperture(
        kind=obj.data.type,
        lens_mm=obj.data.lens,
        fstop=dof.aperture_fstop,
        focus_distance=focus_distance(obj, depsgraph),
        blades=dof.aperture_blades,
        rotation_rad=dof.aperture_rotation,
        ratio=dof.aperture_ratio,
    )


def focus_distance(obj, depsgraph=None):
    """Distance from a camera object at which the picture is sharp."""
    dof = obj.data.dof
    focus = dof.focus_object
    if focus is None:
        return dof.focus_distance
    if depsgraph is not None:
        focus = focus.evaluated_get(depsgraph)
    place = focus.matrix_world
    if focus.pose is not None and dof.focus_subtarget in focus.pose.bones:
        place = place @ focus.pose.bones[dof.focus_subtarget].matrix
    return camera_math.distance_along(obj.matrix_world, place.translation)
