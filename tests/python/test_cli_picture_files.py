"""Tests half floats and view transforms, in files read by independent readers."""

import json

import numpy as np
import pytest
from command import run
from exr_planes import planes
from PIL import Image


@pytest.fixture(scope="module")
def scene(pumice, data, tmp_path_factory):
    """A folder with a scene of a shipped volume (s.json), and the same under an extremely bright sun (bright.json)."""
    folder = tmp_path_factory.mktemp("files")
    path = data / "slicer_Segmentation.seg.nrrd"
    run(pumice, "render", path, "-o", folder / "a.exr", "--size", "48x32", "--spp", "1", "--save-scene", folder / "s.json").fine()
    fields = json.loads((folder / "s.json").read_text())
    fields["film"].update(passes=["diffuse_direct", "normal", "samples", "cryptomatte_label"], transparent=True)
    # Bright enough that all channels of some pixels exceed 1.
    fields["suns"][0]["strength"], fields["world"]["environment"] = 4.0, {"constant": {"radiance": [1, 1, 1]}}
    (folder / "s.json").write_text(json.dumps(fields))
    fields["suns"] = [{"direction": [0.3, 0.2, -1], "strength": 4e6, "color": [1, 0.01, 1e-7], "angle_rad": 0}]
    (folder / "bright.json").write_text(json.dumps(fields))
    return folder


def drawn(pumice, scene, out, *more):
    run(pumice, "render", scene, "-o", out, "--spp", "8", "--backend", "cpu", *more).fine()
    return out


def test_colours_are_the_nearest_halves_and_all_else_is_whole(pumice, scene, tmp_path):
    for name in ("s.json", "bright.json"):
        whole = planes(drawn(pumice, scene / name, tmp_path / "whole.exr"))
        half = planes(drawn(pumice, scene / name, tmp_path / "half.exr", "--half"))
        assert set(half) == set(whole)
        for channel, values in half.items():
            is_color = channel in "RGBA" or any(f".{layer}." in channel for layer in ("DiffDir", "Normal", "Denoising Albedo"))
            assert (values.dtype == np.float16) == is_color, channel
            assert whole[channel].dtype == (np.uint32 if channel == "label.index" else np.float32)
            # numpy rounds to nearest, ties to even. Clipping comes first, since larger values would become infinite.
            expected = np.clip(whole[channel], -65504, 65504).astype(np.float16) if is_color else whole[channel]
            np.testing.assert_array_equal(values.view(np.uint8), expected.view(np.uint8), channel)
        assert (half["R"] == 65504).any() == (name == "bright.json"), name
        assert (tmp_path / "half.exr").stat().st_size < 0.8 * (tmp_path / "whole.exr").stat().st_size


def test_halves_are_made_again_and_compared(pumice, scene, tmp_path):
    whole = drawn(pumice, scene / "s.json", tmp_path / "whole.exr")
    half = drawn(pumice, scene / "s.json", tmp_path / "half.exr", "--half")
    run(pumice, "render", "--again", half, "-o", tmp_path / "again.exr").fine()
    assert half.read_bytes() == (tmp_path / "again.exr").read_bytes()
    assert half.read_bytes() != whole.read_bytes()
    report = json.loads(run(pumice, "compare", half, whole, "--json", "-").fine())
    assert 0 < report["rel_mse"] < 1e-6, "only the rounding to halves, (2^-12)^2"


def shown(path):
    return np.asarray(Image.open(path).convert("RGB")).astype(float)


def test_views_are_told_apart_and_made_again(pumice, scene, tmp_path):
    pictures = {}
    for view in ("standard", "filmic", "agx"):
        png = drawn(pumice, scene / "s.json", tmp_path / f"{view}.png", "--view-transform", view)
        pictures[view] = shown(png)
        run(pumice, "render", "--again", png, "-o", tmp_path / "again.png").fine()
        assert png.read_bytes() == (tmp_path / "again.png").read_bytes()
    plain = shown(drawn(pumice, scene / "s.json", tmp_path / "plain.png"))
    np.testing.assert_array_equal(plain, pictures["standard"])
    # An EXR is scene-linear, whatever view transform the scene has.
    fields = json.loads((scene / "s.json").read_text())
    fields["film"]["view_transform"] = "agx"
    (scene / "agx.json").write_text(json.dumps(fields))
    linear = planes(drawn(pumice, scene / "agx.json", tmp_path / "a.exr"))
    np.testing.assert_array_equal(linear["R"], planes(drawn(pumice, scene / "s.json", tmp_path / "b.exr"))["R"])
    # (Blender 5.0.1 shows middle grey, 0.18, as 118, 128, 118.) Where all channels exceed 1, standard is white and filmic is not.
    alpha = linear["A"]
    straight = np.stack([np.divide(linear[c], alpha, out=np.zeros_like(alpha), where=alpha > 0) for c in "RGB"], axis=-1)
    bright = (straight > 1.2).all(axis=-1)
    assert (pictures["standard"][bright] == 255).all() and (pictures["filmic"][bright] < 255).all()
    apart = {v: np.abs(pictures[v] - plain).mean() for v in ("filmic", "agx")}
    assert min(apart.values()) > 2 and np.abs(pictures["filmic"] - pictures["agx"]).mean() > 2, apart


@pytest.mark.parametrize(
    ("film", "what"),
    [({"view_transform": "AgX"}, "agx"), ({"view_transform": 1}, "view_transform"), ({"half": 1}, "boolean"), ({"half": "yes"}, "boolean")],
)
def test_wishes_that_are_none_are_refused(pumice, scene, tmp_path, film, what):
    fields = json.loads((scene / "s.json").read_text())
    fields["film"].update(film)
    (tmp_path / "s.json").write_text(json.dumps(fields))
    line = run(pumice, "render", tmp_path / "s.json", "-o", tmp_path / "a.png").refused()
    assert what in line or "expected" in line, line
    run(pumice, "render", "--again", scene / "a.exr", "-o", tmp_path / "a.exr", "--half").refused()
    assert "--half" in run(pumice, "render", scene / "s.json", "-o", tmp_path / "a.png", "--half").refused()
    run(pumice, "render", "--again", scene / "a.exr", "-o", tmp_path / "a.png", "--view-transform", "agx").refused()
    assert not list(tmp_path.glob("a.*"))
