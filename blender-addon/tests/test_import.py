# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the import: a source file becomes one object, its compressed form is kept, and a cancelled or failed import leaves nothing.

The compiled module is a mock; `test_real_volumes` imports real volumes.
"""

import importlib
import threading
import types

import bpy
import pytest

from stand_ins import Module, Volume


class Saving(Volume):
    """A volume whose `save` writes a file, as the real one does."""

    def save(self, path, job=None):
        with open(path, "wb") as file:
            file.write(b"PUMICE stand-in")


@pytest.fixture
def stage(blender, extension, monkeypatch, tmp_path):
    load = lambda name: importlib.import_module(f"{extension.__name__}.{name}")  # noqa: E731
    module = Module()
    module.compressed = []

    def compress(source, job=None, **choice):
        module.compressed.append((source, choice))
        return Saving(source)

    module.compress = compress
    monkeypatch.setattr(load("native"), "pumice", module)
    monkeypatch.setattr(load("native"), "MISSING", None)
    load("registry")._entries.clear()
    source = tmp_path / "cells.nrrd"
    source.write_bytes(b"NRRD")
    yield types.SimpleNamespace(bpy=blender, module=module, source=source, folder=tmp_path, load=load)
    load("registry")._entries.clear()


def volumes():
    return [o for o in bpy.data.objects if o.type == "MESH" and o.pumice.filepath]


def test_a_source_becomes_one_object_and_a_file_beside_it(stage):
    assert bpy.ops.pumice.import_volume(filepath=str(stage.source)) == {"FINISHED"}
    (obj,) = volumes()
    assert obj.name == "cells" and obj == bpy.context.view_layer.objects.active and obj.select_get()
    (kept,) = stage.folder.glob("cells-*.pumice")
    assert obj.pumice.filepath == str(kept) and obj.pumice.source_path == str(stage.source)
    assert bpy.context.scene.render.engine == "PUMICE"
    assert stage.load("registry").request(str(kept)).volume.path == str(stage.source), "it is open already"


def test_a_second_import_opens_what_the_first_has_made(stage):
    bpy.ops.pumice.import_volume(filepath=str(stage.source))
    bpy.ops.pumice.import_volume(filepath=str(stage.source))
    assert len(stage.module.compressed) == 1 and len(volumes()) == 2
    bpy.ops.pumice.import_volume(filepath=str(stage.source), use_spacing=True, spacing=(1, 2, 3), layer=2)
    assert stage.module.compressed[-1][1] == {"layer": 2, "spacing": (1.0, 2.0, 3.0)}
    assert len(list(stage.folder.glob("cells-*.pumice"))) == 2


def test_several_files_dropped_at_once_are_all_imported(stage):
    (stage.folder / "more.nrrd").write_bytes(b"NRRD")
    files = [{"name": "cells.nrrd"}, {"name": "more.nrrd"}]
    assert bpy.ops.pumice.import_volume(directory=str(stage.folder), files=files) == {"FINISHED"}
    assert {o.name for o in volumes()} == {"cells", "more"}


def test_an_own_file_is_opened_and_nothing_is_written(stage):
    path = stage.folder / "own.pumice"
    path.write_bytes(b"PUMICE stand-in")
    bpy.ops.pumice.import_volume(filepath=str(path))
    (obj,) = volumes()
    assert obj.pumice.filepath == str(path) and stage.module.compressed == []
    assert sorted(p.name for p in stage.folder.iterdir()) == ["cells.nrrd", "own.pumice"]


def test_what_cannot_be_read_is_one_line_and_leaves_nothing(stage):
    def refuse(source, job=None, **choice):
        raise stage.module.InputError(f"{source}: ends after 4 bytes of the header")

    stage.module.compress = refuse
    with pytest.raises(RuntimeError, match="ends after 4 bytes"):
        bpy.ops.pumice.import_volume(filepath=str(stage.source))
    with pytest.raises(RuntimeError, match="No such file"):
        bpy.ops.pumice.import_volume(filepath=str(stage.folder / "none.nrrd"))
    assert volumes() == [] and [p.name for p in stage.folder.iterdir()] == ["cells.nrrd"]
    assert not [m for m in bpy.data.meshes if "labels" in m.name]


@pytest.mark.parametrize(
    "wishes,line",
    [
        ({"longest_side": 0.0}, "Longest Side: expected a length above 0"),
        ({"longest_side": -5.0}, "Longest Side: expected a length above 0"),
        ({"use_spacing": True, "spacing": (0.0, 1.0, 1.0)}, "Voxel Size: expected three lengths above 0"),
        ({"use_spacing": True, "spacing": (1.0, 1.0, -2.0)}, "Voxel Size: expected three lengths above 0"),
    ],
)
def test_sizes_that_are_none_are_refused(stage, wishes, line):
    with pytest.raises(RuntimeError, match=line):
        bpy.ops.pumice.import_volume(filepath=str(stage.source), **wishes)
    assert not [obj for obj in bpy.data.objects if obj.pumice.filepath] and stage.module.compressed == []


def test_cancel_ends_the_work_and_leaves_nothing(stage):
    begun = threading.Event()

    def endless(source, job=None, **choice):
        begun.set()
        while not job.cancelled:
            pass
        raise stage.module.Cancelled("cancelled")

    stage.module.compress = endless
    path = str(stage.source)
    opening = stage.load("opening")
    wanted = [opening.Wanted(path, {}, str(stage.folder / "user"))]
    work = stage.load("background").Work("Reading", lambda job, tell: opening.open_all(wanted, job, tell), tells=True)
    assert begun.wait(10)
    work.job.cancel()
    work.thread.join(10)
    assert not work.thread.is_alive() and isinstance(work.error, stage.module.Cancelled) and work.result is None
    assert [p.name for p in stage.folder.iterdir()] == ["cells.nrrd"]


def test_the_object_is_undone_whole(stage):
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.pumice.import_volume(filepath=str(stage.source))
    bpy.ops.ed.undo_push(message="imported")
    bpy.ops.ed.undo()
    assert volumes() == []
    bpy.ops.ed.redo()
    (obj,) = volumes()
    assert stage.load("label_table").ids(obj.pumice.table).tolist() == Volume().labels.ids.tolist()


def test_a_saved_scene_finds_its_volume_again(stage):
    bpy.ops.pumice.import_volume(filepath=str(stage.source))
    blend = str(stage.folder / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    bpy.ops.wm.open_mainfile(filepath=blend)
    (obj,) = volumes()
    assert obj.pumice.table is not None and obj.pumice.labels == 3
    registry = stage.load("registry")
    assert registry.request(stage.load("file_paths").find(obj)[0]).done.wait(10)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert registry._entries == {}, "another file closes the volumes of the former"


def test_a_scene_that_was_moved_together_with_its_volume_finds_it(stage):
    bpy.ops.pumice.import_volume(filepath=str(stage.source))
    (kept,) = stage.folder.glob("cells-*.pumice")
    moved = stage.folder / "elsewhere"
    moved.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(moved / "scene.blend"))
    kept.rename(moved / kept.name)
    bpy.ops.wm.open_mainfile(filepath=str(moved / "scene.blend"))
    found, said = stage.load("file_paths").find(volumes()[0])
    assert found == str(moved / kept.name) and "is missing" in said


def test_dropping_is_offered_for_every_ending(stage):
    handler = next(c for c in bpy.types.FileHandler.__subclasses__() if c.bl_idname == "PUMICE_FH_volume")
    offered = set(handler.bl_file_extensions.split(";"))
    assert {".pumice", ".nrrd", ".nii", ".gz", ".tif", ".npy", ".mha"} <= offered
    assert handler.bl_import_operator == "pumice.import_volume"
    where = lambda kind: types.SimpleNamespace(area=types.SimpleNamespace(type=kind))  # noqa: E731
    assert handler.poll_drop(where("VIEW_3D")) and not handler.poll_drop(where("NODE_EDITOR"))
