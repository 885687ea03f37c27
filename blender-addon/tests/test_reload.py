# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests Reload: labels keep by id what the user gave them, new and gone ids are said, and the volume stays where it was put.

The oracle is numpy: the arrays that were written as the source, and dictionaries by id.
"""

import importlib
import os
import re

import bpy
import numpy as np
import pytest

from test_object_is_blenders import label_pass, prepare, same
from stand_ins import Engine
from test_real_volumes import imported, settle, viewport_of

SPACING = (4.0, 4.0, 10.0)


@pytest.fixture
def load(extension):
    return lambda name: importlib.import_module(f"{extension.__name__}.{name}")


def blocks(seed, ids):
    """Random blocks of 3³ voxels with these ids, and background."""
    some = np.random.default_rng(seed).choice(np.array([0, *ids], dtype=np.uint64), (6, 5, 4))
    return some.repeat(3, 0).repeat(3, 1).repeat(3, 2)


FIRST = blocks(1, [3, 17, 2**40, 99, 2**63 + 5])
# 17 is gone, 1 and 2⁶⁴ − 2 are new, so that rows shift.
SECOND = blocks(2, [1, 3, 2**40, 99, 2**63 + 5, 2**64 - 2])


def write(path, dense, spacing=SPACING, **more):
    """Writes a source; a `.pumice` file that is written anew is a changed source too."""
    import pumice

    pumice.compress(dense, spacing=spacing, unit="nm", **more).save(path)


@pytest.fixture
def source(tmp_path):
    return tmp_path / "cells.pumice"


@pytest.fixture
def cells(blender, source):
    write(source, FIRST, names={3: "three", 17: "seventeen", 99: "old"}, types={3: "a", 99: "b"})
    return imported(bpy, source)


def by_id(load, obj):
    """What each label has, by id, read attribute by attribute."""
    table, read = obj.pumice.table, load("label_table")
    kinds, ids = read.type_names(table) or [""], read.ids(table).tolist()
    names = read.names(table) or [""] * len(ids)
    at = table.attributes
    return {
        label: {
            "color": tuple(at["color"].data[row].color),
            **{name: at[name].data[row].value for name in ("visible", "slot", "select", "own_color", "voxels")},
            "name": names[row],
            "type": kinds[at["type"].data[row].value],
            "depth": at["depth"].data[row].value if "depth" in at else None,
        }
        for row, label in enumerate(ids)
    }


def dress(load, obj):
    """Gives labels what a user gives them."""
    table, read = obj.pumice.table, load("label_table")
    obj.data.materials.append(bpy.data.materials.new("ghost"))
    bpy.ops.pumice.labels_select(ids=f"3, {2**40}")
    bpy.ops.pumice.labels_color(color=(0.25, 0.5, 0.75))
    bpy.ops.pumice.labels_assign(slot=1)
    bpy.ops.pumice.labels_hide()
    read.set_number(table, "depth", np.arange(len(table.vertices)) + 0.5)


def reload(capfd):
    """Reloads, and returns what Blender's console was told."""
    capfd.readouterr()
    assert bpy.ops.pumice.reload() == {"FINISHED"}
    return capfd.readouterr().out


