"""Flags of the figure that `pumice render` composes: what they do to the picture, by closed forms on small volumes."""

import json
import math

import numpy as np
import pytest
from command import run
from exr_planes import planes
from PIL import Image

SIZE = ["--size", "96x54"]
QUICK = [*SIZE, "--backend", "cpu"]


@pytest.fixture(scope="module")
def blocks(tmp_path_factory):
    """Three blocks in 24 × 16 × 8 voxels: 5 at the left, 9 in the middle, 4000000000 at the right; a gap of 2 voxels around each."""
    voxels = np.zeros((24, 16, 8), np.uint32)
    for start, label in ((1, 5), (9, 9), (17, 4_000_000_000)):
        voxels[start : start + 6, 2:14, 1:7] = label
    path = tmp_path_factory.mktemp("blocks") / "blocks.npy"
    np.save(path, voxels)
    return path


@pytest.fixture(scope="module")
def named(pumice, blocks):
    """The blocks with a name and a type each."""
    table = blocks.parent / "t.csv"
    table.write_text("id,name,type\n5,thin fibre,axon\n9,thick fibre,axon\n4000000000,body,soma\n")
    path = blocks.parent / "named.pumice"
    run(pumice, "compress", blocks, "-o", path, "--axes", "xyz", "--table", table).fine()
    return path


def scene_of(pumice, volume, folder, *flags):
    """The scene that the flags make."""
    saved = folder / "scene.json"
    run(pumice, "render", volume, "-o", folder / "p.png", "--size", "8x8", "--spp", 1, "--save-scene", saved, *flags).fine()
    return json.loads(saved.read_text())


def shown(scene):
    return scene["instances"][0]["style"]["show"]["only"]


def pixels(path):
    image = Image.open(path)
    assert image.mode == "RGB", image.mode
    return np.asarray(image)


def test_labels_are_named_by_id_name_type_and_size(pumice, named, tmp_path):
    for flags, expected in [
        (["--labels", "9,5"], [9, 5]),
        (["--labels", "body,5"], [4_000_000_000, 5]),
        (["--labels", "type:axon"], [5, 9]),
        (["--query", "fibre -thin"], [9]),
        (["--query", "voxels>1", "--pick", 2], None),
    ]:
        got = shown(scene_of(pumice, named, tmp_path, *flags))
        assert got == expected if expected else len(got) == 2, flags


def test_a_scene_takes_queries_and_refuses_what_it_says_itself(pumice, named, tmp_path):
    scene_of(pumice, named, tmp_path)
    scene = tmp_path / "scene.json"
    again = tmp_path / "again.json"
    line = ["render", scene, "-o", tmp_path / "q.png", "--size", "8x8", "--spp", 1]
    run(pumice, *line, "--query", "type:soma", "--save-scene", again).fine()
    assert shown(json.loads(again.read_text())) == [4_000_000_000]
    assert "no label of the scene matches axn" in run(pumice, *line, "--labels", "axn").refused()
    for flags in [
        ["--pick", 2], ["--color", "5=#fff"], ["--material", "glass"], ["--cut", "x=0.5"], ["--floor"], ["--view", "1,2"],
        ["--distance", 20], ["--frame", "volume"], ["--turntable", 2], ["--focus", 5], ["--aperture", "f/2"],
    ]:
        said = run(pumice, *line, *flags).refused()
        assert said.startswith(f"pumice: {flags[0]}: ") and "is a scene" in said, said


