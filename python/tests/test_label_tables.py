"""Tests tables of labels and queries in Python, against the csv module and numpy."""

import csv
import json
import warnings

import numpy as np
import pumice
import pytest

IDS = [42, 3, 2**53 + 1, 2**64 - 1]


def table():
    return pumice.AnnotationTable(
        IDS,
        names=["axon", "Glia 1", "", "glia ä"],
        types=["neuron", "glia", "", "glia"],
        colors=[(1, 0, 0.2), (0, 0, 0), (np.nan,) * 3, (1, 1, 1)],
        columns={"depth": [0.1, np.nan, -3.0, 1e300], "count": np.array([5, 6, 7, 8], np.uint32)},
    )


def test_rows_are_sorted_by_id():
    t = table()
    assert t.ids.dtype == np.uint64 and t.ids.tolist() == sorted(IDS) and len(t) == 4
    assert t.names == ["Glia 1", "axon", "", "glia ä"] and t.types == ["glia", "neuron", "", "glia"]
    np.testing.assert_array_equal(t.columns["depth"], [np.nan, 0.1, -3.0, 1e300])
    np.testing.assert_array_equal(t.columns["count"], [6, 5, 7, 8])
    np.testing.assert_array_equal(np.isnan(t.colors).all(axis=1), [False, False, True, False])
    np.testing.assert_array_equal(t.query("glia depth>1"), [False, False, False, True])
    with pytest.raises(ValueError):
        t.columns["depth"][0] = 1


@pytest.mark.parametrize("ending,delimiter", [("csv", ","), ("tsv", "\t")])
def test_files_against_the_csv_module(ending, delimiter, tmp_path):
    path = tmp_path / f"t.{ending}"
    table().save(path)
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file, delimiter=delimiter))
    assert [int(row["id"]) for row in rows] == sorted(IDS)
    assert [row["name"] for row in rows] == ["Glia 1", "axon", "", "glia ä"]
    assert [row["color"] for row in rows] == ["#000000", "#ff0033", "", "#ffffff"]
    assert [float(row["depth"] or "nan") for row in rows] == pytest.approx([np.nan, 0.1, -3.0, 1e300], rel=0, nan_ok=True)
    back = pumice.read_label_table(path)
    assert (back.format, back.notes, back.names, back.types) == (ending, (), table().names, table().types)
    np.testing.assert_array_equal(back.ids, table().ids)
    np.testing.assert_array_equal(back.columns["depth"], table().columns["depth"])


def test_what_a_format_does_not_hold_is_a_warning(tmp_path):
    with pytest.warns(pumice.PumiceWarning) as told:
        table().save(tmp_path / "info")
    assert [str(w.message) for w in told] == [
        "left out: the column depth, which has no number for 1 labels",
        "left out: the colours of 3 labels",
    ]
    assert json.loads((tmp_path / "info").read_text(encoding="utf-8"))["inline"]["ids"] == [str(i) for i in sorted(IDS)]
    with pytest.raises(pumice.InputError, match=f"label {2**53 + 1} has no colour"):
        table().save(tmp_path / "t.ctbl")
    with pytest.raises(pumice.InputError, match="format: expected one of csv, tsv"):
        table().save(tmp_path / "t", format="xls")
    (tmp_path / "t.csv").write_text("id,site\n3,left\n")
    with pytest.warns(pumice.PumiceWarning, match="left out: the column site"):
        assert pumice.read_label_table(tmp_path / "t.csv").notes != ()


@pytest.mark.parametrize(
    "given,what",
    [
        ({"ids": [1, 1]}, "one row an id, got two of 1"),
        ({"ids": [-1]}, "ids: expected 0 to"),
        ({"ids": [1.5]}, "ids: expected a whole number"),
        ({"ids": [1], "names": ["a", "b"]}, "names: expected 1 rows, got 2"),
        ({"ids": [1], "colors": [[0, 0, 2]]}, "expected a colour from 0 to 1"),
        ({"ids": [1], "colors": [0, 0, 2]}, "colors: expected an array"),
        ({"ids": [1], "columns": {"a": ["x"]}}, "a: expected an array"),
        ({"ids": [1], "columns": {"a": [np.inf]}}, "label 1, a: expected a finite number"),
    ],
)
def test_faulty_tables_are_refused(given, what):
    with pytest.raises(pumice.InputError, match=what):
        pumice.AnnotationTable(**given)


