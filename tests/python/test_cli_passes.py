"""Tests passes, transparent film and clamps, in files read by an independent decoder."""

import json

import flip_evaluator
import numpy as np
import pytest
from command import run
from exr_planes import planes
from PIL import Image

KINDS = [("Diff", 3), ("Gloss", 3), ("Trans", 3)]
LIGHT = [f"{kind}{part}" for kind, _ in KINDS for part in ("Dir", "Ind", "Col")] + ["Emit", "Env"]


@pytest.fixture(scope="module")
def scene(pumice, data, tmp_path_factory):
    """A scene file of a shipped volume under sky and sun: glossy labels, and one that is glass and emits."""
    folder = tmp_path_factory.mktemp("passes")
    path = data / "slicer_Segmentation.seg.nrrd"
    run(pumice, "render", path, "-o", folder / "a.exr", "--size", "48x32", "--spp", "1", "--save-scene", folder / "s.json").fine()
    fields = json.loads((folder / "s.json").read_text())
    fields["settings"]["bounces"] = 4
    (style,) = [instance["style"] for instance in fields["instances"]]
    style["material"].update(specular=0.5, ior=1.5, roughness=0.4)
    style["materials"]["1"] = {"base_color": [0.9, 0.8, 0.4], "transmission": 0.8, "emission": [0.1, 0.2, 0.0]}
    (folder / "s.json").write_text(json.dumps(fields))
    return folder / "s.json"


def drawn(pumice, scene, out, *more):
    run(pumice, "render", scene, "-o", out, "--spp", "8", "--backend", "cpu", *more).fine()
    return planes(out)


def rgb(of, layer):
    return np.stack([of[f"{layer}{c}"] for c in "RGB"], axis=-1)


def recombined(of, without=None):
    layer = lambda name: 0.0 * rgb(of, "") if name == without else rgb(of, f"ViewLayer.{name}.")  # noqa: E731
    light = sum((layer(f"{k}Dir") + layer(f"{k}Ind")) * layer(f"{k}Col") for k, _ in KINDS)
    return light + layer("Emit") + layer("Env")


def test_light_passes_add_up_to_the_picture(pumice, scene, tmp_path):
    got = drawn(pumice, scene, tmp_path / "a.exr", "--passes", "light")
    assert set(got) == {*"RGB", *(f"ViewLayer.{name}.{c}" for name in LIGHT for c in "RGB")}
    color = rgb(got, "")
    # Both are sums of 8 samples of some dozen contributions each, in 32 bits.
    bound = 3e-5 * np.maximum(color, 1e-3)
    assert (np.abs(recombined(got) - color) <= bound).all()
    for name in LIGHT:
        if rgb(got, f"ViewLayer.{name}.").any():
            assert (np.abs(recombined(got, name) - color) > bound).any(), f"{name} can be done without"
    assert all(rgb(got, f"ViewLayer.{name}.").any() for name in ("DiffDir", "GlossDir", "GlossInd", "Emit", "Env"))
    # The colour is that of a picture without passes, also by NVIDIA's reader.
    plain = drawn(pumice, scene, tmp_path / "b.exr", "--passes", "none")
    assert set(plain) == set("RGB") and np.array_equal(rgb(plain, ""), color)
    assert np.array_equal(np.asarray(flip_evaluator.load(str(tmp_path / "a.exr")))[..., :3], color)


