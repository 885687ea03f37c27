"""Tests cuts: voxels cut away are gone, the rest ends in a cap of the label's colour, and moving a cut live rebuilds nothing."""

import numpy as np
import pumice
import pytest


@pytest.fixture
def half():
    """(volume, scene) of an 8³ block, label 3 below and label 5 above, seen orthographically from above."""
    labels = np.full((8, 8, 8), 3, dtype=np.uint8)
    labels[:, :, 4:] = 5
    volume = pumice.compress(labels)
    scene = pumice.figure(volume, size=(16, 16)).to_dict()
    scene["instances"][0]["world_from_index"] = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]
    scene["camera"] = {
        "world_from_camera": [1, 0, 0, 0, 1, 0, 0, 0, 1, 4, 4, 20],
        "projection": {"orthographic": {"scale": 8.0}},
    }
    return volume, scene


def seen(volume, scene):
    """(labels, depths) of a picture; -1 for pixels without a surface."""
    picture = pumice.render(pumice.Scene.from_dict(scene), volume, spp=1, backend="cpu")
    return np.asarray(picture.label), np.asarray(picture.depth)


def plane(z, up):
    return {"shape": {"plane": {"point": [0, 0, z], "normal": [0, 0, up]}}}


def test_a_cut_shows_what_lies_below(half):
    volume, scene = half
    whole, depth = seen(volume, scene)
    assert np.allclose(depth, 12)
    for z, below in ((6.5, True), (2.25, False)):
        cut, depth = seen(volume, {**scene, "cuts": [plane(z, 1)]})
        assert np.allclose(depth, 20 - z), "the cap lies where the cut is, within voxels"
        assert (cut == whole).all() == below, "the cap shows the labels that the cut passes through"
    gone, depth = seen(volume, {**scene, "cuts": [plane(4, 1), plane(4, -1)]})
    assert not np.isfinite(depth).any() and (gone != whole).all()
    named = {**plane(6.5, 1), "instances": []}
    assert np.allclose(seen(volume, {**scene, "cuts": [named]})[1], 12), "a cut without instances removes nothing"


def test_a_box_takes_its_inside(half):
    volume, scene = half
    # The box cuts away the quarter x, y < 4 down to z = 5.5.
    box = {"shape": {"box": {"world_from_box": [2, 0, 0, 0, 2, 0, 0, 0, 2, 2, 2, 7.5]}}}
    depth = seen(volume, {**scene, "cuts": [box]})[1]
    low = np.isclose(depth, 14.5)
    assert low.sum() == depth.size // 4 and np.allclose(depth[~low], 12)


def test_cuts_that_cannot_be_are_refused_by_name(half):
    volume, scene = half
    for cut, said in (
        (plane(1, 0), r"cuts\[0\]\.shape\.plane\.normal"),
        ({"shape": {"box": {"world_from_box": [0] * 12}}}, r"cuts\[0\]\.shape\.box\.world_from_box"),
        ({**plane(1, 1), "instances": [77]}, r"cuts\[0\]\.instances\[0\]"),
        ({"shape": {"ball": {}}}, "ball"),
    ):
        with pytest.raises(pumice.InputError, match=said):
            pumice.render(pumice.Scene.from_dict({**scene, "cuts": [cut]}), volume, spp=1)
