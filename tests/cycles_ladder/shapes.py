"""Triangle meshes for rungs that have one beside the volume."""

from typing import NamedTuple

import numpy as np


class Shape(NamedTuple):
    """A mesh: corners, triangles as indices of three corners, a material index per triangle, and normals per corner if it is smooth."""

    corners: np.ndarray
    triangles: np.ndarray
    materials: np.ndarray
    normals: np.ndarray | None = None

    def flat(self):
        """The same mesh with flat shading."""
        return self._replace(normals=None)

    def made(self):
        """The mesh as a `pumice.Mesh`."""
        import pumice

        return pumice.Mesh(self.corners, self.triangles, self.materials, normals=self.normals)

    def ply(self):
        """The mesh as the text of a PLY file."""
        smooth = self.normals is not None
        names = [*"xyz", *(["nx", "ny", "nz"] if smooth else [])]
        rows = np.hstack([self.corners, self.normals]) if smooth else self.corners
        header = ["ply", "format ascii 1.0", f"element vertex {len(rows)}", *(f"property double {name}" for name in names)]
        header += [f"element face {len(self.triangles)}", "property list uchar int vertex_indices"]
        header += ["property int material_index", "end_header"]
        vertices = (" ".join(map(repr, row.tolist())) for row in rows)
        faces = (" ".join(map(str, [3, *t, m])) for t, m in zip(self.triangles.tolist(), self.materials, strict=True))
        return "\n".join([*header, *vertices, *faces, ""])


def square():
    """A square of two triangles, counter-clockwise from above."""
    corners = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    return Shape(corners, np.array([[0, 1, 2], [0, 2, 3]]), np.zeros(2, dtype=int))


def ball(times):
    """A ball of radius 1: an icosahedron whose triangles are split into four `times` times. Normals are those of the sphere. Triangles of
    the left half have the first material, those of the right half the second."""
    golden = 0.5 * (1 + 5**0.5)
    corners = [np.roll([0, a, b * golden], turn) for turn in range(3) for a in (-1, 1) for b in (-1, 1)]
    corners = [c / np.linalg.norm(c) for c in corners]
    least = min(np.linalg.norm(a - corners[0]) for a in corners[1:])
    near = [[np.linalg.norm(a - b) < 1.01 * least for b in corners] for a in corners]
    triangles = [
        (i, j, k) for i in range(12) for j in range(i + 1, 12) for k in range(j + 1, 12) if near[i][j] and near[j][k] and near[i][k]
    ]
    # Orients triangles counter-clockwise from outside.
    triangles = [t if np.linalg.det([corners[i] for i in t]) > 0 else t[::-1] for t in triangles]
    for _ in range(times):
        middles = {}

        def middle(a, b, middles=middles):
            key = (min(a, b), max(a, b))
            if key not in middles:
                point = corners[a] + corners[b]
                corners.append(point / np.linalg.norm(point))
                middles[key] = len(corners) - 1
            return middles[key]

        cut = []
        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            cut += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = cut
    places, triangles = np.array(corners), np.array(triangles)
    right = places[triangles].mean(axis=1)[:, 0] > 0
    return Shape(places, triangles, right.astype(int), places.copy())
