"""Tests `pumice bench denoise` on a small volume: a row for each picture, less error after denoising, and what it refuses."""

import csv
import re

import pytest
from command import run

TINY = ["--pick", 6, "--size", "48x32", "--bounces", 2, "--reference-spp", 256]


@pytest.fixture(scope="module")
def measured(pumice, data, tmp_path_factory):
    out = tmp_path_factory.mktemp("denoise") / "made" / "here"
    flags = ["--only", "sky-floor", "--spp", "1,8", "--out", out]
    said = run(pumice, "bench", "denoise", data / "slicer_Segmentation.seg.nrrd", *TINY, *flags).fine()
    assert str(out / "denoise.md") in said
    return out


def test_each_picture_has_a_row_with_and_without_the_denoiser(measured):
    with (measured / "denoise.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(r["scene"], r["samples"], r["denoiser"]) for r in rows] == [
        ("sky-floor", spp, name) for spp in ("1", "8") for name in ("none", "Pumice")
    ]
    for raw, smooth in zip(rows[::2], rows[1::2], strict=True):
        assert float(smooth["relMSE"]) < 0.7 * float(raw["relMSE"]), (raw, smooth)
        assert float(smooth["CPU s"]) >= float(raw["CPU s"]) and raw["of which denoising"] == "0.000"
    assert "## sky-floor\n" in (measured / "denoise.md").read_text()
    assert (measured / "denoise_sky-floor.svg").read_text().startswith("<svg")


@pytest.mark.turn(2, 4)
def test_a_vulkan_backend_draws_and_denoises_the_same_pictures(pumice, data, measured, tmp_path):
    flags = ["--only", "sky-floor", "--spp", "8", "--backend", "vulkan-compute", "--out", tmp_path]
    run(pumice, "bench", "denoise", data / "slicer_Segmentation.seg.nrrd", *TINY, *flags).fine()
    page = (tmp_path / "denoise.md").read_text()
    drawn = re.search("Drawn and denoised by vulkan-compute on (.+)[.]\n", page)
    assert drawn and "the processor denoises" not in page, page
    assert "Drawn and denoised by cpu on " in (measured / "denoise.md").read_text()
    with (tmp_path / "denoise.csv").open() as file:
        there = list(csv.DictReader(file))
    with (measured / "denoise.csv").open() as file:
        here = [row for row in csv.DictReader(file) if row["samples"] == "8"]
    for a, b in zip(there, here, strict=True):
        # The same samples and the same filter: values differ by rounding, which the table's four digits hardly show.
        assert a["denoiser"] == b["denoiser"] and float(a["relMSE"]) == pytest.approx(float(b["relMSE"]), rel=0.01), (a, b)


@pytest.mark.full
def test_a_live_picture_comes_close_to_the_converged_one_with_and_without_the_denoiser(pumice, data, tmp_path):
    flags = [*TINY, "--only", "sky-floor", "--viewport", "--out", tmp_path]
    run(pumice, "bench", "denoise", data / "slicer_Segmentation.seg.nrrd", *flags).fine()
    with (tmp_path / "viewport.csv").open() as file:
        frames = list(csv.DictReader(file))
    for denoised in ("no", "yes"):
        shown = [row for row in frames if row["denoised"] == denoised]
        seconds = [float(row["CPU s"]) for row in shown]
        assert len(shown) > 2 and seconds == sorted(seconds) and seconds[-1] > 24
        # So few pixels converge while they are watched. (How many samples a frame has when it is shown depends on what else the machine does, so
        # the two are not compared; the pictures above are.)
        assert float(shown[-1]["FLIP"]) <= 0.06 < float(shown[0]["FLIP"]), denoised
    page = (tmp_path / "viewport.md").read_text()
    assert "| sky-floor | no |" in page and "| sky-floor | yes |" in page
    assert (tmp_path / "viewport_sky-floor.svg").read_text().startswith("<svg")


def test_what_cannot_denoise_is_refused_before_anything_is_rendered(pumice, data, tmp_path):
    volume = data / "slicer_Segmentation.seg.nrrd"
    line = run(pumice, "bench", "denoise", volume, "--oidn", tmp_path / "none.so", "--out", tmp_path / "out").refused()
    assert "Open Image Denoise: tried" in line and "No such file" in line
    line = run(pumice, "bench", "denoise", volume, "--backend", "vulkan-none", "--out", tmp_path / "out").refused()
    assert "backend vulkan-none: no such backend" in line
    assert "increasing" in run(pumice, "bench", "denoise", volume, "--spp", "4,1", "--out", tmp_path / "out").refused()
    assert not (tmp_path / "out").exists()
