# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests volumes with several time steps: pictures of an animation against `pumice render --time-steps` of the same scene, copies, saved files,
picking, proxies, a time step that cannot be read, and what stays open.

The oracle of a picture is the command, which knows nothing of frames; that of the voxels are numpy's arrays.
"""

import json
import subprocess
import time
import weakref

import bpy
import numpy as np
import pumice
import pytest

from series_scene import BALL, DIMS, RARE, SEEN, SPP, STEPS, dense, made, write
from stand_ins import Engine
from test_animation import animated, key, interpolate
from test_real_volumes import exr, load, settle, viewport_of


@pytest.fixture
def series(blender, tmp_path):
    return made(blender, write(tmp_path / "cells.pumice"))


def colors(picture):
    return np.stack([picture[next(n for n in picture if n.endswith(f".{c}") and "abel" not in n)] for c in "RGB"], axis=2)


@pytest.fixture
def by_command(series, pumice_command, tmp_path):
    """The pictures of the time steps by the command, of the scene that Blender exports."""
    assert bpy.ops.pumice.export_scene(filepath=str(tmp_path / "scene.json")) == {"FINISHED"}
    command = [pumice_command, "render", "scene.json", "--time-steps", "all", "-o", "step.exr", "--spp", str(SPP), "--backend", "cpu"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    pictures = [colors(exr(tmp_path / f"step_{number:04}.exr")) for number in range(1, STEPS + 1)]
    # Controls: each time step has a picture of its own, so a frame that shows another is convicted.
    assert len({picture.tobytes() for picture in pictures}) == STEPS
    return pictures


def steps_of(pictures, by_command):
    """The time steps that pictures show, by frame; None where it is none."""
    found = {}
    for frame, picture in pictures.items():
        same = [step for step, expected in enumerate(by_command) if np.array_equal(colors(picture).view(np.uint32), expected.view(np.uint32))]
        found[frame] = same[0] if same else None
    return found


def test_an_animation_is_the_commands_frame_by_frame(series, by_command, tmp_path):
    """Hold, loop, offset, step; a keyframed offset; and nothing outside of a clip. Time steps by frame are written by hand."""
    of, scene = series.pumice_time, bpy.context.scene
    assert (of.time_steps, of.frame_duration, of.frame_start, of.frame_offset, of.frame_step, of.sequence_mode) == (STEPS, STEPS, 1, 0, 1, "EXTEND")
    assert steps_of(animated(bpy, scene, tmp_path, range(0, 8)), by_command) == {0: 0, 1: 0, 2: 1, 3: 2, 4: 3, 5: 4, 6: 4, 7: 4}
    of.sequence_mode, of.frame_start, of.frame_offset, of.frame_duration, of.frame_step = "REPEAT", 2, 1, 2, 2
    assert steps_of(animated(bpy, scene, tmp_path, range(1, 8)), by_command) == {1: 2, 2: 1, 3: 1, 4: 2, 5: 2, 6: 1, 7: 1}
    of.frame_duration, of.frame_step = 1, 1
    key(of, "frame_offset", [0, 3, 1], frames=(1, 2, 3))
    interpolate(series, "CONSTANT")
    assert steps_of(animated(bpy, scene, tmp_path, range(1, 4)), by_command) == {1: 0, 2: 3, 3: 1}
    series.animation_data_clear()
    of.sequence_mode = "CLIP"
    series.pumice_time.frame_offset = 4
    pictures = animated(bpy, scene, tmp_path, [1, 2])
    assert steps_of(pictures, by_command) == {1: None, 2: 4}
    assert not pictures[1]["Label.X"].any(), "nothing is shown, and nothing is left of another time step"


def test_labels_are_there_when_they_are_there_in_their_own_colors(series, extension, tmp_path):
    """Rows of the label pass against the ids of the arrays, and no row changes its color."""
    ids = np.concatenate([[0], load(extension, "label_table").ids(series.pumice.table).astype(np.uint64)])
    table = load(extension, "label_table").colors(series.pumice.table).copy()
    places = np.array([vertex.co[:] for vertex in series.pumice.table.vertices])
    assert (places >= 0.0).all() and (places <= DIMS).all(), "also of a label that is not there at the import"
    shown = [set(np.unique(ids[picture["Label.X"].astype(int)]).tolist()) - {0} for picture in animated(bpy, bpy.context.scene, tmp_path, range(1, 6)).values()]
    for step, labels in enumerate(shown):
        assert labels <= set(np.unique(dense(step)).tolist()) and BALL in labels
    assert [RARE in labels for labels in shown] == [step in SEEN for step in range(STEPS)]
    assert np.array_equal(load(extension, "label_table").colors(series.pumice.table), table)


def label_pass(tmp_path):
    bpy.context.scene.render.filepath = str(tmp_path / "still.exr")
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    return exr(tmp_path / "still.exr")["Label.X"].astype(int)


def test_copies_have_frames_of_their_own_and_all_of_it_is_saved(series, by_command, tmp_path):
    """A copy with another offset hides the original; the file is opened again, and the object is appended to another."""
    scene = bpy.context.scene
    bpy.ops.object.select_all(action="DESELECT")
    series.select_set(True)
    bpy.context.view_layer.objects.active = series
    bpy.ops.object.duplicate()
    copy = bpy.context.object
    copy.pumice_time.frame_offset, copy.pumice_time.frame_duration = 2, 1
    series.hide_render = True
    assert steps_of(animated(bpy, scene, tmp_path, [1, 4]), by_command) == {1: 2, 4: 2}
    series.hide_render, copy.hide_render = False, True
    assert steps_of(animated(bpy, scene, tmp_path, [1, 4]), by_command) == {1: 0, 4: 3}

    series.pumice_time.sequence_mode, series.pumice_time.frame_start = "PING_PONG", -1
    name = series.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    # Frame 1 is two behind the start, frame 5 six: 0 1 2 3 4 3 2.
    assert steps_of(animated(bpy, bpy.context.scene, tmp_path, [1, 5]), by_command) == {1: 2, 5: 2}
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    for link in (False, True):
        with bpy.data.libraries.load(str(tmp_path / "scene.blend"), link=link) as (_, here):
            here.objects = [name]
        found = here.objects[0]
        assert (found.pumice_time.time_steps, found.pumice_time.sequence_mode, found.pumice_time.frame_start) == (STEPS, "PING_PONG", -1)
    bpy.context.scene.collection.objects.link(found)
    override = found.override_create(remap_local_usages=True)
    override.pumice_time.frame_offset = 3
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "other.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "other.blend"))
    again = next(o for o in bpy.data.objects if o.override_library is not None and o.pumice.filepath)
    assert again.pumice_time.frame_offset == 3 and again.pumice_time.time_steps == STEPS


def test_picking_is_on_the_time_step_that_is_shown(series, extension, tmp_path):
    read, scene = load(extension, "label_table"), bpy.context.scene
    row = read.ids(series.pumice.table).tolist().index(BALL) + 1
    seen = {}
    for frame in (1, 5):
        scene.frame_set(frame)
        seen[frame] = label_pass(tmp_path) == row
        y, x = (int(v) for v in np.argwhere(seen[frame]).mean(axis=0).round())
        assert seen[frame][y, x] and (frame == 1 or not seen[1][y, x]), "it has moved"
        assert bpy.ops.pumice.labels_pick(x=x, y=y) == {"FINISHED"}
        assert read.ids(series.pumice.table)[read.selected(series.pumice.table)].tolist() == [BALL]
        # Control: where it is at the other end, there is another label or none.
        y, x = (int(v) for v in np.argwhere(seen[1]).mean(axis=0).round())
        if frame == 5:
            bpy.ops.pumice.labels_pick(x=x, y=y)
            assert BALL not in read.ids(series.pumice.table)[read.selected(series.pumice.table)].tolist()
    bpy.ops.pumice.labels_select(ids=str(RARE))
    scene.frame_set(1)
    with pytest.raises(RuntimeError, match="not there at the time step that is shown"):
        bpy.ops.pumice.labels_frame()
    scene.frame_set(3)
    assert bpy.ops.pumice.labels_frame() == {"FINISHED"}


def test_the_viewport_follows_the_frame(series, extension, monkeypatch):
    scene = bpy.context.scene
    scene.pumice.viewport_samples = 4
    engine = Engine()
    context, view = viewport_of(bpy, extension, monkeypatch, engine)
    picture = lambda shown: np.array(np.asarray(settle(bpy, shown, context)))  # noqa: E731
    first = picture(view)
    scene.frame_set(4)
    before = engine.updates
    view.draw(context, bpy.context.evaluated_depsgraph_get())
    assert engine.updates == before + 1, "a redraw at another frame asks for an update"
    fourth = picture(view)
    assert not np.array_equal(first, fourth)
    fresh_engine = Engine(4712)
    fresh = load(extension, "viewport").of(fresh_engine)
    assert np.array_equal(picture(fresh), fourth), "as a viewport that never saw another frame"
    scene.frame_set(1)
    assert np.array_equal(picture(view), first)
    # What the session shows is picked and outlined: number of the instance, and row of the table.
    film = load(extension, "label_film").of_viewport(view, 30.0)
    assert film is not None and {obj for obj, _ in film.inside(0, 0, *film.pixels.shape[1::-1])} == {series}


def ball(mesh, extension, series):
    """Lowest and highest x of a mesh's faces of the ball, in whole voxels, because a proxy lies a fifth of a cell outside; None where it has none."""
    row = load(extension, "label_table").ids(series.pumice.table).tolist().index(BALL)
    labels = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.attributes["label"].data.foreach_get("value", labels)
    x = [mesh.vertices[v].co.x for polygon in np.flatnonzero(labels == row) for v in mesh.polygons[polygon].vertices]
    return (round(min(x)), round(max(x))) if x else None


