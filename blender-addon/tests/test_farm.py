# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the recipes of docs/farm.md: a moved folder, whose frames several nodes draw in chunks, has the pictures of one run, bit for bit; a node that
lacks the volume, or memory, fails with one line. The volume is a time series, and the camera moves.

The oracle is *Render Animation* in this process, before anything is moved. `farm_node` stands for the command line.
"""

import json
import shutil
from pathlib import Path

import bpy
import numpy as np
import pytest

import farm_node
from series_scene import STEPS, made, write
from test_animation import animated, key
from test_real_volumes import exr

FRAMES = range(1, STEPS + 1)
JOBS = json.loads((Path(__file__).parent / "flamenco_jobs.json").read_text())
# As in docs/farm.md.
PREFERENCES = "import bpy; p = bpy.context.preferences.addons['bl_ext.user_default.pumice'].preferences; "


@pytest.fixture(scope="module")
def expected():
    """The pictures of one run, by frame; `shot` fills it."""
    return {}


@pytest.fixture
def shot(blender, tmp_path, expected):
    """The path of a .blend file in a folder that has been moved, with its volume in a folder beside."""
    (tmp_path / "project" / "scenes").mkdir(parents=True)
    made(blender, write(tmp_path / "project" / "cells.pumice"))
    scene = bpy.context.scene
    key(scene.camera, "location", [scene.camera.location.copy(), scene.camera.location * 1.1])
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    if not expected:
        expected |= animated(blender, scene, tmp_path, FRAMES)
        colors = {frame: picture["Combined.R"].tobytes() for frame, picture in expected.items()}
        assert len(set(colors.values())) == STEPS, "each frame has a picture of its own"
    assert bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "project" / "scenes" / "shot.blend")) == {"FINISHED"}
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    shutil.move(tmp_path / "project", tmp_path / "node")
    return tmp_path / "node" / "scenes" / "shot.blend"


def same(path, expected):
    """Whether a file has these pixels in all channels."""
    found = exr(path)
    return found.keys() == expected.keys() and all(np.array_equal(found[name], expected[name]) for name in found)


def test_chunks_of_a_moved_folder_are_one_animation(shot, expected, tmp_path):
    start = ["-b", shot, "-E", "PUMICE"]
    limit = ["--python-exit-code", "1", "--python-expr", PREFERENCES + "p.backend = 'cpu'; p.memory_limit = 64"]
    chunks = [["-f", "1..2"], [*limit, "-f", "3"], [*limit, "-s", "4", "-e", "5", "-a"]]
    for number, chunk in enumerate(chunks):
        done = farm_node.blender([*start, "-o", tmp_path / "farm_####", *chunk], RAYON_NUM_THREADS=str(1 + number))
        assert done.returncode == 0, done.stdout + done.stderr
    assert sorted(path.name for path in tmp_path.glob("farm_*")) == [f"farm_{frame:04}.exr" for frame in FRAMES]
    assert all(same(tmp_path / f"farm_{frame:04}.exr", expected[frame]) for frame in FRAMES)
    # Negative control: another seed is another picture, and so is another frame.
    done = farm_node.blender([*start, "-o", tmp_path / "seed_####", "--python-expr", "import bpy; bpy.context.scene.pumice.seed = 8", "-f", "1"])
    assert done.returncode == 0 and not same(tmp_path / "seed_0001.exr", expected[1])
    assert not same(tmp_path / "farm_0002.exr", expected[1])


@pytest.mark.turn(0, 2)
def test_a_node_that_cannot_fails_with_a_line(shot, tmp_path):
    out = ["-o", tmp_path / "none_####"]
    # What needs the whole volume in memory is drawn without a limit, and refused with one: the recipe's limit has reached the renderer.
    smooth = "bpy.context.scene.pumice.smooth_voxels = True; "
    done = farm_node.blender(["-b", shot, "-E", "PUMICE", "--python-expr", "import bpy; " + smooth, "-o", tmp_path / "smooth_####", "-f", "2"])
    assert done.returncode == 0 and (tmp_path / "smooth_0002.exr").exists(), done.stdout + done.stderr
    done = farm_node.blender(["-b", shot, "-E", "PUMICE", "--python-expr", PREFERENCES + smooth + "p.memory_limit = 64", *out, "-f", "2"])
    assert done.returncode == 1 and "memory limit: smooth shading of voxels" in done.stderr, done.stdout + done.stderr
    # A setting that fails ends the node before it draws with others.
    done = farm_node.blender(["-b", shot, "-E", "PUMICE", "--python-exit-code", "1", "--python-expr", PREFERENCES + "p.memory_limit = 'x'", *out, "-f", "2"])
    assert done.returncode == 1
    volume = shot.parents[1] / "cells.pumice"
    volume.unlink()
    done = farm_node.blender(["-b", shot, "-E", "PUMICE", *out, "-s", "2", "-e", "4", "-a"])
    lines = [line for line in (done.stdout + done.stderr).splitlines() if "Frame" in line]
    assert done.returncode == 1 and len(set(lines)) == 1, lines
    assert lines[0].endswith(f"Frame 2: {volume}: the volume's file is missing; set its path in the object's Pumice panel")
    assert not list(tmp_path.glob("none_*"))


@pytest.mark.turn(1, 2)
def test_the_tasks_of_flamenco_draw_the_animation(shot, expected, tmp_path):
    """The commands are those of `tests/python/test_flamenco.py`; Flamenco puts its own arguments and the file before them."""
    (tmp_path / "out").mkdir()
    # The file says otherwise than the tasks: Flamenco's add-on sends it as it is.
    bpy.ops.wm.open_mainfile(filepath=str(shot))
    render = bpy.context.scene.render
    render.use_file_extension, render.use_overwrite, render.use_placeholder = False, True, True
    assert bpy.ops.wm.save_mainfile() == {"FINISHED"}

    def run(arguments):
        filled = [word.replace("{out}", str(tmp_path / "out")) for word in arguments]
        done = farm_node.blender(["-y", "-b", shot, *filled])
        assert done.returncode == 0, done.stdout + done.stderr
        return {int(path.stem): path for path in (tmp_path / "out").rglob("*.exr")}

    tasks = list(JOBS["whole"]["tasks"].values())
    found = [run(arguments) for arguments in tasks][-1]
    assert sorted(found) == [1, 2, 3, 5] and all(same(path, expected[frame]) for frame, path in found.items())
    # A task that runs once more draws the frames whose pictures are not there.
    written = {frame: path.stat().st_mtime_ns for frame, path in found.items()}
    found[2].unlink()
    found = run(tasks[0])
    assert sorted(found) == [1, 2, 3, 5] and same(found[2], expected[2])
    assert {frame for frame, path in found.items() if path.stat().st_mtime_ns != written[frame]} == {2}
