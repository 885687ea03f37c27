# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the import of time series: a file with time steps, files with a number in their names, a compressed series; what the dialog asks, what is
refused, and what a viewport shows while a time step is being opened.

The oracle are the arrays that were written.
"""

import importlib
import json
import threading
import types

import bpy
import numpy as np
import pumice
import pytest

from series_scene import STEPS, dense, write, write_nifti, write_ome_zarr, write_tiff
from stand_ins import Context, Engine, Module, Texture, Volume
from test_import_files import dialog  # noqa: F401 (a fixture)

# 16 bits, as the files have them.
ARRAYS = [dense(step).astype(np.uint16) for step in range(STEPS)]


def volumes():
    return [o for o in bpy.data.objects if o.type == "MESH" and o.pumice.filepath]


def imported(path, **options):
    assert bpy.ops.pumice.import_volume(filepath=str(path), **options) == {"FINISHED"}
    return bpy.context.view_layer.objects.active


def refused(path, **options):
    with pytest.raises(RuntimeError) as raised:
        bpy.ops.pumice.import_volume(filepath=str(path), **options)
    said = str(raised.value).strip()
    assert len(said.splitlines()) == 1 and "defect" not in said and volumes() == []
    return said


def are(obj, arrays):
    """Whether the time steps of an object's file are these arrays, and it says so."""
    steps = [pumice.open(obj.pumice.filepath, time=step).decode() for step in range(len(arrays))]
    return obj.pumice_time.time_steps == len(arrays) and all(np.array_equal(one, two) for one, two in zip(steps, arrays))


def test_a_file_with_time_steps_becomes_one_animated_volume_or_one_time_step(blender, tmp_path):
    path = write_nifti(tmp_path / "cells.nii", ARRAYS)
    assert "5 time steps" in refused(path)
    assert "0-9 is out of range" in refused(path, time_steps="0-9") and "expected all, or" in refused(path, time_steps="some")
    assert [p.name for p in tmp_path.iterdir()] == ["cells.nii"]
    blender.context.scene.frame_start = 10
    obj = imported(path, time_steps="all")
    of = obj.pumice_time
    assert are(obj, ARRAYS) and (of.frame_start, of.frame_duration, of.sequence_mode) == (10, STEPS, "EXTEND")
    (kept,) = tmp_path.glob("cells-*.pumice")
    before = kept.stat().st_mtime_ns
    assert are(imported(path, time_steps="all"), ARRAYS) and kept.stat().st_mtime_ns == before, "what the first has made is opened"
    assert are(imported(path, time_steps="1-3"), ARRAYS[1:4])
    # As before: one time step is a volume without time.
    one = imported(path, time=2)
    assert one.pumice_time.time_steps == 0 and np.array_equal(pumice.open(one.pumice.filepath).decode(), ARRAYS[2])
    assert len(list(tmp_path.glob("cells-*.pumice"))) == 3
    # Control: the arrays differ from one time step to the next.
    assert not are(imported(path, time_steps="all"), ARRAYS[::-1])


@pytest.mark.parametrize("name, write_steps", [("cells.tif", write_tiff), ("cells.zarr", write_ome_zarr)])
def test_time_steps_of_other_formats(blender, tmp_path, name, write_steps):
    path = write_steps(tmp_path / name, ARRAYS)
    assert "5 time steps" in refused(path)
    obj = imported(path, time_steps="1-3")
    assert are(obj, ARRAYS[1:4])
    obj = imported(path, time_steps="all")
    assert are(obj, ARRAYS)
    sides = {tuple(pumice.open(obj.pumice.filepath, time=step).spacing) for step in range(STEPS)}
    assert sides == {(2.0, 2.0, 3.0)}
    # One time step alone is a volume without time.
    alone = imported(path, time=2)
    assert alone.pumice_time.time_steps <= 1 and np.array_equal(pumice.open(alone.pumice.filepath).decode(), ARRAYS[2])