def bounds(step):
    there = np.flatnonzero((dense(step) == BALL).any(axis=(1, 2)))
    return there[0], there[-1] + 1


def test_the_proxy_is_that_of_the_time_step_also_in_another_engines_animation(series, extension, tmp_path):
    scene = bpy.context.scene
    assert ball(series.data, extension, series) == bounds(0)
    scene.frame_set(4)
    assert ball(series.data, extension, series) == bounds(0), "in the background nothing follows by itself"
    assert bpy.ops.pumice.update_proxy() == {"FINISHED"}
    assert ball(series.data, extension, series) == bounds(3) != bounds(0)
    # What the timer does in a window: a surface that is being made is finished, then that of the frame follows.
    tick, ends = load(extension, "proxy_update")._tick, time.monotonic() + 30.0
    scene.frame_set(2)
    assert tick() is not None
    scene.frame_set(5)
    seen = []
    while tick() is not None and time.monotonic() < ends:
        seen.append(ball(series.data, extension, series))
        time.sleep(0.002)
    assert bounds(1) in seen and ball(series.data, extension, series) == bounds(4)
    scene.frame_set(2)
    tick()
    scene.frame_set(5)
    assert tick() is None and ball(series.data, extension, series) == bounds(4), "back where it is: nothing is made"
    seen = []
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    look = lambda *_: seen.append(ball(series.data, extension, series))  # noqa: E731
    bpy.app.handlers.render_post.append(look)
    try:
        pictures = animated(bpy, scene, tmp_path, [1, 2, 3])
    finally:
        bpy.app.handlers.render_post.remove(look)
    assert seen == [bounds(0), bounds(1), bounds(2)]
    assert len({picture["Combined.R"].tobytes() for picture in pictures.values()}) == 3
    series.pumice_time.sequence_mode = "CLIP"
    scene.frame_set(9)
    assert bpy.ops.pumice.update_proxy() == {"FINISHED"} and not series.data.polygons, "a box in lines"


