"""Tests the subcommands of `pumice bench` that write one table, on a small volume: all columns are there with plausible values."""

import csv
import json
import os

import pytest
from command import run

SMALL = "platynereis_nuclei.tif"
VOXELS = 256 * 256 * 103
FLAT = ["sizes", "speeds", "live", "backends", "instances", "embree", "errors"]


@pytest.fixture
def measured(pumice, data, tmp_path):
    """A function: measured(name, *flags) runs a bench on the small volume and returns the rows of its CSV. Checks that the page is printed
    and written."""

    def measure(name, *flags):
        out = tmp_path / "made" / "here"
        said = run(pumice, "bench", name, data / SMALL, *flags, "--out", out).fine()
        page = (out / f"{name}.md").read_text()
        assert page.startswith(f"# {name}\n\nPumice ") and page.strip() == said.strip()
        with (out / f"{name}.csv").open() as file:
            rows = list(csv.DictReader(file))
        assert rows and all(row[next(iter(row))] == SMALL for row in rows)
        return rows

    return measure


def bytes_of(cell):
    """1234 of the cell `1234 (0.5 %)`, whose percentage must be of 4 bytes per voxel."""
    count, share = cell.removesuffix(" %)").split(" (")
    assert float(share) == pytest.approx(100 * int(count) / (4 * VOXELS), abs=5e-4)
    return int(count)


def test_sizes_are_those_that_info_tells(measured, pumice, data, tmp_path):
    (row,) = measured("sizes")
    file = tmp_path / "v.pumice"
    run(pumice, "compress", data / SMALL, "-o", file).fine()
    info = json.loads(run(pumice, "info", file, "--json").fine())
    assert (int(row["voxels"]), int(row["labels"]), int(row["boxes"])) == (VOXELS, info["labels"], info["boxes"])
    parts = {"box": "boxes", "node": "nodes", "leaf": "leaves", "label": "labels", "brick": "bricks", "acceleration": "acceleration"}
    for column, part in parts.items():
        assert bytes_of(row[f"{column} bytes"]) == info["resident_parts"][part]
    rays = info["resident_parts"]["bricks"] + info["resident_parts"]["acceleration"]
    assert bytes_of(row["together"]) == info["bytes_resident"] - rays == info["bytes_volume"]
    assert bytes_of(row["disk, default"]) == os.path.getsize(file)
    assert bytes_of(row["disk, small"]) < bytes_of(row["disk, default"]) < bytes_of(row["disk, fast"])


def test_speeds_are_above_nothing(measured):
    (row,) = measured("speeds")
    for column in ("parts, MVoxel per CPU s", "primary rays, M per CPU s", "diffuse rays, M per CPU s", "occlusion rays, M per CPU s"):
        assert float(row[column]) > 0, column


def test_error_falls_with_samples(measured):
    rows = measured("errors", "--backends", "cpu", "--spp", 16)
    assert [(r["backend"], r["samples"]) for r in rows] == [("cpu", n) for n in ("1", "4", "16")]
    one, four, sixteen = (float(r["relMSE"]) for r in rows)
    # Samples are independent, so four times as many have about a quarter of the error, within the noise of one picture.
    assert one / 8 < four < one / 2 and four / 8 < sixteen < four / 2


def test_a_backend_has_rays_and_frames(measured):
    (row,) = measured("backends", "--backends", "cpu", "--size", "96x54", "--labels", 8)
    assert (row["backend"], row["frame"]) == ("cpu", "96x54") and int(row["hierarchy, bytes"]) > 0
    assert float(row["primary, M rays per CPU s"]) > 0
    assert all(float(s.strip("()")) > 0 for s in row["coarsest"].replace("/", "").split())


def test_a_watched_backend_says_what_it_draws(pumice, data):
    said = run(pumice, "bench", "backends", data / SMALL, "--backends", "cpu", "--size", "48x27", "--labels", 8, "--watch")
    lines = said.err.splitlines()
    assert said.code == 0 and len(lines) == 16 and all(line.startswith(f"{SMALL}, cpu: ") for line in lines), said
    assert any(line.endswith(": by distance, 32 bounces") for line in lines)
    assert any("by distance, 32 bounces: " in line and " s the first frame, then " in line for line in lines)


def test_what_is_wrong_is_said_in_a_line(pumice, data, tmp_path):
    for name in FLAT:
        assert run(pumice, "bench", name).code == 2, "a volume must be named"
    for name in ("sizes", "speeds", "errors", "backends", "live", "instances"):
        assert "none.nrrd" in run(pumice, "bench", name, tmp_path / "none.nrrd").refused()
    assert "abacus" in run(pumice, "bench", "backends", data / SMALL, "--backends", "abacus").refused()
    assert run(pumice, "bench", "embree", data / SMALL, "--side", "9").code == 2
