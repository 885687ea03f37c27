# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that cut: an empty or a mesh whose *Cut* is set in its Pumice panel removes a part of space from all volumes.

    PLANE   the half-space that its own +z axis points to, from its origin on
    BOX     an empty: the cube that it shows (display size on each side of its origin); a mesh: its bounding box

It cuts the volumes of the collection *Volumes* in the panel, or all volumes where there is none. The object itself is not drawn.
"""

from mathutils import Matrix, Vector

from . import matrix


def is_cut(obj):
    """Whether an object cuts."""
    return obj.type in {"EMPTY", "MESH"} and obj.pumice.cut != "NONE" and not obj.pumice.filepath


def read(obj, world_from_object):
    """(shape of the cut or None, what was left out) of an object that cuts."""
    world = matrix.rows(world_from_object)
    if obj.pumice.cut == "PLANE":
        # A plane's normal transforms by the inverse transpose, so that the x and y axes stay in the plane even under shear.
        normal = _cross([row[0] for row in world[:3]], [row[1] for row in world[:3]])
        if sum(n * row[2] for n, row in zip(normal, world)) < 0.0:
            normal = [-n for n in normal]
        if sum(n * n for n in normal) < 1e-30:
            return None, [f"Object {obj.name}: scaled to nothing, so it cuts nothing"]
        return {"plane": {"point": [row[3] for row in world[:3]], "normal": normal}}, []
    if obj.type == "EMPTY":
        half, middle = Vector([obj.empty_display_size] * 3), Vector((0.0, 0.0, 0.0))
    else:
        corners = [Vector(corner) for corner in obj.bound_box]
        low = Vector([min(c[axis] for c in corners) for axis in range(3)])
        high = Vector([max(c[axis] for c in corners) for axis in range(3)])
        half, middle = (high - low) / 2.0, (high + low) / 2.0
    box = Matrix.Translation(middle) @ Matrix.Diagonal((*half, 1.0))
    world_from_box = matrix.times(world, matrix.rows(box))
    if not matrix.is_invertible(world_from_box):
        return None, [f"Object {obj.name}: it is flat, so it cuts nothing as a box"]
    return {"box": {"world_from_box": matrix.twelve(world_from_box)}}, []


def targets(obj, keys):
    """(keys of the volumes that an object cuts, or None for all; what was left out).

    `keys` are those of the scene's volumes, which begin with the uids of the objects: a volume that another object instances is cut
    where the collection has either of them.
    """
    chosen = obj.original.pumice.cut_volumes
    if chosen is None:
        return None, []
    uids = {one.session_uid for one in chosen.all_objects}
    found = sorted(key for key in keys if uids.intersection(key[:2]))
    return found, [] if found else [f"Object {obj.name}: collection {chosen.name} has no volume, so it cuts nothing"]


def _cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
