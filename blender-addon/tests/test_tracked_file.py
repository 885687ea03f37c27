# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that Blender and packers find the file of a volume object. The oracle is Blender Asset Tracer, which reads .blend files without Blender: what
it traces of a saved file, and a packed folder that a fresh Blender renders after the original is gone."""

import importlib
import shutil
from pathlib import Path

import bpy
import numpy as np
import pytest
from blender_asset_tracer import blendfile, pack, trace

import farm_node
from share import one_of_today
from test_file_paths import save, volume
from test_object_is_blenders import SIZE, label_pass, made
from test_real_volumes import exr


@pytest.fixture
def files(extension):
    return importlib.import_module(f"{extension.__name__}.file_paths")


@pytest.fixture
def project(blender, tmp_path):
    """A project with its .blend in `scenes` and its volume in `data`; nothing is saved yet."""
    (tmp_path / "project" / "scenes").mkdir(parents=True)
    made(tmp_path / "project" / "data" / "cells.pumice")
    return tmp_path / "project"


def opened(path):
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return volume()


def traced(blend):
    """The files, other than .blend files, that Blender Asset Tracer finds, with the path as it is stored."""
    # It keeps what it has read of a path.
    blendfile.close_all_cached()
    uses = [one for one in trace.deps(Path(blend)) if one.block.code != b"LI"]
    return {(str(one.abspath.resolve()), bytes(one.asset_path).decode()) for one in uses}


def empty_file(path):
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    return save(path)


def brought(blend, name, link):
    """The volume object of another file, in the scene."""
    with bpy.data.libraries.load(str(blend), link=link) as (_, here):
        here.objects = [name]
    bpy.context.scene.collection.objects.link(here.objects[0])
    return here.objects[0]


def without_data_block(extension, path):
    """Saves the file as a version of the extension that knows no such data-block does."""
    handlers = importlib.import_module(f"{extension.__name__}.file_paths").HANDLERS
    for calls, call in handlers:
        calls.remove(call)
    volume().pumice.filepath = bpy.path.relpath(volume().pumice.filepath, start=str(path.parent))
    volume().pumice.tracked_file = None
    try:
        return save(path)
    finally:
        for calls, call in handlers:
            calls.append(call)


def test_a_saved_file_names_the_volume(project, extension):
    file = str(project / "data" / "cells.pumice")
    blend = save(project / "scenes" / "one.blend")
    assert traced(blend) == {(file, "//../data/cells.pumice")}
    assert file in [str(Path(path).resolve()) for path in bpy.utils.blend_paths(absolute=True)]
    assert volume().pumice.tracked_file.filepath == volume().pumice.filepath == "//../data/cells.pumice"
    # Saved elsewhere, saved again, and as a copy: the path is that of the file that is written, and of the one that is open.
    assert traced(save(project / "two.blend")) == {(file, "//data/cells.pumice")}
    assert traced(save(project / "scenes" / "copy.blend", copy=True)) == {(file, "//../data/cells.pumice")}
    assert volume().pumice.tracked_file.filepath == volume().pumice.filepath == "//data/cells.pumice"
    assert traced(save(project / "two.blend")) == {(file, "//data/cells.pumice")} and len(bpy.data.volumes) == 1
    # It is no object, and nothing has opened the file for it.
    block = opened(project / "scenes" / "copy.blend").pumice.tracked_file
    assert block.users == 1 and not block.use_fake_user and not block.grids.is_loaded and len(block.grids) == 0
    assert not [o for o in bpy.data.objects if o.type == "VOLUME"]


def test_an_older_file_opens_and_names_it_once_it_is_saved(project, extension, files):
    """The negative control of the others: without the data-block nobody finds the file."""
    blend = without_data_block(extension, project / "scenes" / "old.blend")
    assert traced(blend) == set()
    obj = opened(blend)
    assert obj.pumice.tracked_file is None and files.find(obj) == (str(project / "data" / "cells.pumice"), None)
    assert len(traced(save(blend))) == 1


def test_without_relative_paths_the_absolute_one_is_named(project, monkeypatch):
    monkeypatch.setattr(bpy.context.preferences.filepaths, "use_relative_paths", False)
    save(project / "scenes" / "one.blend")
    file = str(project / "data" / "cells.pumice")
    assert volume().pumice.filepath == file
    assert {path for path, _ in traced(save(project / "scenes" / "one.blend"))} == {file}


def test_it_goes_with_the_object(project):
    blend = save(project / "one.blend")
    first = volume()
    other = first.copy()
    bpy.context.scene.collection.objects.link(other)
    assert other.pumice.tracked_file == first.pumice.tracked_file, "copies share it"
    shutil.copyfile(project / "data" / "cells.pumice", project / "data" / "more.pumice")
    other.pumice.filepath = "//data/more.pumice"
    assert {stored for _, stored in traced(save(blend))} == {"//data/cells.pumice", "//data/more.pumice"}
    first.pumice.filepath = "//data/more.pumice"
    assert {stored for _, stored in traced(save(blend))} == {"//data/more.pumice"}
    first.pumice.filepath = ""
    bpy.data.objects.remove(other)
    save(blend)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert traced(blend) == set() and len(bpy.data.volumes) == 0


def test_undo_brings_back_what_was_there(project):
    obj_name, place = volume().name, volume().location.x
    bpy.ops.ed.undo_push(message="before")
    save(project / "one.blend")
    volume().location.x = place + 1.0
    bpy.ops.ed.undo_push(message="moved")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert bpy.data.objects[obj_name].location.x == place and bpy.data.objects[obj_name].pumice.tracked_file is None
    assert len(traced(save(project / "one.blend"))) == 1
    assert bpy.ops.ed.redo() == {"FINISHED"}
    assert bpy.data.objects[obj_name].location.x == place + 1.0
    assert len(traced(save(project / "one.blend"))) == 1


def test_an_appended_volume_is_named_from_its_new_file(project, files, tmp_path):
    blend, name = save(project / "scenes" / "one.blend"), volume().name
    new = empty_file(tmp_path / "away" / "new.blend")
    obj = brought(blend, name, link=False)
    # The older memory of the place is not what finds it.
    obj.pumice.last_filepath = ""
    file = str(project / "data" / "cells.pumice")
    assert files.find(obj)[0] == file
    assert traced(save(new)) == {(file, "//../project/data/cells.pumice")}
    assert volume().pumice.filepath == "//../project/data/cells.pumice" and files.find(volume()) == (file, None)


@pytest.mark.parametrize("override", [False, True])
def test_a_linked_volume_is_named_by_its_library(project, files, tmp_path, override):
    blend, name = save(project / "scenes" / "one.blend"), volume().name
    new = empty_file(tmp_path / "away" / "new.blend")
    obj = brought(blend, name, link=True)
    if override:
        obj.override_create(remap_local_usages=True)
    file = str(project / "data" / "cells.pumice")
    assert traced(save(new)) == {(file, "//../data/cells.pumice")}
    assert files.find(opened(new)) == (file, None)
    # When it is gone from the file, so is what named it.
    for one in [o for o in bpy.data.objects if o.pumice.filepath]:
        bpy.data.objects.remove(one)
    save(new)
    bpy.ops.wm.open_mainfile(filepath=str(new))
    assert traced(new) == set() and not bpy.context.scene.pumice.linked_files


def test_what_blender_packs_is_not_saved(project):
    blend = save(project / "one.blend")
    assert bpy.ops.file.pack_all() == {"FINISHED"} and volume().pumice.tracked_file.packed_file is not None
    save(blend)
    assert volume().pumice.tracked_file.packed_file is None
    assert traced(blend) == {(str(project / "data" / "cells.pumice"), "//data/cells.pumice")}
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert [block.packed_file for block in bpy.data.volumes] == [None]


def test_find_missing_files_finds_the_volume(project, files):
    blend = save(project / "one.blend")
    (project / "elsewhere").mkdir()
    moved = (project / "data" / "cells.pumice").rename(project / "elsewhere" / "cells.pumice")
    obj = opened(blend)
    obj.pumice.last_filepath = ""
    missing = str(project / "data" / "cells.pumice")
    assert files.find(obj) == (missing, None)
    bpy.ops.file.find_missing_files(find_all=True, directory=str(project))
    assert files.find(obj) == (str(moved), f"{obj.name}: {missing} is missing; {moved} is taken instead")
    assert traced(save(blend)) == {(str(moved), "//elsewhere/cells.pumice")} and files.find(obj) == (str(moved), None)


@pytest.mark.parametrize("linked", one_of_today([False, True]))
def test_a_packed_folder_is_rendered_where_the_original_is_gone(project, extension, tmp_path, linked):
    """The volume lies outside of the project that is packed, so the packer writes a new path, into the data-block alone."""
    scene = bpy.context.scene
    blend, expected = save(project / "scenes" / "one.blend"), label_pass(tmp_path)
    if linked:
        name, camera = volume().name, scene.camera.name
        new = empty_file(project / "scenes" / "new.blend")
        brought(blend, name, link=True)
        bpy.context.scene.camera = brought(blend, camera, link=True)
        bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = SIZE
        bpy.context.scene.render.engine = "PUMICE"
        importlib.import_module("test_object_is_blenders").prepare(bpy.context.scene)
        blend = save(new)
    away = tmp_path / "node"
    with pack.Packer(blend, project / "scenes", away) as packer:
        packer.strategise()
        packer.execute()
        assert not packer.missing_files
    [found] = away.rglob("cells.pumice")
    assert found.parent != away / "data"
    shutil.rmtree(project)
    done = farm_node.blender(["-b", away / blend.name, "-E", "PUMICE", "-o", tmp_path / "node_####", "-f", "1"])
    assert done.returncode == 0, done.stdout + done.stderr
    assert np.array_equal(exr(tmp_path / "node_0001.exr")["Label.X"], expected)
    # Negative control: without the packed volume there is no picture.
    found.unlink()
    done = farm_node.blender(["-b", away / blend.name, "-E", "PUMICE", "-o", tmp_path / "none_####", "-f", "1"])
    assert done.returncode == 1 and not (tmp_path / "none_0001.exr").exists()
