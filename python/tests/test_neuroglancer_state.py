"""Tests states of Neuroglancer as pictures: place of what is seen, and colours, against Neuroglancer's own formulas in numpy.

The oracle shares no code with Pumice: matrices as glMatrix makes them, from `src/perspective_view/panel.ts` and `src/navigation_state.ts`; colours from
`src/segment_color.ts`.
"""

import copy
import json
import math
import urllib.parse
import warnings

import numpy as np
import pumice
import pytest
from command import run

NM = np.array([16.0, 16.0, 40.0])
OFFSET = np.array([100, 50, 7])
SIZE = (160, 120)
# Cubes of 3 voxels, far from each other, by id.
CENTRES = {11: (8, 8, 8), 12: (50, 10, 20), 13: (10, 44, 30), 2**63 + 9: (54, 50, 12), 15: (30, 30, 40)}


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A folder with a precomputed volume, whose first voxel does not lie at the origin."""
    folder = tmp_path_factory.mktemp("states")
    labels = np.zeros((64, 64, 48), np.uint64)
    for label, (x, y, z) in CENTRES.items():
        labels[x - 1 : x + 2, y - 1 : y + 2, z - 1 : z + 2] = label
    matrix = np.array([[16, 0, 0, 1600], [0, 16, 0, 800], [0, 0, 40, 280], [0, 0, 0, 1]], float)
    volume = pumice.compress(labels, axes="xyz", world_from_index=matrix, unit="nm")
    volume.write(folder / "cells", format="precomputed")
    volume.save(folder / "cells.pumice")
    return folder


def state(url="precomputed://cells", **changes):
    layer = {"type": "segmentation", "name": "cells", "source": url, "segments": [str(label) for label in CENTRES]}
    fields = {
        "dimensions": {"x": [16e-9, "m"], "y": [16e-9, "m"], "z": [40e-9, "m"]},
        "position": [130.5, 80.0, 30.0],
        "projectionScale": 180.0,
        "projectionOrientation": [0.0, 0.0, 0.0, 1.0],
        "layers": [layer],
        "layout": "3d",
    }
    return fields | changes


def layer_of(fields, **changes):
    changed = copy.deepcopy(fields)
    changed["layers"][0] |= changes
    return changed


def rotation(quaternion):
    """The matrix of a quaternion x, y, z, w."""
    x, y, z, w = np.array(quaternion) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def pixel_of(fields, voxel):
    """Where Neuroglancer draws a place of the volume, in voxels of the state, in pixels from the upper left."""
    scales = np.array([fields["dimensions"][axis][0] for axis in "xyz"])
    scales = scales * [fields.get("relativeDisplayScales", {}).get(axis, 1) for axis in "xyz"]
    factors = scales / scales.min()
    layout = fields["layout"]
    orthographic = isinstance(layout, dict) and layout.get("orthographicProjection", False)
    f = 1 / math.tan(math.pi / 8)
    zoom = fields["projectionScale"] / 2 * (1 if orthographic else f)
    # The inverse view: rotate, scale each row to voxels, put at the position, flip y and z, step back by one.
    inverse = np.eye(4)
    inverse[:3, :3] = rotation(fields["projectionOrientation"]) * (zoom / factors)[:, None]
    inverse[:3, 3] = fields["position"]
    inverse = inverse @ np.diag([1, -1, -1, 1.0])
    step = np.eye(4)
    step[2, 3] = 1
    x, y, z, _ = np.linalg.inv(inverse @ step) @ [*voxel, 1.0]
    width, height = SIZE
    x, y = (x, y) if orthographic else (x * f / -z, y * f / -z)
    return (x / (width / height) + 1) / 2 * width, (1 - y) / 2 * height


def opened(fields, folder, **keywords):
    path = folder / "state.json"
    path.write_text(json.dumps(fields))
    return pumice.open_state(path, size=SIZE, **keywords)


def hash_color(label, seed=0):
    def mixed(state, value):
        value = value * 0xCC9E2D51 & 0xFFFFFFFF
        value = (value << 15 | value >> 17) & 0xFFFFFFFF
        state ^= value * 0x1B873593 & 0xFFFFFFFF
        state = (state << 13 | state >> 19) & 0xFFFFFFFF
        return (state * 5 + 0xE6546B64) & 0xFFFFFFFF

    h = mixed(mixed(seed, label & 0xFFFFFFFF), label >> 32)
    hue, saturation = (h & 0xFF) / 255 * 6, 0.5 + 0.5 * (h >> 8 & 0xFF) / 255
    part = hue - int(hue)
    a, b, c = 1 - saturation, 1 - saturation * part, 1 - saturation * (1 - part)
    return [(1, c, a), (b, 1, a), (a, 1, c), (a, b, 1), (c, a, 1), (1, a, b)][int(hue) % 6]


def linear(srgb):
    srgb = np.array(srgb)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


VIEWS = {
    "along z": {},
    "turned": {"projectionOrientation": [0.3, -0.5, 0.2, 0.7]},
    "from behind": {"projectionOrientation": [0.0, 1.0, 0.1, 0.2], "projectionScale": 260.0},
    "parallel rays": {"projectionOrientation": [-0.4, 0.2, 0.6, 0.3], "layout": {"type": "3d", "orthographicProjection": True}},
    "stretched": {"relativeDisplayScales": {"z": 0.5, "x": 1.5}, "projectionOrientation": [0.3, -0.5, 0.2, 0.7]},
}


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("says_dimensions", [True, False])
def test_cells_are_where_neuroglancer_draws_them(stored, view, says_dimensions):
    """A state without `dimensions` has those of its first layer, 16 × 16 × 40 nm."""
    fields = state(**VIEWS[view])
    scene, volumes = opened({name: value for name, value in fields.items() if says_dimensions or name != "dimensions"}, stored)
    ids = pumice.render(scene, volumes, spp=1).ids()
    seen = 0
    for label, centre in CENTRES.items():
        x, y = pixel_of(fields, np.array(centre) + 0.5 + OFFSET)
        if 2 < x < SIZE[0] - 2 and 2 < y < SIZE[1] - 2:
            assert ids[int(y), int(x)] == label, (label, x, y)
            seen += 1
    assert seen >= 3
    # The control: a state that is turned a little more shows them elsewhere.
    turned = fields | {"projectionOrientation": [a + b for a, b in zip(fields["projectionOrientation"], (0.2, 0, 0, 0), strict=True)]}
    places = [pixel_of(turned, np.array(centre) + 0.5 + OFFSET) for centre in CENTRES.values()]
    inside = [(int(y), int(x)) for x, y in places if 0 <= x < SIZE[0] and 0 <= y < SIZE[1]]
    assert sum(ids[place] != 0 for place in inside) < len(CENTRES) - 1


def test_colors_are_those_of_the_state_or_of_neuroglancer(stored):
    def colors(fields):
        scene, volumes = opened(fields, stored)
        picture = pumice.render(scene, volumes, spp=1)
        ids = picture.ids()
        return {label: picture.passes["albedo"][ids == label][0] for label in CENTRES if (ids == label).any()}

    plain = colors(state())
    assert len(plain) == len(CENTRES)
    for label, color in plain.items():
        assert color == pytest.approx(linear(hash_color(label)), abs=2e-3), label
    seeded = colors(layer_of(state(), colorSeed=2_000_000_001, saturation=0.25))
    for label, color in seeded.items():
        mixed = np.array(hash_color(label, 2_000_000_001)) * 0.25 + 0.75
        assert color == pytest.approx(linear(mixed), abs=2e-3), label
    own = colors(layer_of(state(), segmentColors={"11": "#e0a030"}, segmentDefaultColor="#2060c0"))
    assert own[11] == pytest.approx(linear(np.array([0xE0, 0xA0, 0x30]) / 255), abs=2e-3)
    assert own[12] == pytest.approx(linear(np.array([0x20, 0x60, 0xC0]) / 255), abs=2e-3)


def test_segments_are_hidden_and_joined(stored):
    def shown(fields):
        scene, volumes = opened(fields, stored)
        [instance] = scene.to_dict()["instances"]
        return sorted(instance["style"]["show"]["only"])

    assert shown(layer_of(state(), segments=["11", "!12", 13])) == [11, 13]
    joined = layer_of(state(), segments=["12"], equivalences=[["12", "13"], [15, "13"], ["11", "99"]])
    assert shown(joined) == [12, 13, 15]
    scene, volumes = opened(joined, stored)
    picture = pumice.render(scene, volumes, spp=1)
    albedo, ids = picture.passes["albedo"], picture.ids()
    assert albedo[ids == 15][0] == pytest.approx(linear(hash_color(12)), abs=2e-3), "the lowest of the joined"
    linked = state()
    linked["layers"] = [
        {"type": "segmentation", "name": "a", "source": "cells", "segments": ["11"], "visible": False},
        {"type": "segmentation", "name": "b", "source": "cells", "linkedSegmentationGroup": "a"},
    ]
    assert shown(linked) == [11]


def test_what_is_left_out_is_said(stored):
    fields = layer_of(state(), segments=["11", "99"], objectAlpha=0.5)
    fields["layers"] += [{"type": "image", "name": "em", "source": "precomputed://gs://b/em"}, {"type": "segmentation", "name": "none", "source": "x"}]
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        scene, volumes = opened(fields, stored)
    text = "\n".join(str(warning.message) for warning in said)
    assert "layer em is left out: image" in text and "layer none is left out: no segment" in text
    assert "1 of 2 segments are not in" in text and "such as 99" in text
    assert len(volumes) == 1
    [group] = scene.to_dict()["instances"][0]["style"]["groups"]
    assert group["material"]["alpha"] == 0.5
    behind = opened(state(projectionBackgroundColor="#ffffff"), stored)[0].to_dict()["film"]
    assert behind["background"] == [1, 1, 1] and behind["transparent"]


def test_states_of_old_show_the_same(stored):
    now, _ = opened(state(), stored)
    fields = state()
    old = {
        "navigation": {"pose": {"position": {"voxelSize": list(NM), "voxelCoordinates": fields["position"]}}},
        "perspectiveOrientation": fields["projectionOrientation"],
        "perspectiveZoom": fields["projectionScale"] * 16 / (200 * math.tan(math.pi / 8)),
        "layers": {"cells": {"source": "precomputed://cells", "segments": list(map(str, CENTRES))}},
    }
    before, _ = opened(old, stored)
    assert np.allclose(now.to_dict()["camera"]["world_from_camera"], before.to_dict()["camera"]["world_from_camera"], rtol=1e-12)
    places = [scene.to_dict()["instances"][0]["world_from_index"] for scene in (now, before)]
    assert np.allclose(*places, rtol=1e-12)


def test_without_a_view_all_is_seen(stored):
    fields = state()
    del fields["position"], fields["projectionScale"]
    scene, volumes = opened(fields, stored)
    assert set(np.unique(pumice.render(scene, volumes, spp=1).ids())) >= {0, 12, 13, 15}


def test_the_command_draws_states_and_links(command, stored, tmp_path):
    fields = state("precomputed://gs://bucket/cells")
    path = tmp_path / "state.json"
    path.write_text(json.dumps(fields))
    flags = ("--size", "160x120", "--spp", "4")
    line = run(command, "render", path, "-o", tmp_path / "no.png").refused()
    assert "layer cells lies on a server, at precomputed://gs://bucket/cells" in line and "--layer-file cells=PATH" in line
    copied = ("--layer-file", f"cells={stored / 'cells.pumice'}")
    run(command, "render", path, *copied, *flags, "-o", tmp_path / "a.exr", "--save-scene", tmp_path / "scene.json").fine()
    run(command, "render", tmp_path / "scene.json", *flags, "-o", tmp_path / "b.exr").fine()
    link = "https://neuroglancer-demo.appspot.com/#!" + urllib.parse.quote(json.dumps(fields))
    run(command, "render", link, *copied, *flags, "-o", tmp_path / "c.exr").fine()
    run(command, "render", "--again", tmp_path / "c.exr", "-o", tmp_path / "d.exr").fine()
    first, *others = (pumice.open_picture(tmp_path / f"{name}.exr").color for name in "abcd")
    assert first.any() and all(np.array_equal(first, other) for other in others)
    for args, expected in (
        (("--layer-file", "nuclei=x.pumice"), "the state shows no such layer; it shows cells"),
        ((*copied, "--view", "1,2"), "is a state of Neuroglancer, which says that itself"),
        ((*copied, "--labels", "11"), "is a state of Neuroglancer, which says that itself"),
        (("--layer-file", "cells"), "expected NAME=PATH"),
        ((*copied, "--time-steps", "all"), "shows one time step"),
    ):
        assert expected in run(command, "render", path, *args, "-o", tmp_path / "no_1.png").refused(), args
    line = run(command, "render", stored / "cells.pumice", *copied, "-o", tmp_path / "no.png").refused()
    assert "is no state of Neuroglancer" in line
    assert not (tmp_path / "no.png").exists()


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"dimensions": {"x": [1, "m"], "y": [1, "m"]}}, "there is no z"),
        ({"dimensions": {"x": [1, "m"], "y": [1, "m"], "z": [1, "s"]}}, "expected a length in m"),
        ({"dimensions": {"x": [0, "m"], "y": [1, "m"], "z": [1, "m"]}}, "expected lengths above 0"),
        ({"dimensions": 7}, "expected an object"),
        ({"displayDimensions": ["x", "y", "t"]}, "displayDimensions: expected x, y, z"),
        ({"position": [1, 2]}, "position: expected a number for each"),
        ({"projectionOrientation": [0, 0, 0, 0]}, "expected a rotation"),
        ({"projectionScale": -1}, "projectionScale: expected a number above 0"),
        ({"projectionBackgroundColor": "mauve"}, "projectionBackgroundColor: expected a colour"),
        ({"layers": []}, "expected a layer of segments"),
        ({"layers": 3}, "layers: expected a list"),
    ],
)
def test_wrong_states_are_refused(stored, changes, expected):
    with pytest.raises(pumice.InputError, match=expected):
        opened(state() | changes, stored)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"segments": ["eleven"]}, "expected the id of a segment"),
        ({"segments": {"11": True}}, "layer cells: invalid type: map, expected a sequence"),
        ({"segments": ["-3"]}, "expected the id of a segment"),
        ({"segments": [str(2**64)]}, "expected the id of a segment"),
        ({"segments": ["98", "99"]}, "it has none of the 2 segments, such as 98"),
        ({"segmentColors": {"11": "blue-ish"}}, "segmentColors: expected a colour"),
        ({"source": None}, "source: expected a URL"),
        ({"source": {"url": "cells", "transform": {"matrix": [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]}}}, "without a transform"),
        ({"source": "precomputed://nowhere"}, "nowhere"),
        ({"linkedSegmentationGroup": "other"}, "there is no layer other"),
    ],
)
def test_wrong_layers_are_refused(stored, changes, expected):
    with pytest.raises(pumice.InputError, match=expected):
        opened(layer_of(state(), **changes), stored)


def test_wrong_links_are_refused(stored):
    with pytest.raises(pumice.InputError, match="the state lies on a server"):
        pumice.open_state("https://neuroglancer-demo.appspot.com/#!gs://bucket/state.json")
    with pytest.raises(pumice.InputError, match="state"):
        pumice.open_state("https://neuroglancer-demo.appspot.com/#!%7Bnot json")
    with pytest.raises(pumice.InputError, match=r"missing\.json: No such file"):
        pumice.open_state(stored / "missing.json")
    for name, text in (("scene.json", '{"version": 1, "layers": []}'), ("none.json", "[1]"), ("broken.json", '{"layers": [')):
        (stored / name).write_text(text)
        with pytest.raises(pumice.InputError, match="expected a state of Neuroglancer, got another file"):
            pumice.open_state(stored / name)


def test_layers_are_named_without_opening_them(tmp_path, monkeypatch):
    """Files relative to the state's file, or to the working folder; URLs as they are written."""
    hidden = {"type": "segmentation", "name": "hidden", "source": "precomputed://b", "segments": ["1"], "visible": False}
    image = {"type": "image", "name": "em", "source": "precomputed://gs://bucket/em"}
    for url, expected in [
        ("precomputed://cells", tmp_path / "cells"),
        ("precomputed://file:///data/the%20cortex", "/data/the cortex"),
        ("precomputed://gs://bucket/cortex", "precomputed://gs://bucket/cortex"),
        ("https://server/cells.zarr/|zarr2:", "https://server/cells.zarr/|zarr2:"),
    ]:
        fields = state(url)
        fields["layers"] += [hidden, image]
        (tmp_path / "state.json").write_text(json.dumps(fields))
        assert pumice.state_layers(tmp_path / "state.json") == {"cells": str(expected)}
        if not isinstance(expected, str):
            monkeypatch.chdir(tmp_path)
            expected = "cells"
        for given in (fields, "https://neuroglancer-demo.appspot.com/#!" + urllib.parse.quote(json.dumps(fields))):
            assert pumice.state_layers(given) == {"cells": str(expected)}
    assert pumice.is_on_server("precomputed://gs://bucket/cortex") and not pumice.is_on_server(tmp_path / "cells")
    with pytest.raises(pumice.InputError, match="layer cells: graphene://https://server/table: expected a file, or a store"):
        pumice.state_layers(state("graphene://https://server/table"))
