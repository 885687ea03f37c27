"""Tests what is exported of a region: the examples of pumice-export write the volume `blobs` also as `part`, within REGION, and numpy
restricts the whole volume's voxels, cells and boxes by itself."""

import json

import numpy as np
import pytest
import trimesh
from pxr import Usd, UsdGeom
from test_gltf_scenes import File, boxes_of
from test_gltf_scenes import faces_of as faces_of_gltf
from test_triangle_files import faces_in, matrix_of
from test_usd_scenes import cells, faces, faces_of, voxels

REGION = np.array([[5, 0, 9], [66, 41, 30]])


@pytest.fixture(scope="module")
def folder(exported_scenes):
    return exported_scenes


def within(field, low, high):
    """The field where it lies from `low` up to `high`, and 0 elsewhere."""
    place = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
    only = np.zeros_like(field)
    only[place] = field[place]
    return only


def overlapping(lows, sizes):
    return ((lows < REGION[1]) & (lows + sizes > REGION[0])).all(axis=1)


@pytest.fixture(scope="module")
def expected(folder):
    """What each form shows: {form: field of dense index + 1}."""
    drawn = voxels(folder, "part")
    assert (drawn == voxels(folder, "blobs")).all(), "the voxels beside the file are those of the whole volume"
    whole_cells = REGION[0] // 4 * 4, -(-REGION[1] // 4) * 4
    lows, sizes, labels = boxes_of(File(folder / "blobs.instances.glb"))
    none = drawn.max() + 1
    least = np.full(drawn.shape, none)
    for low, size, label in zip(lows, sizes, labels, strict=True):
        if overlapping(low[None], size[None])[0]:
            place = tuple(slice(a, a + n) for a, n in zip(low, size, strict=True))
            least[place] = np.minimum(least[place], label + 1)
    return {
        "voxels": faces(within(drawn, *REGION)),
        "cells4": faces(within(cells(drawn), *whole_cells)),
        "boxes": faces(np.where(least == none, 0, least)),
    }


@pytest.mark.parametrize("form", ["voxels", "cells4", "boxes"])
def test_surfaces_are_closed_at_the_regions_border(folder, expected, form):
    stage = Usd.Stage.Open(str(folder / "part.usdc"))
    stage.SetEditTarget(stage.GetSessionLayer())
    stage.GetPrimAtPath("/Scene/volume_7").GetVariantSet("form").SetVariantSelection(form)
    assert faces_of(UsdGeom.Mesh(stage.GetPrimAtPath("/Scene/volume_7/surface"))) == expected[form]
    found, _ = faces_of_gltf(File(folder / f"part.{form}.glb"))
    assert found == expected[form]
    # Control: the whole volume has other faces, and so has a region that is one voxel larger.
    assert faces_of_gltf(File(folder / f"blobs.{form}.glb"))[0] != expected[form]
    larger = faces(within(voxels(folder, "part"), REGION[0], REGION[1] + 1))
    assert larger != expected[form]


def test_faces_alone_have_the_same(folder, expected):
    raw = trimesh.load(folder / "part.voxels.ply", process=False).metadata["_ply_raw"]
    points = np.stack([raw["vertex"]["data"][axis] for axis in "xyz"], axis=1)
    rectangles = points[raw["face"]["data"]["vertex_indices"]["f1"]]
    assert faces_in(rectangles, raw["face"]["data"]["label"].tolist(), matrix_of(folder, "part")) == expected["voxels"]


def test_boxes_that_overlap_are_whole(folder):
    whole, part = (boxes_of(File(folder / f"{name}.instances.glb")) for name in ("blobs", "part"))
    kept = overlapping(whole[0], whole[1])
    rows = {tuple(row) for row in np.column_stack(whole)[kept].tolist()}
    assert rows == {tuple(row) for row in np.column_stack(part).tolist()} and 0 < len(rows) < len(kept)
    stage = Usd.Stage.Open(str(folder / "part.usda"))
    stage.SetEditTarget(stage.GetSessionLayer())
    stage.GetPrimAtPath("/Scene/volume_7").GetVariantSet("form").SetVariantSelection("instances")
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/Scene/volume_7/boxes"))
    assert len(instancer.GetPositionsAttr().Get()) == len(rows)


def test_files_say_which_part_they_hold(folder):
    region = REGION.ravel().tolist()
    for name, expected in [("part", region), ("blobs", None)]:
        file = File(folder / f"{name}.voxels.glb")
        assert file.nodes[file.named("volume_7")]["extras"].get("region") == expected
        stage = Usd.Stage.Open(str(folder / f"{name}.usdc"))
        note = stage.GetPrimAtPath("/Scene/volume_7").GetAttribute("userProperties:region").Get()
        assert (note and json.loads(note)) == expected