@pytest.mark.parametrize(
    ("flags", "what"),
    [
        (["--labels", "5,axn"], "--labels: no label of the volume matches axn"),
        (["--labels", "5,7"], "--labels: the volume has no label 7"),
        (["--query", "voxels>1e9"], "--query: no label of the volume matches voxels>1e9"),
        (["--query", "size>3"], "--query: query, column 1: expected a column of numbers"),
        (["--color", "7=#fff"], "--color: the volume has no label 7"),
        (["--color", "5=golden"], "such as #e0a030 or orange, got golden"),
        (["--material", "body=gold"], "expected plastic, metal, ghost, glass, got gold"),
        (["--material", "axn=glass"], "--material: no label of the volume matches axn"),
        (["--cut", "x=1.5"], "got x=1.5"),
        (["--focus", "axn"], "--focus: no label of the volume matches axn"),
        (["--aperture", "0"], "got 0"),
        (["--background", "greyish"], "got greyish"),
        (["--background", "white", "--transparent"], "--transparent"),
        (["--view", "nan,0"], "got nan,0"),
        (["--distance", "-3"], "-3"),
        (["--floor", "--view", "0,-10"], "--floor: it hides what is seen from below"),
        (["--turntable", "0"], "0"),
        (["--turntable", "2", "--explain"], "--explain"),
        (["--labels", "5", "--pick", "2"], "--pick"),
    ],
)
def test_what_cannot_be_done_is_refused_by_name(pumice, named, tmp_path, flags, what):
    said = run(pumice, "render", named, "-o", tmp_path / "p.png", *QUICK, "--spp", 1, *flags).refused()
    assert what in said, said
    assert not list(tmp_path.iterdir())


def test_a_look_of_what_is_not_shown_is_refused_by_name(pumice, named, tmp_path):
    line = ["render", named, "-o", tmp_path / "p.png", *QUICK, "--spp", 1]
    for flags, what in [
        (["--labels", "5", "--color", "9=#fff"], "--color: label 9 is not shown; add it to labels"),
        (["--labels", "type:axon", "--material", "type:soma=glass"], "--material: no label that matches type:soma is shown; add it to labels"),
        (["--query", "fibre", "--color", "body=#fff"], "--color: no label that matches body is shown; the query does not match"),
        (["--query", "id=5", "--pick", 1, "--material", "9=ghost"], "--material: label 9 is not shown; pick chose others"),
    ]:
        said = run(pumice, *line, *flags).refused()
        assert what in said and not list(tmp_path.iterdir()), said
    # Controls: of a type, a part that is shown suffices; without a choice all are.
    run(pumice, *line, "--labels", "5", "--color", "type:axon=#fff", "--material", "*=ghost").fine()
    run(pumice, *line, "--color", "9=#fff", "--material", "body=glass").fine()


def test_a_picture_is_made_again_without_flags_of_a_figure(pumice, named, tmp_path):
    made = tmp_path / "made.png"
    run(pumice, "render", named, "-o", made, *QUICK, "--spp", 2, "--floor", "--background", "white", "--material", "5=glass").fine()
    run(pumice, "render", "--again", made, "-o", tmp_path / "again.png").fine()
    assert made.read_bytes() == (tmp_path / "again.png").read_bytes()
    for flag in (["--floor"], ["--labels", "5"], ["--turntable", "2"], ["--background", "white"]):
        run(pumice, "render", "--again", made, "-o", tmp_path / "again.png", *flag).refused()


def test_a_saved_scene_draws_the_same_picture(pumice, named, tmp_path):
    flags = ["--spp", 2, *QUICK, "--save-scene", tmp_path / "s.json"]
    looks = ["--floor", "--cut", "-y=0.4", "--smooth", "--focus", "body", "--background", "#102030", "--color", "type:axon=#26c"]
    run(pumice, "render", named, "-o", tmp_path / "a.png", *flags, *looks).fine()
    run(pumice, "render", tmp_path / "s.json", "-o", tmp_path / "b.png", "--spp", 2, "--backend", "cpu").fine()
    assert (pixels(tmp_path / "a.png") == pixels(tmp_path / "b.png")).all()


