# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that of a volume only the labels that are shown are read, that others are added when they are shown, and that pictures are those of the
whole volume.
"""

import importlib

import bpy
import numpy as np
import pumice
import pytest

import test_viewport
from test_real_volumes import exr, imported, load

# A grid of 4³ cubes with an id each.
IDS = np.arange(1, 65, dtype=np.uint32) * 1001


def cubes():
    return np.kron(IDS.reshape(4, 4, 4), np.ones((12, 12, 12), np.uint32))


@pytest.fixture
def registry(blender, extension):
    found = importlib.import_module(f"{extension.__name__}.registry")
    found._entries.clear()
    yield found
    found._entries.clear()


@pytest.fixture
def opened(registry, extension, tmp_path):
    """A volume object that shows three labels, in a file that was opened again: nothing of its volume is read yet."""
    pumice.compress(cubes()).save(tmp_path / "cubes.pumice", level="fast")
    obj = imported(bpy, tmp_path / "cubes.pumice")
    show(extension, obj, [0, 21, 63])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    registry._entries.clear()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    return next(o for o in bpy.data.objects if o.pumice.filepath)


def show(extension, obj, rows):
    flags = np.zeros(len(IDS), dtype=bool)
    flags[rows] = True
    load(extension, "label_table").set_visible(obj.pumice.table, flags)
    obj.update_tag()


def read(registry):
    """Rows of the labels that are open, of each volume."""
    return [np.flatnonzero(e.volume.labels.boxes).tolist() for e in registry._entries.values() if e.done.wait(10) and e.error is None]


def picture(tmp_path, name):
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 36, 100
    scene.pumice.samples, scene.pumice.backend = 2, "CPU"
    scene.render.filepath = str(tmp_path / name)
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    bpy.ops.render.render(write_still=True)
    found = exr(tmp_path / name)
    return np.stack([found[channel] for channel in sorted(found)], axis=-1)


def test_pictures_of_some_labels_are_those_of_the_whole_volume(opened, registry, extension, tmp_path):
    first = picture(tmp_path, "some.exr")
    assert read(registry) == [[0, 21, 63]]
    # Showing others adds them; hiding keeps what is there.
    show(extension, opened, [21, 30])
    more = picture(tmp_path, "more.exr")
    assert read(registry) == [[0, 21, 30, 63]]
    show(extension, opened, [0, 21, 63])
    again = picture(tmp_path, "again.exr")
    assert read(registry) == [[0, 21, 30, 63]]
    # From half of the labels on all are read, as one volume.
    show(extension, opened, range(40))
    picture(tmp_path, "most.exr")
    assert read(registry) == [list(range(64))]
    show(extension, opened, [0, 21, 63])
    whole = picture(tmp_path, "whole.exr")
    show(extension, opened, [21, 30])
    whole_more = picture(tmp_path, "whole_more.exr")
    for some, all_of_it in ((first, whole), (again, whole), (more, whole_more)):
        np.testing.assert_array_equal(some.view(np.uint32), all_of_it.view(np.uint32))
    # A control: the pictures differ.
    assert not np.array_equal(whole, whole_more)


def test_operators_read_what_they_ask_for(opened, registry, extension):
    table = load(extension, "label_table")
    bpy.context.view_layer.objects.active = opened
    selected = np.zeros(len(IDS), dtype=bool)
    selected[[5, 42]] = True
    table.set_selected(opened.pumice.table, selected)
    # The bounds of hidden labels are known once these are read.
    place = bpy.context.scene.camera.matrix_world.copy()
    assert bpy.ops.pumice.labels_frame() == {"FINISHED"}
    assert bpy.context.scene.camera.matrix_world != place and read(registry) == [[5, 42]]
    load(extension, "proxy_update").refresh_all()
    assert read(registry) == [[0, 5, 21, 42, 63]]
    faces = load(extension, "proxy").LABEL
    assert set(np.unique([v.value for v in opened.data.attributes[faces].data])) == {0, 21, 63}


def test_two_objects_of_a_file_share_what_is_read(opened, registry, extension, tmp_path):
    other = imported(bpy, tmp_path / "cubes.pumice")
    registry._entries.clear()
    show(extension, other, [7])
    parts = load(extension, "scene_reader").read(bpy.context.evaluated_depsgraph_get(), {}, {}, load(extension, "scene_reader").Kept())[0]
    volumes = registry.wait_all(parts.wanted(), lambda: False)
    assert len(volumes) == 2 and volumes[0] is volumes[1] and read(registry) == [[0, 7, 21, 63]]


def test_a_file_that_lacks_a_label_or_is_of_another_kind_is_read_whole(registry, tmp_path):
    pumice.compress(cubes()).save(tmp_path / "a.pumice")
    pumice.compress(cubes()).save(tmp_path / "small.pumice", level="small")
    np.save(tmp_path / "a.npy", cubes())
    some = (np.append(IDS, 65 * 1001).astype(np.uint64), np.arange(65) > 60)
    known = (IDS.astype(np.uint64), np.arange(64) > 60)
    for name, shown in (("a.pumice", some), ("small.pumice", known), ("a.npy", known)):
        volume = registry.wait(str(tmp_path / name), lambda: False, None, shown)
        assert volume.is_whole and registry.request(str(tmp_path / name), None, None).volume is volume, name
    (tmp_path / "broken.pumice").write_bytes((tmp_path / "a.pumice").read_bytes()[:900])
    with pytest.raises(load_refused(registry), match="broken.pumice"):
        registry.wait(str(tmp_path / "broken.pumice"), lambda: False, None, known)


def load_refused(registry):
    return importlib.import_module(registry.__name__.rpartition(".")[0] + ".reports").Refused


# A viewport, whose session and volumes are stand-ins.

stage = test_viewport.stage


def test_a_viewport_shows_what_it_has_until_more_is_read(stage, monkeypatch):
    registry, table = stage.load("registry"), stage.load("label_table")
    # The stand-in has three labels, of which two are most.
    monkeypatch.setattr(registry, "MOST_LABELS", 1.0)
    table.set_visible(stage.obj.pumice.table, [True, False, False])
    stage.obj.update_tag()
    stage.update()
    entry = registry.request(str(stage.path), None, (table.ids(stage.obj.pumice.table), np.array([True, False, False])))
    assert entry.done.wait(10) and entry.volume.read == {3}
    shown = stage.update()
    session, sent = shown.session, dict(shown.sent.placed)
    # While the next labels are read, the picture stays, without a box and without the labels that are not there.
    stage.module.may_open.clear()
    table.set_visible(stage.obj.pumice.table, [False, True, False])
    stage.obj.update_tag()
    before = len(session.edits)
    stage.update()
    assert session.edits[before:] == [] and list(shown.waiting) == list(sent) and not shown._undrawn
    assert any("opening" in line for line in shown.notes)
    stage.module.may_open.set()
    assert next(iter(shown.waiting.values())).done.wait(10)
    stage.update()
    assert shown.session is session
    assert [e["edit"] for e in session.edits[before:]] == ["remove", "add", "visible", "groups"]
    assert session.volumes[-1].read == {3, 17} and session.edits[-2]["visible"][1].tolist() == [False, True, False]
    # What was read is there at once.
    table.set_visible(stage.obj.pumice.table, [True, False, False])
    stage.obj.update_tag()
    before = len(session.edits)
    stage.update()
    assert [e["edit"] for e in session.edits[before:]] == ["visible"]
