"""The surface of a volume at a level of detail, as arrays, and how many faces it has."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from . import _native, arguments
from ._native import Job
from .checked import checked
from .volume import Faces, Volume, visible_rows


@checked
def surface(
    volume: Volume,
    labels: Iterable[int] | None = None,
    *,
    lod: int = 1,
    merged: bool = False,
    shared_corners: bool = False,
    job: Job | None = None,
) -> Faces:
    """The surface of the `labels` of a `volume` with these ids (all labels if omitted) as `Faces`, normals outward.

    `lod`: 1 (every voxel), 4 (cells of 4³ voxels) or 16 (boxes). `merged` makes rectangles of neighbouring faces of one label in one plane:
    a half to a quarter of the faces and the same shape, but edges may end within those of others, where a renderer's rounding can let a
    single ray through. `shared_corners` gives one vertex per position instead of four per quad. Costs 68 bytes per quad; with shared
    corners 36, and some 30 more during the search for them.
    """
    vertices, quads, rows = _native.surface(
        volume._native,
        visible_rows(volume, labels),
        lod=arguments.whole("lod", lod, 1, 16),
        merged=merged,
        shared_corners=shared_corners,
        job=job,
    )
    return Faces(np.asarray(vertices), np.asarray(quads), np.asarray(rows))


@checked
def count_faces(
    volume: Volume,
    labels: Iterable[int] | None = None,
    *,
    lod: int = 1,
    merged: bool = False,
    limit: int | None = None,
    job: Job | None = None,
) -> int:
    """Number of faces that `surface` gives, without the memory for them. InputError as soon as there are more than `limit`. `volume`, `labels`,
    `lod` and `merged`: as for `surface`."""
    return _native.count_faces(
        volume._native,
        visible_rows(volume, labels),
        lod=arguments.whole("lod", lod, 1, 16),
        merged=merged,
        limit=arguments.MOST_64 if limit is None else arguments.whole("limit", limit, 0, arguments.MOST_64),
        job=job,
    )