@pytest.mark.parametrize("view", ["standard", "filmic", "agx"])
def test_a_background_is_exactly_that_color_where_nothing_is(pumice, named, tmp_path, view):
    flags = [*QUICK, "--spp", 4]
    run(pumice, "render", named, "-o", tmp_path / "label.exr", *flags).fine()
    nothing = planes(tmp_path / "label.exr")["label.index"] == 0
    # The filter spreads edges over a pixel and a half on each side.
    far = nothing.copy()
    for _ in range(2):
        far[1:] &= far[:-1].copy()
        far[:-1] &= far[1:].copy()
        far[:, 1:] &= far[:, :-1].copy()
        far[:, :-1] &= far[:, 1:].copy()
    assert far.sum() > 500
    for name, rgb in (("white", (255, 255, 255)), ("#f4f1ea", (0xF4, 0xF1, 0xEA))):
        out = tmp_path / "p.png"
        run(pumice, "render", named, "-o", out, *flags, "--view-transform", view, "--background", name).fine()
        assert (pixels(out)[far] == rgb).all(), name
        assert (pixels(out)[~nothing] != rgb).any(), "the blocks are there"
    # The control: the default backdrop is not white.
    run(pumice, "render", named, "-o", tmp_path / "plain.png", *flags, "--view-transform", view).fine()
    assert (pixels(tmp_path / "plain.png")[far] != 255).all()


def test_a_floor_has_shadows_and_white_corners(pumice, named, tmp_path):
    flags = [*QUICK, "--spp", 32, "--background", "white", "--distance", "60"]
    run(pumice, "render", named, "-o", tmp_path / "floor.png", *flags, "--floor").fine()
    run(pumice, "render", named, "-o", tmp_path / "plain.png", *flags).fine()
    floor, plain = pixels(tmp_path / "floor.png"), pixels(tmp_path / "plain.png")
    for corner in (floor[0, 0], floor[0, -1], floor[-1, 0], floor[-1, -1]):
        assert (corner == 255).all(), corner
    shadow = (plain == 255).all(axis=-1) & (floor < 200).all(axis=-1)
    assert shadow.sum() > 20, shadow.sum()


def test_a_color_is_seen_under_the_default_light_and_does_not_clip(pumice, named, tmp_path):
    """The upper faces of the blocks, seen so that the key light falls on them as straight as it can: its direction, 0.55 back - 0.65 right
    + 0.9 up of the camera, is 0.851 upwards where the camera stands 31.4 degrees above the horizon."""
    color = np.array([0xE0, 0xA0, 0x30])
    looks = ["--color", "*=#e0a030", "--background", "black", "--view", "0,31.4"]
    run(pumice, "render", named, "-o", tmp_path / "p.png", *QUICK, "--spp", 64, *looks).fine()
    seen = pixels(tmp_path / "p.png").astype(int)
    # The pixels of the upper faces are the brightest; the filter mixes those at their edges with darker ones.
    brightest = sorted(seen.reshape(-1, 3).tolist(), key=sum)[-200:]
    brightest = np.array(brightest)
    assert brightest.max() < 250, "no channel clips"
    # The white highlight adds most to the darkest channel: 0.045 to 0.03, which is 29 steps.
    assert np.abs(np.median(brightest, axis=0) - color).max() < 32, np.median(brightest, axis=0)
    linear = np.where(brightest / 255 <= 0.04045, brightest / 255 / 12.92, ((brightest / 255 + 0.055) / 1.055) ** 2.4)
    albedo = np.array([0.7454, 0.3515, 0.0296])
    matte = albedo * (0.851 * 0.7 * np.array([1, 0.945, 0.885]) + [0.44, 0.475, 0.52])
    # The layer of plastic takes up to 4 % of the matte light and adds up to 0.1 of its own.
    assert (np.median(linear, axis=0) > 0.95 * matte).all() and (np.median(linear, axis=0) < matte + 0.1).all(), (matte, np.median(linear, axis=0))


