# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the operators on labels: each against a naive model of the table in plain Python, at random; undo; what is refused."""

import json
import random

import numpy as np
import pytest

from test_real_volumes import imported

IDS = [3, 17, 2**32 + 17, 2**53 + 1, 2**64 - 2]
NAMES = {3: "Axon one", 17: "axon two", 2**32 + 17: "glia", 2**53 + 1: "", 2**64 - 2: "Glia far"}


@pytest.fixture
def table(extension):
    return extension.label_table


@pytest.fixture
def volume(blender, tmp_path):
    """Five labels in a row along x, of 8, 64, 8, 8 and 8 voxels, with names."""
    import pumice

    dense = np.zeros((40, 6, 6), dtype=np.uint64)
    for place, label in enumerate(IDS):
        side = 4 if place == 1 else 2
        dense[8 * place : 8 * place + side, :side, :side] = label
    pumice.compress(dense, names={k: v for k, v in NAMES.items() if v}).save(tmp_path / "five.pumice")
    obj = imported(blender, tmp_path / "five.pumice")
    blender.context.view_layer.objects.active = obj
    for name in ("ghost", "metal"):
        obj.data.materials.append(blender.data.materials.new(name))
    return obj


def ids(mask):
    return [label for label, flag in zip(IDS, mask) if flag]


def select(blender, *labels, **more):
    assert blender.ops.pumice.labels_select(ids=",".join(map(str, labels)), **more) == {"FINISHED"}


QUERIES = {
    "": IDS,
    "axon": [3, 17],
    "AXON -one": [17],
    "glia": [2**32 + 17, 2**64 - 2],
    "17 42": [17],
    f"{2**53 + 1}": [2**53 + 1],
    "voxels>8": [17],
    "voxels<=8 -glia": [3, 2**53 + 1],
    'name:"axon two"': [17],
    "nothing": [],
}


@pytest.mark.parametrize("query", QUERIES)
def test_the_search_lists_what_the_query_finds(blender, volume, query):
    assert blender.ops.pumice.labels_search(query=query) == {"FINISHED"}
    search = blender.context.window_manager.pumice_labels
    assert [IDS[hit.row] for hit in search.hits] == QUERIES[query] and search.count == len(QUERIES[query])
    blender.ops.pumice.labels_select_hits()
    assert ids(volume.pumice.table.attributes["select"].data[row].value for row in range(5)) == QUERIES[query]


def test_a_query_without_a_meaning_is_said_and_lists_nothing(blender, volume):
    with pytest.raises(RuntimeError, match="column 8: expected a number, got the end"):
        blender.ops.pumice.labels_search(query="voxels>")
    search = blender.context.window_manager.pumice_labels
    assert search.problem and not search.hits
    search.query = "axon"
    assert not search.problem and len(search.hits) == 2


def test_the_list_is_short_and_the_hits_are_all(blender, extension, tmp_path, monkeypatch):
    import pumice

    pumice.compress(np.arange(1, 1001, dtype=np.uint32).reshape(10, 10, 10)).save(tmp_path / "many.pumice")
    obj = imported(blender, tmp_path / "many.pumice")
    search = blender.context.window_manager.pumice_labels
    search.query = "id>100"
    assert (len(search.hits), search.count) == (200, 900)
    blender.ops.pumice.labels_select_hits()
    assert int(extension.label_table.selected(obj.pumice.table).sum()) == 900


def test_the_list_follows_the_active_volume(blender, volume, tmp_path):
    import pumice

    search = blender.context.window_manager.pumice_labels
    search.query = "axon"
    pumice.compress(np.full((4, 4, 4), 9, dtype=np.uint8), names={9: "An axon"}).save(tmp_path / "other.pumice")
    imported(blender, tmp_path / "other.pumice")
    blender.context.view_layer.update()
    assert search.count == 1
    blender.context.view_layer.objects.active = volume
    blender.context.view_layer.update()
    volume.update_tag()
    blender.context.view_layer.update()
    assert search.count == 2


