"""Tests colours that are as far as possible from given ones, by CIELAB of scikit-image and vision deficiencies written down here again."""

import numpy as np
import pytest
from skimage.color import xyz2lab

import pumice

# Machado, Oliveira, Fernandes 2009, table 1, severity 1.0: protanomaly and deuteranomaly, on linear Rec. 709.
DEFICIENT = (
    np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]),
    np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]),
)
XYZ = np.array([[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]])


def apart(a, b, is_safe=True):
    """ΔE of linear colours (n, 3) and (m, 3) as (n, m): for normal eyes, or the least over three kinds."""
    out = []
    for vision in (np.eye(3), *DEFICIENT)[: 3 if is_safe else 1]:
        p, q = (xyz2lab((np.asarray(c, dtype=float) @ vision.T).clip(0.0, 1.0) @ XYZ.T) for c in (a, b))
        out.append(np.linalg.norm(p[:, None] - q[None], axis=2))
    return np.min(out, axis=0)


@pytest.fixture
def volume():
    """Random blocks of 4³ voxels in 60 labels, so that a label touches many."""
    blocks = np.random.default_rng(3).integers(1, 61, (8, 8, 8))
    return pumice.compress(blocks.repeat(4, 0).repeat(4, 1).repeat(4, 2).astype(np.uint16))


def test_a_new_label_has_the_colour_of_the_palette_farthest_from_its_neighbours(volume):
    palette = np.unique(pumice.compress(np.arange(1, 513, dtype=np.uint16).reshape(8, 8, 8)).labels.auto_colors(), axis=0)
    assert len(palette) == 36
    known = np.random.default_rng(4).random((len(volume.labels), 3)).astype(np.float32)
    new = 17
    known[new] = np.nan
    colors = volume.labels.auto_colors(known=known)
    kept = np.delete(np.arange(len(known)), new)
    assert np.array_equal(colors[kept], known[kept])
    pairs = volume.contacts
    neighbors = np.unique(pairs[(pairs == new).any(axis=1)])
    neighbors = neighbors[neighbors != new]
    assert len(neighbors) > 20
    nearest = apart(palette, known[neighbors]).min(axis=1)
    mine = apart(colors[new : new + 1], known[neighbors]).min()
    # The constants of sRGB have four digits there and six here: a ΔE of 0.05 at most.
    assert mine >= nearest.max() - 0.05
    # Negative control: most colours of the palette are nearer.
    assert (nearest < mine - 1.0).mean() > 0.5


def test_labels_that_are_all_new_differ_from_their_neighbours():
    blocks = np.arange(1, 217, dtype=np.uint16).reshape(6, 6, 6).repeat(4, 0).repeat(4, 1).repeat(4, 2)
    volume = pumice.compress(blocks)
    colors = volume.labels.auto_colors(known=np.full((216, 3), np.nan))
    a, b = volume.contacts.T
    assert apart(colors, colors)[a, b].min() > 10.0


def test_known_colours_must_be_one_a_label(volume):
    with pytest.raises(pumice.InputError, match=r"known: expected an array \(60, 3\), got \(3, 60\)"):
        volume.labels.auto_colors(known=np.zeros((3, 60)))


@pytest.mark.parametrize("is_safe,least", [(False, {12: 40.0, 256: 5.0}), (True, {12: 20.0, 256: 2.0})])
def test_distinct_colours_are_apart(is_safe, least):
    for count, expected in least.items():
        colors = pumice.distinct_colors(count, color_blind_safe=is_safe)
        assert colors.shape == (count, 3) and (colors >= 0.0).all() and (colors <= 1.0).all()
        off = apart(colors, np.vstack([colors, np.zeros(3), np.ones(3)]), is_safe)
        np.fill_diagonal(off, np.inf)
        print(f"{count} colours, safe {is_safe}: ΔE {off.min():.2f}")
        assert off.min() >= expected
    assert np.array_equal(pumice.distinct_colors(12, color_blind_safe=is_safe), colors[:12]), "a sequence"
    if not is_safe:
        twelve = colors[:12]
        off = apart(twelve, twelve)
        np.fill_diagonal(off, np.inf)
        assert off.min() < 20.0, "negative control: the first 12 for normal eyes are alike for others"


def test_more_colours_than_there_are_is_refused():
    with pytest.raises(pumice.InputError, match="count: expected at most 256, got 257"):
        pumice.distinct_colors(257)
    assert pumice.distinct_colors(0).shape == (0, 3)