def test_new_labels_join_the_group_of_their_type_where_there_is_one(blender, source, load, capfd):
    """Dictionaries by id are the oracle: type and group of the kept labels."""
    types = {3: "a", 17: "b", 99: "b", 2**40: "c", 2**63 + 5: "c"}
    write(source, FIRST, types=types)
    cells = imported(bpy, source)
    bpy.ops.pumice.labels_select(ids=f"17, 99, {2**40}")
    bpy.ops.pumice.labels_assign(slot=1)
    # 17 and 99 are in the second group, of type c one label is there and one is elsewhere, of type d nothing was.
    new = {1: "a", 2: "b", 4: "c", 5: "d", 6: ""}
    write(source, blocks(3, [*types, *new]), types=types | {label: kind for label, kind in new.items() if kind})
    before = by_id(load, cells)
    reload(capfd)
    after = by_id(load, cells)
    assert {label: after[label]["slot"] for label in types} == {label: before[label]["slot"] for label in types}
    assert before[3]["slot"] == 0 and before[2**63 + 5]["slot"] == 2
    assert {label: after[label]["slot"] for label in new} == {1: 0, 2: 1, 4: 0, 5: 0, 6: 0}
    # Control: with the labels of type c in one group, a new one of this type is there too.
    bpy.ops.pumice.labels_select(ids=f"{2**40}, 4")
    bpy.ops.pumice.labels_assign(slot=2)
    write(source, blocks(4, [*types, *new, 7]), types=types | {4: "c", 7: "c"})
    reload(capfd)
    assert by_id(load, cells)[7]["slot"] == 2


def test_labels_keep_by_id_what_they_have_and_new_and_gone_ids_are_said(cells, source, load, capfd):
    dress(load, cells)
    before, mesh, materials = by_id(load, cells), cells.data, list(cells.data.materials)
    write(source, SECOND, names={3: "drei", 1: "one"}, types={1: "c"})
    said = reload(capfd)

    assert "4 labels kept, 2 new (1, 18446744073709551614), 1 gone (17)" in said
    after = by_id(load, cells)
    assert sorted(after) == np.unique(SECOND)[1:].tolist()
    for label in set(before) & set(after):
        kept = {name: value for name, value in before[label].items() if name != "voxels"}
        assert {name: value for name, value in after[label].items() if name != "voxels"} == kept, label
    for label, row in after.items():
        assert row["voxels"] == (SECOND == label).sum(), "numbers of voxels are those of the new source"
    for label in (1, 2**64 - 2):
        row = after[label]
        assert row["visible"] and not row["select"] and row["slot"] == 0 and not row["own_color"] and np.isnan(row["depth"])
    assert after[1]["name"] == "one" and after[1]["type"] == "c" and after[3]["name"] == "three"
    assert cells.data == mesh and list(cells.data.materials) == materials
    assert cells.pumice.labels == 6 and len([m for m in bpy.data.meshes if "label" in m.name]) == 1


def test_columns_of_the_source_are_those_of_the_new_source(blender, source, load, capfd):
    import pumice

    def of(dense, plus):
        ids = np.unique(dense)[1:]
        return {"table": pumice.AnnotationTable(ids, columns={"mass": (ids % 97).astype(float) + plus})}

    write(source, FIRST, **of(FIRST, 0.0))
    cells = imported(bpy, source)
    write(source, SECOND, **of(SECOND, 0.5))
    reload(capfd)
    table = cells.pumice.table
    assert load("label_table").numbers(table)["mass"].tolist() == [int(label) % 97 + 0.5 for label in np.unique(SECOND)[1:]]
    assert cells.data.color_attributes.active_color_name == "Label Color"
    shown = {tuple(round(c, 1) for c in d.color[:3]) for d in cells.data.color_attributes["Label Color"].data}
    assert shown <= {tuple(round(float(c), 1) for c in row[:3]) for row in load("label_table").colors(table)}, "of the new table"


def test_new_labels_differ_from_the_labels_that_they_touch(cells, source, load, capfd):
    import pumice

    # All labels have the color that the import would give to the new one, so that this one will not do.
    write(source, SECOND)
    disguise = pumice.open(source).labels.auto_colors()[0]
    load("label_table").set_color(cells.pumice.table, slice(None), disguise)
    reload(capfd)
    after = by_id(load, cells)
    touching = {
        frozenset(pair)
        for axis in range(3)
        for pair in zip(np.delete(SECOND, -1, axis).ravel().tolist(), np.delete(SECOND, 0, axis).ravel().tolist())
        if pair[0] != pair[1] and 0 not in pair
    }
    new = {1, 2**64 - 2}
    seen = [pair for pair in touching if pair & new]
    assert len(seen) > 4
    for pair in seen:
        one, other = (np.array(after[label]["color"][:3]) ** (1 / 2.2) for label in pair)  # about as a screen shows them
        # python/tests/test_farthest_colors.py tests that they are farthest; here, that they are not alike.
        assert np.abs(one - other).max() > 0.15, pair


