"""Tests the coarse surface against the dense array: volume enclosed, bounds, labels that are shown."""

import numpy as np
import pumice
import pytest


def enclosed(surface):
    """Voxels that are enclosed, by the divergence theorem over the two triangles of each quad."""
    a, b, c, d = np.moveaxis(surface.vertices.astype(float)[surface.quads.astype(np.int64)], 1, 0)
    return ((a * np.cross(b, c)).sum() + (a * np.cross(c, d)).sum()) / 6.0


@pytest.fixture(scope="module")
def balls():
    """Two balls of 20 voxels' radius as an array (x, y, z), and its volume: label 3 at x = 30, label 9 at x = 90."""
    x, y, z = np.indices((120, 60, 60)) + 0.5
    labels = np.zeros((120, 60, 60), dtype=np.uint16)
    for label, middle in ((3, 30.0), (9, 90.0)):
        labels[(x - middle) ** 2 + (y - 30.0) ** 2 + (z - 30.0) ** 2 < 400.0] = label
    return labels, pumice.compress(labels)


def test_a_coarse_surface_encloses_the_voxels_that_are_shown(balls):
    labels, volume = balls
    for visible, ids in ((None, [3, 9]), ([False, True], [9])):
        surface = volume.coarse_surface(visible, most_faces=4000)
        assert 1500 < len(surface.quads) <= 4000 and len(surface.quads) == len(surface.labels)
        # Surfaces lie a fifth of a cell outside: with cells of 2 voxels a shell of 6 % of a ball of radius 20. A ball left out is half of all.
        assert surface.cell == (2, 2, 2) and 1.0 < enclosed(surface) / np.isin(labels, ids).sum() < 1.08
        x = surface.vertices[surface.quads.astype(np.int64), 0].mean(axis=1)
        assert (volume.labels.ids[surface.labels] == np.where(x < 60.0, 3, 9)).all()
        x, y, z = np.nonzero(np.isin(labels, ids))
        low, high = np.array([x.min(), y.min(), z.min()]), np.array([x.max(), y.max(), z.max()]) + 1
        assert np.abs(surface.vertices.min(axis=0) - low).max() < 1.0 and np.abs(surface.vertices.max(axis=0) - high).max() < 1.0


def test_nothing_shown_has_no_faces_and_bad_input_is_refused(balls):
    _, volume = balls
    nothing = volume.coarse_surface([False, False])
    assert nothing.vertices.shape == (0, 3) and nothing.quads.shape == (0, 4) and nothing.cell == (0, 0, 0)
    with pytest.raises(pumice.InputError, match="visible: expected 2 values, one a label, got 3"):
        volume.coarse_surface([True] * 3)
    with pytest.raises(pumice.InputError, match="most_faces"):
        volume.coarse_surface(most_faces=5)


def test_a_cancelled_surface_raises_cancelled(balls):
    _, volume = balls
    for call in (volume.coarse_surface, lambda job: pumice.surface(volume, job=job), lambda job: pumice.count_faces(volume, job=job)):
        job = pumice.Job()
        job.cancel()
        with pytest.raises(pumice.Cancelled):
            call(job=job)
