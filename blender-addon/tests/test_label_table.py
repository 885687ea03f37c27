# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the label table: values survive undo and saving, and it needs no property group per label."""

import importlib

import numpy as np
import pytest

from stand_ins import Labels


@pytest.fixture
def table(extension):
    return importlib.import_module(f"{extension.__name__}.label_table")


def some():
    ids = [1, 7, 2**31, 2**32 + 5, 2**64 - 1]
    colors = np.full((5, 3), np.nan)
    colors[1] = [1.0, 0.5, 0.0]
    return Labels(ids, ["", "liver", "", "ünï", ""], colors, ["axon", "", "axon", "soma", ""])


def test_ids_of_64_bits_come_back(blender, table):
    mesh = table.create("x", some())
    assert table.ids(mesh).tolist() == some().ids.tolist()
    assert table.ids(mesh).dtype == np.uint64
    assert table.names(mesh) == some().names
    assert mesh["pumice_types"] == '["", "axon", "soma"]'
    assert mesh.attributes["type"].data[3].value == 2


def test_only_the_files_own_colours_are_own(blender, table):
    mesh = table.create("x", some())
    assert table.own_color(mesh).tolist() == [False, True, False, False, False]
    # sRGB 0.5 is 0.21404 in linear values (IEC 61966-2-1).
    assert table.colors(mesh)[1] == pytest.approx([1.0, 0.21404114, 0.0, 1.0], abs=1e-6)
    assert np.array_equal(table.colors(mesh)[[0, 2], :3], some().auto_colors()[[0, 2]])


def test_tables_that_are_read_in_turn_have_their_own_ids(blender, table):
    """The ids that were read last are kept: those of another table, equal in one half, are others."""
    lists = [[1, 7, 2**32 + 5], [1, 7, 2**33 + 5], [1, 6, 2**32 + 5], [1, 7]]
    meshes = [table.create(f"t{number}", Labels(ids)) for number, ids in enumerate(lists)]
    for _ in range(2):
        for mesh, ids in zip(meshes, lists):
            assert table.ids(mesh).tolist() == ids
            assert table.ids(mesh) is table.ids(mesh)
    with pytest.raises(ValueError, match="read-only"):
        table.ids(meshes[0])[0] = 3


def test_few_rows_get_the_colors_that_many_get(blender, table, monkeypatch):
    """Few rows are written one by one; columns that are read, changed and written again are the oracle."""
    rng = np.random.default_rng(5)
    count = 40
    mask = rng.random(count) < 0.3
    rows = (slice(None), [3], mask, np.flatnonzero(mask), np.array([], dtype=int))
    for few in rows:
        chosen = np.arange(count)[few]
        own = rng.random(len(chosen)) < 0.5
        for linear, is_own in (((0.25, 0.5, 0.75), True), (rng.random((len(chosen), 3), dtype=np.float32), own)):
            found = []
            for most in (0, count):
                monkeypatch.setattr(table, "FEW_ROWS", most)
                mesh = table.create("few", Labels(range(1, count + 1)))
                table.set_color(mesh, few, linear, own=is_own)
                found.append((table.colors(mesh).tolist(), table.own_color(mesh).tolist()))
            assert found[0] == found[1]
            assert len(chosen) == 0 or np.allclose(np.array(found[0][0])[chosen, :3], linear)


def test_edits_of_the_table_stay_through_saving(blender, table, tmp_path):
    mesh = table.create("x", some())
    mesh.use_fake_user = True
    table.set_visible(mesh, [True, False, True, True, False])
    table.set_color(mesh, [3], (0.25, 0.5, 0.75))
    blender.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    blender.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    mesh = next(m for m in blender.data.meshes if m.name.startswith("x"))
    assert table.visible(mesh).tolist() == [True, False, True, True, False]
    assert table.own_color(mesh).tolist() == [False, True, False, True, False]
    assert table.colors(mesh)[3, :3].tolist() == [0.25, 0.5, 0.75]


def test_an_empty_volume_has_an_empty_table(blender, table):
    mesh = table.create("none", Labels([]))
    assert table.ids(mesh).tolist() == [] and table.visible(mesh).tolist() == []


def test_a_mesh_that_is_none_is_named(blender, table):
    with pytest.raises(Exception, match="Mesh plain: it is no label table, or has lost its attribute id_low"):
        table.ids(blender.data.meshes.new("plain"))
