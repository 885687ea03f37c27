# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Converts ordinary objects to triangle meshes of the scene: meshes, curves, surfaces, texts, metaballs, with their modifiers.

    geometry    evaluated triangles, and the normals of their corners where they are smooth, read once and kept until Blender reports
                a change; objects that share data share it
    place       the instance's matrix
    materials   of the object's slots, in order: a triangle names its slot

Reading triangles is expensive, so `Geometries` caches them. The dependency graph says what has changed: after a moved camera or object,
or a new colour, no triangles are read.
"""

from typing import NamedTuple

import numpy as np

from .. import native
from . import drawn, matrix, object_rays
from .parts import PlacedMesh

# What has triangles; of other objects with a surface (hair, points, volumes, strokes) there is a line. The dependency graph gives of
# each an evaluated object of type MESH; of a curve, a text and the like besides the object itself, whose triangles those are.
KINDS = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
# Normals nearer than a tenth of a degree are the same: single precision turns them by less, and no shading shows it.
LEAST_COSINE = 0.999998


class Geometry(NamedTuple):
    """Triangles as the compiled module has them, and whether any is shaded smooth."""

    mesh: object
    is_smooth: bool


class Geometries:
    """Cache of triangles, by the key of the object or data that they belong to."""

    def __init__(self, make=None):
        """`make` takes corners, triangles, material indices and, where the mesh is smooth, `normals` of the triangles' corners; by
        default it is the compiled module's `Mesh`."""
        self._kept, self._seen = {}, set()
        self._make = make or (lambda *arrays, **more: native.require().Mesh(*arrays, **more))
        self.reads = 0

    def begin(self, depsgraph):
        """A reading begins: drops what the dependency graph says has other triangles than before. It tells so while it is updated, and
        to `view_update`."""
        changed = {
            update.id.original.session_uid for update in depsgraph.updates if getattr(update, "is_updated_geometry", False)
        }
        self._kept = {key: kept for key, kept in self._kept.items() if key[0] not in changed}
        self._seen = set()

    def end(self):
        """A reading has ended: drops what no object has any more."""
        self._kept = {key: kept for key, kept in self._kept.items() if key in self._seen}

    def of(self, obj):
        """The Geometry of an evaluated object; None where it has no triangle."""
        key, stamp = _key(obj), (obj.data.as_pointer(), obj.data.session_uid)
        self._seen.add(key)
        kept = self._kept.get(key)
        # An evaluated mesh that Blender rebuilt counts as another one, even if this module missed the update of the graph.
        if kept is None or kept[0] != stamp:
            self.reads += 1
            kept = self._kept[key] = (stamp, _read(obj, self._make))
        return kept[1]


def placed(obj, world_from_mesh, geometries, dresses):
    """(PlacedMesh or None, what was left out) of an evaluated object; `dresses` are the materials that were read so far."""
    owner = f"Object {obj.name}"
    geometry = geometries.of(obj)
    if geometry is None:
        return None, []
    place = matrix.rows(world_from_mesh)
    if not matrix.is_invertible(place):
        return None, [f"{owner}: scaled to nothing; it is left out"]
    worn, left_out = [], left_out_of(obj)
    for material in [slot.material for slot in obj.material_slots] or [None]:
        dress, missing = dresses.read(material)
        worn.append(dress)
        left_out += missing
    if geometry.is_smooth and not drawn.SMOOTH_MESHES:
        left_out.append(f"{owner}: smooth shading is drawn flat")
    catches = drawn.SHADOW_CATCHER and bool(obj.is_shadow_catcher)
    return PlacedMesh(obj.name, geometry.mesh, matrix.twelve(place), worn, catches), left_out


def left_out_of(obj):
    """One line for each property of an object that is not drawn; its materials have their own lines."""
    hair = [f"Object {obj.name}: its particle hair is not drawn"] if any(map(_is_hair, obj.modifiers)) else []
    return hair + object_rays.left_out_of(obj, catches=drawn.SHADOW_CATCHER)


def _is_hair(modifier):
    """Whether a modifier makes strands; what particles place is an instance, and drawn."""
    if modifier.type != "PARTICLE_SYSTEM" or not (modifier.show_viewport or modifier.show_render):
        return False
    settings = modifier.particle_system.settings
    return settings.type == "HAIR" and settings.render_type == "PATH"


def _key(obj):
    """The key of an object's triangles: by object if modifiers or another kind of data make them, otherwise by data.

    The uids are those of the originals, because evaluated data have others, or none. The address distinguishes several meshes of one
    object (instances of geometry nodes); it is valid as long as nothing changes.
    """
    if obj.original.type != "MESH" or len(obj.modifiers) > 0 or obj.mode == "EDIT":
        return (obj.original.session_uid, obj.data.as_pointer())
    return (obj.original.data.session_uid, 0)


def _read(obj, make):
    of_curve = obj.original.type != "MESH"
    # The evaluated mesh of an object in edit mode is a wrapper; of a curve it is the mesh itself.
    mesh = obj.data if of_curve else obj.to_mesh()
    try:
        mesh.calc_loop_triangles()
        count = len(mesh.loop_triangles)
        if count == 0:
            return None
        positions = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", positions)
        corners = np.empty(3 * count, dtype=np.int32)
        mesh.loop_triangles.foreach_get("vertices", corners)
        slots = np.empty(count, dtype=np.int32)
        mesh.loop_triangles.foreach_get("material_index", slots)
        is_smooth = _is_smooth(mesh)
        more = {"normals": _normals(mesh, count)} if is_smooth and drawn.SMOOTH_MESHES else {}
        made = make(
            positions.reshape(-1, 3), corners.reshape(-1, 3).view(np.uint32), np.maximum(slots, 0).view(np.uint32), **more
        )
        return Geometry(made, is_smooth)
    finally:
        if not of_curve:
            obj.to_mesh_clear()


def _normals(mesh, count):
    """(triangles, 3, 3): normals of the triangles' corners, sharp edges and custom normals heeded."""
    at_corners = np.empty(3 * len(mesh.loops), dtype=np.float32)
    mesh.corner_normals.foreach_get("vector", at_corners)
    corners = np.empty(3 * count, dtype=np.int32)
    mesh.loop_triangles.foreach_get("loops", corners)
    # What Blender could not tell is a normal that says nothing.
    return np.nan_to_num(at_corners).reshape(-1, 3)[corners].reshape(-1, 3, 3)


def _is_smooth(mesh):
    """Whether a normal at a corner is another than its polygon's: a smooth plane is flat all the same."""
    if mesh.normals_domain == "FACE":
        return False
    at_corners = np.empty(3 * len(mesh.loops), dtype=np.float32)
    mesh.corner_normals.foreach_get("vector", at_corners)
    of_polygons = np.empty(3 * len(mesh.polygons), dtype=np.float32)
    mesh.polygon_normals.foreach_get("vector", of_polygons)
    corners = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_total", corners)
    cosines = (at_corners.reshape(-1, 3) * np.repeat(of_polygons.reshape(-1, 3), corners, axis=0)).sum(axis=1)
    return bool(cosines.min() < LEAST_COSINE)
