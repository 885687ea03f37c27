"""The keywords of `pumice.figure`: they are the flags of the command, and what they mean is checked there (tests/python/test_cli_figure.py)."""

import inspect
import math
import re
from pathlib import Path

import numpy as np
import pytest

import pumice

COMMAND = Path(__file__).parents[2] / "cli" / "src" / "args" / "figure.rs"


@pytest.fixture(scope="module")
def blocks():
    """Three blocks in 24 × 16 × 8 voxels, two of which have a name."""
    voxels = np.zeros((24, 16, 8), np.uint32)
    for start, label in ((1, 5), (9, 9), (17, 12)):
        voxels[start : start + 6, 2:14, 1:7] = label
    return pumice.compress(voxels, names={5: "thin fibre", 9: "thick fibre"})


def style(volume, **keywords):
    return pumice.figure(volume, size=(16, 9), **keywords).to_dict()["instances"][0]["style"]


def test_each_flag_of_the_command_is_a_keyword():
    fields = re.findall(r"^    (\w+): (?:Option|Vec|bool)", COMMAND.read_text().split("impl Figure")[0], re.M)
    assert len(fields) == 15 and set(fields) <= set(inspect.signature(pumice.figure).parameters), fields


def test_labels_are_chosen_by_selectors(blocks):
    for keywords, expected in [
        ({"labels": ["fibre", 12]}, [5, 9, 12]),
        ({"labels": "12,thin"}, [12, 5]),
        ({"labels": np.array([9, 5])}, [9, 5]),
        ({"query": "-thin"}, [9, 12]),
        ({"query": "fibre", "pick": 5}, [5, 9]),
    ]:
        assert style(blocks, **keywords)["show"] == {"only": expected}, keywords


def test_colors_and_materials_go_to_their_labels(blocks):
    looks = style(blocks, color={"fibre": "#f00", np.uint32(9): "#00f"}, material={"*": "ghost", "thin": "glass"})
    groups = {tuple(g["labels"]): g for g in looks["groups"]}
    assert groups[5,]["material"]["transmission"] == 1 and groups[5,]["colors"] == [[1, 0, 0]]
    assert groups[9, 12]["material"]["alpha"] < 1 and groups[9, 12]["colors"][0] == [0, 0, 1]
    assert style(blocks, material="metal")["material"]["metallic"] == 1


def test_the_other_keywords_set_their_fields(blocks):
    scene = pumice.figure(
        blocks, size=(16, 9), background="#ff0000", floor=True, cut=["x=0.5", "-y=0.25"], smooth=True, focus=20.0, aperture=0.5,
        view=(90, 0), distance=33, frame="volume",
    ).to_dict()
    assert scene["film"]["background"] == [1, 0, 0] and scene["film"]["transparent"] is True
    assert len(scene["cuts"]) == 2 and scene["meshes"][0]["shadow_catcher"] is True
    assert scene["settings"]["smooth_voxels"] is True
    assert scene["camera"]["aperture"]["focus_distance"] == 20 and scene["camera"]["aperture"]["radius"] == 0.5
    # From the right, at 33 units.
    np.testing.assert_allclose(scene["camera"]["world_from_camera"][9:], [33, 0, 0], atol=1e-12)
    assert pumice.figure(blocks, view=(3, 4)) == pumice.figure(blocks, view_deg=(3, 4)) != pumice.figure(blocks)


