"""Tests tables of labels through the command, against Python's csv and json modules and numpy."""

import csv
import io
import json
import re

import numpy as np
import pytest
from command import run
from decode_pumice import read_sections

# 2⁵³ + 1 is no f64, 2⁶⁴ − 1 is the largest id.
IDS = [3, 17, 42, 1000, 2**53 + 1, 2**64 - 1]
NAMES = {3: "Glia 1", 17: 'PV "basket", left', 42: "glia ä", 2**53 + 1: "L5", 2**64 - 1: "an axon"}
TYPES = {3: "glia", 17: "neuron", 42: "glia", 2**64 - 1: "axon initial segment"}
COLORS = {3: (255, 128, 0), 17: (1, 2, 3), 1000: (0, 0, 0)}
DEPTHS = {3: 0.1, 17: -2.5e-7, 42: 1e300, 2**53 + 1: 12.0}
SPACING = (2.0, 3.0, 4.0)


def voxels():
    """Slabs along x with labels of 6 ids, and background; indexed [x, y, z]."""
    out = np.zeros((40, 12, 9), np.uint64)
    for i, label in enumerate(IDS):
        out[6 * i : 6 * i + 2 + i // 2, i : 10, 1 : 3 + i] = label
    return out


@pytest.fixture(scope="module")
def volume(tmp_path_factory):
    path = tmp_path_factory.mktemp("volume") / "v.npy"
    np.save(path, voxels())
    return path


def text_of_table(rows, delimiter=","):
    """The text of a table of id, name, type, color, depth."""
    out = io.StringIO()
    writer = csv.writer(out, delimiter=delimiter)
    writer.writerow(["id", "name", "type", "color", "depth", "site"])
    for label in rows:
        color = "#{:02x}{:02x}{:02x}".format(*COLORS[label]) if label in COLORS else ""
        depth = repr(DEPTHS[label]) if label in DEPTHS else ""
        writer.writerow([label, NAMES.get(label, ""), TYPES.get(label, ""), color, depth, "left"])
    return out.getvalue()


@pytest.fixture(scope="module")
def annotated(pumice, volume):
    """A .pumice file whose labels have names, types, colours and depths, and what the command said."""
    table = volume.with_name("in.csv")
    table.write_text(text_of_table([99, *IDS[::-1], 0, 98], ";"), encoding="utf-8")
    out = volume.with_name("v.pumice")
    said = run(pumice, "compress", volume, "-o", out, "--table", table, "--spacing", ",".join(map(str, SPACING))).fine()
    return out, said


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


def expected_row(label):
    """What a table has of a label, by numpy."""
    where = np.argwhere(voxels() == label)
    low, high = where.min(axis=0), where.max(axis=0)
    # Arrays have no origin: the centre of the first voxel is at 0.
    centre = (low + high) / 2 * SPACING
    return {
        "name": NAMES.get(label, ""),
        "type": TYPES.get(label, ""),
        "color": "#{:02x}{:02x}{:02x}".format(*COLORS[label]) if label in COLORS else "",
        "depth": DEPTHS.get(label, np.nan),
        "voxels": len(where),
        **{f"{name}_{axis}": value[a] for name, value in [("low", low), ("high", high), ("centre", centre)] for a, axis in enumerate("xyz")},
    }


def test_a_table_comes_back_with_what_the_volume_has(pumice, annotated, tmp_path):
    for ending, delimiter in [("csv", ","), ("tsv", "\t")]:
        out = tmp_path / f"t.{ending}"
        assert "6 labels" in run(pumice, "table", annotated[0], "-o", out).fine()
        with out.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file, delimiter=delimiter))
        assert [int(row["id"]) for row in rows] == IDS
        for row in rows:
            for name, value in expected_row(int(row["id"])).items():
                if isinstance(value, str):
                    assert row[name] == value, (row, name)
                else:
                    got = float(row[name]) if row[name] else np.nan
                    # Equal to the last bit: Python prints and reads f64 exactly, and so must the command.
                    assert got == value or (np.isnan(got) and np.isnan(value)), (row, name, value)
    assert sum(int(row["boxes"]) for row in rows) == json.loads(run(pumice, "info", annotated[0], "--json").fine())["boxes"]


