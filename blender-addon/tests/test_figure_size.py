# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests size, presets and estimate of a figure: millimeters against plain arithmetic, the density in a file, a probe against the picture."""

import importlib
import json
import math
import re
import struct
import types

import numpy as np
import pumice
import pytest

from test_real_volumes import exr, scene  # noqa: F401


@pytest.fixture
def empty(blender):
    return blender.context.scene


@pytest.mark.parametrize("width,height,dpi,pixels", [(89.0, 60.0, 300, (1051, 709)), (183.0, 120.0, 600, (4323, 2835)), (25.4, 50.8, 72, (72, 144))])
def test_paper_is_what_output_says(empty, width, height, dpi, pixels):
    figure, render = empty.pumice_figure, empty.render
    render.resolution_percentage, render.pixel_aspect_x = 50, 2.0
    figure.width_mm, figure.height_mm, figure.dpi = width, height, dpi
    assert (render.resolution_x, render.resolution_y) == pixels == (math.floor(width / 25.4 * dpi + 0.5), math.floor(height / 25.4 * dpi + 0.5))
    assert render.resolution_percentage == 100 and render.pixel_aspect_x == render.pixel_aspect_y
    # Another dpi is another number of pixels on the same paper.
    figure.dpi = 2 * dpi
    assert abs(render.resolution_x - 2 * pixels[0]) <= 1 and figure.width_mm == pytest.approx(width)


def test_output_changed_by_hand_is_seen_and_taken(empty, blender, extension):
    sizes = importlib.import_module(f"{extension.__name__}.figure_settings")
    assert sizes.is_written(empty), "what Blender starts with is what the figure starts with"
    empty.render.resolution_x, empty.render.resolution_percentage = 1000, 50
    assert not sizes.is_written(empty)
    assert blender.ops.pumice.figure_size(action="READ") == {"FINISHED"}
    figure = empty.pumice_figure
    assert figure.width_mm == pytest.approx(500 / 300 * 25.4) and figure.height_mm == pytest.approx(540 / 300 * 25.4)
    assert (empty.render.resolution_x, empty.render.resolution_y, empty.render.resolution_percentage) == (500, 540, 100)
    empty.render.resolution_y = 77
    assert blender.ops.pumice.figure_size(action="WRITE") == {"FINISHED"} and empty.render.resolution_y == 540


def test_presets_keep_the_paper(empty, blender):
    figure, wishes = empty.pumice_figure, empty.pumice
    empty.render.resolution_x, empty.render.resolution_y = 900, 600
    for preset, dpi, samples, error, bounces in (("FINAL", 600, 65536, 0.5, 32), ("DRAFT", 100, 64, 10.0, 4), ("FIGURE", 300, 4096, 2.0, 16)):
        assert blender.ops.pumice.figure_preset(preset=preset) == {"FINISHED"}
        assert (empty.render.resolution_x, empty.render.resolution_y) == (3 * dpi, 2 * dpi), "900 × 600 at 300 dpi are 3 × 2 inches"
        assert (wishes.samples, wishes.bounces, wishes.use_error) == (samples, bounces, True) and wishes.error_percent == pytest.approx(error)
        assert figure.dpi == dpi
    for name in ("PUMICE_OT_figure_preset", "PUMICE_OT_figure_size", "PUMICE_OT_add_scale_bar", "PUMICE_OT_add_legend"):
        assert "UNDO" in blender.types.Operator.bl_rna_get_subclass_py(name).bl_options


def test_a_png_has_the_density(scene, blender, tmp_path):  # noqa: F811
    if not hasattr(scene.render, "ppm_factor"):
        assert blender.app.version < (5, 0, 0), "Blender writes a density since 5.0"
        return
    scene.pumice_figure.dpi, scene.pumice_figure.width_mm, scene.pumice_figure.height_mm = 127, 8.0, 4.0
    image = scene.render.image_settings
    image.media_type, image.file_format, scene.render.filepath = "IMAGE", "PNG", str(tmp_path / "a.png")
    blender.ops.render.render(write_still=True)
    data = (tmp_path / "a.png").read_bytes()
    at = data.index(b"pHYs") + 4
    # 127 dpi are 5,000 pixels a metre (ISO/IEC 15948 §11.3.5.3).
    assert struct.unpack_from(">IIB", data, at) == (5000, 5000, 1)
    assert struct.unpack_from(">II", data, 16) == (40, 20)


