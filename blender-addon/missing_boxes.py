# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a volume cannot be drawn, because its file is missing or still being opened, its box is drawn in lines over the picture."""

import gpu
from gpu_extras.batch import batch_for_shader

COLOR = (1.0, 0.45, 0.1, 1.0)
# Pairs of corners that differ in one bit: x is bit 0, y bit 1, z bit 2.
EDGES = [(a, a | bit) for a in range(8) for bit in (1, 2, 4) if not a & bit]


def lines(dims, world_from_index, clip_from_world, size):
    """End points of the visible edges of a volume's box, in pairs, in pixels of a region of `size`. Matrices are lists of rows."""
    corners = []
    for corner in range(8):
        p = [float(dims[axis]) * (corner >> axis & 1) for axis in range(3)] + [1.0]
        p = _times(clip_from_world, _times(world_from_index, p))
        corners.append(p)
    ends = []
    for a, b in EDGES:
        cut = _in_front(corners[a], corners[b])
        if cut is not None:
            ends += [[(p[axis] / p[3] + 1.0) / 2.0 * size[axis] for axis in range(2)] for p in cut]
    return ends


def draw(ends):
    """Draws lines in pixels of the region."""
    if not ends:
        return
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINES", {"pos": [(x, y, 0.0) for x, y in ends]})
    shader.bind()
    shader.uniform_float("color", COLOR)
    batch.draw(shader)


def _times(matrix, p):
    return [sum(float(matrix[r][c]) * p[c] for c in range(4)) for r in range(4)]


def _in_front(a, b):
    """The part of an edge in front of the camera, in homogeneous coordinates; None if there is none."""
    least = 1e-6
    if a[3] < least and b[3] < least:
        return None
    if a[3] < least or b[3] < least:
        t = (least - a[3]) / (b[3] - a[3])
        cut = [x + t * (y - x) for x, y in zip(a, b)]
        return (cut, b) if a[3] < least else (a, cut)
    return a, b
