# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes triangles as a PLY file, to which scene files refer. Does not use Blender.

    header (text)   ply, format binary_little_endian 1.0, element vertex n: float x y z,
                    element face m: list uchar uint vertex_indices, uint material_index
    n times         3 floats, and 3 more (property float nx ny nz) where the mesh is smooth
    m times         1 byte (3), 3 numbers of 32 bits (corners), 1 number of 32 bits (material)

Blender's coordinates and normals are 32-bit floats, so nothing is rounded. The file has one normal per vertex: a corner of the mesh
that has several normals, beside a sharp edge, is written once for each.
"""

import os
from typing import NamedTuple

import numpy as np


class Arrays(NamedTuple):
    """The arrays of a mesh: corners (n, 3), triangles (m, 3) of corner indices, material index (m,) of each; if the mesh is smooth,
    normals (m, 3, 3) of the triangles' corners."""

    positions: np.ndarray
    triangles: np.ndarray
    materials: np.ndarray
    normals: np.ndarray | None = None


def write(path, arrays):
    """Writes the file, which appears complete or not at all."""
    corners, triangles = np.ascontiguousarray(arrays.positions, dtype="<f4"), arrays.triangles
    axes = "xyz"
    if arrays.normals is not None:
        axes = ("x", "y", "z", "nx", "ny", "nz")
        corners, triangles = _with_normals(corners, triangles, arrays.normals)
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("corners", "<u4", 3), ("material", "<u4")])
    faces["count"], faces["corners"], faces["material"] = 3, triangles, arrays.materials
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(corners)}"]
    header += [f"property float {axis}" for axis in axes]
    header += [f"element face {len(faces)}", "property list uchar uint vertex_indices", "property uint material_index"]
    partial = f"{path}.partial"
    with open(partial, "wb") as file:
        file.write("\n".join([*header, "end_header", ""]).encode("ascii"))
        file.write(corners.tobytes())
        file.write(faces.tobytes())
    os.replace(partial, path)


def _with_normals(corners, triangles, normals):
    """(corners with their normals, (n, 6); triangles that name them): each pair of both once."""
    named = np.ascontiguousarray(triangles, dtype=np.uint32).ravel()
    rows = np.hstack([corners[named], np.asarray(normals, dtype="<f4").reshape(-1, 3)])
    # By the corner's number, not its place: corners may lie on each other.
    keys = np.column_stack([named, np.ascontiguousarray(rows[:, 3:]).view(np.uint32)])
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return np.ascontiguousarray(rows[first]), number.reshape(-1, 3)
