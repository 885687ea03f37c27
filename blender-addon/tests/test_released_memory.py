# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that a volume that no object shows any more is closed, by deleting, by undo and by another path, and that its memory is free again."""

import gc
import importlib
import os
import weakref

import bpy
import numpy as np
import pytest

from test_real_volumes import imported


@pytest.fixture
def registry(blender, extension):
    found = importlib.import_module(f"{extension.__name__}.registry")
    found._entries.clear()
    return found


def small(path):
    import pumice

    pumice.compress(np.full((8, 8, 8), 7, dtype=np.uint8)).save(path)
    return path


def open_files(registry):
    bpy.context.view_layer.update()
    return sorted(os.path.basename(key[0]) for key in registry._entries)


def delete(obj):
    bpy.ops.object.select_all(action="DESELECT")
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.delete()


def test_the_last_object_that_is_deleted_closes_its_volume(registry, tmp_path):
    one, other = imported(bpy, small(tmp_path / "one.pumice")), imported(bpy, small(tmp_path / "other.pumice"))
    held = weakref.ref(next(e.volume for k, e in registry._entries.items() if k[0].endswith("one.pumice")))
    bpy.context.view_layer.objects.active = one
    bpy.ops.object.select_all(action="DESELECT")
    one.select_set(True)
    bpy.ops.object.duplicate(linked=True)
    delete(bpy.context.object)
    assert open_files(registry) == ["one.pumice", "other.pumice"], "another object shows it"
    delete(one)
    assert open_files(registry) == ["other.pumice"]
    gc.collect()
    assert held() is None, "nothing else holds the volume"
    bpy.data.objects.remove(other)
    assert open_files(registry) == []


def test_undo_opens_a_deleted_volume_again_and_redo_closes_it(registry, tmp_path):
    obj = imported(bpy, small(tmp_path / "one.pumice"))
    bpy.ops.ed.undo_push(message="imported")
    delete(obj)
    bpy.ops.ed.undo_push(message="deleted")
    assert open_files(registry) == []
    bpy.ops.ed.undo()
    back = next(o for o in bpy.data.objects if o.pumice.filepath)
    assert registry.wait(back.pumice.filepath, lambda: False).labels.ids.tolist() == [7]
    bpy.ops.ed.redo()
    assert open_files(registry) == []


@pytest.mark.full
def test_importing_and_deleting_again_and_again_takes_the_memory_of_one_volume(registry, tmp_path):
    import pumice

    # Noise does not compress: a voxel is a label's box of its own.
    noise = np.random.default_rng(1).integers(1, 200, (160, 160, 160)).astype(np.uint8)
    pumice.compress(noise).save(tmp_path / "noise.pumice", level="fast")
    size = pumice.open(tmp_path / "noise.pumice").bytes_resident
    assert size > 5e6

    def rss():
        gc.collect()
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    def cycle(keep):
        obj = imported(bpy, tmp_path / "noise.pumice")
        entry = next(iter(registry._entries.values()))
        if keep is not None:
            keep.append(entry.volume)
        delete(obj)
        assert open_files(registry) == []
        bpy.data.orphans_purge(do_recursive=True)

    cycle(None)  # what is loaded once, such as code and Blender's caches
    cycle(None)
    start = rss()
    for _ in range(6):
        cycle(None)
    grown = rss() - start
    print(f"grown by {grown}, a volume has {size}")
    # Allocators keep some free pages: those of at most one volume. Six that were kept would be six times that.
    assert grown < size, (grown, size)
    # Pages that earlier tests have freed are filled first, as many as they were.
    kept = []
    while rss() - start <= size and len(kept) < 60:
        cycle(kept)
    assert rss() - start > size, "negative control: volumes that something holds stay in memory"
