# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests where a volume's files are found: relative paths after saving, moving and copying, and a moved folder in a fresh Blender."""

import importlib
import os
import shutil
import subprocess
import sys

import bpy
import numpy as np
import pytest

from test_object_is_blenders import label_pass, made, same
from test_real_volumes import exr


@pytest.fixture
def find(extension):
    return importlib.import_module(f"{extension.__name__}.file_paths").find


@pytest.fixture
def project(blender, tmp_path):
    """A project with its .blend in `scenes` and its volume in `data`."""
    made(tmp_path / "project" / "cells.pumice")
    (tmp_path / "project" / "scenes").mkdir()
    return tmp_path / "project"


def volume():
    return next(o for o in bpy.data.objects if o.pumice.filepath)


def save(path, **more):
    path.parent.mkdir(exist_ok=True)
    assert bpy.ops.wm.save_as_mainfile(filepath=str(path), **more) == {"FINISHED"}
    return path


def test_saving_makes_paths_relative_and_saving_elsewhere_adapts_them(project, find):
    volume_file = str(project / "cells.pumice")
    assert volume().pumice.filepath == volume_file, "a file that was never saved has no folder"
    save(project / "scenes" / "one.blend")
    assert volume().pumice.filepath == volume().pumice.source_path == "//../cells.pumice"
    assert find(volume()) == (volume_file, None)
    save(project / "two.blend")
    assert volume().pumice.filepath == "//cells.pumice" and find(volume()) == (volume_file, None)
    # A copy has its own paths, and the file that is open keeps its own.
    save(project / "scenes" / "copy.blend", copy=True)
    assert volume().pumice.filepath == "//cells.pumice"
    bpy.ops.wm.open_mainfile(filepath=str(project / "scenes" / "copy.blend"))
    assert volume().pumice.filepath == "//../cells.pumice" and find(volume()) == (volume_file, None)


def test_a_copy_of_a_file_that_was_never_saved_leaves_absolute_paths(project, find):
    save(project / "scenes" / "copy.blend", copy=True)
    assert bpy.data.filepath == "" and volume().pumice.filepath == str(project / "cells.pumice")


def test_without_the_preference_absolute_paths_stay(project, find, monkeypatch):
    monkeypatch.setattr(bpy.context.preferences.filepaths, "use_relative_paths", False)
    save(project / "scenes" / "one.blend")
    assert volume().pumice.filepath == str(project / "cells.pumice")
    volume().pumice.filepath = "//../cells.pumice"
    save(project / "two.blend")
    assert volume().pumice.filepath == "//cells.pumice", "a relative path follows the file all the same"


def test_a_moved_folder_is_found_silently_and_a_scattered_one_is_said(project, find):
    save(project / "scenes" / "one.blend")
    moved = project.parent / "moved"
    project.rename(moved)
    bpy.ops.wm.open_mainfile(filepath=str(moved / "scenes" / "one.blend"))
    assert find(volume()) == (str(moved / "cells.pumice"), None)

    beside = moved / "scenes" / "cells.pumice"
    (moved / "cells.pumice").rename(beside)
    found, line = find(volume())
    assert found == str(beside)
    assert line == f"cells: {moved / 'cells.pumice'} is missing; {beside} is taken instead"
    # Saving writes down where it is now.
    save(moved / "scenes" / "one.blend")
    assert volume().pumice.filepath == "//cells.pumice" and find(volume()) == (str(beside), None)


def test_the_volume_of_a_linked_object_is_found_beside_the_library(project, find, tmp_path):
    save(project / "scenes" / "one.blend")
    beside = project / "scenes" / "cells.pumice"
    (project / "cells.pumice").rename(beside)
    name = volume().name
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    save(tmp_path / "away" / "other.blend")
    with bpy.data.libraries.load(str(project / "scenes" / "one.blend"), link=True) as (_, here):
        here.objects = [name]
    found, line = find(here.objects[0])
    assert found == str(beside) and "is missing" in line


def test_a_missing_file_is_said_with_the_path_where_it_should_be(project, find, tmp_path):
    save(project / "one.blend")
    (project / "cells.pumice").unlink()
    assert find(volume()) == (str(project / "cells.pumice"), None)
    bpy.context.scene.render.filepath = str(tmp_path / "a.exr")
    with pytest.raises(RuntimeError, match=f"{project / 'cells.pumice'}: the volume's file is missing; set its path"):
        bpy.ops.render.render(write_still=True)


def test_a_path_of_another_system_is_found_beside_the_file(project, find):
    save(project / "one.blend")
    volume().pumice.filepath, volume().pumice.last_filepath = r"C:\data\cells.pumice", ""
    assert find(volume())[0] == str(project / "cells.pumice")


FRESH = """
import os, shutil, sys, bpy, addon_utils
assert addon_utils.enable(sys.argv[1], persistent=True) is not None
bpy.ops.wm.open_mainfile(filepath=sys.argv[2])
bpy.context.scene.render.filepath = sys.argv[3]
status = bpy.ops.render.render(write_still=True)
sys.stdout.flush()
shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
os._exit(0 if status == {"FINISHED"} else 1)
"""


@pytest.mark.full
def test_a_moved_folder_is_rendered_by_a_fresh_blender(project, extension, tmp_path):
    expected = label_pass(tmp_path)
    save(project / "scenes" / "one.blend")
    moved = tmp_path / "somewhere" / "else"
    shutil.copytree(project, moved)
    shutil.rmtree(project)

    def fresh(out):
        return subprocess.run(
            [sys.executable, "-c", FRESH, extension.__name__, str(moved / "scenes" / "one.blend"), str(out)],
            env=os.environ, capture_output=True, text=True, timeout=120,
        )

    done = fresh(tmp_path / "fresh.exr")
    assert done.returncode == 0, done.stdout + done.stderr
    found = exr(tmp_path / "fresh.exr")["Label.X"]
    assert same(found, expected) and len(np.unique(found)) >= 3
    # Negative control: without the volume there is no picture.
    (moved / "cells.pumice").unlink()
    done = fresh(tmp_path / "none.exr")
    assert not (tmp_path / "none.exr").exists() or done.returncode != 0
    assert "the volume's file is missing" in done.stdout + done.stderr
