# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles as a PLY file, which scene files name. Knows no Blender.

    header (text)   ply, format binary_little_endian 1.0, element vertex n: float x y z,
                    element face m: list uchar uint vertex_indices, uint material_index
    n times         3 floats
    m times         1 byte (3), 3 numbers of 32 bits (corners), 1 number of 32 bits (material)

Blender's coordinates are floats of 32 bits, so nothing is rounded.
"""

import os
from typing import NamedTuple

import numpy as np


class Arrays(NamedTuple):
    """What a mesh is made of: corners (n, 3), triangles (m, 3) that name them, material index (m,) of each."""

    positions: np.ndarray
    triangles: np.ndarray
    materials: np.ndarray


def write(path, arrays):
    """Writes the file, whole or not at all."""
    corners = np.ascontiguousarray(arrays.positions, dtype="<f4")
    faces = np.empty(len(arrays.triangles), dtype=[("count", "u1"), ("corners", "<u4", 3), ("material", "<u4")])
    faces["count"], faces["corners"], faces["material"] = 3, arrays.triangles, arrays.materials
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(corners)}"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += [f"element face {len(faces)}", "property list uchar uint vertex_indices", "property uint material_index"]
    partial = f"{path}.partial"
    with open(partial, "wb") as file:
        file.write("\n".join([*header, "end_header", ""]).encode("ascii"))
        file.write(corners.tobytes())
        file.write(faces.tobytes())
    os.replace(partial, path)