def test_shown_only_lists_shown_labels_and_follows_edits_and_undo(blender, volume):
    name = volume.name
    search = blender.context.window_manager.pumice_labels
    listed = lambda: [IDS[hit.row] for hit in search.hits]  # noqa: E731
    try:
        blender.ops.pumice.labels_hide(ids="17")
        assert blender.ops.pumice.labels_search(query="axon", shown_only=True) == {"FINISHED"}
        assert listed() == [3] and search.count == 1
        blender.ops.pumice.labels_select_hits()
        assert ids(volume.pumice.table.attributes["select"].data[row].value for row in range(5)) == [3]
        blender.ops.ed.undo_push(message="before")
        blender.ops.pumice.labels_hide(ids="3")
        blender.context.view_layer.update()
        assert listed() == []
        blender.ops.ed.undo_push(message="hide")
        blender.ops.ed.undo()
        assert blender.context.object.name == name and listed() == [3]
        search.shown_only = False
        assert listed() == [3, 17]
        search.shown_only = True
        assert listed() == [3]
        search.query, search.active = "", 2
        blender.data.objects[name].update_tag()
        blender.context.view_layer.update()
        assert search.active == 2, "an update that hides nothing leaves the list as it is"
    finally:
        blender.ops.pumice.labels_search(query="")
    assert not search.shown_only and listed() == IDS


def test_random_operators_do_what_a_naive_model_does(blender, volume, table):
    rng = random.Random(5)
    shown, chosen, slots = set(IDS), set(), dict.fromkeys(IDS, 0)
    mesh = volume.pumice.table
    for _ in range(120):
        some = rng.sample(IDS, rng.randint(1, 3))
        step = rng.randrange(8)
        if step == 0:
            select(blender, *some)
            chosen = set(some)
        elif step == 1:
            select(blender, *some, extend=True)
            chosen |= set(some)
        elif step == 2:
            blender.ops.pumice.labels_invert()
            chosen = shown - chosen
        elif step == 3:
            blender.ops.pumice.labels_show_all()
            shown = set(IDS)
        elif step == 4:
            label = some[0]
            blender.ops.pumice.labels_hide(ids=str(label))
            shown ^= {label}
        elif not chosen:
            continue
        elif step == 5:
            unselected = rng.random() < 0.5
            blender.ops.pumice.labels_hide(unselected=unselected)
            shown = shown & chosen if unselected else shown - chosen
        elif step == 6:
            blender.ops.pumice.labels_isolate()
            shown = set(chosen)
        else:
            slot = rng.randrange(3)
            blender.ops.pumice.labels_assign(slot=slot)
            slots.update(dict.fromkeys(chosen, slot))
        assert set(ids(table.visible(mesh))) == shown
        assert set(ids(table.selected(mesh))) == chosen
        assert table.slots(mesh).tolist() == [slots[label] for label in IDS]


def test_a_group_is_selected_as_faces_of_a_slot_are(blender, volume, table):
    mesh = volume.pumice.table
    select(blender, 17, 2**53 + 1)
    volume.active_material_index = 1
    blender.ops.pumice.labels_assign()
    select(blender, 3)
    blender.ops.pumice.labels_select_group()
    assert ids(table.selected(mesh)) == [3, 17, 2**53 + 1]
    blender.ops.pumice.labels_select_group(deselect=True)
    assert ids(table.selected(mesh)) == [3]


def test_colors_stay_with_their_labels(blender, volume, table):
    mesh = volume.pumice.table
    before = table.colors(mesh)
    select(blender, 17)
    blender.ops.pumice.labels_color(color=(0.25, 0.5, 0.75))
    blender.ops.pumice.labels_hide()
    assert table.colors(mesh)[1, :3].tolist() == [0.25, 0.5, 0.75]
    assert np.array_equal(np.delete(table.colors(mesh), 1, axis=0), np.delete(before, 1, axis=0)), "hiding recolors nothing"
    blender.ops.pumice.labels_recolor(palette="NUMBER", column="voxels")
    few, many = table.colors(mesh)[0, :3], table.colors(mesh)[1, :3]
    assert np.allclose(many, table.linear_from_srgb(np.array([253, 231, 37]) / 255.0), atol=1e-6), "the only selected label"
    assert np.array_equal(few, before[0, :3])
    select(blender, 3, 2**64 - 2)
    blender.ops.pumice.labels_recolor(palette="NUMBER")
    assert np.allclose(table.colors(mesh)[[0, 4], :3], table.linear_from_srgb(np.array([68, 1, 84]) / 255.0), atol=1e-6)
    blender.ops.pumice.labels_select(ids="")
    blender.ops.pumice.labels_recolor()
    assert np.array_equal(table.colors(mesh), before) and not table.own_color(mesh).any()
    select(blender, 17)
    with pytest.raises(RuntimeError, match="color: expected three finite numbers, got .*nan"):
        blender.ops.pumice.labels_color(color=(0.25, float("nan"), 0.75))
    assert np.array_equal(table.colors(mesh), before)
    with pytest.raises(RuntimeError, match="no label of the table has a type"):
        blender.ops.pumice.labels_recolor(palette="TYPE")
    with pytest.raises(RuntimeError, match="no column 'mass'; it has voxels"):
        blender.ops.pumice.labels_recolor(palette="NUMBER", column="mass")


