# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests tables in files against Python's csv module, options of the import that concern labels, and tables of duplicated objects."""

import csv

import numpy as np
import pytest

from test_label_operators import IDS, ids, select, table, volume  # noqa: F401
from test_real_volumes import imported

ROWS = {
    3: {"name": "Axon A", "type": "axon", "color": "#ff0000", "mass": "2.5"},
    2**53 + 1: {"name": "", "type": "glia", "color": "", "mass": ""},
    2**64 - 2: {"name": 'said "two", words', "type": "axon", "color": "#00ff80", "mass": "-1"},
    99: {"name": "nobody", "type": "", "color": "", "mass": "1"},
}


@pytest.fixture
def sheet(tmp_path):
    path = tmp_path / "labels.csv"
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, ["id", "name", "type", "color", "mass"])
        writer.writeheader()
        writer.writerows({"id": label, **row} for label, row in ROWS.items())
    return path


def test_a_table_replaces_what_it_says_and_nothing_else(blender, volume, table, sheet):  # noqa: F811
    mesh = volume.pumice.table
    before = table.colors(mesh)
    assert blender.ops.pumice.labels_import(filepath=str(sheet)) == {"FINISHED"}
    assert table.names(mesh) == ["Axon A", "axon two", "glia", "", 'said "two", words']
    kinds = table.type_names(mesh)
    assert [kinds[place] for place in table.types(mesh)] == ["axon", "", "", "glia", "axon"]
    mass = table.numbers(mesh)["mass"]
    assert mass[[0, 4]].tolist() == [2.5, -1.0] and np.isnan(mass[[1, 2, 3]]).all()
    # sRGB 128 is 0.21586 in linear values (IEC 61966-2-1).
    assert np.allclose(table.colors(mesh)[[0, 4], :3], [[1, 0, 0], [0, 1, 0.21586]], atol=1e-5)
    assert np.array_equal(table.colors(mesh)[1:4], before[1:4]) and table.own_color(mesh).tolist() == [True, False, False, False, True]
    blender.ops.pumice.labels_search(query="mass>0 type:axon")
    assert [IDS[hit.row] for hit in blender.context.window_manager.pumice_labels.hits] == [3]
    blender.ops.pumice.labels_recolor(palette="TYPE")
    colors = table.colors(mesh)[:, :3]
    assert np.array_equal(colors[0], colors[4]) and not np.array_equal(colors[0], colors[3])


def test_a_table_that_is_written_comes_back(blender, volume, table, sheet, tmp_path):  # noqa: F811
    mesh = volume.pumice.table
    blender.ops.pumice.labels_import(filepath=str(sheet))
    out = tmp_path / "out.csv"
    assert blender.ops.pumice.labels_export(filepath=str(out)) == {"FINISHED"}
    with out.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["id"]) for row in rows] == IDS
    assert [row["name"] for row in rows] == table.names(mesh) and rows[0]["color"] == "#ff0000"
    names, colors, mass = table.names(mesh), table.colors(mesh), table.numbers(mesh)["mass"]
    table.set_names(mesh, [])
    table.set_number(mesh, "mass", np.zeros(5))
    blender.ops.pumice.labels_import(filepath=str(out))
    assert table.names(mesh) == names and np.array_equal(table.numbers(mesh)["mass"], mass, equal_nan=True)
    assert np.abs(table.srgb_from_linear(table.colors(mesh)) - table.srgb_from_linear(colors)).max() <= 0.5 / 255 + 1e-6, "eight bits"


def test_what_cannot_be_read_or_written_is_one_line(blender, volume, table, tmp_path):  # noqa: F811
    mesh = volume.pumice.table
    bad = tmp_path / "bad.csv"
    bad.write_text("id,name\n3,a\n3,b\n")
    before = table.names(mesh)
    for path, problem in ((bad, "3"), (tmp_path / "none.csv", "No such file")):
        with pytest.raises(RuntimeError, match=problem):
            blender.ops.pumice.labels_import(filepath=str(path))
    with pytest.raises(RuntimeError, match="there is no such folder"):
        blender.ops.pumice.labels_export(filepath=str(tmp_path / "none" / "x.csv"))
    assert table.names(mesh) == before


def test_an_import_takes_a_table_and_makes_a_group_for_each_type(blender, extension, sheet, tmp_path):
    import pumice

    dense = np.zeros((20, 4, 4), dtype=np.uint64)
    for place, label in enumerate(IDS):
        dense[4 * place : 4 * place + 2] = label
    pumice.compress(dense).save(tmp_path / "five.pumice")
    obj = imported(blender, tmp_path / "five.pumice", table=str(sheet))
    table = extension.label_table  # noqa: F811
    assert [slot.material.name for slot in obj.material_slots] == ["five other", "five axon", "five glia"]
    assert table.slots(obj.pumice.table).tolist() == [1, 0, 0, 2, 1]
    bad = tmp_path / "bad.csv"
    bad.write_text("id,name\nx,a\n")
    count = len(blender.data.objects)
    with pytest.raises(RuntimeError, match="bad.csv"):
        imported(blender, tmp_path / "five.pumice", table=str(bad))
    assert len(blender.data.objects) == count


def test_an_import_shows_what_the_command_would_pick(blender, extension, data, tmp_path):
    import pumice

    path = data / "connectomics_32x32x40nm.nrrd"
    pumice.open(path).save(tmp_path / "cortex.pumice")
    obj = imported(blender, tmp_path / "cortex.pumice", pick=5)
    table = extension.label_table  # noqa: F811
    shown = table.ids(obj.pumice.table)[table.visible(obj.pumice.table)].tolist()
    picked = pumice.figure(pumice.open(tmp_path / "cortex.pumice"), pick=5).to_dict()["instances"][0]["style"]["show"]["only"]
    assert shown == sorted(picked) and len(shown) == 5


@pytest.mark.parametrize("linked", [False, True], ids=["Shift D", "Alt D"])
def test_a_duplicate_has_a_table_of_its_own_and_a_linked_one_shares_it(blender, volume, table, linked):  # noqa: F811
    for obj in blender.data.objects:
        obj.select_set(obj == volume)
    blender.ops.object.duplicate(linked=linked)
    copy = blender.context.object
    assert copy != volume
    select(blender, 17)
    blender.ops.pumice.labels_hide()
    assert ids(table.visible(copy.pumice.table)) == [label for label in IDS if label != 17]
    assert (17 in ids(table.visible(volume.pumice.table))) is not linked
    assert (copy.pumice.table == volume.pumice.table) is linked