def test_whole_numbers_are_exact_or_left_out(pumice, volume, tmp_path):
    """2^53 + 1 is the first whole number that f64 rounds, to 2^53."""
    for number, is_kept in [(2**53, True), (-(2**53), True), (2**53 + 1, False), (-(2**53) - 1, False), (10**60, False)]:
        (tmp_path / "t.csv").write_text(f"id,x\n3,{number}\n17,5\n")
        said = run(pumice, "compress", volume, "-o", tmp_path / "o.pumice", "--table", tmp_path / "t.csv").fine()
        assert ("would be rounded" in said) == (not is_kept), said
        assert f"{int(is_kept)} columns of numbers" in said, said


def test_types_have_two_columns(pumice, volume, tmp_path):
    (tmp_path / "t.csv").write_text("id,name,type\n3,a,axon\n")
    line = run(pumice, "compress", volume, "-o", tmp_path / "o.pumice", "--types", tmp_path / "t.csv").refused()
    assert "line 1" in line and "--table" in line, line


def test_what_does_not_fit_is_counted_and_named(pumice, volume, annotated, tmp_path):
    said = annotated[1].splitlines()
    assert "table: 6 of 6 labels have a row, 1 columns of numbers" in said
    assert "note: left out: the column site, because line 2 has `left`, which is no number" in said
    assert "note: 2 of 8 rows of the table have ids that the volume lacks: 98, 99" in said
    (tmp_path / "t.tsv").write_text("label\tvoxels\n3\t7\n17\t8\n")
    report = tmp_path / "r.json"
    run(pumice, "compress", volume, "-o", tmp_path / "o.pumice", "--table", tmp_path / "t.tsv", "--json", report).fine()
    fit = json.loads(report.read_text())["table"]
    assert [fit[key] for key in ("rows", "labels_with_row", "labels_without_row", "rows_without_label", "columns")] == [2, 2, 4, 0, 0]
    assert fit["notes"] == [
        "left out: the columns voxels, which the volume itself determines",
        f"4 of 6 labels of the volume have no row in the table: 42, 1000, {2**53 + 1}, {2**64 - 1}",
    ]


@pytest.mark.parametrize("level", ["fast", "default", "small"])
def test_the_file_has_the_numbers_where_its_page_says(pumice, volume, annotated, level, tmp_path):
    """Read by the independent decoder. A volume without a table has the same bytes as before there were tables: no section LCOL."""
    table, out = volume.with_name("in.csv"), tmp_path / "o.pumice"
    run(pumice, "compress", volume, "-o", out, "--table", table, "--level", level).fine()
    sections, _ = read_sections(out.read_bytes())
    assert json.loads(sections["INFO"])["columns"] == ["depth"]
    np.testing.assert_array_equal(np.frombuffer(sections["LCOL"], "<f8"), [DEPTHS.get(label, np.nan) for label in IDS])
    run(pumice, "compress", volume, "-o", out, "--level", level).fine()
    sections, _ = read_sections(out.read_bytes())
    assert "LCOL" not in sections and "columns" not in json.loads(sections["INFO"])


def listed(pumice, path, *args):
    return [int(row["id"]) for row in rows_of(run(pumice, "info", path, "--labels", "--csv", *args).fine())]


def queries():
    """Pairs of a query line and what it means for a label, in Python."""
    n = {label: int((voxels() == label).sum()) for label in IDS}
    name, kind, depth = (lambda i: NAMES.get(i, "").lower()), (lambda i: TYPES.get(i, "")), (lambda i: DEPTHS.get(i, np.nan))
    middle = sorted(n.values())[3]
    return [
        ("", lambda i: True),
        ("*", lambda i: True),
        ("GLIA", lambda i: "glia" in name(i)),
        ("-glia", lambda i: "glia" not in name(i)),
        ("!glia 17 42", lambda i: "glia" not in name(i) and i in (17, 42)),
        ("17-1000", lambda i: 17 <= i <= 1000),
        (f"{2**53 + 1} 3", lambda i: i in (3, 2**53 + 1)),
        (f"{2**53}", lambda i: i == 2**53),
        ("type:axon", lambda i: "axon" in kind(i)),
        ("type=axon", lambda i: kind(i) == "axon"),
        ('name:"\\"basket\\", l"', lambda i: '"basket", l' in name(i)),
        (f"voxels>{middle}", lambda i: n[i] > middle),
        (f"voxels <= {middle} glia", lambda i: n[i] <= middle and "glia" in name(i)),
        ("depth>=0.1", lambda i: depth(i) >= 0.1),
        ("depth!=12", lambda i: not np.isnan(depth(i)) and depth(i) != 12),
        ("-depth<12", lambda i: not depth(i) < 12),
        (f"id>{2**53}", lambda i: i > 2**53),
        ("low_x>=6 high_x<26", lambda i: expected_row(i)["low_x"] >= 6 and expected_row(i)["high_x"] < 26),
        ("centre_z=8", lambda i: expected_row(i)["centre_z"] == 8),
    ]