def test_files_with_a_number_in_their_names_become_one_volume(blender, tmp_path, monkeypatch):
    for step, array in enumerate(ARRAYS):
        write_nifti(tmp_path / f"t_{step + 8}.nii", [array])
    write_nifti(tmp_path / "other_1.nii", [ARRAYS[0]])
    obj = imported(tmp_path / "t_10.nii", use_sequence=True)
    assert are(obj, ARRAYS) and obj.pumice.source_path == str(tmp_path / "t_8.nii")
    assert json.loads(obj["pumice_choice"])["files"] == [f"t_{n}.nii" for n in range(8, 13)]
    files = [{"name": f"t_{n}.nii"} for n in (10, 9, 8)]
    assert bpy.ops.pumice.import_volume(directory=str(tmp_path), files=files, use_sequence=True) == {"FINISHED"}
    assert are(bpy.context.object, ARRAYS[:3])
    # A changed file is another series, also by Reload.
    write_nifti(tmp_path / "t_9.nii", [ARRAYS[4]])
    assert bpy.ops.pumice.reload() == {"FINISHED"} and are(bpy.context.object, [ARRAYS[0], ARRAYS[4], ARRAYS[2]])
    # Controls: without the option they are three volumes; of one file without siblings, and with a gap, there is no series.
    before = len(volumes())
    bpy.ops.pumice.import_volume(directory=str(tmp_path), files=files)
    assert len(volumes()) == before + 3
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert "no other file differs" in refused(tmp_path / "other_1.nii", use_sequence=True)
    (tmp_path / "t_11.nii").unlink()
    assert "11 is missing" in refused(tmp_path / "t_8.nii", use_sequence=True)
    write_nifti(tmp_path / "t_11.nii", [ARRAYS[0][:-1]])
    assert "t_11.nii" in refused(tmp_path / "t_8.nii", use_sequence=True)


def test_a_cancelled_import_leaves_nothing(blender, extension, tmp_path):
    load = lambda name: importlib.import_module(f"{extension.__name__}.{name}")  # noqa: E731
    path, job = str(write_nifti(tmp_path / "cells.nii", ARRAYS)), pumice.Job()
    choice = {"time_steps": "all"}
    wanted = [load("opening").Wanted(path, choice, str(tmp_path / "user"))]
    job.cancel()
    with pytest.raises(pumice.Cancelled):
        load("opening").open_all(wanted, job, lambda stage: None)
    assert [p.name for p in tmp_path.rglob("*")] == ["cells.nii"]
    # Control: what is not cancelled is there.
    (opened,) = load("opening").open_all(wanted, pumice.Job(), lambda stage: None)
    assert (opened.volume.time_step, opened.volume.time_steps) == (0, STEPS) and len(list(tmp_path.glob("*.pumice"))) == 1


def test_a_compressed_series_is_opened_as_it_is(blender, tmp_path):
    path = write(tmp_path / "cells.pumice")
    assert "the file has 5 time steps; choose one with time (0 to 4), or all" in refused(path)
    assert "5" in refused(path, time=5) and "Offset and Frames" in refused(path, time_steps="1-2") and "spacing" in refused(
        path, time_steps="all", use_spacing=True
    )
    assert [p.name for p in tmp_path.iterdir()] == ["cells.pumice"], "nothing is written"
    obj = imported(path, time_steps="all")
    assert obj.pumice.filepath == str(path) and are(obj, [dense(step) for step in range(STEPS)])
    one = imported(path, time=3)
    assert (one.pumice_time.frame_offset, one.pumice_time.frame_duration, one.pumice_time.time_steps) == (3, 1, STEPS)
    assert [p.name for p in tmp_path.iterdir()] == ["cells.pumice"]