def world_of(load, obj):
    bpy.context.view_layer.update()
    return load("volume_place").world_from_index(obj)


def test_the_volume_stays_where_it_was_put(cells, source, load, capfd, tmp_path):
    cells.location.x += 2.0
    cells.scale.y *= 1.5
    bpy.ops.transform.mirror(constraint_axis=(False, False, True))
    bpy.ops.object.transform_apply()
    cells.rotation_euler.z = 0.3
    before = world_of(load, cells)
    write(source, SECOND)
    reload(capfd)
    assert np.allclose(world_of(load, cells), before, rtol=1e-6, atol=1e-6)
    # The proxy is in the volume's place: its corners are corners of the volume, mapped.
    low = np.array([cells.matrix_world @ v.co for v in cells.data.vertices])
    index = (np.linalg.inv(before) @ np.column_stack([low, np.ones(len(low))]).T).T[:, :3]
    assert np.abs(index.min(axis=0)).max() < 1e-3 and np.allclose(index.max(axis=0), SECOND.shape, atol=1e-3)
    middle = sum((v.co for v in cells.data.vertices), cells.data.vertices[0].co * 0) / len(cells.data.vertices)
    spanned = sum((f.center - middle).dot(f.normal) * f.area for f in cells.data.polygons)
    assert spanned > 0.0, "faces look outward although the map mirrors"

    # Another voxel size, and a crop that begins elsewhere, have the place that the file says.
    import pumice

    crop = np.diag([*SPACING, 1.0]) @ np.diag([2.0, 1.0, 1.0, 1.0])
    crop[:3, 3] = (6 * SPACING[0], 0.0, 0.0)
    pumice.compress(SECOND, world_from_index=crop, unit="nm").save(source)
    reload(capfd)
    index_before_from_index = np.diag([2.0, 1.0, 1.0, 1.0])
    index_before_from_index[0, 3] = 6.0
    assert np.allclose(world_of(load, cells), before @ index_before_from_index, rtol=1e-5, atol=1e-5)
    assert list(cells.pumice.spacing) == pytest.approx([8.0, 4.0, 10.0])


def test_linked_duplicates_follow_and_others_stay(cells, source, load, capfd):
    bpy.ops.object.duplicate(linked=True)
    linked = bpy.context.object
    bpy.ops.object.duplicate(linked=False)
    own = bpy.context.object
    bpy.context.view_layer.objects.active = cells
    before = by_id(load, own)
    write(source, SECOND)
    reload(capfd)
    assert linked.pumice.table == cells.pumice.table and linked.pumice.labels == 6
    assert by_id(load, own) == before


def test_reload_is_one_undo_step_and_the_picture_follows(cells, source, load, capfd, tmp_path):
    prepare(bpy.context.scene)
    first = label_pass(tmp_path)
    write(tmp_path / "second.pumice", SECOND)
    cells.pumice.source_path = str(tmp_path / "second.pumice")
    bpy.ops.ed.undo_push(message="before")
    open_files = lambda: sorted(os.path.basename(key[0]) for key in load("registry")._entries)  # noqa: E731
    assert open_files() == ["cells.pumice"]
    reload(capfd)
    assert open_files() == ["second.pumice"], "the former volume is closed"
    bpy.ops.ed.undo_push(message="reloaded")
    second = label_pass(tmp_path)
    assert not same(first, second)
    bpy.ops.ed.undo()
    assert open_files() == [] and same(label_pass(tmp_path), first)
    bpy.ops.ed.redo()
    assert open_files() == [] and same(label_pass(tmp_path), second)


