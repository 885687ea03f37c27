# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests with real pictures that a volume object may be treated as any other: F12's label pass is the same after Apply, Set Origin and mirror,
and after append, link and library override from another file. The oracle is the label pass before."""

import importlib

import bpy
import numpy as np
import pytest

from test_real_volumes import exr, imported
from test_round_trip import with_usd  # noqa: F401

SIZE = (40, 30)


@pytest.fixture
def load(extension):
    return lambda name: importlib.import_module(f"{extension.__name__}.{name}")


@pytest.fixture
def cells(blender, tmp_path):
    """Three labels in a volume of uneven shape, framed, ready for F12 with one sample a pixel."""
    return made(tmp_path / "cells.pumice")


def made(path):
    import pumice

    dense = np.zeros((24, 12, 8), dtype=np.uint16)
    dense[:20, 2:10, :4], dense[4:, :6, 3:8], dense[10:14, 6:, 2:7] = 5, 9, 300
    path.parent.mkdir(exist_ok=True)
    pumice.compress(dense, spacing=(8.0, 10.0, 30.0), unit="nm").save(path)
    obj = imported(bpy, path)
    prepare(bpy.context.scene)
    return obj


def prepare(scene):
    render = scene.render
    render.engine = "PUMICE"
    render.resolution_x, render.resolution_y, render.resolution_percentage = *SIZE, 100
    scene.pumice.samples, scene.pumice.bounces, scene.pumice.backend = 1, 0, "CPU"
    if bpy.app.version >= (5, 0, 0):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    render.image_settings.color_depth, render.image_settings.exr_codec = "32", "NONE"
    scene.view_layers[0].pumice.use_pass_label = True


def label_pass(folder):
    """F12's label pass: rows of the table plus 1."""
    bpy.context.scene.render.filepath = str(folder / "picture.exr")
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    found = exr(folder / "picture.exr")["Label.X"]
    assert len(np.unique(found)) >= 3, "several labels and the background are seen"
    return found


def same(one, other):
    """Whether two label passes agree. A ray along the edge of a voxel may fall to either side when a matrix is rounded otherwise: 1 in 300."""
    return (one != other).mean() <= 1 / 300


def test_apply_set_origin_and_mirror_leave_the_picture(cells, tmp_path):
    before = label_pass(tmp_path)
    bpy.ops.object.transform_apply(location=True, rotation=True, scale=True)
    assert same(label_pass(tmp_path), before)
    bpy.ops.object.origin_set(type="ORIGIN_GEOMETRY", center="BOUNDS")
    assert same(label_pass(tmp_path), before)

    # Negative controls: the object moves, and a mirrored volume is another picture; both come back.
    cells.location.x += 1.0
    assert not same(label_pass(tmp_path), before)
    cells.location.x -= 1.0
    for number in range(2):
        bpy.ops.transform.mirror(constraint_axis=(True, False, False))
        bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
        assert same(label_pass(tmp_path), before) == (number == 1)

    # A parent that shears, and the parent's transform applied by Blender.
    cells.rotation_euler.z += 0.4
    parent = bpy.data.objects.new("parent", None)
    bpy.context.collection.objects.link(parent)
    parent.scale = (1.0, 0.6, 1.2)
    cells.parent = parent
    sheared = label_pass(tmp_path)
    assert not same(sheared, before)
    bpy.ops.object.transform_apply(location=True, rotation=True, scale=True)
    assert same(label_pass(tmp_path), sheared)


def test_the_exact_mesh_of_an_applied_volume_is_in_its_place(cells, load):
    bpy.ops.transform.mirror(constraint_axis=(False, True, False))
    bpy.context.view_layer.update()
    expected = corners(cells.matrix_world, [(0, 0, 0), (24, 12, 8)])
    bpy.ops.object.transform_apply()
    assert bpy.ops.pumice.make_exact_mesh(hide_volume=False) == {"FINISHED"}
    mesh = next(o for o in bpy.data.objects if o.get("pumice_volume") == cells)
    bpy.context.view_layer.update()
    points = np.array([mesh.matrix_world @ v.co for v in mesh.data.vertices])
    low, high = np.min(expected, axis=0), np.max(expected, axis=0)
    assert np.allclose(points.min(axis=0), low, atol=1e-5) and np.allclose(points.max(axis=0), high, atol=1e-5)
    # Faces look outward: their normals and positions span a positive volume (divergence theorem).
    assert sum(f.center.dot(f.normal) * f.area for f in mesh.data.polygons) > 0.0


def test_a_volume_that_shears_by_what_was_applied_to_it_comes_back_from_usd(with_usd, cells, load, tmp_path):  # noqa: F811
    """Parent and object have matrices at right angles; only with what was applied to the mesh the volume shears."""
    parent = bpy.data.objects.new("parent", None)
    bpy.context.collection.objects.link(parent)
    parent.scale, cells.rotation_euler, cells.parent = (1.0, 0.5, 1.5), (0.4, 0.2, 0.7), parent
    bpy.context.view_layer.update()
    box = [(x, y, z) for x in (0, 24) for y in (0, 12) for z in (0, 8)]
    expected = corners(cells.matrix_world, box)
    bpy.ops.object.transform_apply()
    assert bpy.ops.pumice.export_scene(filepath=str(tmp_path / "stage.usda")) == {"FINISHED"}
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert bpy.ops.pumice.import_scene(filepath=str(tmp_path / "stage.usda")) == {"FINISHED"}
    bpy.context.view_layer.update()
    mesh = next(o for o in bpy.data.objects if o.type == "MESH")
    assert np.allclose(corners(mesh.matrix_world, box), expected, atol=1e-4)


