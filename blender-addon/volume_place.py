# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The place of a volume: the affine map from voxels to the scene, read from what Blender has done to the object and to its mesh.

    scene ◄── matrix_world ── object's space ◄── object_from_index ── voxels
              what moves the object              what moved the vertices: Apply Transform, Set Origin, transforms in edit mode

Each vertex of the proxy has its place in voxels as the attribute `pumice_index`, which equals its position when the proxy is made. Blender's
operators move vertices and leave attributes alone, so the map that takes one to the other is what has been applied. It is found by least
squares over all vertices, in double precision, and any proxy with three vertices out of line and a fourth out of their plane has it. Undo,
copies, links and files carry it along, because it is nothing but the mesh.

An edit that is no affine map (a vertex that was dragged, an object that was joined) leaves some vertices off: `Fit.off_voxels` says how far.
Whoever gives a proxy another shape sets its vertices in voxels, calls `mark`, and then `move` with the `fit` of the shape before.
"""

from typing import NamedTuple

import bmesh
import numpy as np
from mathutils import Matrix

from .reports import Refused

ATTRIBUTE = "pumice_index"
# Custom property of a mesh that has, or had, the attribute: remeshing takes the attribute and leaves this.
MARKED = "pumice_marked"
# Vertices may be this far off, in voxels, before the mesh counts as edited. Single precision puts those of a volume of 10,000 voxels off by
# 0.001 with each Apply, while an edit that anybody sees is a good part of a voxel.
MOST_OFF_VOXELS = 0.1
# A proxy whose vertices span less than this of its size in some direction does not tell the map.
LEAST_SPAN = 1e-6
LOST = f"its mesh lost the vertices or the attribute {ATTRIBUTE} that tell its place; undo that, or Reload"
# A map that shrinks one direction so much against another is one to a plane: what is left are roundings of single precision.
FLAT = 1e-6
# By the mesh's session_uid: its columns, and what was found of them. Reading and comparing 25,000 vertices takes a millisecond, solving 20.
_fits = {}
MOST_FITS = 16


class Fit(NamedTuple):
    """The map from voxels to the object's space, (4, 4) float64, and the largest distance of a vertex from it, in voxels."""

    object_from_index: np.ndarray
    off_voxels: float


def mark(mesh):
    """Notes the vertices' present positions as their places in voxels."""
    attribute = mesh.attributes.get(ATTRIBUTE) or mesh.attributes.new(ATTRIBUTE, "FLOAT_VECTOR", "POINT")
    attribute.data.foreach_set("vector", _positions(mesh))
    mesh[MARKED] = True


def fit(mesh):
    """What was applied to a proxy's vertices; None where too few are left to tell, or the attribute was removed. A mesh of an earlier
    version, which never had it, has its vertices in voxels."""
    if ATTRIBUTE not in mesh.attributes:
        return None if mesh.get(MARKED) else Fit(np.eye(4), 0.0)
    index, positions = _columns(mesh)
    if len(index) and np.array_equal(index, positions):
        return Fit(np.eye(4), 0.0)
    kept = _fits.get(mesh.session_uid)
    if kept is None or not (np.array_equal(kept[0], index) and np.array_equal(kept[1], positions)):
        while len(_fits) >= MOST_FITS:
            _fits.pop(next(iter(_fits), None), None)  # a render reads in a thread of its own
        kept = _fits[mesh.session_uid] = (index, positions, _of(index.reshape(-1, 3).astype(float), positions.reshape(-1, 3).astype(float)))
    return kept[2]


def world_from_index(obj, world_from_object=None):
    """The map from voxels to the scene of a volume object, (4, 4) float64; None where its mesh does not tell. `world_from_object` replaces
    the object's own matrix, for an instance of it."""
    found = fit(obj.original.data)
    world = np.array(obj.matrix_world if world_from_object is None else world_from_object, dtype=float)
    return None if found is None else world @ found.object_from_index


def known(obj):
    """The map from voxels to the scene of a volume object, as a matrix of Blender's. Raises Refused where its mesh does not tell."""
    found = world_from_index(obj)
    if found is None:
        raise Refused(f"{obj.name}: {LOST}")
    return Matrix(found.tolist())


def read(obj, world_from_object):
    """(map from voxels to the scene or None, what of the object's shape is not drawn) of a volume object."""
    original = obj.original
    found, name = fit(original.data), obj.name
    if found is None:
        return None, [f"{name}: {LOST}, so it is not drawn"]
    lines = []
    if found.off_voxels > MOST_OFF_VOXELS:
        lines.append(f"{name}: vertices of its mesh were moved by up to {found.off_voxels:.3g} voxels; the volume is drawn as it was")
    if any(modifier.show_render for modifier in original.modifiers) or original.data.shape_keys is not None:
        lines.append(f"{name}: modifiers and shape keys do not change a volume")
    return np.array(world_from_object, dtype=float) @ found.object_from_index, lines


def move(mesh, object_from_index):
    """Moves the vertices of a mesh from voxels to the object's space. A mirroring map turns its faces over, so that they stay outside."""
    object_from_index = np.asarray(object_from_index, dtype=float)
    if np.array_equal(object_from_index, np.eye(4)):
        return
    mesh.transform(Matrix(object_from_index.tolist()))
    if np.linalg.det(object_from_index[:3, :3]) < 0.0:
        mesh.flip_normals()


def _of(index, positions):
    """The map from places in voxels to positions, both (n, 3) float64; None where these lie in a plane."""
    if len(index) < 4:
        return None
    middle, target = index.mean(axis=0), positions.mean(axis=0)
    x, y = index - middle, positions - target
    spread = x.T @ x
    lengths = np.linalg.eigvalsh(spread)
    if lengths[0] <= LEAST_SPAN**2 * lengths[2]:
        return None
    axes, scales, from_axes = np.linalg.svd(np.linalg.solve(spread, x.T @ y).T)
    scales[scales < FLAT * scales[0]] = 0.0
    linear = axes * scales @ from_axes
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = linear, target - linear @ middle
    # In voxels, along the directions in which the map is not flat: a mesh that is scaled to nothing is no edit.
    off = (y - x @ linear.T) @ np.linalg.pinv(linear, rcond=FLAT).T
    return Fit(found, float(np.sqrt((off**2).sum(axis=1).max())))


def _columns(mesh):
    """(places in voxels, positions) of all vertices, flat float32. In edit mode the edited mesh counts, which has no columns."""
    if mesh.is_editmode:
        edited = bmesh.from_edit_mesh(mesh)
        layer = edited.verts.layers.float_vector[ATTRIBUTE]
        rows = [(*vertex[layer], *vertex.co) for vertex in edited.verts]
        both = np.array(rows, dtype=np.float32).reshape(-1, 6)
        return both[:, :3].ravel(), both[:, 3:].ravel()
    index = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.attributes[ATTRIBUTE].data.foreach_get("vector", index)
    return index, _positions(mesh)


def _positions(mesh):
    positions = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    # As an attribute they are copied whole; `co` of the vertices is read one by one, in 80 times as long.
    mesh.attributes["position"].data.foreach_get("vector", positions)
    return positions
