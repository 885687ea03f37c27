# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the import by URL against a server on loopback: the voxels are those of the array that was written, few chunks are asked for, Blender's
*Online Access* is respected, and what fails is one line and leaves nothing.
"""

import importlib
import json
import socket
import threading
import types
from pathlib import Path

import bpy
import numpy as np
import pumice
import pytest
from store_server import serving

DIMS = (20, 12, 8)
CHUNK = (10, 12, 8)


def labels():
    """array[x, y, z] of two chunks."""
    x, y, z = np.indices(DIMS)
    return (x // 5 * 10 + y // 6 + z // 4 * 100 + 1).astype("u4")


def write(folder, array, resolution=(8, 8, 40)):
    """A folder that Neuroglancer reads, of raw chunks and two levels, the second with every other voxel."""
    scales = []
    for step, key in ((1, "fine"), (2, "coarse")):
        level = array[::step, ::step, ::step]
        chunk = [side // step for side in CHUNK]
        scales.append(
            {
                **{"key": key, "size": level.shape, "chunk_sizes": [chunk], "voxel_offset": [0, 0, 0], "encoding": "raw"},
                "resolution": [side * step for side in resolution],
            }
        )
        (folder / key).mkdir(parents=True, exist_ok=True)
        for begin in range(0, level.shape[0], chunk[0]):
            name = f"{begin}-{begin + chunk[0]}_0-{chunk[1]}_0-{chunk[2]}"
            (folder / key / name).write_bytes(level[begin : begin + chunk[0]].astype("<u4").tobytes(order="F"))
    said = {"@type": "neuroglancer_multiscale_volume", "type": "segmentation", "data_type": "uint32", "num_channels": 1, "scales": scales}
    (folder / "info").write_text(json.dumps(said))


@pytest.fixture
def stage(blender, extension, tmp_path):
    system = bpy.context.preferences.system
    former, system.use_online_access = system.use_online_access, True
    kept = Path(bpy.utils.extension_path_user(extension.__name__, path="volumes", create=True))
    before = set(kept.iterdir())
    write(tmp_path / "cells", labels())
    with serving(tmp_path) as server:
        yield types.SimpleNamespace(
            server=server,
            url=f"{server.url}/cells",
            folder=tmp_path,
            load=lambda name: importlib.import_module(f"{extension.__name__}.{name}"),
            kept=lambda: sorted(set(kept.iterdir()) - before),
            system=system,
        )
    for path in set(kept.iterdir()) - before:
        path.unlink()
    system.use_online_access = former


def volumes():
    return [o for o in bpy.context.scene.objects if o.pumice.filepath]


def chunks(server):
    return [path for path, _ in server.asked if path.count("-") == 3]


def refused(call, **arguments):
    with pytest.raises(RuntimeError) as raised:
        call(**arguments)
    line = str(raised.value).strip().removeprefix("Error: ")
    assert len(line.splitlines()) == 1 and "defect" not in line, line
    return line


def test_a_url_becomes_the_volume_that_the_server_has(stage):
    assert bpy.ops.pumice.import_volume(filepath=f"precomputed://{stage.url}/", scale=0) == {"FINISHED"}
    (obj,) = volumes()
    assert obj.name == "cells" and obj.pumice.source_path == f"precomputed://{stage.url}/" and obj.pumice.unit == "nm"
    (kept,) = stage.kept()
    assert obj.pumice.filepath == str(kept) and kept.name.startswith("cells-")
    np.testing.assert_array_equal(pumice.open(kept).decode(), labels())
    assert sorted(p.name for p in stage.folder.iterdir()) == ["cells"], "nothing is written beside what is served"
    # What is kept is opened again, and the server is asked for no chunk.
    assert len(chunks(stage.server)) == 2
    bpy.ops.pumice.import_volume(filepath=f"precomputed://{stage.url}/", scale=0)
    assert len(chunks(stage.server)) == 2 and len(stage.kept()) == 1 and len(volumes()) == 2


def test_options_of_reading_are_those_of_files(stage):
    bpy.ops.pumice.import_volume(filepath=stage.url, scale=0, roi="12:18,0:6,:")
    np.testing.assert_array_equal(pumice.open(bpy.context.object.pumice.filepath).decode(), labels()[12:18, :6])
    assert chunks(stage.server) == ["cells/fine/10-20_0-12_0-8"]
    bpy.ops.pumice.import_volume(filepath=stage.url, scale=1, pick=1)
    obj = bpy.context.object
    np.testing.assert_array_equal(pumice.open(obj.pumice.filepath).decode(), labels()[::2, ::2, ::2])
    assert tuple(obj.pumice.spacing) == (16, 16, 80) and stage.load("label_table").visible(obj.pumice.table).sum() == 1
    assert len(stage.kept()) == 2


def test_a_scene_keeps_the_url(stage):
    bpy.ops.pumice.import_volume(filepath=stage.url, scale=0)
    for folder in ("a", "b"):
        (stage.folder / folder).mkdir()
        blend = str(stage.folder / folder / "scene.blend")
        bpy.ops.wm.save_as_mainfile(filepath=blend)
        bpy.ops.wm.open_mainfile(filepath=blend)
        (obj,) = volumes()
        assert obj.pumice.source_path == stage.url and stage.load("file_paths").find(obj, "source_path") == (stage.url, None)


def test_reload_reads_what_the_server_describes_otherwise(stage):
    bpy.ops.pumice.import_volume(filepath=stage.url, scale=0)
    obj = bpy.context.object
    first = obj.pumice.filepath
    assert bpy.ops.pumice.reload() == {"FINISHED"} and obj.pumice.filepath == first and len(chunks(stage.server)) == 2
    stage.system.use_online_access = False
    assert "Allow Online Access" in refused(bpy.ops.pumice.reload)
    stage.system.use_online_access = True
    bpy.data.objects.remove(obj)
    # Descriptions are known for some seconds by their URL, so the changed store has another one.
    write(stage.folder / "other", labels() + 1, resolution=(4, 4, 20))
    bpy.ops.pumice.import_volume(filepath=f"{stage.server.url}/other", scale=0)
    assert bpy.context.object.pumice.filepath != first and bpy.context.object.pumice.spacing[0] == 4.0


def test_a_store_that_is_described_otherwise_is_kept_in_another_file(stage, monkeypatch):
    """The compiled module knows descriptions for some seconds, so the other one is a mock."""
    cache, native = stage.load("cache"), stage.load("native")
    names = [cache.file_name(stage.url, {"scale": 0}), cache.file_name(stage.url, {"scale": 1}), cache.file_name(f"{stage.url}/", {"scale": 0})]
    assert cache.file_name(stage.url, {"scale": 0}) == names[0]
    changed = types.SimpleNamespace(is_on_server=pumice.is_on_server, probe=lambda path, **choice: pumice.probe(path, **choice) | {"label_type": "u8"})
    monkeypatch.setattr(native, "pumice", changed)
    names.append(cache.file_name(stage.url, {"scale": 0}))
    assert len(set(names)) == 4


def test_the_dialog_says_what_the_server_has(stage):
    facts = stage.load("file_facts").Facts([stage.url])
    assert [value["value"] for value in facts.open_choice("scale")["values"]] == ["0", "1"]
    lines = [text for text, _ in facts.lines({"scale": 1})]
    assert lines[0] == "10 × 6 × 4 voxels of u32, each 16 × 16 × 80 nm"
    assert chunks(stage.server) == []
    ((line, is_warning),) = stage.load("file_facts").Facts([f"{stage.server.url}/none"]).lines({})
    assert is_warning and "gives none of the files that describe a store" in line


def test_the_first_dialog_takes_the_url_from_the_clipboard_and_asks_nobody_offline(stage):
    reports = []
    operator, refused = stage.load("import_url").PUMICE_OT_import_url, stage.load("background").InBackground.refused
    dialog = types.SimpleNamespace(url="", report=lambda kind, line: reports.append(line), refused=lambda error: refused(dialog, error))
    manager = types.SimpleNamespace(clipboard=f" {stage.url}\n", invoke_props_dialog=lambda *_, **__: {"RUNNING_MODAL"})
    context = types.SimpleNamespace(window_manager=manager)
    assert operator.invoke(dialog, context, None) == {"RUNNING_MODAL"} and dialog.url == stage.url and reports == []
    dialog.url, manager.clipboard, stage.system.use_online_access = "", "a letter", False
    assert operator.invoke(dialog, context, None) == {"CANCELLED"} and dialog.url == ""
    assert len(reports) == 1 and "Allow Online Access" in reports[0] and stage.server.asked == []


def test_a_silent_server_is_not_waited_for_without_end(stage, monkeypatch):
    answer = threading.Event()
    stage.server.fault = lambda path, tries: answer.wait(60) and None
    facts = stage.load("file_facts")
    monkeypatch.setattr(facts, "PATIENCE_SECONDS", 0.0)
    assert "the server has not answered for 0 seconds" in facts.Facts([stage.url]).of(stage.url, {})
    # ESC ends the operator, and the thread ends by itself; of work without a server the end is waited for.
    background = stage.load("background")
    monkeypatch.setattr(background, "PATIENCE_SECONDS", 0.0)
    other = f"{stage.server.url}/other"
    works = [background.Work("Asking", lambda job: pumice.probe(other, job=job), asks_server=asks) for asks in (True, False)]
    for work in works:
        assert not work.is_left
        work.cancel()
    assert [work.is_left for work in works] == [True, False]
    reports = []
    operator = types.SimpleNamespace(_work=works[0], report=lambda kind, line: reports.append((kind, line)))
    assert background.InBackground._outcome(operator, bpy.context) == {"CANCELLED"}
    assert reports == [({"WARNING"}, "Cancelled: Asking")]
    answer.set()
    for work in works:
        work.thread.join(30)
        assert not work.thread.is_alive() and not work.is_left and work.error is not None


def test_faults_are_one_line_and_leave_nothing(stage):
    importing = bpy.ops.pumice.import_volume
    assert "gives none of the files that describe a store" in refused(importing, filepath=f"{stage.server.url}/none")
    assert "gives none of the files that describe a store" in refused(bpy.ops.pumice.import_url, url=f"{stage.server.url}/none")
    assert "letter: expected the URL of a store" in refused(bpy.ops.pumice.import_url, url="letter")
    stage.server.fault = lambda path, tries: 401
    assert "/cells/zarr.json: the server answers 401 Unauthorized" in refused(importing, filepath=stage.url, scale=0)
    stage.server.fault = lambda path, tries: None
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        line = refused(importing, filepath=f"http://127.0.0.1:{closed.getsockname()[1]}/cells")
    assert "the server cannot be read" in line
    stage.server.fault = lambda path, tries: 400 if "10-20" in path else None
    assert "400 Bad Request" in refused(importing, filepath=stage.url, scale=0)
    stage.server.fault = lambda path, tries: None
    (stage.folder / "cells" / "fine" / "10-20_0-12_0-8").write_bytes(b"cut")
    assert "10-20_0-12_0-8" in refused(importing, filepath=stage.url, scale=0)
    assert volumes() == [] and stage.kept() == [] and sorted(p.name for p in stage.folder.iterdir()) == ["cells"]


def test_blender_that_may_not_go_online_asks_nothing(stage):
    stage.system.use_online_access = False
    for call, arguments in (
        (bpy.ops.pumice.import_volume, {"filepath": stage.url}),
        (bpy.ops.pumice.import_volume, {"filepath": f"zarr://{stage.url}"}),
        (bpy.ops.pumice.import_url, {"url": stage.url}),
    ):
        assert "switch on Preferences › System › Network › Allow Online Access" in refused(call, **arguments)
    assert stage.server.asked == [] and volumes() == []
    # Files need no network.
    np.save(stage.folder / "cells.npy", labels())
    assert bpy.ops.pumice.import_volume(filepath=str(stage.folder / "cells.npy"), axes="xyz") == {"FINISHED"}