def corners(matrix, points):
    from mathutils import Vector

    return [tuple(matrix @ Vector(p)) for p in points]


def test_labels_are_framed_where_an_applied_volume_is(cells):
    bpy.ops.object.select_all(action="DESELECT")
    cells.select_set(True)
    bpy.ops.pumice.labels_select(ids="300")
    bpy.ops.pumice.labels_frame()
    expected = np.array(bpy.context.scene.camera.matrix_world)
    bpy.ops.object.transform_apply()
    bpy.context.scene.camera.location.x += 3.0
    bpy.ops.pumice.labels_frame()
    bpy.context.view_layer.update()
    assert np.allclose(np.array(bpy.context.scene.camera.matrix_world), expected, atol=1e-4)


@pytest.fixture
def two_files(cells, tmp_path):
    """(label pass of a volume, its .blend in a folder of its own with a relative path): another file, in another folder, is open."""
    home, away = tmp_path / "home", tmp_path / "away"
    away.mkdir()
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    made(home / "cells.pumice")
    bpy.ops.object.transform_apply()
    bpy.ops.wm.save_as_mainfile(filepath=str(home / "cells.blend"))
    assert bpy.context.object.pumice.filepath == "//cells.pumice"
    expected = label_pass(tmp_path)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(away / "other.blend"))
    return expected, home / "cells.blend"


def bring(blend, link):
    """Appends or links all objects of a file; returns the volume."""
    with bpy.data.libraries.load(str(blend), link=link) as (there, here):
        here.objects, here.worlds = there.objects, there.worlds
    scene = bpy.context.scene
    for obj in here.objects:
        scene.collection.objects.link(obj)
    scene.camera, scene.world = next(o for o in here.objects if o.type == "CAMERA"), here.worlds[0]
    prepare(scene)
    return next(o for o in here.objects if o.pumice.filepath)


@pytest.mark.parametrize("way", ["append", "link", "override"])
def test_a_volume_of_another_file_is_drawn(two_files, load, tmp_path, capfd, way):
    expected, blend = two_files
    obj = bring(blend, link=way != "append")
    if way == "override":
        obj = obj.override_create(remap_local_usages=True)
    capfd.readouterr()
    assert same(label_pass(tmp_path), expected)
    assert ("is missing" in capfd.readouterr().out) == (way == "append"), "F12 says it"
    bpy.context.view_layer.objects.active = obj
    found, said = load("file_paths").find(obj)
    assert found == str(blend.parent / "cells.pumice")
    # A copy of the object keeps a path that is relative to the other file; where it was then is said.
    assert (said is None) == (way != "append")
    assert (said in load("panels").not_drawn(bpy.context.scene, bpy.context.view_layer)) == (way == "append")

    if way == "link":
        with pytest.raises(RuntimeError, match="make a library override"):
            bpy.ops.pumice.labels_select(ids="9")
        with pytest.raises(RuntimeError, match="reload it in that file"):
            bpy.ops.pumice.reload()
        return
    # Labels are hidden in this file alone, and stay hidden in it.
    bpy.ops.pumice.labels_select(ids="9")
    bpy.ops.pumice.labels_hide()
    row = load("label_table").ids(obj.pumice.table).tolist().index(9) + 1
    hidden = label_pass(tmp_path)
    assert (expected == row).any() and not (hidden == row).any()
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    assert same(label_pass(tmp_path), hidden)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert same(label_pass(tmp_path), expected)


def test_a_copy_in_a_second_scene_is_drawn_there_and_undo_takes_it_back(cells, tmp_path):
    before = label_pass(tmp_path)
    bpy.ops.ed.undo_push(message="one scene")
    bpy.ops.scene.new(type="FULL_COPY")
    bpy.ops.ed.undo_push(message="two scenes")
    copies = [o for o in bpy.context.scene.objects if o.pumice.filepath]
    assert len(bpy.data.scenes) == 2 and len(copies) == 1 and copies[0].name != "cells"
    assert same(label_pass(tmp_path), before)
    bpy.context.view_layer.objects.active = copies[0]
    bpy.ops.pumice.labels_select(ids="9")
    bpy.ops.pumice.labels_hide()
    bpy.ops.ed.undo_push(message="hidden")
    assert not same(label_pass(tmp_path), before)
    bpy.context.window.scene = bpy.data.scenes[0]
    assert same(label_pass(tmp_path), before), "the first scene shows all labels"
    for _ in range(2):
        bpy.ops.ed.undo()
    assert len(bpy.data.scenes) == 1 and same(label_pass(tmp_path), before)