@pytest.mark.parametrize("line,holds", queries(), ids=[line for line, _ in queries()])
def test_queries_choose_what_python_chooses(pumice, annotated, line, holds, tmp_path):
    expected = [label for label in IDS if holds(label)]
    assert listed(pumice, annotated[0], "--query", line, "--sort", "id") == expected
    run(pumice, "table", annotated[0], "-o", tmp_path / "t.csv", "--query", line).fine()
    assert [int(row["id"]) for row in rows_of((tmp_path / "t.csv").read_text(encoding="utf-8"))] == expected


def test_the_queries_tell_labels_apart():
    """Control of the test above: most lines choose some labels and not others, and no two choose for the same reason."""
    chosen = [tuple(holds(label) for label in IDS) for _, holds in queries()]
    assert sum(0 < sum(c) < len(IDS) for c in chosen) > 12 and len(set(chosen)) > 9


def test_labels_are_listed_in_order(pumice, annotated):
    by_voxels = sorted(IDS, key=lambda i: (-int((voxels() == i).sum()), i))
    assert listed(pumice, annotated[0]) == by_voxels
    assert listed(pumice, annotated[0], "--sort", "id") == IDS
    assert listed(pumice, annotated[0], "--sort", "name") == sorted(IDS, key=lambda i: NAMES.get(i, ""))
    assert listed(pumice, annotated[0], "--sort", "low_x") == IDS[::-1]
    # Labels without a number come last.
    assert listed(pumice, annotated[0], "--sort", "depth") == [42, 2**53 + 1, 3, 17, 1000, 2**64 - 1]


def test_the_list_as_text(pumice, annotated):
    lines = run(pumice, "info", annotated[0], "--labels", "--sort", "id", "--query", "voxels>0").fine().splitlines()
    assert lines[0].split() == ["id", "name", "type", "voxels", "low", "high", "centre", "color"]
    assert len(lines) == 7
    row = expected_row(17)
    corners = [",".join(str(row[f"{which}_{a}"]) for a in "xyz") for which in ("low", "high")]
    centre = ",".join(f"{row[f'centre_{a}']:g}" for a in "xyz")
    assert re.split(r"  +", lines[2].strip()) == ["17", NAMES[17], "neuron", str(row["voxels"]), *corners, centre, "#010203"]


