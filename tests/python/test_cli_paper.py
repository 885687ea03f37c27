"""Tests `pumice bench paper`: the paper's encodings beside Pumice's own form."""

import csv

import numpy as np
import pytest
from command import run

FORMS = ["SVOs (AABB)", "SVDAGs (TYPE)", "SVDAG (SHARED)"]
SMALL = ["--side", 64, "--rounds", 1]


def figures_of(out):
    """Values of paper.csv by (table, row, column)."""
    with (out / "paper.csv").open() as file:
        return {(r["table"], r["row"], r["column"]): float(r["figure"]) for r in csv.DictReader(file)}


@pytest.fixture(scope="module")
def measured(pumice, data, tmp_path_factory):
    """Output folder and values of the bench on a small real volume."""
    out = tmp_path_factory.mktemp("paper") / "made" / "here"
    volume = data / "platynereis_nuclei.tif"
    said = run(pumice, "bench", "paper", volume, "--side", 192, "--rounds", 1, "--show", 100, "--out", out).fine()
    assert str(out / "paper.md") in said
    return out, figures_of(out)


def test_all_forms_see_the_same(measured):
    _, f = measured
    rows = [form + fields for fields in ("", " with fields") for form in FORMS] + ["Pumice"]
    for kind in ("camera", "diffuse"):
        hits = [f["3 4", row, f"{kind} hits at voxels"] for row in rows]
        assert min(hits) > 100
        # Rounding may move a diffuse ray that grazes an edge to either side of it.
        assert max(hits) - min(hits) <= (0 if kind == "camera" else 1), hits
    for row in rows:
        assert f["3 4", row, "camera rays at voxels M/s"] > 0
        # A box covers all its voxels, so solid boxes are hit at least as often.
        assert f["3 4", row, "camera hits at boxes"] >= f["3 4", row, "camera hits at voxels"]


def test_bytes_are_those_of_the_layouts(measured):
    out, f = measured
    boxes = f["3 4", FORMS[0], "boxes"]
    for fields in ("", " with fields"):
        svo, types, shared = (f["3 4", form + fields, "tree bytes"] for form in FORMS)
        assert all(f["3 4", form + fields, "box bytes"] == 32 * boxes for form in FORMS)
        assert shared < types and shared % 32 == 0 and svo % 8 == 0
        # The last step of merging has the bytes of the shared graph.
        if fields:
            growth = [(k[1], v) for k, v in f.items() if k[0] == "figure 6 growth" and k[2] == FORMS[2]]
            assert growth[-1][1] == shared and len(growth) == f["1", "volume", "types"]
    # A node is referenced by parents and boxes. A parent has eight references, some of them to the uniform leaves.
    levels = [k[1] for k in f if k[0] == "figure 6" and k[2] == "nodes" and k[1].startswith("with fields")]
    nodes = sum(f["figure 6", row, "nodes"] for row in levels)
    assert 32 * (nodes + 2) == f["3 4", FORMS[2] + " with fields", "tree bytes"]
    uses = sum(f["figure 6", row, "references"] for row in levels)
    inner = nodes - f["figure 6", "with fields, 4³", "nodes"]
    assert nodes <= uses <= 8 * inner + boxes
    assert f["3 4", "Pumice", "tree bytes"] < f["3 4", FORMS[2] + " with fields", "tree bytes"] / 3
    page = (out / "paper.md").read_text()
    for part in ("Table 1", "Table 3", "Table 4", "Table 5", "Section 5.6", "Figure 6"):
        assert part in page
    for svg in ("paper_platynereis_nuclei_reuse.svg", "paper_platynereis_nuclei_growth.svg"):
        assert (out / svg).read_text().startswith("<svg")


def test_sizes_of_boxes_and_hiding_are_measured(measured):
    _, f = measured
    boxes = [f["5.6 sides", side, "boxes"] for side in ("8³", "16³", "32³", "undivided")]
    assert boxes == sorted(boxes, reverse=True) and boxes[-1] == f["1", "volume", "labels"]
    assert boxes[1] == f["3 4", FORMS[0], "boxes"]
    for shown in (100, 50, 25, 10, 3):
        for who in ("SVDAG (SHARED) with fields", "Pumice"):
            row = f"{shown} % shown, {who}"
            assert f["5.6 hiding", row, "rebuild CPU ms"] > 0 and f["5.6 hiding", row, "discarding M/s"] > 0


def test_types_are_dealt_and_noise_fits(pumice, tmp_path):
    """Types are assigned round robin; and noise gives the largest possible octree, which pointers of 12 bits must address."""
    rng = np.random.default_rng(3)
    np.save(tmp_path / "noise.npy", rng.integers(0, 2, (40, 33, 20), dtype=np.uint32))
    run(pumice, "bench", "paper", tmp_path / "noise.npy", *SMALL, "--types", 5, "--show", 100, "--out", tmp_path / "o").fine()
    f = figures_of(tmp_path / "o")
    assert f["1", "volume", "types"] == 1, "no more types than labels"
    np.save(tmp_path / "many.npy", rng.integers(0, 50, (20, 20, 20), dtype=np.uint32))
    run(pumice, "bench", "paper", tmp_path / "many.npy", *SMALL, "--types", 5, "--show", 100, "--out", tmp_path / "o").fine()
    assert figures_of(tmp_path / "o")["1", "volume", "types"] == 5


def test_bad_arguments_are_refused(pumice, data, tmp_path):
    line = run(pumice, "bench", "paper", tmp_path / "none.nrrd", "--out", tmp_path / "o").refused()
    assert "none.nrrd" in line
    for bad in (["--show", 0], ["--show", 101], ["--side", 7], ["--types", 0], ["--rounds", 0]):
        assert run(pumice, "bench", "paper", data / "platynereis_nuclei.tif", *bad, "--out", tmp_path / "o").code == 2
    (tmp_path / "file").write_text("")
    np.save(tmp_path / "tiny.npy", np.ones((3, 3, 3), dtype=np.uint32))
    line = run(pumice, "bench", "paper", tmp_path / "tiny.npy", *SMALL, "--show", 100, "--out", tmp_path / "file").refused()
    assert str(tmp_path / "file") in line