def test_the_scene_asks_and_again_repeats(pumice, scene, tmp_path):
    fields = json.loads(scene.read_text())
    fields["film"].update(passes=["emission", "samples"], transparent=True)
    (tmp_path / "s.json").write_text(json.dumps(fields))
    got = drawn(pumice, tmp_path / "s.json", tmp_path / "a.exr")
    assert {"A", "ViewLayer.Emit.G", "ViewLayer.Debug Sample Count.X", "ViewLayer.Position.Z"} <= set(got)
    assert "ViewLayer.Env.R" not in got and (got["ViewLayer.Debug Sample Count.X"] == 8).all()
    run(pumice, "render", "--again", tmp_path / "a.exr", "-o", tmp_path / "b.exr").fine()
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_a_transparent_film(pumice, scene, tmp_path):
    got = drawn(pumice, scene, tmp_path / "a.exr", "--transparent", "--passes", "environment,label,position,depth")
    opaque = drawn(pumice, scene, tmp_path / "b.exr", "--passes", "none")
    alpha, color = got["A"][..., None], rgb(got, "")
    assert 0 < alpha.mean() < 1 and alpha.min() == 0 and alpha.max() == 1 and ((0 < alpha) & (alpha < 1)).any()
    assert (color[alpha[..., 0] == 0] == 0).all()
    # Composited over the environment it is the opaque picture, up to the rounding of sums of 8 samples in 32 bits.
    over = color + rgb(got, "ViewLayer.Env.")
    assert np.abs(over - rgb(opaque, "")).max() <= 8 * 2.0**-23 * max(1.0, over.max())
    inside = (got["label.index"] > 0) & (alpha[..., 0] == 1)
    assert inside.any() and np.isinf(got["ViewLayer.Depth.Z"][got["label.index"] == 0]).all()
    assert got["label.index"].dtype == np.uint32
    # A PNG has unassociated colours and linear alpha.
    run(pumice, "render", scene, "-o", tmp_path / "a.png", "--spp", "8", "--backend", "cpu", "--transparent").fine()
    png = Image.open(tmp_path / "a.png")
    assert png.mode == "RGBA"
    png = np.asarray(png).astype(float)
    assert np.abs(png[..., 3] - 255 * alpha[..., 0]).max() <= 0.5 + 1e-4
    straight = np.clip(np.divide(color, alpha, out=np.zeros_like(color), where=alpha > 0), 0, 1).astype(float)
    encoded = 255 * np.where(straight <= 0.0031308, 12.92 * straight, 1.055 * straight ** (1 / 2.4) - 0.055)
    assert np.abs(png[..., :3] - encoded).max() <= 0.5 + 1e-3
    run(pumice, "render", scene, "-o", tmp_path / "b.png", "--spp", "1", "--backend", "cpu").fine()
    assert Image.open(tmp_path / "b.png").mode == "RGB"


def test_clamps_darken(pumice, scene, tmp_path):
    plain = rgb(drawn(pumice, scene, tmp_path / "a.exr", "--passes", "none"), "")
    fields = json.loads(scene.read_text())
    pictures = {}
    for which in ("clamp_direct", "clamp_indirect"):
        fields["settings"].update({"clamp_direct": 0.0, "clamp_indirect": 0.0, which: 0.02})
        (tmp_path / "s.json").write_text(json.dumps(fields))
        pictures[which] = rgb(drawn(pumice, tmp_path / "s.json", tmp_path / "b.exr", "--passes", "none"), "")
        assert (pictures[which] <= plain * (1 + 1e-5)).all() and (pictures[which] < plain * 0.99).any(), which
    assert pictures["clamp_direct"].mean() < 0.5 * plain.mean()
    # The sky in the corner is direct light, which only the direct clamp changes.
    sky = drawn(pumice, scene, tmp_path / "c.exr", "--passes", "label")["label.index"] == 0
    corner = sky[:2, :2].all() and np.array_equal(pictures["clamp_indirect"][:2, :2], plain[:2, :2])
    assert corner and not np.array_equal(pictures["clamp_direct"][:2, :2], plain[:2, :2])


@pytest.mark.parametrize(
    ("film", "what"),
    [
        ({"passes": ["beauty"]}, "beauty"),
        ({"passes": ["all"]}, "`all`"),
        # Errors of types give line and column, as everywhere in a scene.
        ({"passes": "light"}, "expected a sequence"),
        ({"passes": None}, "expected a sequence"),
        ({"transparent": 1}, "expected a boolean"),
    ],
)
def test_scenes_that_ask_for_what_is_none_are_refused(pumice, scene, tmp_path, film, what):
    fields = json.loads(scene.read_text())
    fields["film"].update(film)
    (tmp_path / "s.json").write_text(json.dumps(fields))
    line = run(pumice, "render", tmp_path / "s.json", "-o", tmp_path / "a.exr").refused()
    assert what in line, line
    assert not (tmp_path / "a.exr").exists()


def test_names_that_are_none_are_refused(pumice, scene, tmp_path):
    for names in ("beauty", "light,all", "none,depth", "Light", ""):
        line = run(pumice, "render", scene, "-o", tmp_path / "a.exr", "--passes", names).refused()
        assert "passes" in line, line
    run(pumice, "render", "--again", tmp_path / "x.exr", "-o", tmp_path / "a.exr", "--transparent").refused()