def test_a_time_step_that_cannot_be_read_ends_the_animation_in_one_line(series, tmp_path):
    """The file was replaced by a shorter series with the same labels."""
    write(tmp_path / "cells.pumice", steps=4)
    with pytest.raises(RuntimeError) as raised:
        animated(bpy, bpy.context.scene, tmp_path, [3, 4, 5, 6])
    said = str(raised.value).strip()
    assert "Frame 5: " in said and "cells.pumice: time step 4 is out of range" in said and "defect" not in said and "Traceback" not in said
    assert sorted(p.name for p in tmp_path.glob("anim_*")) == ["anim_0003.exr", "anim_0004.exr"]
    # Control: the whole series is read to its end.
    write(tmp_path / "cells.pumice")
    assert len(animated(bpy, bpy.context.scene, tmp_path, [5, 6])) == 2


def test_reload_reads_all_time_steps_again(series, tmp_path, capfd):
    write(tmp_path / "cells.pumice", steps=6)
    bpy.context.scene.frame_set(5)
    assert bpy.ops.pumice.reload() == {"FINISHED"}
    assert "labels kept, none new, none gone" in capfd.readouterr().out
    of = series.pumice_time
    assert (of.time_steps, of.frame_duration) == (6, 6)
    of.frame_duration, of.frame_offset = 2, 1
    write(tmp_path / "cells.pumice", steps=5)
    bpy.ops.pumice.reload()
    assert (of.time_steps, of.frame_duration, of.frame_offset) == (5, 2, 1), "what the user has set stays"
    pumice.compress(dense(2)).save(tmp_path / "cells.pumice")
    with pytest.raises(RuntimeError, match="time"):
        label_pass(tmp_path)


