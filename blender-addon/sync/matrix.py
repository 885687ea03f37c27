# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Converts matrices between Blender (rows of four) and the scene (twelve numbers: x column, y column, z column, translation).

They are plain lists of rows in double precision: Blender's own are in single precision, too little to invert a window matrix.
"""

# Largest cosine between two axes that the scene takes for a right angle.
MOST_SHEAR = 1e-4


def rows(matrix):
    """A copy as four lists of four floats; takes whatever is indexed [row][column]."""
    return [[float(matrix[r][c]) for c in range(4)] for r in range(4)]


def twelve(matrix):
    """The scene's form of an affine matrix."""
    return [float(matrix[r][c]) for c in range(4) for r in range(3)]


def from_twelve(numbers):
    """The inverse of `twelve`."""
    columns = [numbers[3 * c : 3 * c + 3] for c in range(4)]
    return [[columns[c][r] for c in range(4)] for r in range(3)] + [[0.0, 0.0, 0.0, 1.0]]


def times(a, b):
    """The product a · b."""
    return [[sum(a[r][k] * b[k][c] for k in range(4)) for c in range(4)] for r in range(4)]


def inverse_rigid(matrix):
    """The inverse of a matrix whose axes are orthonormal, as Blender's view matrices are: transpose and turn the translation."""
    turned = [[matrix[c][r] for c in range(3)] for r in range(3)]
    moved = [-sum(turned[r][k] * matrix[k][3] for k in range(3)) for r in range(3)]
    return [turned[r] + [moved[r]] for r in range(3)] + [[0.0, 0.0, 0.0, 1.0]]


def unit_axes(matrix, only=None):
    """The same place and directions without scale: what Blender makes of a camera's matrix. `only` names one axis to take."""
    out = rows(matrix)
    for c in range(3) if only is None else (only,):
        length = sum(out[r][c] ** 2 for r in range(3)) ** 0.5
        for r in range(3):
            out[r][c] = out[r][c] / length if length > 0.0 else float(r == c)
    return out


def without_shear(matrix):
    """(the matrix with its axes at right angles, whether they were not): z and all lengths stay, x turns least, y turns with it."""
    out = rows(matrix)
    x, y, z = ([out[r][c] for r in range(3)] for c in range(3))
    lengths = [_dot(a, a) ** 0.5 for a in (x, y, z)]
    x, y, z = ([v / length for v in a] for a, length in zip((x, y, z), lengths))
    if max(abs(_dot(x, y)), abs(_dot(y, z)), abs(_dot(z, x))) <= MOST_SHEAR:
        return out, False
    across = [a - _dot(x, z) * b for a, b in zip(x, z)]
    length = _dot(across, across) ** 0.5
    across = [a / length for a in across]
    along = [z[(r + 1) % 3] * across[(r + 2) % 3] - z[(r + 2) % 3] * across[(r + 1) % 3] for r in range(3)]
    if _dot(along, y) < 0.0:
        along = [-a for a in along]
    for r in range(3):
        out[r][0], out[r][1] = lengths[0] * across[r], lengths[1] * along[r]
    return out, True


def _dot(a, b):
    return sum(s * t for s, t in zip(a, b))


def is_invertible(matrix):
    """Whether the axes do not lie in a plane, as the scene asks it: of unit length they span more than 1e-12, and none is 0."""
    lengths = [sum(float(matrix[r][c]) ** 2 for r in range(3)) ** 0.5 for c in range(3)]
    if min(lengths) <= 1e-30:
        return False
    (a, b, c), (d, e, f), (g, h, i) = ([matrix[r][k] / lengths[k] for k in range(3)] for r in range(3))
    return abs(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)) > 1e-12


def moved_back(matrix, distance):
    """The matrix with its origin moved along its own +z."""
    out = rows(matrix)
    for r in range(3):
        out[r][3] += distance * out[r][2]
    return out
