# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The proxy, a coarse shape that represents a volume in Solid mode: flat faces around the non-empty cells. Does not use Blender.

Boxes of the compressed form are entered into a grid of cells (16 voxels per side, or a multiple); there is a face wherever a non-empty
cell meets an empty one. The cell size doubles until there are few enough faces: neighbours merge, and faces inside vanish. A face
takes the label whose boxes fill most of its cell's volume.
"""

from typing import NamedTuple

import numpy as np

MAX_FACES = 20_000
# 8 bytes per cell, three grids: about 100 MB at most while it is built.
MAX_CELLS = 4_000_000
FINEST_CELL_VOXELS = 16

# Corners of a face by axis and side, counter-clockwise seen from outside.
_CORNERS = {
    (0, 0): ((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)),
    (0, 1): ((1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)),
    (1, 0): ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)),
    (1, 1): ((0, 1, 0), (0, 1, 1), (1, 1, 1), (1, 1, 0)),
    (2, 0): ((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0)),
    (2, 1): ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
}


class Proxy(NamedTuple):
    """A mesh in voxel units: vertices (n, 3), quads (m, 4) of vertex indices, dense label (m,) of each quad."""

    vertices: np.ndarray
    quads: np.ndarray
    labels: np.ndarray


def build(dims, origins, extents, labels, max_faces=MAX_FACES):
    """The proxy of boxes; without any, the volume's own box."""
    dims = np.asarray(dims, dtype=np.int64)
    origins = np.asarray(origins, dtype=np.int64).reshape(-1, 3)
    extents = np.asarray(extents, dtype=np.int64).reshape(-1, 3)
    labels = np.asarray(labels, dtype=np.int64)
    if len(origins) == 0:
        return _faces(np.zeros((1, 1, 1), dtype=np.int64), np.maximum(dims, 1), np.maximum(dims, 1))
    cell = FINEST_CELL_VOXELS
    while np.prod(-(-dims // cell), dtype=float) > MAX_CELLS:
        cell *= 2
    while True:
        proxy = _faces(_grid(dims, origins, extents, labels, cell), np.array([cell] * 3), dims)
        if len(proxy.quads) <= max_faces or (dims <= cell).all():
            return proxy
        cell *= 2


def _grid(dims, origins, extents, labels, cell):
    """Label of each cell, −1 where it is empty."""
    shape = -(-dims // cell)
    grid = np.full(shape, -1, dtype=np.int64)
    # Every cell that a box touches: a box is at most 16 voxels wide, a cell at least that, so it touches at most two along an axis.
    low, high = origins // cell, np.minimum((origins + extents - 1) // cell, shape - 1)
    rank = np.argsort(np.prod(extents, axis=1), kind="stable")  # the largest box is written last and stays
    for corner in np.ndindex(2, 2, 2):
        at = np.where(np.array(corner, dtype=bool), high, low)[rank]
        grid[at[:, 0], at[:, 1], at[:, 2]] = labels[rank]
    return grid


def _faces(grid, cell, dims):
    full = np.pad(grid >= 0, 1)
    inside = full[1:-1, 1:-1, 1:-1]
    corners, owners = [], []
    for (axis, side), offsets in _CORNERS.items():
        window = [slice(1, -1)] * 3
        window[axis] = slice(2, None) if side else slice(0, -2)
        at = np.argwhere(inside & ~full[tuple(window)])
        corners.append(at[:, None, :] + np.array(offsets)[None])
        owners.append(grid[at[:, 0], at[:, 1], at[:, 2]])
    corners = np.concatenate(corners)
    size = np.array(grid.shape) + 1
    flat = np.ravel_multi_index(corners.reshape(-1, 3).T, size)
    unique, quads = np.unique(flat, return_inverse=True)
    vertices = np.stack(np.unravel_index(unique, size), axis=1) * cell
    vertices = np.minimum(vertices, dims).astype(np.float32)
    return Proxy(vertices, quads.reshape(-1, 4).astype(np.int32), np.concatenate(owners))