def test_a_table_is_given_to_an_array_and_kept_by_files(tmp_path):
    array = np.zeros((8, 4, 4), np.uint64)
    array[:2], array[4:6], array[7] = 3, 42, 7
    with pytest.warns(pumice.PumiceWarning) as told:
        volume = pumice.compress(array, names={7: "seven", 3: "three"}, table=table())
    assert sorted(str(w.message).split(":")[0] for w in told) == [
        "1 of 3 labels of the volume have no row in the table",
        "2 of 4 rows of the table have ids that the volume lacks",
    ]
    path = tmp_path / "v.pumice"
    volume.save(path)
    for v in (volume, pumice.open(path)):
        assert v.labels.names == ["Glia 1", "seven", "axon"] and v.labels.types == ["glia", "", "neuron"]
        np.testing.assert_array_equal(v.labels.columns["depth"], [np.nan, np.nan, 0.1])
        np.testing.assert_array_equal(v.labels.columns["count"], [6, np.nan, 5])
        np.testing.assert_allclose(v.labels.colors, [[0, 0, 0], [np.nan] * 3, [1, 0, 0.2]], rtol=1e-7)
        np.testing.assert_array_equal(v.labels.query("glia"), [True, False, False])
        np.testing.assert_array_equal(v.labels.query("voxels>16 depth<1"), [False, False, True])
        np.testing.assert_array_equal(v.labels.query("low_x>=4"), v.labels.low[:, 0] >= 4)
        with pytest.raises(pumice.InputError, match="column 6: expected a column of numbers .*low_x.*count.*, got weight"):
            v.labels.query("glia weight>3")

    # The same table as a file, for a file.
    table().save(tmp_path / "t.csv")
    np.save(tmp_path / "a.npy", array)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pumice.PumiceWarning)
        again = pumice.compress(tmp_path / "a.npy", table=tmp_path / "t.csv")
    assert again.labels.names == ["Glia 1", "", "axon"]
    assert again.content_hash == volume.content_hash
    with pytest.raises(pumice.InputError, match="types or table, not both"):
        pumice.compress(array, types={3: "x"}, table=table())
    with pytest.raises(pumice.InputError, match="table: expected a path or an AnnotationTable, got dict"):
        pumice.compress(array, table={3: "x"})


def test_a_table_is_given_to_a_pumice_file(tmp_path):
    """The volume and its bytes are those of the source with the table; keywords without effect are refused."""
    labels = np.zeros((20, 20, 20), np.uint64)
    labels[2:9], labels[9:15] = 3, 42
    pumice.compress(labels).save(tmp_path / "bare.pumice", level="small")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pumice.PumiceWarning)
        pumice.compress(labels, table=table()).save(tmp_path / "told.pumice")
        named = pumice.compress(tmp_path / "bare.pumice", table=table())
    assert named.labels.names == ["Glia 1", "axon"]
    named.save(tmp_path / "again.pumice")
    assert (tmp_path / "again.pumice").read_bytes() == (tmp_path / "told.pumice").read_bytes()
    for keyword in ({"types": {3: "axon"}}, {"memory_limit": 1 << 30}, {"axes": "zyx"}):
        with pytest.raises(pumice.InputError, match=next(iter(keyword))):
            pumice.compress(tmp_path / "bare.pumice", **keyword)


def test_queries_against_numpy():
    """A thousand labels with columns of several types; each line beside the numpy expression that it stands for."""
    rng = np.random.default_rng(1)
    n = 1000
    ids = np.unique(rng.integers(1, 2**64, 2 * n, dtype=np.uint64))[:n]
    names = [f"{rng.choice(['Glia', 'axon', 'PV basket'])} {i}" for i in range(n)]
    types = [str(rng.choice(["", "glia", "axon", "axon hillock"])) for _ in range(n)]
    whole = rng.integers(2**60, 2**60 + 5, n).astype(np.uint64)
    real = np.where(rng.uniform(size=n) < 0.2, np.nan, rng.normal(size=n).round(1))
    low = np.array([name.lower() for name in names])
    kind = np.array(types)
    some = sorted(ids.tolist())[10:13]
    for line, expected in [
        ("", np.full(n, True)),
        ("glia 1", (np.char.find(low, "glia") >= 0) & (ids == 1)),
        ("glia", np.char.find(low, "glia") >= 0),
        ("GLIA -\"glia 1\"", (np.char.find(low, "glia") >= 0) & (np.char.find(low, "glia 1") < 0)),
        (f"{some[0]} {some[2]}", np.isin(ids, [some[0], some[2]])),
        (f"{some[0]}-{some[2]}", (ids >= np.uint64(some[0])) & (ids <= np.uint64(some[2]))),
        (f"whole>{2**60 + 2}", whole > np.uint64(2**60 + 2)),
        (f"whole!={2**60 + 1} type=axon", (whole != np.uint64(2**60 + 1)) & (kind == "axon")),
        ("type:axon", np.char.find(kind, "axon") >= 0),
        ("!type:axon real<=0.5", (np.char.find(kind, "axon") < 0) & (real <= 0.5)),
        ("real=0.3", real == 0.3),
        ("-real=0.3", real != 0.3),
        ("real!=0.3", (real != 0.3) & ~np.isnan(real)),
    ]:
        got = pumice.query_labels(line, ids, names=names, types=types, columns={"whole": whole, "real": real})
        assert got.dtype == bool
        np.testing.assert_array_equal(got, expected, err_msg=line)
    # Control: in f64, which a lazy implementation would use, the whole numbers are all alike.
    assert len(np.unique(whole)) == 5 and len(np.unique(whole.astype(np.float64))) == 1


def test_a_query_that_does_not_fit_is_refused():
    for line, what in [
        ("a>", "query, column 3: expected a number, got the end of the line"),
        ("b>1", "query, column 1: expected a column of numbers \\(id, a\\), got b"),
    ]:
        with pytest.raises(pumice.InputError, match=what):
            pumice.query_labels(line, [1, 2], columns={"a": [1, 2]})
    with pytest.raises(pumice.InputError, match="names: expected 2 values, one an id, got 1"):
        pumice.query_labels("x", [1, 2], names=["x"])
    with pytest.raises(pumice.InputError, match="a: expected 2 values"):
        pumice.query_labels("x", [1, 2], columns={"a": [1.5]})