def test_a_live_viewport_shows_the_reloaded_volume(cells, source, extension, load, capfd, monkeypatch):
    """The file keeps its name, so that only its content tells the viewport."""
    prepare(bpy.context.scene)
    bpy.context.scene.pumice.viewport_samples = 4
    context, view = viewport_of(bpy, extension, monkeypatch, Engine())
    first = np.array(np.asarray(settle(bpy, view, context)))
    write(source, np.where(FIRST == 3, FIRST, 0))
    reload(capfd)
    second = np.array(np.asarray(settle(bpy, view, context)))
    view.close()
    context, view = viewport_of(bpy, extension, monkeypatch, Engine(2))
    fresh = np.array(np.asarray(settle(bpy, view, context)))
    assert np.array_equal(second, fresh) and not np.array_equal(first, second)


@pytest.fixture
def left_behind(cells, source, capfd):
    """A duplicate with a table of its own, whose file the reload of another object has replaced."""
    bpy.ops.object.duplicate(linked=False)
    duplicate = bpy.context.object
    duplicate.location.x += 20.0
    bpy.ops.pumice.labels_select(ids="17")
    bpy.context.view_layer.objects.active = cells
    write(source, SECOND)
    reload(capfd)
    bpy.context.view_layer.objects.active = duplicate
    return duplicate


def test_a_duplicate_that_is_left_behind_shows_the_new_voxels_as_a_new_viewport_does(cells, source, extension, capfd, monkeypatch):
    prepare(bpy.context.scene)
    bpy.context.scene.pumice.viewport_samples = 2
    bpy.ops.object.duplicate(linked=False)
    bpy.context.object.location.z += 3.0
    bpy.context.view_layer.objects.active = cells
    context, view = viewport_of(bpy, extension, monkeypatch, Engine())
    first = np.array(np.asarray(settle(bpy, view, context)))
    write(source, np.where(FIRST == 3, FIRST, 0))
    reload(capfd)
    second = np.array(np.asarray(settle(bpy, view, context)))
    context, view = viewport_of(bpy, extension, monkeypatch, Engine(2))
    fresh = np.array(np.asarray(settle(bpy, view, context)))
    assert np.array_equal(second, fresh) and not np.array_equal(first, second)


def test_a_duplicate_whose_shown_label_is_gone_is_a_box_and_refused_by_f12(left_behind, extension, load, monkeypatch, capfd):
    prepare(bpy.context.scene)
    bpy.context.scene.pumice.viewport_samples = 2
    context, view = viewport_of(bpy, extension, monkeypatch, Engine())
    settle(bpy, view, context)
    assert len(view.sent.placed) == 2, "while all labels are shown it is drawn"
    bpy.ops.pumice.labels_isolate()
    settle(bpy, view, context)
    said = "lacks 1 of the labels that are shown, the first 17; press Reload"
    assert len(view.sent.placed) == 1 and len(view._undrawn) == 1 and said in " ".join(view.notes)
    with pytest.raises(RuntimeError, match=said):
        bpy.ops.render.render()
    reload(capfd)
    settle(bpy, view, context)
    assert len(view.sent.placed) == 2 and not view._undrawn
    assert bpy.ops.render.render() == {"FINISHED"}


@pytest.mark.parametrize("operator", ["labels_frame", "labels_recolor", "make_exact_mesh"])
def test_what_needs_rows_of_the_file_is_refused_where_the_table_is_another_files(left_behind, operator):
    left_behind.select_set(True)
    with pytest.raises(RuntimeError, match="so its label table does not fit; press Reload") as raised:
        getattr(bpy.ops.pumice, operator)()
    assert len(str(raised.value).strip().splitlines()) == 1


def test_an_unchanged_source_is_said(cells, load, capfd):
    before = by_id(load, cells)
    said = reload(capfd)
    assert "5 labels kept, none new, none gone; its voxels are as before" in said
    assert by_id(load, cells) == before