def test_what_is_assigned_is_drawn(blender, volume, extension):
    """Group, color and visibility arrive in the scene that is rendered."""
    import pumice

    select(blender, 17)
    blender.ops.pumice.labels_assign(slot=2)
    select(blender, 3)
    blender.ops.pumice.labels_color(color=(0.25, 0.5, 0.75))
    select(blender, 2**64 - 2)
    blender.ops.pumice.labels_hide()
    camera = blender.data.objects.new("camera", blender.data.cameras.new("camera"))
    blender.context.scene.collection.objects.link(camera)
    blender.context.scene.camera = camera
    volume.active_material.pumice.colors_by_label = True
    parts, left_out = extension.final_render.parts_of_frame(blender.context.evaluated_depsgraph_get())
    style = parts.made(pumice).to_dict()["instances"][0]["style"]
    assert style["show"] == {"except": [2**64 - 2]}
    assert [group["labels"] for group in style["groups"]] == [[3, 2**32 + 17, 2**53 + 1, 2**64 - 2], [], [17]]
    assert style["groups"][0]["colors"][0] == [0.25, 0.5, 0.75] and style["groups"][2]["colors"] == []
    assert any("no label is in the group of slot 2 (ghost)" in line for line in left_out)


def test_frame_puts_the_selection_into_the_picture(blender, volume):
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    camera = blender.data.objects.new("camera", blender.data.cameras.new("camera"))
    blender.context.scene.collection.objects.link(camera)
    blender.context.scene.camera = camera
    for kind in ("PERSP", "ORTHO"):
        camera.data.type, camera.rotation_euler = kind, (1.0, 0.2, 0.7)
        blender.context.view_layer.update()
        select(blender, 2**53 + 1)
        blender.ops.pumice.labels_frame()
        blender.context.view_layer.update()
        seen = [
            world_to_camera_view(blender.context.scene, camera, volume.matrix_world @ Vector((24 + x, y, z)))
            for x in (0, 2)
            for y in (0, 2)
            for z in (0, 2)
        ]
        across = [v[0] for v in seen] + [v[1] for v in seen]
        assert 0.0 <= min(across) and max(across) <= 1.0 and max(across) - min(across) > 0.3, kind
        assert all(camera.data.clip_start < v[2] < camera.data.clip_end for v in seen)


def test_each_operator_is_one_undo_step(blender, volume, table, extension):
    name = volume.name
    blender.ops.ed.undo_push(message="before")
    select(blender, 17)
    blender.ops.ed.undo_push(message="select")
    blender.ops.pumice.labels_hide()
    blender.ops.ed.undo_push(message="hide")
    mesh = lambda: blender.data.objects[name].pumice.table  # noqa: E731
    assert ids(table.visible(mesh())) == [label for label in IDS if label != 17]
    blender.ops.ed.undo()
    assert ids(table.visible(mesh())) == IDS and ids(table.selected(mesh())) == [17]
    blender.ops.ed.undo()
    assert ids(table.selected(mesh())) == []
    blender.ops.ed.redo()
    blender.ops.ed.redo()
    assert ids(table.visible(mesh())) == [label for label in IDS if label != 17]


@pytest.mark.parametrize("operator", ["hide", "isolate", "color", "assign", "frame", "copy_ids"])
def test_an_empty_selection_is_refused(blender, volume, operator):
    with pytest.raises(RuntimeError, match="No label is selected"):
        getattr(blender.ops.pumice, f"labels_{operator}")()


def test_what_does_not_exist_is_named(blender, volume):
    for text, problem in (("4", "no label 4"), ("-1", "got '-1'"), (str(2**64), "expected whole numbers from 0 to"), ("1.5", "got '1.5'")):
        with pytest.raises(RuntimeError, match=problem):
            blender.ops.pumice.labels_select(ids=text)
    select(blender, 3)
    with pytest.raises(RuntimeError, match="has 3 material slots, got 3"):
        blender.ops.pumice.labels_assign(slot=3)
    blender.context.view_layer.objects.active = None
    assert not blender.ops.pumice.labels_hide.poll()


def test_the_table_is_an_ordinary_mesh_for_other_tools(blender, volume, table):
    mesh = volume.pumice.table
    assert sorted(table.numbers(mesh)) == ["voxels"] and table.numbers(mesh)["voxels"].tolist() == [8, 64, 8, 8, 8]
    assert [v.co[:] for v in mesh.vertices] == [(1, 1, 1), (10, 2, 2), (17, 1, 1), (25, 1, 1), (33, 1, 1)]
    assert json.loads(mesh["pumice_names"])[1] == "axon two"