@pytest.mark.parametrize("most,frames", [(2, 20), (100, 6)])
def test_twenty_frames_keep_few_time_steps_in_memory(blender, extension, monkeypatch, tmp_path, most, frames):
    """After a frame there are its time step and the one of before. With a limit that is never reached all of them are: the control."""
    registry, seen, counts, steps = load(extension, "registry"), weakref.WeakSet(), [], []
    registry._entries.clear()
    monkeypatch.setattr(registry, "MOST_TIME_STEPS", most)
    made(blender, write(tmp_path / "cells.pumice", steps=20))

    def look(*_):
        seen.update(entry.volume for entry in registry._entries.values())
        counts.append(len(seen))
        steps.append([key[3] for key in registry._entries])

    bpy.app.handlers.render_post.append(look)
    try:
        pictures = animated(bpy, bpy.context.scene, tmp_path, range(1, frames + 1))
    finally:
        bpy.app.handlers.render_post.remove(look)
    assert len(pictures) == len(counts) == frames
    expected = [min(frame, most) for frame in range(1, frames + 1)]
    assert counts == expected and list(map(len, steps)) == expected, "nothing else holds a volume, and no cycle of references"
    assert steps[-1] == list(range(frames))[-most:]


def test_exports_and_exact_meshes_are_of_the_time_step_that_is_shown(series, extension, tmp_path):
    bpy.context.scene.frame_set(4)
    assert bpy.ops.pumice.export_scene(filepath=str(tmp_path / "scene.json")) == {"FINISHED"}
    said = json.loads((tmp_path / "scene.json").read_text())
    assert said["instances"][0]["reading"] == {"time": 3}
    # Exports read the file by themselves.
    written = {}
    for frame in (4, 1, 9):
        bpy.context.scene.frame_set(frame)
        assert bpy.ops.pumice.export_gltf(filepath=str(tmp_path / "cells.glb")) == {"FINISHED"}
        written[frame] = (tmp_path / "cells.glb").read_bytes()
    assert len(set(written.values())) == 3
    series.pumice_time.frame_offset, series.pumice_time.frame_duration = 3, 1
    assert bpy.ops.pumice.export_gltf(filepath=str(tmp_path / "cells.glb")) == {"FINISHED"}
    assert (tmp_path / "cells.glb").read_bytes() == written[4]
    assert bpy.ops.pumice.make_exact_mesh() == {"FINISHED"}
    exact = next(o for o in bpy.data.objects if o.name.endswith("exact"))
    assert ball(exact.data, extension, series) == bounds(3) != bounds(0)