def test_a_tiff_is_compressed_again_as_it_was_imported(blender, tmp_path, capfd):
    import pumice

    source, dense = tmp_path / "cells.tif", blocks(3, [2, 7, 900])
    write_tiff(source, dense)
    obj = imported(bpy, source, use_spacing=True, spacing=(0.5, 0.5, 2.0))
    former = obj.pumice.filepath
    dense[dense == 900] = 0
    write_tiff(source, dense)
    said = reload(capfd)
    assert "2 labels kept, none new, 1 gone (900)" in said
    assert obj.pumice.filepath != former and list(obj.pumice.spacing) == pytest.approx([0.5, 0.5, 2.0])
    assert pumice.open(obj.pumice.filepath).labels.ids.tolist() == np.unique(dense)[1:].tolist()


def write_tiff(path, dense):
    """A plain TIFF stack, slices along z, in 16 bits: header, slices, one directory each."""
    slices = np.ascontiguousarray(dense.transpose(2, 1, 0).astype("<u2"))
    depth, height, width = slices.shape
    out = bytearray(b"II*\0" + (8 + slices.nbytes).to_bytes(4, "little") + slices.tobytes())
    for z in range(depth):
        tags = [(256, 3, width), (257, 3, height), (258, 3, 16), (259, 3, 1), (262, 3, 1), (273, 4, 8 + z * 2 * width * height)]
        tags += [(277, 3, 1), (278, 3, height), (279, 4, 2 * width * height)]
        out += len(tags).to_bytes(2, "little")
        for tag, kind, value in tags:
            out += tag.to_bytes(2, "little") + kind.to_bytes(2, "little") + (1).to_bytes(4, "little") + value.to_bytes(4, "little")
        out += (len(out) + 4 if z + 1 < depth else 0).to_bytes(4, "little")
    path.write_bytes(bytes(out))


def test_a_reload_that_is_cancelled_or_fails_changes_nothing(cells, source, load, capfd, monkeypatch):
    import pumice

    def cancelled(*_):
        raise pumice.Cancelled("cancelled")

    before, path = by_id(load, cells), cells.pumice.filepath
    write(source, SECOND)
    monkeypatch.setattr(load("opening"), "_open", cancelled)
    assert bpy.ops.pumice.reload() == {"CANCELLED"}
    assert "Cancelled" in capfd.readouterr().out
    monkeypatch.undo()
    source.write_bytes(source.read_bytes()[:-50])
    with pytest.raises(RuntimeError, match="cells.pumice"):
        bpy.ops.pumice.reload()
    assert by_id(load, cells) == before and cells.pumice.filepath == path


def test_what_cannot_be_reloaded_is_said(cells, source, load):
    source.unlink()
    with pytest.raises(RuntimeError, match=re.escape(f"{source}: the source is missing; set Source")):
        bpy.ops.pumice.reload()
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RuntimeError, match="leave edit mode first"):
        bpy.ops.pumice.reload()
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.mesh.primitive_cube_add()
    with pytest.raises(RuntimeError, match="The active object is no volume"):
        bpy.ops.pumice.reload()


def test_the_next_volume_of_a_series_keeps_known_colors(cells, load, tmp_path):
    dress(load, cells)
    before = by_id(load, cells)
    write(tmp_path / "next.pumice", SECOND)
    plain = by_id(load, imported(bpy, tmp_path / "next.pumice"))
    bpy.context.view_layer.objects.active = cells
    after = by_id(load, imported(bpy, tmp_path / "next.pumice", use_known_colors=True))
    known = set(before) & set(after)
    assert all(after[label]["color"] == before[label]["color"] for label in known)
    assert not all(plain[label]["color"] == before[label]["color"] for label in known), "negative control"
    assert all(row["visible"] and row["slot"] == 0 for row in after.values()), "colors alone are taken"
    assert after[3]["own_color"] and not after[1]["own_color"]