def test_tables_of_other_programs_by_their_documentation(pumice, annotated, tmp_path):
    """Lines are taken apart as each program's documentation says. Colours that labels have are kept, the others are automatic."""
    own = {label: COLORS[label] for label in COLORS}

    said = run(pumice, "table", annotated[0], "-o", tmp_path / "t.ctbl").fine()
    assert "note: 3 of 6 labels have no colour and get an automatic one" in said
    lines = (tmp_path / "t.ctbl").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "# Color table file t.ctbl" and lines[1] == "# 7 values" and lines[2] == "0 Background 0 0 0 0"
    slicer = {int(line.split()[0]): line.split()[1:] for line in lines[3:]}
    assert sorted(slicer) == IDS and all(len(fields) == 5 and fields[4] == "255" for fields in slicer.values())
    assert {label: tuple(map(int, slicer[label][1:4])) for label in own} == own
    assert slicer[17][0] == 'PV_"basket",_left' and slicer[1000][0] == "Label_1000"

    said = run(pumice, "table", annotated[0], "-o", tmp_path / "t.txt").fine()
    assert "note: ITK-SNAP cannot read 2 of the ids: its largest is 65535" in said
    assert "note: left out: the types of 4 labels" in said
    lines = [line for line in (tmp_path / "t.txt").read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    snap = {}
    for line in lines:
        match = re.fullmatch(r'\s*(\d+)\s+(\d+)\s+(\d+)\s+(\d+)\s+([0-9.]+)\s+([01])\s+([01])\s+"(.*)"', line)
        snap[int(match[1])] = (tuple(map(int, match.group(2, 3, 4))), match[8], match.group(5, 6, 7))
    assert sorted(snap) == [0, *IDS] and snap[0] == ((0, 0, 0), "Clear Label", ("0", "0", "0"))
    assert snap[17] == (COLORS[17], NAMES[17], ("1", "1", "1"))

    run(pumice, "table", annotated[0], "-o", tmp_path / "MyLUT.txt").fine()
    lines = (tmp_path / "MyLUT.txt").read_text(encoding="utf-8").splitlines()
    assert lines[0].split() == ["#No.", "Label", "Name:", "R", "G", "B", "A"]
    free = [line.split() for line in lines[1:]]
    assert [int(f[0]) for f in free] == [0, *IDS] and all(len(f) == 6 and f[5] == "0" for f in free)
    assert free[2][1:5] == ['PV_"basket",_left', "1", "2", "3"]

    said = run(pumice, "table", annotated[0], "-o", tmp_path / "info").fine()
    assert "note: left out: the colours of 3 labels" in said and "note: left out: the column depth, which has no number for 2" in said
    info = json.loads((tmp_path / "info").read_text(encoding="utf-8"))
    assert info["@type"] == "neuroglancer_segment_properties" and [int(i) for i in info["inline"]["ids"]] == IDS
    properties = {p["id"]: p for p in info["inline"]["properties"]}
    assert properties["name"]["type"] == "label" and properties["name"]["values"] == [NAMES.get(i, "") for i in IDS]
    tags = properties["type"]
    assert [[tags["tags"][t] for t in row] for row in tags["values"]] == [
        [TYPES[i].replace(" ", "_")] if i in TYPES else [] for i in IDS
    ]
    assert properties["voxels"]["values"] == [int((voxels() == i).sum()) for i in IDS]
    assert properties["voxels"]["data_type"] == "uint8"

    # Each of them can be given to a volume again.
    for name in ["t.ctbl", "t.txt", "MyLUT.txt", "info"]:
        out = tmp_path / "again.pumice"
        said = run(pumice, "compress", annotated[0].with_name("v.npy"), "-o", out, "--table", tmp_path / name).fine()
        assert "table: 6 of 6 labels have a row" in said
        back = {int(row["id"]): row for row in rows_of(run(pumice, "info", out, "--labels", "--csv").fine())}
        if name != "info":
            assert {i: back[i]["color"] for i in own} == {i: "#{:02x}{:02x}{:02x}".format(*own[i]) for i in own}
        assert back[2**53 + 1]["name"] == "L5"


def test_the_format_can_be_chosen(pumice, annotated, tmp_path):
    run(pumice, "table", annotated[0], "-o", tmp_path / "t.txt", "--as", "csv").fine()
    assert (tmp_path / "t.txt").read_text(encoding="utf-8").startswith("id,name,type,color,voxels,boxes,low_x")
    report = json.loads(run(pumice, "table", annotated[0], "-o", tmp_path / "t.csv", "--query", "glia", "--json").fine())
    assert (report["format"], report["labels"], report["notes"]) == ("csv", 2, [])


def test_a_volume_of_another_format_has_a_table_too(pumice, data, tmp_path):
    """The names and colours of 3D Slicer's segments."""
    run(pumice, "table", data / "slicer_Segmentation.seg.nrrd", "-o", tmp_path / "t.csv").fine()
    rows = rows_of((tmp_path / "t.csv").read_text(encoding="utf-8"))
    head = (data / "slicer_Segmentation.seg.nrrd").read_bytes().split(b"\n\n")[0].decode()
    names = re.findall(r"Segment\d+_Name:=(.*)", head)
    assert names and {row["name"] for row in rows} <= set(names) and all(re.fullmatch("#[0-9a-f]{6}", row["color"]) for row in rows)


def test_warnings_about_the_volume_are_said_beside_the_table(pumice, volume, tmp_path):
    """An array has no spacing. Programs that read standard output get the labels alone."""
    warning = "no spacing"
    done = run(pumice, "table", volume, "-o", tmp_path / "t.csv")
    assert warning not in done.fine() and warning in " ".join(done.warnings)
    done = run(pumice, "info", volume, "--labels", "--csv")
    assert done.code == 0 and warning in " ".join(done.warnings) and [int(row["id"]) for row in rows_of(done.out)] != []
