"""Tests `pumice bench lod`: picture error against frame time and resident bytes for each level of detail."""

import csv
import sys

import pytest
from command import run

LEVELS = ["voxels", "by distance", "cells of 4³", "boxes of 16³"]


@pytest.fixture(scope="module")
def measured(pumice, data, tmp_path_factory):
    """Output folder and CSV rows of a small run of the bench."""
    out = tmp_path_factory.mktemp("lod") / "made" / "here"
    args = ["--pick", 8, "--size", "48x32,160x107", "--spp", "1,4", "--repeats", 1, "--reference-spp", 64, "--out", out]
    said = run(pumice, "bench", "lod", data / "platynereis_nuclei.tif", *args).fine()
    assert str(out / "lod.md") in said
    with (out / "lod.csv").open() as file:
        return out, list(csv.DictReader(file))


def test_each_level_size_and_number_of_samples_has_its_row(measured):
    out, rows = measured
    expected = [(w, level, n) for w in ("48", "160") for level in LEVELS for n in ("1", "4")]
    assert [(r["width"], r["level"], r["samples"]) for r in rows] == expected
    assert all(r["labels"] == "8" and float(r["frame_cpu_s"]) > 0 and int(r["bytes_held"]) > 0 for r in rows)
    page = (out / "lod.md").read_text()
    for size in ("48x32", "160x107"):
        svg = f"lod_platynereis_nuclei_{size}.svg"
        assert svg in page and (out / svg).read_text().startswith("<svg")


def test_coarser_levels_are_farther_from_the_picture(measured):
    _, rows = measured
    for width in ("48", "160"):
        own = {r["level"]: r for r in rows if r["width"] == width}
        assert own["voxels"]["own_relmse"] == "", "the reference has no error against itself"
        cells, boxes = (float(own[level]["own_relmse"]) for level in LEVELS[2:])
        assert 0 < cells < boxes
    # Detail below a pixel is hardly visible: by distance, a small picture uses coarser levels than a large one and yet has a small error.
    small = {r["level"]: r for r in rows if r["width"] == "48"}
    assert float(small["by distance"]["own_relmse"]) < float(small["boxes of 16³"]["own_relmse"]) / 4


def test_a_coarser_level_touches_no_more_of_the_file(measured):
    _, rows = measured
    for width in ("48", "160"):
        told = {r["level"]: r["bytes_touched"] for r in rows if r["width"] == width}
        if not sys.platform.startswith("linux"):
            assert set(told.values()) == {""}, "only Linux reports resident bytes of a file"
            continue
        touched = {level: int(bytes_) for level, bytes_ in told.items()}
        mapped = int(rows[0]["bytes_mapped"])
        assert 0 < touched["boxes of 16³"] <= touched["voxels"] <= mapped + 2 * 65536


def test_bad_arguments_are_refused(pumice, data, tmp_path):
    volume = data / "platynereis_nuclei.tif"
    line = run(pumice, "bench", "lod", volume, "--spp", "4,1", "--out", tmp_path / "o").refused()
    assert "--spp" in line and "increasing" in line
    line = run(pumice, "bench", "lod", tmp_path / "none.nrrd", "--out", tmp_path / "o").refused()
    assert "none.nrrd" in line
    assert run(pumice, "bench", "lod", volume, "--size", "0x4", "--out", tmp_path / "o").code == 2
    (tmp_path / "file").write_text("")
    small = ["--size", "16x16", "--spp", 1, "--repeats", 1, "--reference-spp", 8]
    line = run(pumice, "bench", "lod", volume, *small, "--out", tmp_path / "file").refused()
    assert str(tmp_path / "file") in line
