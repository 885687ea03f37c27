"""Tests `pumice compress` of a `.pumice` file: the bytes are those of compressing its source so, and options without effect are refused."""

import json

import numpy as np
import pytest
from command import run

LEVELS = ["fast", "default", "small"]


@pytest.fixture(scope="module")
def folder(pumice, tmp_path_factory):
    """A volume of some labels and many voxels, its files at all levels with and without a table, and a series of two time steps."""
    folder = tmp_path_factory.mktemp("rewrite")
    z, y, x = np.indices((40, 50, 60))
    np.save(folder / "a.npy", ((x // 9 + 7 * (y // 11) + (x * y // 50 + z) % 5) % 23).astype(np.uint16))
    (folder / "table.csv").write_text("id,name,type,color,size\n1,alpha,axon,#ff0000,1.5\n3,gamma,soma,,2\n99,nobody,,,\n")
    for level in LEVELS:
        for name, more in {"bare": [], "told": ["--table", folder / "table.csv"]}.items():
            run(pumice, "compress", folder / "a.npy", "--level", level, "-o", folder / f"{name}_{level}.pumice", *more).fine()
    run(pumice, "compress", folder / "a.npy", folder / "a.npy", "-o", folder / "series.pumice").fine()
    return folder


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("before", LEVELS)
def test_the_bytes_are_those_of_the_source(pumice, folder, tmp_path, before, level):
    out = tmp_path / "o.pumice"
    run(pumice, "compress", folder / f"bare_{before}.pumice", "--level", level, "-o", out).fine()
    assert out.read_bytes() == (folder / f"bare_{level}.pumice").read_bytes()
    # Negative control: another level has other bytes.
    others = [(folder / f"bare_{other}.pumice").read_bytes() for other in LEVELS if other != level]
    assert out.read_bytes() not in others


@pytest.mark.parametrize("level", LEVELS)
def test_a_table_is_added_and_stays(pumice, folder, tmp_path, level):
    out, report, expected = tmp_path / "o.pumice", tmp_path / "r.json", folder / f"told_{level}.pumice"
    arguments = ["--level", level, "-o", out, "--json", report]
    run(pumice, "compress", folder / "bare_default.pumice", "--table", folder / "table.csv", *arguments).fine()
    assert out.read_bytes() == expected.read_bytes()
    found = json.loads(report.read_text())
    assert [found["table"][key] for key in ("labels_with_row", "rows_without_label", "columns")] == [2, 1, 1]
    run(pumice, "compress", folder / "a.npy", "--table", folder / "table.csv", *arguments).fine()
    of_source = json.loads(report.read_text())
    same = ["dims", "labels", "boxes", "bytes_raw", "bytes_disk", "bytes_volume", "table"]
    assert [found[key] for key in same] == [of_source[key] for key in same]
    run(pumice, "compress", folder / "told_small.pumice", *arguments).fine()
    assert out.read_bytes() == expected.read_bytes()


@pytest.mark.parametrize(
    ("name", "more", "expected"),
    [
        ("series", [], "time series"),
        ("bare_small", ["--types", "types.csv"], "--types"),
        ("bare_small", ["--memory-limit", "1G"], "--memory-limit"),
        ("bare_small", ["--time-steps", "all"], "--time-steps"),
        ("bare_small", ["--axes", "zyx"], "--axes"),
        ("bare_small", ["--resume"], "this is a .pumice file"),
        ("bare_small", ["--chunks", "0"], "this is a .pumice file"),
        ("bare_small", ["bare_fast.pumice"], "this is a .pumice file"),
    ],
)
def test_what_has_no_effect_is_refused(pumice, folder, tmp_path, name, more, expected):
    (folder / "types.csv").write_text("1,axon\n")
    out = tmp_path / "o.pumice"
    assert expected in run(pumice, "compress", f"{name}.pumice", *more, "-o", out, cwd=folder).refused()
    assert not out.exists()


def test_a_file_does_not_replace_itself(pumice, folder, tmp_path):
    own = tmp_path / "own.pumice"
    own.write_bytes((folder / "bare_small.pumice").read_bytes())
    assert "own.pumice" in run(pumice, "compress", own, "--level", "fast", "-o", own).refused()
    assert own.read_bytes() == (folder / "bare_small.pumice").read_bytes()