def test_a_backdrop_is_seen_and_lights_nothing(scene, blender, extension, tmp_path):  # noqa: F811
    scene.render.filepath = str(tmp_path / "a.exr")

    def drawn():
        blender.ops.render.render(write_still=True)
        found = exr(scene.render.filepath)
        return np.stack([found[f"Combined.{c}"] for c in "RGBA"], axis=2)

    world = drawn()
    figure = scene.pumice_figure
    figure.use_backdrop, figure.backdrop = True, (0.1, 0.7, 0.3)
    seen = drawn()
    assert any("backdrop" in line for line in importlib.import_module(f"{extension.__name__}.usd_stage").lacks_of(blender.context))
    scene.render.film_transparent = True
    alpha = drawn()[..., 3]
    volume, behind = alpha == 1.0, alpha == 0.0
    assert volume.sum() > 100 and behind.sum() > 100
    assert np.array_equal(seen[volume], world[volume]), "the volume is lit by the world, bit for bit"
    # Single precision, and a mean of four equal samples.
    assert np.allclose(seen[behind], (0.1, 0.7, 0.3, 1.0), atol=1e-6)
    assert not np.allclose(world[behind], (0.1, 0.7, 0.3, 1.0), atol=0.1), "negative control"


def test_the_estimate_is_near_what_the_picture_says(scene, blender):  # noqa: F811
    scene.pumice.samples = 256
    assert blender.ops.pumice.figure_estimate() == {"FINISHED"}
    number = r"for ([\d,]+) samples"
    said = re.fullmatch(
        rf"About [\d.]+ \w+ {number} of 48 × 32 pixels, error about ([\d.]+) % \(a guess from \d+ samples\)", scene.pumice_figure.estimate
    )
    assert said, scene.pumice_figure.estimate
    picture = rendered(blender)
    assert int(said[1]) == picture["spp"] == 256
    # The probe has at least 16 samples, the estimates of which are right to a third; samples that are spread evenly do better than the root.
    assert picture["error_estimate"] / 2.5 < float(said[2]) / 100 < 2.5 * picture["error_estimate"]
    # With a target, the samples follow from it: so many have about that error.
    target = 2 * picture["error_estimate"]
    scene.pumice.samples, scene.pumice.use_error, scene.pumice.error_percent = 65536, True, 100 * target
    assert blender.ops.pumice.figure_estimate() == {"FINISHED"}
    scene.pumice.samples = int(re.search(number, scene.pumice_figure.estimate)[1].replace(",", ""))
    scene.pumice.use_error = False
    assert target / 2.5 < rendered(blender)["error_estimate"] < 2.5 * target


def rendered(bpy):
    """Figures of F12's picture: its error is in the file."""
    found = []
    original = pumice.Renderer.render
    pumice.Renderer.render = lambda *a, **k: found.append(original(*a, **k)) or found[-1]
    try:
        assert bpy.ops.render.render() == {"FINISHED"}
    finally:
        pumice.Renderer.render = original
    return {"spp": found[0].spp, "error_estimate": found[0].error_estimate}


def test_an_estimate_is_arithmetic(extension):
    """A probe of 16 samples in 2 s with an error of 8 %, for a picture of nine times as many pixels."""
    operators = importlib.import_module(f"{extension.__name__}.figure_operators")
    probe = types.SimpleNamespace(spp=16, seconds=2.0, error_estimate=0.08)
    guess = lambda **limits: operators.estimate(probe, 100, (30, 30), {"spp": 64, "seconds": None, "error": None, **limits})  # noqa: E731
    assert guess() == "About 72 s for 64 samples of 30 × 30 pixels, error about 4 % (a guess from 16 samples)"
    assert guess(spp=10**6, error=0.01).startswith("About 19 min for 1,024 samples of 30 × 30 pixels, error about 1 %")
    assert guess(spp=10**6, seconds=18.0) == "About 18 s for 16 samples of 30 × 30 pixels, error about 8 % (a guess from 16 samples)"
    probe.error_estimate = math.inf
    assert "too few samples" in guess()
    film = {"width": 3000, "height": 2000, "passes": ["depth"], "filter": {"box": {"width": 1.0}}}
    small = operators.probe_film(film)
    assert json.dumps(small, sort_keys=True) == json.dumps({"width": 245, "height": 163, "filter": film["filter"]}, sort_keys=True)
    assert operators.probe_film({"width": 30, "height": 20}) == {"width": 30, "height": 20}
