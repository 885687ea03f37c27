"""Tests the exact surface against faces that numpy finds in the dense array."""

import numpy as np
import pumice
import pytest


def expected(labels, shown, interfaces):
    """Rows (label, middle of the face in half voxels, outward normal) of all faces, sorted."""
    kept = np.pad(np.where(np.isin(labels, list(shown)), labels.astype(np.int64), 0), 1)
    rows = []
    for axis in range(3):
        for step in (-1, 1):
            beyond = np.roll(kept, -step, axis)
            at = (kept != 0) & ((beyond == 0) if interfaces == "outside" else (beyond != kept))
            normal = np.zeros(3, dtype=np.int64)
            normal[axis] = step
            place = np.argwhere(at)
            rows.append(np.column_stack([kept[at], 2 * (place - 1) + 1 + normal, np.broadcast_to(normal, place.shape)]))
    return in_order(np.concatenate(rows))


def got(volume, faces):
    corners = faces.vertices[faces.quads.astype(np.int64)].astype(np.int64)
    middle = (corners[:, 0] + corners[:, 2]).astype(np.int64)
    assert np.array_equal(middle, corners[:, 1] + corners[:, 3])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1])
    return in_order(np.column_stack([volume.labels.ids[faces.labels].astype(np.int64), middle, normal]))


def in_order(rows):
    return rows[np.lexsort(rows.T[::-1])]


@pytest.mark.parametrize("interfaces", ["outside", "all"])
@pytest.mark.parametrize("shared_corners", [False, True])
def test_faces_are_those_of_the_array(volume, labels, interfaces, shared_corners):
    ids = volume.labels.ids.tolist()
    for shown in (ids, ids[::3], []):
        faces = volume.faces(shown, interfaces=interfaces, shared_corners=shared_corners)
        np.testing.assert_array_equal(got(volume, faces), expected(labels, shown, interfaces))
        assert faces.vertices.dtype == np.int32 and faces.quads.dtype == faces.labels.dtype == np.uint32
        if shared_corners:
            assert len(np.unique(faces.vertices, axis=0)) == len(faces.vertices)
        else:
            assert len(faces.vertices) == 4 * len(faces.quads)
    whole = volume.faces(interfaces=interfaces, shared_corners=shared_corners)
    np.testing.assert_array_equal(got(volume, whole), expected(labels, ids, interfaces))


def test_a_voxel_too_few_is_noticed(volume, labels):
    # Negative control: faces of an array that lacks one voxel differ.
    lacking = labels.copy()
    lacking[tuple(np.argwhere(labels > 0)[1000])] = 0
    rows, wrong = got(volume, volume.faces()), expected(lacking, volume.labels.ids.tolist(), "outside")
    assert rows.shape != wrong.shape or (rows != wrong).any()


def test_real_volumes(ct):
    dense = ct.decode()
    np.testing.assert_array_equal(got(ct, ct.faces()), expected(dense, ct.labels.ids.tolist(), "outside"))


def test_what_cannot_be_is_refused(volume):
    with pytest.raises(pumice.InputError, match="^interfaces: expected outside or all, got 'both'$"):
        volume.faces(interfaces="both")
    with pytest.raises(pumice.InputError, match="^the volume has no label 12345678$"):
        volume.faces([12345678])
    job = pumice.Job()
    job.cancel()
    with pytest.raises(pumice.Cancelled):
        volume.faces(job=job)


def test_a_surface_is_made_of_those_faces(volume, labels):
    ids = volume.labels.ids.tolist()
    for shown in (None, ids[::3], []):
        surface = pumice.surface(volume, shown)
        whole = ids if shown is None else shown
        np.testing.assert_array_equal(got(volume, surface), expected(labels, whole, "outside"))
        assert pumice.count_faces(volume, shown) == len(surface.quads)
    shared = pumice.surface(volume, shared_corners=True)
    assert len(np.unique(shared.vertices, axis=0)) == len(shared.vertices)
    np.testing.assert_array_equal(got(volume, shared), got(volume, pumice.surface(volume)))


def test_merged_rectangles_cover_the_same(volume):
    plain, merged = pumice.surface(volume), pumice.surface(volume, merged=True)
    assert pumice.count_faces(volume, merged=True) == len(merged.quads) < len(plain.quads) / 1.5

    def area(surface):
        corners = surface.vertices[surface.quads.astype(np.int64)].astype(np.int64)
        sides = np.abs(np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])).sum(axis=1)
        return np.bincount(surface.labels, sides, len(volume.labels))

    np.testing.assert_array_equal(area(merged), area(plain))


def test_coarser_surfaces_and_limits(volume):
    counts = [pumice.count_faces(volume, lod=lod) for lod in (1, 4, 16)]
    assert counts[0] > 3 * counts[1] and counts[1] >= counts[2] > 0
    assert pumice.count_faces(volume, limit=counts[0]) == counts[0]
    with pytest.raises(pumice.InputError, match="faces of the surface, counted so far"):
        pumice.count_faces(volume, limit=counts[0] - 1)
    with pytest.raises(pumice.InputError, match="lod: expected 1, 4 or 16, got 2"):
        pumice.surface(volume, lod=2)
