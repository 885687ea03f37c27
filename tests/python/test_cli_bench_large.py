"""Tests `pumice bench large`: what it counts is what numpy counts, and a limit that is exceeded is told by the exit code."""

import csv

import numpy as np
from command import run


def rows_of(folder):
    with (folder / "large.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_copies_have_the_filling_of_the_volume(pumice, tmp_path):
    labels = np.zeros((70, 40, 33), np.uint32)
    labels[3:50, 5:30, 2:20] = 7
    labels[60:, 30:, 25:] = 9
    np.save(tmp_path / "v.npy", labels)
    flags = ("--copies", "1,1,1", "--copies", "3,2,2", "--size", "100,50,40", "--memory-limit", "64MiB", "--out", tmp_path / "out")
    said = run(pumice, "bench", "large", tmp_path / "v.npy", *flags)
    assert said.code == 0 and "# large" in said.out, said
    one, many, cut = rows_of(tmp_path / "out")
    assert one["volume"] == "v.npy, 70 × 40 × 33" and many["volume"] == "v.npy, 210 × 80 × 66"
    solid = f"{100 * np.count_nonzero(labels) / labels.size:.2f} %"
    assert one["solid"] == many["solid"] == solid
    assert (one["labels"], many["labels"]) == ("2", "24")
    assert int(many["boxes"]) > int(one["boxes"]) and int(many["file, bytes"]) > int(one["file, bytes"])
    assert all(0 < int(row["peak, MiB"]) < 128 for row in (one, many, cut))
    # Mirrored copies on the far sides, and none of the labels' ids changed.
    large = np.pad(labels, [(0, 30), (0, 10), (0, 7)], mode="symmetric")
    assert cut["volume"] == "v.npy, 100 × 50 × 40" and cut["labels"] == "2"
    assert cut["solid"] == f"{100 * np.count_nonzero(large) / large.size:.2f} %"


def test_what_cannot_be_is_refused(pumice, tmp_path):
    np.save(tmp_path / "v.npy", np.ones((8, 8, 8), np.uint8))
    line = run(pumice, "bench", "large", tmp_path / "v.npy", "--copies", "1,1").refused()
    assert "three whole numbers" in line, line
    line = run(pumice, "bench", "large", tmp_path / "v.npy", "--size", "1,1,0").refused()
    assert "three whole numbers" in line, line
    line = run(pumice, "bench", "large", tmp_path / "missing.npy").refused()
    assert "missing.npy" in line, line
    line = run(pumice, "bench", "large", tmp_path / "v.npy", "--memory-limit", "1").refused()
    assert "ended with" in line and "40 is more than the limit of 1" in line, line
