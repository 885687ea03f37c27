"""Tests `pumice bench types`: types are switched on in turn, what is counted is what numpy counts, and both ways draw the same bits."""

import csv

import numpy as np
from command import run


def rows_of(folder):
    with (folder / "types.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_types_are_switched_on_in_turn(pumice, tmp_path):
    ids = np.arange(1, 65, dtype=np.uint16).reshape(4, 4, 4) * 7
    np.save(tmp_path / "v.npy", np.kron(ids, np.ones((8, 8, 8), np.uint16)))
    flags = ("--types", "5", "--rows", "1,2,5,9", "--rounds", "2", "--out", tmp_path / "out")
    said = run(pumice, "bench", "types", tmp_path / "v.npy", *flags)
    assert said.code == 0 and "# types" in said.out, said
    rows = rows_of(tmp_path / "out")
    assert [(row["file"], row["types on"]) for row in rows] == [
        (level, f"{on} of 5") for level in ("fast", "default") for on in (1, 2, 5)
    ]
    # Labels are dealt in turn: rows 0, 5, … of the table are of the first type. Each is a box of its own.
    for row, labels, boxes in zip(rows, [13, 13, 12] * 2, [13, 26, 64] * 2):
        assert (int(row["labels of the last"]), int(row["its boxes"]), int(row["boxes"])) == (labels, labels, boxes), row
    assert all(row["same bits"] == "yes" for row in rows)
    # All boxes have the same contents, so every type after the first finds its nodes there.
    assert [row["nodes it shares"] for row in rows] == ["0.0 %", "100.0 %", "100.0 %"] * 2
    assert int(rows[2]["bytes"]) > int(rows[0]["bytes"])


def test_types_of_the_table_are_taken(pumice, tmp_path):
    np.save(tmp_path / "v.npy", np.kron(np.arange(1, 9, dtype=np.uint16).reshape(2, 2, 2), np.ones((8, 8, 8), np.uint16)))
    (tmp_path / "t.csv").write_text("id,type\n1,axon\n2,axon\n3,dendrite\n8,axon\n")
    run(pumice, "compress", tmp_path / "v.npy", "--axes", "xyz", "--types", tmp_path / "t.csv", "-o", tmp_path / "v.pumice").fine()
    said = run(pumice, "bench", "types", tmp_path / "v.pumice", "--rows", "1,2", "--rounds", "1", "--out", tmp_path / "out")
    assert said.code == 0, said
    found = [(row["types on"], row["labels of the last"], row["boxes"]) for row in rows_of(tmp_path / "out")]
    assert found == [("1 of 2", "3", "3"), ("2 of 2", "1", "4")] * 2


def test_what_cannot_be_is_refused(pumice, tmp_path):
    assert "missing.pumice" in run(pumice, "bench", "types", tmp_path / "missing.pumice").refused()
    np.save(tmp_path / "v.npy", np.ones((8, 8, 8), np.uint8))
    line = run(pumice, "bench", "types", tmp_path / "v.npy", "--backend", "cuda").refused()
    assert "cuda" in line, line
