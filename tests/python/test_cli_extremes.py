"""Tests `pumice bench extremes`, which compresses generated worst-case volumes."""

import csv
import math

import pytest
from command import run

# Numbers of labels and boxes of each case as functions of its dimensions, derived by hand.
LABELS = {
    "runs": lambda x, y, z: 4,
    "full": lambda x, y, z: 1,
    "labels": lambda x, y, z: x * y * z,
    "checkerboard": lambda x, y, z: 2,
    "noise-2": lambda x, y, z: 1,
    "noise-256": lambda x, y, z: 255,
}
BOXES = {
    "full": lambda x, y, z: math.ceil(x / 16) * math.ceil(y / 16) * math.ceil(z / 16),
    "labels": lambda x, y, z: x * y * z,
    "checkerboard": lambda x, y, z: 2 * math.ceil(x / 16) * math.ceil(y / 16) * math.ceil(z / 16),
    "noise-2": lambda x, y, z: math.ceil(x / 16) * math.ceil(y / 16) * math.ceil(z / 16),
}


@pytest.fixture(scope="module")
def measured(pumice, tmp_path_factory):
    """Output folder and standard output of the bench with --reduced."""
    out = tmp_path_factory.mktemp("extremes") / "made" / "here"
    return out, run(pumice, "bench", "extremes", "--reduced", "--out", out).fine()


def rows_of(out):
    with (out / "extremes.csv").open() as file:
        return list(csv.DictReader(file))


def test_each_case_has_the_labels_and_boxes_that_it_must_have(measured):
    out, said = measured
    assert str(out / "extremes.md") in said and "beyond its bound" not in said
    rows = rows_of(out)
    assert [row["case"] for row in rows] == [name for name in LABELS for _ in range(2)]
    for row in rows:
        dims = [int(row[axis]) for axis in "xyz"]
        assert int(row["labels"]) == LABELS[row["case"]](*dims), row
        if row["case"] in BOXES:
            assert int(row["boxes"]) == BOXES[row["case"]](*dims), row
        assert 0 < int(row["bytes_resident"]) <= int(row["bytes_bound"]), row
        # A file of the fast level holds the bytes in memory without the hierarchy, and a table of sections.
        assert int(row["bytes_fast"]) < int(row["bytes_resident"]) + 4096
        assert int(row["bytes_default"]) <= int(row["bytes_fast"])
    for small, large in zip(rows[::2], rows[1::2], strict=True):
        assert (small["exponent"], small["case"]) == (large["exponent"], large["case"])
        ratio = math.prod(int(large[a]) for a in "xyz") / math.prod(int(small[a]) for a in "xyz")
        assert 7 <= ratio <= 9
    page = (out / "extremes.md").read_text()
    for row in rows[1::2]:
        assert f" | {int(row['labels'])} | {int(row['boxes'])} | " in page


def test_a_memory_limit_changes_nothing_but_memory(measured, pumice, tmp_path):
    args = ["--reduced", "--case", "noise-2,noise-256", "--out", tmp_path]
    run(pumice, "bench", "extremes", *args, "--memory-limit", "16M").fine()
    same = ["case", "x", "y", "z", "labels", "boxes", "bytes_resident", "bytes_fast", "bytes_default"]
    free = {(r["case"], r["x"]): r for r in rows_of(measured[0])}
    rows = rows_of(tmp_path)
    assert len(rows) == 4
    for row in rows:
        other = free[row["case"], row["x"]]
        assert {key: row[key] for key in same} == {key: other[key] for key in same}
    # A limit that is too small even for the result is refused with a text that names it.
    line = run(pumice, "bench", "extremes", *args, "--memory-limit", "100K").refused()
    assert "noise-2" in line and "102400" in line


def test_bad_arguments_are_refused(pumice, tmp_path):
    out = tmp_path / "out"
    line = run(pumice, "bench", "extremes", "--case", "abacus", "--out", out).refused()
    assert "abacus" in line and "checkerboard" in line
    done = run(pumice, "bench", "extremes", "--memory-limit", "much", "--out", out)
    assert done.code == 2 and not out.exists()
    (tmp_path / "file").write_text("")
    line = run(pumice, "bench", "extremes", "--reduced", "--case", "runs", "--out", tmp_path / "file").refused()
    assert str(tmp_path / "file") in line
