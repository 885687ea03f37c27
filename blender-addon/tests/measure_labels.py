# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures what edits of labels cost in Blender, as tables for bench/results/blender.md. It is no test and is collected only by name:

    python -m pytest -s blender-addon/tests/measure_labels.py

with the environment of the tests (conftest.py) and a zip with a release build of the module. PUMICE_MEASURED_VOLUME is the real volume that is
measured; without it, it is the cortex in data/.

main thread     time of the thread that runs Blender, for the operator, for reading the scene and for sending the edits
first picture   wall time from the operator to the first frame of the edited scene, with all that the session computes in between
"""

import os
import shutil
import time
from pathlib import Path

import numpy as np

from stand_ins import Engine
from test_real_volumes import imported, load, settle, viewport_of

ROOT = Path(__file__).resolve().parents[2]
# As many labels as the largest volume that was met has.
LABELS = 118_251
ROUNDS = 20


def array(folder):
    """A volume in which every label has one voxel."""
    import pumice

    ids = np.zeros(50 * 50 * 48, dtype=np.uint64)
    ids[:LABELS] = np.arange(1, LABELS + 1, dtype=np.uint64) * 7919
    path = folder / "many.pumice"
    pumice.compress(ids.reshape(48, 50, 50)).save(path)
    return path


def edits(ops, context, ids, material):
    """(what, the edit, what undoes it) of each edit."""

    def select(some):
        return lambda: ops.pumice.labels_select(ids=",".join(str(i) for i in some))

    def roughen(value):
        material.inputs["Roughness"].default_value = value

    one, hundred = ids[len(ids) // 2 : len(ids) // 2 + 1], ids[:: max(1, len(ids) // 100)][:100]
    nothing = lambda: None  # noqa: E731
    return [
        ("hide one", select(one), ops.pumice.labels_hide, ops.pumice.labels_show_all),
        ("isolate 100", select(hundred), ops.pumice.labels_isolate, ops.pumice.labels_show_all),
        ("recolor one", select(one), lambda: ops.pumice.labels_color(color=tuple(np.random.rand(3))), nothing),
        ("roughness of a group", nothing, lambda: roughen(float(np.random.rand())), nothing),
    ]


def shown(view, context, graph, limit=60.0):
    """Draws until the picture is of the newest revision, coarse or not."""
    end = time.monotonic() + limit
    while True:
        view.draw(context, graph)
        if view.frame is not None and view.frame.revision == view.session.status.revision:
            return
        assert time.monotonic() < end, view.session.status
        time.sleep(0.0005)


def measured(bpy, extension, monkeypatch, path):
    """Rows (what, main thread ms, first picture ms), medians and largest."""
    obj = imported(bpy, path)
    bpy.context.scene.pumice.viewport_samples = 1
    bpy.context.scene.pumice.backend = "CPU"
    ids = load(extension, "label_table").ids(obj.pumice.table)
    material = obj.active_material.node_tree.nodes["Principled BSDF"]
    context, view = viewport_of(bpy, extension, monkeypatch, Engine())
    context.region.width, context.region.height = 1280, 720
    settle(bpy, view, context)
    rows = []
    for what, before, edit, undo in edits(bpy.ops, bpy.context, ids, material):
        before()
        settle(bpy, view, context)
        thread, wall, back = [], [], []
        for _ in range(ROUNDS):
            for action, walls in ((edit, wall), (undo, back)):
                began, of_thread = time.monotonic(), time.thread_time()
                action()
                graph = bpy.context.evaluated_depsgraph_get()
                view.sync(context, graph)
                if action is edit:
                    thread.append(1e3 * (time.thread_time() - of_thread))
                shown(view, context, graph)
                walls.append(1e3 * (time.monotonic() - began))
                settle(bpy, view, context)
        rows.append((what, thread, wall))
        if undo is bpy.ops.pumice.labels_show_all:
            rows.append((f"show all after {what}", [], back))
    return obj, ids, rows


def table(rows):
    said = lambda values: f"{np.median(values):.1f}, {max(values):.1f}" if values else ""  # noqa: E731
    print("| edit | main thread, ms | first picture, ms |\n| --- | --- | --- |")
    for what, thread, wall in rows:
        print(f"| {what} | {said(thread)} | {said(wall)} |")


def test_many_labels(blender, extension, monkeypatch, tmp_path):
    path = array(tmp_path)
    blender.ops.wm.save_as_mainfile(filepath=str(tmp_path / "empty.blend"))
    obj, ids, rows = measured(blender, extension, monkeypatch, path)
    print(f"\n{len(ids)} labels, 50 × 50 × 48 voxels:\n")
    table(rows)
    search, keys = load(extension, "label_search"), []
    for length in range(1, 9):
        for query in ("voxels>0 79", "17-4200 !1"):
            began = time.thread_time()
            try:
                blender.ops.pumice.labels_search(query=query[:length])
            except RuntimeError:  # half of a word may have no meaning
                pass
            keys.append(1e3 * (time.thread_time() - began))
    print(f"\na key in the search line: {np.median(keys):.1f} ms, at most {max(keys):.1f} ms ({search.MOST_HITS} hits listed)")
    blender.ops.wm.save_as_mainfile(filepath=str(tmp_path / "full.blend"))
    grown = (tmp_path / "full.blend").stat().st_size - (tmp_path / "empty.blend").stat().st_size
    print(f".blend: {grown / 1e6:.2f} MB more than without the volume")


def test_a_real_volume(blender, extension, monkeypatch, tmp_path):
    # A copy, because the import keeps what it compressed beside the file.
    source = Path(os.environ.get("PUMICE_MEASURED_VOLUME", ROOT / "data/connectomics_32x32x40nm.nrrd"))
    path = tmp_path / source.name
    shutil.copy(source, path)
    obj, ids, rows = measured(blender, extension, monkeypatch, path)
    print(f"\n{os.path.basename(path)}, {len(ids)} labels, all shown, 1280 × 720:\n")
    table(rows)