def test_the_dialog_asks_for_time_steps_and_offers_all_of_them(dialog, tmp_path, extension):  # noqa: F811
    facts = lambda: importlib.import_module(f"{extension.__name__}.import_dialog")._facts  # noqa: E731
    path = write_nifti(tmp_path / "cells.nii", ARRAYS)
    shown = dialog(path)
    # Of a file of another program one is read, as before, until the user says otherwise.
    assert shown.asked_for() == {"time_menu"} and shown.choice_of(str(path)) == {"time": 0}
    assert [item[0] for item in facts().menu("time")] == ["0", "1", "2", "3", "4", "all"]
    shown.time_steps = "all"
    assert shown.asked_for() == {"time_menu", "time_steps"} and shown.choice_of(str(path)) == {"time_steps": "all"}
    assert shown.lines()[0].startswith("40 × 20 × 16 voxels") and "Compressed before: opens at once" not in shown.lines()
    imported(path, time_steps="all")
    shown = dialog(path)
    shown.time_steps = "all"
    assert "Compressed before: opens at once" in shown.lines()
    # A compressed series was made to be one.
    path = write(tmp_path / "cells.pumice")
    shown = dialog(path)
    assert shown.asked_for() == {"time_menu", "time_steps"} and shown.choice_of(str(path)) == {"time_steps": "all"}
    assert shown.lines()[0].endswith("with 5 time steps, opened as it is") and len(facts().menu("time")) == STEPS + 1
    shown.time_steps, shown.time = "", 2
    assert shown.choice_of(str(path)) == {"time": 2}
    # Control: a file without time is not asked for it, and gets no answer to it.
    pumice.compress(dense(0)).save(tmp_path / "one.pumice")
    shown = dialog(tmp_path / "one.pumice")
    shown.time_steps = "all"
    assert shown.asked_for() == set() and shown.choice_of(str(tmp_path / "one.pumice")) == {}


def test_the_dialog_offers_files_as_one_series(dialog, tmp_path):  # noqa: F811
    files = [write_nifti(tmp_path / f"t_{step + 8}.nii", [array]) for step, array in enumerate(ARRAYS)]
    for chosen, expected in [(files[:1], files), (files[3:1:-1], files[2:4])]:
        shown = dialog(*chosen)
        assert shown.asked_for() == {"use_sequence"} and len(shown.wanted(bpy.context.scene)) == len(chosen), "it is off"
        shown.use_sequence = True
        (wanted,) = shown.wanted(bpy.context.scene)
        assert wanted.source == str(expected[0]) and wanted.choice == {"files": [file.name for file in expected]}
    # Control: a file without siblings.
    assert dialog(write_nifti(tmp_path / "alone_1.nii", ARRAYS[:1])).asked_for() == set()


def test_the_menu_sets_what_a_script_sets(dialog, tmp_path):  # noqa: F811
    imported(write(tmp_path / "cells.pumice"), time_steps="all")
    properties = bpy.context.window_manager.operator_properties_last("pumice.import_volume")
    dialog(tmp_path / "cells.pumice")
    properties.time_menu = "2"
    assert (properties.time, properties.time_steps) == (2, "")
    properties.time_menu = "all"
    assert properties.time_steps == "all" and properties.time_menu == "all"
    properties.time_steps, properties.time = "", 1
    assert properties.time_menu == "1"


class Steps(Module):
    """A module whose files have nine time steps; `gates` hold back the opening of some of them."""

    def __init__(self):
        super().__init__()
        self.opened, self.gates = [], {}

    def open(self, path, job=None, time=None):
        self.opened.append(time)
        gate = self.gates.get(time)
        while gate is not None and not gate.wait(0.005):
            if job.cancelled:
                raise self.Cancelled("cancelled")
        volume = Volume(path)
        volume.time_step, volume.time_steps, volume.content_hash = time, 9, f"{time:032}"
        return volume