@pytest.mark.parametrize(
    ("keywords", "what"),
    [
        ({"labels": [7]}, "labels: the volume has no label 7"),
        ({"labels": ["axn"]}, "labels: no label of the volume matches axn"),
        ({"labels": [5], "query": "fibre"}, "not both"),
        ({"color": {5: (1, 0, 0)}}, "color: expected a text"),
        ({"color": {5: "reddish"}}, "color: expected a colour such as #e0a030 or orange, got reddish"),
        ({"color": {-1: "#fff"}}, "color: expected 0 to"),
        ({"material": {"axn": "glass"}}, "material: no label of the volume matches axn"),
        ({"material": "gold"}, "material: expected plastic, metal, ghost, glass, got gold"),
        ({"color": "#fff"}, "color: expected a dict by selector"),
        ({"labels": 5}, "labels: expected a list, got 5"),
        ({"cut": 0.5}, "cut: expected a list, got 0.5"),
        ({"size": 5}, "size: expected a list, got 5"),
        ({"background": 1}, "background: expected a text"),
        ({"cut": "x=2"}, "cut: expected AXIS=FRACTION"),
        ({"focus": -1.5}, "focus: expected a distance above 0"),
        ({"focus": 7}, "focus: the volume has no label 7"),
        ({"aperture": float("nan")}, "aperture: expected an f-number"),
        ({"aperture": []}, "aperture: expected a number"),
        ({"view": (1, 2, 3)}, "view: expected two numbers"),
        ({"view": (1, 91)}, "view: expected degrees"),
        ({"view": (1, 2), "view_deg": (1, 2)}, "older name"),
        ({"distance": 0}, "distance: expected a distance above 0"),
        ({"frame": "all"}, "frame: expected labels or volume, got all"),
        ({"turntable": 0}, "turntable: expected 1 to"),
        ({"floor": True, "view": (0, -10)}, "floor: it hides"),
        ({"legend": 0}, "legend: expected 1 to"),
        ({"legend": 3, "dpi": "300"}, "dpi: expected a number above 0"),
        ({"legend": 3, "dpi": float("nan")}, "dpi: expected a number above 0"),
        ({"legend": 3, "dpi": 4000}, "legend: a picture of 960 × 540 pixels at 4000 dpi has no room"),
    ],
)
def test_what_cannot_be_done_is_refused_by_name(blocks, keywords, what):
    with pytest.raises(pumice.InputError, match=re.escape(what)) as refused:
        pumice.figure(blocks, **keywords)
    assert "\n" not in str(refused.value)


def test_a_look_of_labels_that_are_not_shown_is_refused_by_name(blocks, tmp_path):
    blocks.save(tmp_path / "v.pumice")
    part = pumice.open(tmp_path / "v.pumice", labels=[5, 9])
    for keyword, look in (("color", "#fff"), ("material", "glass")):
        for volume, shown, selector, said in [
            (blocks, {"labels": [5, 9]}, 12, "label 12 is not shown; add it to labels"),
            (blocks, {"labels": ["thin"]}, np.uint64(9), "label 9 is not shown; add it to labels"),
            (blocks, {"query": "fibre"}, "id>9", "no label that matches id>9 is shown; the query does not match"),
            (blocks, {"query": "thin", "pick": 1}, 9, "label 9 is not shown; pick chose others"),
            (part, {}, 12, "label 12 is not shown; the volume was read without it"),
        ]:
            with pytest.raises(pumice.InputError, match=f"^{keyword}: {re.escape(said)}") as refused:
                pumice.figure(volume, **shown, **{keyword: {5: look, selector: look}})
            assert "\n" not in str(refused.value)
        # Controls: what is shown, also as a part of a query, and all without a choice.
        pumice.figure(blocks, labels=[5], **{keyword: {"fibre": look, "*": look, 5: look}})
        pumice.figure(blocks, **{keyword: {12: look}})
        pumice.figure(part, **{keyword: {9: look}})


def test_a_floor_needs_no_mesh_from_the_caller(blocks):
    scene = pumice.figure(blocks, size=(48, 27), floor=True, background="transparent")
    with_floor = pumice.render(scene, blocks, spp=8, backend="cpu")
    without = pumice.render(pumice.figure(blocks, size=(48, 27), background="transparent"), blocks, spp=8, backend="cpu")
    # The shadow has alpha where the film is else empty.
    assert ((with_floor.alpha > 0.2) & (without.alpha == 0)).sum() > 5
    assert (pumice.Renderer(backend="cpu").render(scene, blocks, spp=8).color == with_floor.color).all()


def test_a_turntable_turns_the_camera_alone(blocks):
    scene = pumice.figure(blocks, size=(48, 27), turntable=4)
    scenes = scene.turntable(4)
    assert len(scenes) == 4 and scenes[0] == scene
    first = np.array(scene.to_dict()["camera"]["world_from_camera"]).reshape(4, 3)
    quarter = scenes[1].to_dict()
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(np.array(quarter["camera"]["world_from_camera"]).reshape(4, 3), first @ turn.T, atol=1e-12)
    quarter["camera"] = scene.to_dict()["camera"]
    assert pumice.Scene.from_dict(quarter) == scene
    renderer = pumice.Renderer(backend="cpu")
    for one in scenes:
        kept = renderer.render(one, blocks, spp=2)
        assert (kept.color == pumice.render(one, blocks, spp=2, backend="cpu").color).all()
    assert renderer.rebuilt["acceleration"] == 1
    assert math.isclose(np.linalg.norm(first[3]), np.linalg.norm(np.array(scenes[2].to_dict()["camera"]["world_from_camera"][9:])))
    with pytest.raises(pumice.InputError, match="count: expected 1 to"):
        scene.turntable(0)
