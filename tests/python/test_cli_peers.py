"""Tests `pumice bench peers`, which measures other programs through their own Python packages."""

import csv
import pathlib
import shutil
import sys

import pytest
from command import run

# All programs together take most of a minute.
IN_TURN = pytest.mark.turn(3, 4)

COMMITTED = pathlib.Path(__file__).parents[2] / "bench/results/peers.csv"
SMALL = "platynereis_nuclei.tif"
# The output of deflate depends on the zlib that Python was built with. Every other program brings its own coder.
BY_ZLIB = {"compresso + gzip", "NIfTI + gzip"}


def rows_of(path, volume):
    with path.open() as file:
        return {row["program"]: row for row in csv.DictReader(file) if row["volume"] == volume}


def differing(got, expected):
    """Names of programs whose bytes differ from the expected ones."""

    def apart(program):
        a, b = (int(rows[program]["bytes"]) for rows in (got, expected))
        return abs(a - b) > (0.02 * b if program in BY_ZLIB else 0)

    return sorted(p for p in expected if p not in got or apart(p)) + sorted(got.keys() - expected.keys())


@pytest.fixture(scope="module")
def measured(pumice, data, tmp_path_factory):
    """Output folder and standard output of the bench on the small volume."""
    out = tmp_path_factory.mktemp("peers") / "made" / "here"
    said = run(pumice, "bench", "peers", data / SMALL, "--python", sys.executable, "--out", out).fine()
    return out, said


@IN_TURN
def test_bytes_are_those_of_the_committed_table(measured):
    out, said = measured
    assert str(out / "peers.md") in said
    got, expected = rows_of(out / "peers.csv", SMALL), rows_of(COMMITTED, SMALL)
    assert len(expected) == 13 and differing(got, expected) == []
    # Control: the comparison finds one byte of difference, and a missing program.
    for program in ("crackle", "Pumice, default"):
        off = {**got, program: {**got[program], "bytes": str(int(got[program]["bytes"]) + 1)}}
        assert differing(off, expected) == [program]
        assert differing({p: row for p, row in got.items() if p != program}, expected) == [program]


@IN_TURN
def test_the_table_is_whole_and_its_figures_are_possible(measured):
    out, _ = measured
    rows = rows_of(out / "peers.csv", SMALL)
    page = (out / "peers.md").read_text()
    for program, row in rows.items():
        assert f"| {program} {row['version']} | {row['bytes']} | " in page
        assert int(row["bytes_raw"]) == 4 * 256 * 256 * 103 > int(row["bytes"]) > 0
        assert float(row["compress_cpu_s"]) > 0 and float(row["decompress_cpu_s"]) > 0
        assert (row["voxel_cpu_us"] == "") == (program in {"Pumice, fast", "Pumice, default", "Pumice, small"})
    voxel = {program: float(row["voxel_cpu_us"]) for program, row in rows.items() if row["voxel_cpu_us"]}
    # Decoding everything to read one voxel is slower than decoding one block, by orders of magnitude on any machine.
    assert voxel["zstd"] > 10 * voxel["compressed_segmentation"]


@IN_TURN
def test_levels_are_each_at_its_own_bytes_and_seconds(pumice, data, tmp_path):
    volume = "slicer_Segmentation.seg.nrrd"
    without = [p for p in rows_of(COMMITTED, SMALL) if not p.startswith("Pumice") and p not in {"zstd", "NIfTI + gzip"}]
    flags = ["--levels", "--python", sys.executable, "--out", tmp_path, "--without", ",".join(without)]
    run(pumice, "bench", "peers", data / volume, *flags).fine()
    with (tmp_path / "peers_levels.csv").open() as file:
        rows = {(row["program"], row["setting"]): row for row in csv.DictReader(file) if row["volume"] == volume}
    assert list(rows) == [
        *(("Pumice", level) for level in ("fast", "default", "small")),
        *(("zstd", f"zstd {level}") for level in (3, 1, 9, 19)),
        *(("NIfTI + gzip", f"gzip {level}") for level in (6, 1, 9)),
    ]
    size = {key: int(row["bytes"]) for key, row in rows.items()}
    # A higher level takes fewer bytes, and the usual ones are those of the other table.
    assert size["Pumice", "fast"] > size["Pumice", "default"] > size["Pumice", "small"]
    assert size["zstd", "zstd 3"] > size["zstd", "zstd 19"]
    assert size["NIfTI + gzip", "gzip 1"] > size["NIfTI + gzip", "gzip 9"]
    usual = rows_of(tmp_path / "peers.csv", volume)
    assert size["zstd", "zstd 3"] == int(usual["zstd"]["bytes"])
    assert size["Pumice", "small"] == int(usual["Pumice, small"]["bytes"])
    for what in ("writing", "opening"):
        assert (tmp_path / f"peers_levels_slicer_Segmentation_{what}.svg").read_text().startswith("<svg")
    assert "| zstd | zstd 19 | " in (tmp_path / "peers_levels.md").read_text()


def test_what_is_left_out_is_told(pumice, data, tmp_path):
    args = ["--python", sys.executable, "--out", tmp_path, "--without"]
    kept = {"zstd"}
    without = [p for p in rows_of(COMMITTED, SMALL) if not p.startswith("Pumice") and p not in kept]
    run(pumice, "bench", "peers", data / "slicer_Segmentation.seg.nrrd", *args, ",".join(without)).fine()
    rows = rows_of(tmp_path / "peers.csv", "slicer_Segmentation.seg.nrrd")
    assert {p for p in rows if not p.startswith("Pumice")} == kept
    assert f"Left out: {', '.join(without)}." in (tmp_path / "peers.md").read_text()
    line = run(pumice, "bench", "peers", data / SMALL, *args, "abacus").refused()
    assert "abacus" in line and "crackle" in line


def test_what_is_missing_is_named_before_anything_is_measured(pumice, data, tmp_path):
    out = tmp_path / "out"
    # The same interpreter without its packages.
    bare = tmp_path / "python"
    bare.write_text(f'#!/bin/sh\nexec "{sys.executable}" -I -S "$@"\n')
    bare.chmod(0o755)
    line = run(pumice, "bench", "peers", data / SMALL, "--python", bare, "--out", out).refused()
    assert "crackle needs the Python package crackle-codec: pip install crackle-codec" in line and "--without" in line
    line = run(pumice, "bench", "peers", data / SMALL, "--python", tmp_path / "none", "--out", out).refused()
    assert str(tmp_path / "none") in line
    line = run(pumice, "bench", "peers", tmp_path / "none.nrrd", "--python", sys.executable, "--out", out).refused()
    assert "none.nrrd" in line
    line = run(pumice, "bench", "peers", data / SMALL, "--python", shutil.which("false"), "--out", out).refused()
    assert "false" in line
    assert not out.exists()