@pytest.fixture
def stage(blender, extension, monkeypatch, tmp_path):
    load = lambda name: importlib.import_module(f"{extension.__name__}.{name}")  # noqa: E731
    module = Steps()
    monkeypatch.setattr(load("native"), "pumice", module)
    monkeypatch.setattr(load("native"), "MISSING", None)
    monkeypatch.setattr(load("picture_texture"), "PictureTexture", Texture)
    monkeypatch.setattr(load("missing_boxes"), "draw", lambda ends: None)
    load("registry")._entries.clear()
    path = tmp_path / "cells.pumice"
    path.write_bytes(b"\x89PUMICE\n" + bytes(28) + b"\x09\0\0\0")
    obj = imported(path, time_steps="all")
    engine = Engine()
    context, view = Context(blender), load("viewport").of(engine)

    def update(frame):
        blender.context.scene.frame_set(frame)
        view.sync(context, blender.context.evaluated_depsgraph_get())
        return [one.time_step for one in view.sent.placed.values()]

    def opened():
        """Waits for what is being opened, and polls as Blender's timer does."""
        for entry in list(view.waiting.values()):
            assert entry.done.wait(10)
        view.poll()

    yield types.SimpleNamespace(bpy=blender, module=module, obj=obj, engine=engine, view=view, update=update, opened=opened, load=load)
    view.close()
    load("registry")._entries.clear()


def test_the_former_time_step_is_shown_until_the_next_is_open(stage):
    assert stage.update(1) == [0]
    gate = stage.module.gates[1] = threading.Event()
    assert stage.update(2) == [0] and "opening cells.pumice, time step 1" in stage.view.notes
    assert not [e for e in stage.view.session.edits if e["edit"] == "remove"], "the picture does not flicker"
    gate.set()
    stage.opened()
    assert stage.update(2) == [1] and stage.view.notes == []
    assert [e["edit"] for e in stage.view.session.edits][:2] == ["remove", "add"]
    # Control: where nothing of the file is shown yet, nothing stands for it.
    stage.view._stop()
    stage.module.gates[5] = threading.Event()
    assert stage.update(6) == []


def test_an_animation_that_plays_faster_than_it_opens_shows_some_time_steps(stage):
    assert stage.update(1) == [0]
    gates = stage.module.gates
    gates[1], gates[3] = threading.Event(), threading.Event()
    assert [stage.update(frame) for frame in (2, 3, 4)] == [[0]] * 3
    assert stage.module.opened == [0, 1], "one at a time"
    gates[1].set()
    stage.opened()
    assert stage.update(4) == [1], "what is open is shown, though the frame is further"
    assert stage.module.opened == [0, 1, 3]
    gates[3].set()
    stage.opened()
    assert stage.update(4) == [3]


def test_what_is_no_longer_shown_is_closed_but_for_the_last_two(stage):
    registry = stage.load("registry")
    for frame in range(1, 8):
        stage.update(frame)
        stage.opened()
        stage.update(frame)
    assert [key[3] for key in registry._entries] == [4, 5, 6]
    # A second viewport of another frame keeps its own.
    registry.hold("another", [(stage.obj.pumice.filepath, 4)])
    for frame in (8, 9):
        stage.update(frame)
        stage.opened()
        stage.update(frame)
    assert sorted(key[3] for key in registry._entries) == [4, 6, 7, 8]
    registry.hold("another", ())
    assert sorted(key[3] for key in registry._entries) == [6, 7, 8]
    # A change without a change of the frame, too: the offset is dragged.
    stage.obj.pumice_time.frame_duration = 1
    for offset in range(9):
        stage.obj.pumice_time.frame_offset = offset
        stage.update(9)
        stage.opened()
        stage.update(9)
    assert len(registry._entries) == 3
    gate = stage.module.gates[2] = threading.Event()
    registry.hold("another", [(stage.obj.pumice.filepath, 2)])
    entry = registry.request(stage.obj.pumice.filepath, 2)
    registry.hold("another", ())
    assert entry.job.cancelled and entry.done.wait(10) and entry.volume is None and not gate.is_set(), "nobody waits for it any more"


def test_the_panel_of_time_is_there_for_series_alone(stage, tmp_path):
    panel = stage.load("panels").PUMICE_OBJECT_PT_time
    context = types.SimpleNamespace(object=stage.obj)
    assert panel.poll(context)
    stage.obj.pumice_time.time_steps = 0
    assert not panel.poll(context)
