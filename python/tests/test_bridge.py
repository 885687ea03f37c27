"""Tests `pumice.export` and the refusals of `pumice.verify_render`; a comparison itself needs Blender
(blender-addon/tests/test_verify_render.py)."""

import json
import struct
import sys

import numpy as np
import pumice
import pytest


@pytest.fixture
def volume(tmp_path):
    labels = np.zeros((9, 8, 7), dtype=np.uint16)
    labels[2:7, 1:5, 3] = 4
    labels[8, 7, 6] = 900
    path = tmp_path / "cells.pumice"
    pumice.compress(labels).save(path)
    return path


def test_a_volume_is_exported(volume, tmp_path):
    report = pumice.export(volume, tmp_path / "cells.glb", plain=True)
    # 5 × 4 × 1 voxels have 2 · (20 + 5 + 4) faces, one voxel 6.
    assert report["faces"] == 58 + 6 and report["forms"] == ["voxels"] and report["left_out"] == []
    data = (tmp_path / "cells.glb").read_bytes()
    magic, version, length, json_length = struct.unpack_from("<4sIII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data)) and report["bytes"] == len(data)
    assert "meshes" in json.loads(data[20 : 20 + json_length])
    some = pumice.export(volume, tmp_path / "cells.usda", form=["boxes", "voxels"], labels=[900], for_blender=True)
    assert some["forms"] == ["boxes", "voxels"] and some["faces"] == 12
    # 3 × 4 × 1 voxels.
    part = pumice.export(volume, tmp_path / "part.ply", form="smooth", region=(4, 0, 0, 9, 8, 4))
    assert part["faces"] == 2 * (12 + 4 + 3) and (tmp_path / "part.ply").stat().st_size == part["bytes"]


def test_what_cannot_be_exported_is_refused(volume, tmp_path):
    for out, options, what in [
        ("cells.xyz", {}, "expected a name that ends in"),
        ("cells.usdc", {"form": "spheres"}, "form: expected one of instances, boxes, cells4, voxels, smooth, got spheres"),
        ("cells.usdc", {"labels": [7]}, "no label 7"),
        ("cells.usdc", {"region": [0, 0, 0, 9, 8]}, "region: expected six numbers x0, y0, z0, x1, y1, z1, got 5"),
        ("cells.usdc", {"region": [0, 0, 0, 9, 8, 1.5]}, "region: expected a whole number, got 1.5"),
        ("cells.usdc", {"region": (0, 0, 0, 10, 8, 7)}, "region: expected X1,Y1,Z1 of at most 9,8,7, the voxels of volume_1, got 10,8,7"),
        ("cells.usdc", {"limit_bytes": 10}, "more than the limit of 10"),
        ("cells.glb", {"form": ["boxes", "voxels"]}, "write a file for each"),
        ("cells.glb", {"for_blender": True}, "the same for every program"),
    ]:
        with pytest.raises(pumice.InputError, match=what):
            pumice.export(volume, tmp_path / out, **options)
    assert [p.name for p in tmp_path.iterdir()] == ["cells.pumice"]
    job = pumice.Job()
    job.cancel()
    with pytest.raises(pumice.Cancelled):
        pumice.export(volume, tmp_path / "cells.usdc", job=job)


def test_what_cannot_be_compared_is_refused(volume, tmp_path):
    for options, what in [
        ({"blender": tmp_path / "nowhere"}, "nowhere: No such file"),
        ({"blender": sys.executable}, "No module named 'bpy'"),
        ({"blender": sys.executable, "spp": 255}, "expected at least 256 samples, got 255"),
        ({"blender": sys.executable, "lod": 2}, "lod: expected 1, 4 or 16, got 2"),
        ({"blender": sys.executable, "page": "page.pdf"}, "expected a name that ends in .html"),
    ]:
        with pytest.raises(pumice.InputError, match=what):
            pumice.verify_render(volume, size=(8, 8), backend="cpu", **options)


def test_pictures_of_two_programs_are_compared():
    random = np.random.default_rng(3)

    def noisy(mean, deviation=0.01):
        return mean * (1 + deviation * random.standard_normal((16, 24, 32, 3)))

    same = pumice.agreement(noisy(0.5), noisy(0.5))
    assert same["verdict"] == "agrees" and same["sentence"].startswith("Agrees: every tile lies within 1 %"), same
    assert same["pictures"] == [16, 16] and same["tiles_across_and_down"] == [4, 3]
    # The middle 99 % of a sum over 2,304 values, each with the variance that it is divided by: ± 2.6 √(2 / 2304), and the variances' own.
    assert abs(same["equality"]["ratio"] - 1) < 0.15
    # Controls: one tile that is 2 % brighter; and noise that hides everything.
    brighter = noisy(0.5)
    brighter[:, 8:16, 16:24] *= 1.02
    off = pumice.agreement(brighter, noisy(0.5))
    assert off["verdict"] == "differs" and off["proven_in_tile"][1] == [16, 8], off
    assert pumice.agreement(noisy(0.5, 3.0), noisy(0.5, 3.0))["verdict"] == "cannot_tell"
    # A mean of half the pixels, which are off: with the others it would be within its margin.
    half = np.arange(32) < 16
    ours = noisy(0.5) * np.where(half, 1.003, 0.999)[:, None]
    covered = np.broadcast_to(half, (24, 32))
    assert pumice.agreement(ours, noisy(0.5), covered=covered)["verdict"] == "differs"
    assert pumice.agreement(ours, noisy(0.5))["verdict"] != "differs"
    for arrays, what in [((noisy(1)[..., :2], noisy(1)), "got .16, 24, 32, 2."), ((noisy(1)[:1], noisy(1)), "two pictures or more")]:
        with pytest.raises(pumice.InputError, match=what):
            pumice.agreement(*arrays)
    with pytest.raises(pumice.InputError, match="covered: expected the shape"):
        pumice.agreement(noisy(1), noisy(1), covered=np.ones((3, 3)))
