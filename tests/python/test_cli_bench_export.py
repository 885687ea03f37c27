"""Tests `pumice bench export`, which measures exports beside other writers of USD and Blender's import, on a few cubes."""

import csv
import os
import sys

import pytest
from command import run

FORMATS = {"instances": ["usda", "usdc", "usdz", "glb"], "boxes": ["usda", "usdc", "usdz", "glb", "ply", "obj", "stl"]}
CUBES = 12


@pytest.fixture(scope="module")
def measured(pumice, tmp_path_factory):
    """Output folder and standard output of the bench."""
    out = tmp_path_factory.mktemp("export") / "made" / "here"
    flags = ["--boxes", CUBES, "--rounds", 1, "--python", sys.executable, "--out", out]
    return out, run(pumice, "bench", "export", *flags).fine()


def test_the_table_is_whole_and_its_figures_are_possible(measured):
    out, said = measured
    page = (out / "export.md").read_text()
    assert page.startswith("# export\n\nPumice ") and str(out / "export.md") in said
    with (out / "export.csv").open() as file:
        rows = list(csv.DictReader(file))
    found = {form: [r["file"][1:] for r in rows if r["form"] == form and r["writer"].startswith("pumice")] for form in FORMATS}
    assert found == FORMATS
    for form in FORMATS:
        others = [r for r in rows if r["form"] == form and r["writer"].startswith("usd-core ")]
        assert [r["file"] for r in others] == [".usda", ".usdc"] and all(float(r["peak, over ours"]) > 0 for r in others)
    for row in rows:
        wall, cpu = (float(part.strip("()")) for part in row["write, s (CPU)"].split())
        # CPU time of twelve cubes may be less than the clock's step, which is written as 0.
        assert int(row["bytes"]) > 0 and wall > 0 and cpu >= 0 and float(row["peak, MB"]) > 1
        assert row["volume"] == f"{CUBES} cubes" and (row["find, s (CPU)"] == "") == row["writer"].startswith("usd-core")
    for left_out in ("a real volume: none was given", "the crate openusd: no --openusd", "the import into Blender: no --blender"):
        assert left_out in page
    # The bar is of a million boxes alone.
    assert "bar" not in page


def test_what_is_wrong_is_said_in_a_line(pumice, tmp_path):
    out = tmp_path / "out"
    bare = tmp_path / "python"
    bare.write_text(f'#!/bin/sh\nexec "{sys.executable}" -I -S "$@"\n')
    bare.chmod(0o755)
    few = ["bench", "export", "--boxes", 1, "--out", out]
    assert "usd-core and numpy are missing: pip install usd-core numpy" in run(pumice, *few, "--python", bare).refused()
    assert "none.nrrd" in run(pumice, *few, "--without", "usd-core", "--rounds", 1, tmp_path / "none.nrrd").refused()
    assert str(tmp_path / "none") in run(pumice, *few, "--without", "usd-core", "--blender", tmp_path / "none").refused()
    assert run(pumice, "bench", "export", "--boxes", 0).code == 2
    assert not out.exists()


@pytest.mark.full
def test_a_writer_of_other_arrays_is_convicted(pumice, tmp_path):
    """Control: a program in the place of openusd's that changes a value, and one that only copies what Pumice wrote."""
    writer = tmp_path / "writer"
    flags = ["bench", "export", "--boxes", 2, "--rounds", 1, "--python", sys.executable, "--out", tmp_path / "out", "--openusd", writer]
    for change, is_same in [("", True), ("points = points + 1", False)]:
        writer.write_text(WRITER.format(python=sys.executable, change=change))
        os.chmod(writer, 0o755)
        done = run(pumice, *flags)
        if is_same:
            assert done.code == 0, done
        else:
            assert "openusd 0.8.0 wrote another /Scene/volume_1/boxes.positions" in done.refused()


WRITER = """#!{python}
import json, pathlib, sys
import numpy as np
from pxr import Sdf, Usd, Vt
arrays, job = (pathlib.Path(p) for p in sys.argv[1:])
job = json.loads(job.read_text())
stage = Usd.Stage.CreateNew(job["out"])
for prim in json.loads(arrays.read_text())["prims"]:
    made = stage.DefinePrim(prim["path"], prim["type"])
    for a in prim["attributes"]:
        authored = made.CreateAttribute(a["name"], Sdf.ValueTypeNames.Find(a["type"]), False)
        if "token" in a:
            authored.Set(a["token"])
        elif a["kind"] == "int":
            authored.Set(Vt.IntArray.FromNumpy(np.fromfile(arrays.parent / a["file"], "<i4")))
        else:
            points = np.fromfile(arrays.parent / a["file"], "<f4").reshape(-1, 3)
            if a["name"] in ("points", "positions"):
                {change}
                pass
            authored.Set(Vt.Vec3fArray.FromNumpy(points))
        if a["interpolation"]:
            authored.SetMetadata("interpolation", a["interpolation"])
stage.GetRootLayer().Save()
pathlib.Path(job["report"]).write_text(json.dumps({{"seconds": 1, "cpu_seconds": 1, "peak_rss_bytes": 1}}))
"""
