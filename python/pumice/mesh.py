"""Triangle meshes that stand beside volumes: a floor, a scale bar, a mould."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np
import numpy.typing as npt

from . import _native, arguments
from .arguments import Path
from .checked import checked
from .errors import InputError


class Mesh:
    """An immutable triangle mesh in a space of its own, which scenes and threads may share. The scene holds its place and its materials
    (`meshes` in docs/scene.md)."""

    @checked
    def __init__(
        self,
        positions: npt.ArrayLike,
        triangles: npt.ArrayLike,
        materials: npt.ArrayLike | None = None,
        *,
        normals: npt.ArrayLike | None = None,
    ) -> None:
        """`positions` (n, 3) are corners; `triangles` (m, 3) have three corner indices each, counter-clockwise seen from outside;
        `materials` (m,) are indices into the list of materials that the scene has for this mesh, all 0 if omitted. Arrays are copied.

        `normals` make the mesh smooth: (n, 3), one per corner, or (m, 3, 3), one for each corner of each triangle, so that edges may be
        sharp. They point to the outer side and may have any length. A triangle with a zero normal keeps its own. Without normals the mesh
        is flat."""
        corners = _array("positions", positions, np.float64, 2)
        faces = _array("triangles", triangles, np.uint32, 2)
        chosen = _array("materials", () if materials is None else materials, np.uint32, 1)
        directions, of_triangles = None, False
        if normals is not None:
            of_triangles = np.ndim(normals) == 3
            directions = _array("normals", normals, np.float32, 3 if of_triangles else 2)
        self._native = _native.Mesh(corners, faces, chosen, directions, of_triangles)

    @classmethod
    @checked
    def open(cls, path: Path) -> Self:
        """Reads a PLY file, text or binary, as a scene reads the `source` of a mesh. Polygons become triangles, normals of vertices make
        the mesh smooth, and a whole number `material_index` of a face is the index of its material. InputError says in one line what is wrong
        with the file."""
        mesh = cls.__new__(cls)
        mesh._native = _native.Mesh.open(arguments.path("path", path))
        return mesh

    @checked
    def save(self, path: Path) -> None:
        """Writes a PLY file, which appears complete or not at all, and to which a scene's `meshes` may refer. Read again, it is the same mesh
        with the same `content_hash`, unless triangles have different normals at one corner: each triangle has corners of its own then."""
        self._native.save(arguments.path("path", path))

    def __repr__(self) -> str:
        corners, triangles, bytes_resident = self._native.counts()
        return f"<pumice.Mesh {corners} corners, {triangles} triangles, {bytes_resident} bytes>"

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return self._native.counts()[1]

    @property
    def is_smooth(self) -> bool:
        """Whether some triangle is shaded smooth; normals that equal those of the triangles do not count."""
        return self._native.is_smooth()

    @property
    def bytes_resident(self) -> int:
        """Bytes of its numbers in memory, without what a renderer builds over them."""
        return self._native.counts()[2]

    @property
    def content_hash(self) -> str:
        """Hash of all its numbers, 32 hexadecimal digits. Materials that were omitted count as the zeros that they stand for."""
        return self._native.content_hash()


def natives(meshes: Sequence[Mesh]) -> list[_native.Mesh]:
    """The meshes as the compiled part takes them."""
    return [mesh._native for mesh in meshes]


def _array(name: str, values: npt.ArrayLike, dtype: type, axes: int) -> npt.NDArray[np.generic]:
    """Values as a C-ordered array of a type that holds each of them exactly."""
    try:
        given = np.asarray(values)
        empty = given.size == 0
        if not empty and dtype is np.uint32 and (given.dtype.kind not in "ui" or given.min() < 0 or given.max() > 2**32 - 1):
            raise InputError(f"mesh: {name}: expected whole numbers from 0 to 4294967295")
        array: npt.NDArray[np.generic] = np.ascontiguousarray(given, dtype=dtype)
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"mesh: {name}: {error}") from None
    if empty:
        return np.zeros((0, *[3] * (axes - 1)), dtype=dtype)
    if array.ndim != axes or array.shape[1:] != (3,) * (axes - 1):
        wanted = ["(n,)", "(n, 3)", "(n, 3, 3)"][axes - 1]
        raise InputError(f"mesh: {name}: expected an array of shape {wanted}, got {array.shape}")
    return array
