"""Tests scenes with triangle meshes: how they appear in pictures, and errors for files that are no meshes."""

import json

import numpy as np
import pytest
from command import run
from exr_planes import planes
from PIL import Image

HEADER = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
"""
QUICK = ["--backend", "cpu", "--spp", "1"]
# A square around the origin, as one face with four corners.
SQUARE = HEADER + "-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n4 0 1 2 3\n"


@pytest.fixture
def floored(pumice, data, tmp_path):
    """(path, fields) of a scene of nuclei over a floor that is wider than the picture, seen obliquely from above."""
    made = tmp_path / "made.json"
    nuclei = [data / "platynereis_nuclei.tif", "--spacing", "1,1,1"]
    run(pumice, "render", *nuclei, "-o", tmp_path / "made.png", *QUICK, "--size", "64x48", "--save-scene", made).fine()
    scene = json.loads(made.read_text())
    (tmp_path / "floor.ply").write_text(SQUARE)
    material = {"base_color": [0.8, 0.1, 0.1], "roughness": 1.0, "specular": 0.0}
    place = [100, 0, 0, 0, 100, 0, 0, 0, 100, 0, 0, -1.8]
    scene["meshes"] = [{"id": 1, "source": "floor.ply", "world_from_mesh": place, "materials": [material]}]
    file = tmp_path / "scene.json"
    file.write_text(json.dumps(scene))
    return file, scene


def picture(pumice, scene, out):
    run(pumice, "render", scene, "-o", out, "--backend", "cpu", "--spp", "8").fine()
    return np.asarray(Image.open(out).convert("RGB"), dtype=float)


def test_a_floor_is_drawn_under_a_volume_and_lies_in_its_shadow(pumice, floored, tmp_path):
    file, fields = floored
    with_floor = picture(pumice, file, tmp_path / "with.png")
    alone = {**fields, "meshes": []}
    file.write_text(json.dumps(alone))
    without = picture(pumice, file, tmp_path / "without.png")
    changed = np.abs(with_floor - without).max(axis=-1) > 25
    assert changed.mean() > 0.3, "the floor covers background"
    red = changed & (with_floor[..., 0] > 1.5 * with_floor[..., 2])
    assert red.sum() > 0.8 * changed.sum()
    # Where the volume shades the floor, the floor without the volume is lighter.
    (tmp_path / "hidden.json").write_text(json.dumps(_hidden(fields)))
    bare = picture(pumice, tmp_path / "hidden.json", tmp_path / "bare.png")
    darker = red & (bare[..., 0] - with_floor[..., 0] > 20)
    lighter = red & (with_floor[..., 0] - bare[..., 0] > 20)
    assert darker.sum() > 20 and darker.sum() > 5 * lighter.sum(), (darker.sum(), lighter.sum())


def _hidden(fields):
    style = {**fields["instances"][0]["style"], "show": {"only": []}}
    return {**fields, "instances": [{**fields["instances"][0], "style": style}]}


def test_the_picture_is_made_again_from_the_same_mesh_alone(pumice, floored, tmp_path):
    file, _ = floored
    out = tmp_path / "with.png"
    first = picture(pumice, file, out)
    again = tmp_path / "again.png"
    run(pumice, "render", "--again", out, "-o", again).fine()
    assert np.array_equal(np.asarray(Image.open(again).convert("RGB"), dtype=float), first)
    (tmp_path / "floor.ply").write_text(SQUARE.replace("-1 -1 0", "-1 -2 0"))
    assert "mesh" in run(pumice, "render", "--again", out, "-o", again).refused()


def test_a_floor_that_catches_leaves_its_shadow(pumice, floored, tmp_path):
    """A shadow catcher is dark where an ordinary floor is in the volume's shadow, and transparent elsewhere. The shadow pass holds what
    alpha loses."""
    file, fields = floored
    fields["film"]["transparent"] = True

    def drawn(name, catches, *more):
        fields["meshes"][0]["shadow_catcher"] = catches
        file.write_text(json.dumps(fields))
        out = tmp_path / name
        run(pumice, "render", file, "-o", out, "--backend", "cpu", "--spp", "16", *more).fine()
        return planes(out)

    caught, apart = drawn("caught.exr", True), drawn("apart.exr", True, "--passes", "shadow_catcher")
    ordinary = drawn("floor.exr", False)
    (tmp_path / "hidden.json").write_text(json.dumps(_hidden(fields)))
    run(pumice, "render", tmp_path / "hidden.json", "-o", tmp_path / "bare.exr", "--backend", "cpu", "--spp", "16").fine()
    bare = planes(tmp_path / "bare.exr")
    floor = (ordinary["label.index"] == 0) & (ordinary["A"] == 1) & (apart["A"] == 0)
    left = np.mean([ordinary[c] / bare[c] for c in "RGB"], axis=0)[floor]
    assert floor.mean() > 0.2 and left.min() < 0.7
    # Both are the same quotient of sums over the same 16 samples.
    assert np.abs(1 - caught["A"][floor] - np.minimum(left, 1)).max() < 1e-4
    assert set(apart) == {*"RGBA", *(f"ViewLayer.Shadow Catcher.{c}" for c in "RGB")}
    assert (apart["R"] == caught["R"]).all() and apart["A"].max() == 1
    mean = np.mean([apart[f"ViewLayer.Shadow Catcher.{c}"] for c in "RGB"], axis=0)
    assert np.abs(mean[floor] - left).max() < 1e-4
    for name in ("caught.exr", "apart.exr"):
        run(pumice, "render", "--again", tmp_path / name, "-o", tmp_path / "again.exr").fine()
        again = planes(tmp_path / "again.exr")
        assert all(np.array_equal(again[c], plane) for c, plane in planes(tmp_path / name).items() if c in again)
        assert "A" in again


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "floor.ply"),
        ("solid cube", "expected a PLY mesh"),
        (SQUARE[:-10], "floor.ply"),
        (SQUARE.replace("4 0 1 2 3", "4 0 1 2 9"), "got 9"),
        (SQUARE.replace("1 1 0", "1 nan 0", 1), "finite"),
    ],
)
def test_a_file_that_is_no_mesh_is_refused_in_a_line(pumice, floored, tmp_path, text, said):
    file, _ = floored
    path = tmp_path / "floor.ply"
    path.unlink() if text is None else path.write_text(text)
    assert said in run(pumice, "render", file, "-o", tmp_path / "no.png", *QUICK).refused()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"shadow_catcher": 1}, "expected a boolean"),
        ({"materials": []}, "meshes[0].materials"),
        ({"world_from_mesh": [0.0] * 12}, "meshes[0].world_from_mesh"),
        ({"world_from_mesh": [1e-300, 0, 0, 0, 1e-300, 0, 0, 0, 1e-300, 0, 0, 0]}, "meshes[0]"),
    ],
)
def test_a_mesh_that_cannot_be_drawn_is_named(pumice, floored, tmp_path, change, said):
    file, fields = floored
    fields["meshes"][0].update(change)
    file.write_text(json.dumps(fields))
    assert said in run(pumice, "render", file, "-o", tmp_path / "no.png", *QUICK).refused()