def test_cuts_leave_the_half_that_they_say(pumice, named, tmp_path):
    """The plane stands where the fraction says in index space, and its normal points to what is removed."""
    for cut, axis, sign in (("x=0.25", 0, 1), ("-x=0.25", 0, -1), ("z=0.5", 2, 1)):
        scene = scene_of(pumice, named, tmp_path, "--cut", cut, "--frame", "volume")
        numbers = np.array(scene["instances"][0]["world_from_index"]).reshape(4, 3)
        linear, translation = numbers[:3].T, numbers[3]
        plane = scene["cuts"][0]["shape"]["plane"]
        index = np.linalg.solve(linear, np.array(plane["point"]) - translation)
        fraction = float(cut.split("=")[1])
        assert math.isclose(index[axis], fraction * (24, 16, 8)[axis], rel_tol=1e-9)
        along = linear[:, axis] / np.linalg.norm(linear[:, axis])
        assert math.isclose(np.dot(along, plane["normal"]), sign, rel_tol=1e-9)
    # Where only the left quarter is left, only the left block is drawn.
    out = tmp_path / "c.exr"
    run(pumice, "render", named, "-o", out, *QUICK, "--spp", 1, "--cut", "x=0.3", "--view", "0,30").fine()
    assert set(np.unique(planes(out)["label.index"])) == {0, 1}


def test_framing_the_volume_does_not_depend_on_labels(pumice, named, tmp_path):
    of = {}
    for frame in ("labels", "volume"):
        for labels in ("5", "9,4000000000"):
            scene = scene_of(pumice, named, tmp_path, "--labels", labels, "--frame", frame)
            of[frame, labels] = (scene["camera"], scene["instances"][0]["world_from_index"])
    assert of["volume", "5"] == of["volume", "9,4000000000"]
    assert of["labels", "5"] != of["labels", "9,4000000000"]


def test_a_turntable_is_fresh_renders_from_a_rotated_camera(pumice, named, tmp_path):
    flags = [*QUICK, "--spp", 4]
    saved = tmp_path / "first.json"
    report = tmp_path / "r.json"
    run(pumice, "render", named, "-o", tmp_path / "turn.exr", *flags, "--turntable", 3, "--save-scene", saved, "--json", report).fine()
    files = sorted(tmp_path.glob("turn*"))
    assert [f.name for f in files] == [f"turn_000{k}.exr" for k in (1, 2, 3)]
    assert [p["picture"] for p in json.loads(report.read_text())["pictures"]] == list(map(str, files))
    scene = json.loads(saved.read_text())
    first = np.array(scene["camera"]["world_from_camera"]).reshape(4, 3)
    for number, file in enumerate(files):
        angle = 2 * math.pi * number / 3
        turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
        again = tmp_path / "again.exr"
        run(pumice, "render", "--again", file, "-o", again, "--save-scene", tmp_path / "k.json").fine()
        of_picture = json.loads((tmp_path / "k.json").read_text())
        # The scene is the first one but for its camera, which has gone around the vertical axis.
        np.testing.assert_allclose(np.array(of_picture["camera"]["world_from_camera"]).reshape(4, 3), first @ turn.T, atol=1e-12)
        of_picture["camera"]["world_from_camera"] = scene["camera"]["world_from_camera"]
        assert of_picture == scene
        # A fresh process draws the same bits.
        assert file.read_bytes() == again.read_bytes()
    assert files[0].read_bytes() != files[1].read_bytes()


def test_the_focus_is_the_depth_of_the_label(pumice, named, tmp_path):
    scene = scene_of(pumice, named, tmp_path, "--focus", "9", "--aperture", "0.25")
    numbers = np.array(scene["instances"][0]["world_from_index"]).reshape(4, 3)
    middle = np.array([12, 8, 4]) @ numbers[:3] + numbers[3]
    camera = np.array(scene["camera"]["world_from_camera"]).reshape(4, 3)
    aperture = scene["camera"]["aperture"]
    assert math.isclose(aperture["focus_distance"], np.dot(camera[3] - middle, camera[2]), rel_tol=1e-9)
    assert aperture["radius"] == 0.25
    assert scene_of(pumice, named, tmp_path, "--focus", "31.5")["camera"]["aperture"]["focus_distance"] == 31.5
    assert scene_of(pumice, named, tmp_path)["camera"]["aperture"] is None


def test_smooth_is_the_setting_of_the_scene(pumice, named, tmp_path):
    assert scene_of(pumice, named, tmp_path, "--smooth")["settings"]["smooth_voxels"] is True
    assert scene_of(pumice, named, tmp_path)["settings"]["smooth_voxels"] is False
