# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the proxy mesh of a volume: it encloses every voxel, is closed, flat and small enough. Neither it nor this test needs Blender."""

import numpy as np
import pytest


@pytest.fixture
def proxy(extension):
    import importlib

    return importlib.import_module(f"{extension.__name__}.proxy")


def boxes(random, dims, count):
    origins = (random.integers(0, np.array(dims) - 16, (count, 3)) // 4) * 4
    extents = random.integers(1, 17, (count, 3))
    return origins, extents, random.integers(0, 7, count)


def inside(shape, point):
    """Whether a point is inside a closed surface of axis-parallel quads: a ray along x crosses the surface an odd number of times."""
    corners = shape.vertices[shape.quads]
    low, high = corners.min(axis=1), corners.max(axis=1)
    across = low[:, 0] == high[:, 0]
    ahead = across & (low[:, 0] > point[0])
    hit = ahead & ((low[:, 1:] < point[1:]) & (point[1:] < high[:, 1:])).all(axis=1)
    return hit.sum() % 2 == 1


@pytest.mark.parametrize("max_faces", [20_000, 400, 30])
def test_every_box_is_enclosed(proxy, max_faces):
    random = np.random.default_rng(5)
    dims = (200, 150, 300)
    origins, extents, labels = boxes(random, dims, 80)
    shape = proxy.build(dims, origins, extents, labels, max_faces)
    assert 6 <= len(shape.quads) <= max_faces
    assert (shape.vertices >= 0).all() and (shape.vertices <= dims).all()
    for origin, extent in zip(origins, extents):
        # Points off the planes of the grid, on which "inside" is undefined.
        for point in (origin + 0.3, origin + extent - 0.3, origin + extent * 0.47):
            if (point < dims).all():
                assert inside(shape, point)


def test_every_edge_is_between_two_faces_and_faces_look_outwards(proxy):
    random = np.random.default_rng(6)
    dims = (160, 160, 160)
    shape = proxy.build(dims, *boxes(random, dims, 40))
    edges = np.concatenate([shape.quads[:, [i, (i + 1) % 4]] for i in range(4)])
    forth, counts = np.unique(edges, axis=0, return_counts=True)
    back = np.unique(edges[:, ::-1], axis=0)
    assert (forth == back).all(), "each edge occurs once in each direction"
    # For a closed surface that faces outward, the divergence theorem gives the volume of the cells.
    corners = shape.vertices[shape.quads].astype(float)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
    volume = (corners.mean(axis=1) * normal).sum() / 3.0
    cells = volume / 16.0**3
    assert cells == pytest.approx(round(cells)) and 0 < cells <= 1000


def test_a_volume_without_voxels_gets_its_own_box(proxy):
    none = np.zeros((0, 3), dtype=np.int32)
    shape = proxy.build((30, 20, 10), none, none, np.zeros(0, dtype=np.uint32))
    assert len(shape.quads) == 6 and shape.vertices.max(axis=0).tolist() == [30.0, 20.0, 10.0]


def test_one_box_is_a_cell_of_its_label(proxy):
    shape = proxy.build((64, 64, 64), [[16, 32, 0]], [[16, 16, 16]], [5])
    assert len(shape.quads) == 6 and set(shape.labels) == {5}
    assert shape.vertices.min(axis=0).tolist() == [16.0, 32.0, 0.0]
    assert shape.vertices.max(axis=0).tolist() == [32.0, 48.0, 16.0]
