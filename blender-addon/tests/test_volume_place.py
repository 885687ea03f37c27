# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that a volume stays in its place while Blender's operators move its matrix into its mesh, and that edits of the mesh are said.

The oracle is where corners of the volume were before the operator, by Blender's own matrix of the fresh object.
"""

import importlib
import math

import bmesh
import bpy
import numpy as np
import pytest

from stand_ins import Volume
from test_volume_object import SKEW

CORNERS = np.array([[x, y, z, 1.0] for x in (0, 64) for y in (0, 64) for z in (0, 32)])


@pytest.fixture
def load(extension):
    return lambda name: importlib.import_module(f"{extension.__name__}.{name}")


def create(load, world=None):
    """A selected, moved, turned and unevenly scaled volume."""
    obj = load("volume_object").create(
        bpy.context, Volume(world=world), name="cells", filepath="/nowhere/cells.pumice", source_path="", longest_side=10.0, placement="CENTER"
    )
    obj.location, obj.rotation_euler = (3.0, -2.0, 5.0), (0.3, -0.7, 1.1)
    if world is None:
        obj.scale = [s * f for s, f in zip(obj.scale, (2.0, 0.5, 3.0))]
    bpy.ops.object.select_all(action="DESELECT")
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    bpy.context.view_layer.update()
    return obj


def in_scene(load, obj):
    """Corners of the volume in the scene, by the map that is drawn."""
    bpy.context.view_layer.update()
    world, lines = load("volume_place").read(obj, obj.matrix_world)
    assert lines == []
    return (CORNERS @ world.T)[:, :3]


def by_matrix(obj):
    return (CORNERS @ np.array(obj.matrix_world, dtype=float).T)[:, :3]


def applied(**which):
    wanted = {"location": False, "rotation": False, "scale": False, **which}
    return lambda obj: bpy.ops.object.transform_apply(**wanted)


def mirrored_and_applied(obj):
    bpy.ops.transform.mirror(constraint_axis=(True, False, False))
    expected = by_matrix(obj)
    bpy.ops.object.transform_apply()
    return expected


def turned_in_edit_mode(obj):
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(1.0, 2.0, -3.0), orient_type="GLOBAL")
    bpy.ops.object.mode_set(mode="OBJECT")
    return by_matrix(obj) + (1.0, 2.0, -3.0)


def made_single_and_applied(obj):
    """A linked duplicate shares the mesh, so Blender makes the mesh its own first."""
    bpy.ops.object.duplicate(linked=True)
    other = bpy.context.object
    assert other.data == obj.data and other != obj
    bpy.ops.object.select_all(action="DESELECT")
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.transform_apply(isolate_users=True)
    assert other.data != obj.data


CHANGES = {
    "scale": applied(scale=True),
    "rotation": applied(rotation=True),
    "location": applied(location=True),
    "all": applied(location=True, rotation=True, scale=True),
    "origin to the mesh": lambda obj: bpy.ops.object.origin_set(type="ORIGIN_GEOMETRY", center="BOUNDS"),
    "origin to the cursor": lambda obj: bpy.ops.object.origin_set(type="ORIGIN_CURSOR"),
    "mesh to the origin, and back": lambda obj: [bpy.ops.object.origin_set(type=kind) for kind in ("ORIGIN_CURSOR", "ORIGIN_CENTER_OF_MASS")],
    "mirrored and applied": mirrored_and_applied,
    "moved in edit mode": turned_in_edit_mode,
    "a linked duplicate": made_single_and_applied,
    "deltas": lambda obj: bpy.ops.object.transforms_to_deltas(mode="ALL"),
    "half of the mesh deleted": lambda obj: delete_vertices(obj, lambda index: index % 2 == 0),
}


def delete_vertices(obj, chosen):
    edited = bmesh.new()
    edited.from_mesh(obj.data)
    bmesh.ops.delete(edited, geom=[v for v in edited.verts if chosen(v.index)], context="VERTS")
    edited.to_mesh(obj.data)
    edited.free()


@pytest.mark.parametrize("world", [None, SKEW], ids=["at right angles", "sheared"])
@pytest.mark.parametrize("change", CHANGES)
def test_the_drawn_place_is_the_proxys_place_after(blender, load, world, change):
    obj = create(load, world)
    expected = by_matrix(obj)
    size = np.ptp(expected, axis=0).max()
    assert np.array_equal(in_scene(load, obj), expected), "an untouched mesh gives the object's matrix to the last bit"
    outcome = CHANGES[change](obj)
    expected = outcome if isinstance(outcome, np.ndarray) else expected
    # Positions and matrices have single precision, 24 bits; each of a few operators rounds both once.
    off = np.abs(in_scene(load, obj) - expected).max() / size
    assert off <= 16 * 2.0**-24, off


def test_the_matrix_alone_would_be_wrong_after_apply(blender, load):
    """Negative control: without the attribute the oracle convicts."""
    obj = create(load)
    expected = by_matrix(obj)
    bpy.ops.object.transform_apply()
    bpy.context.view_layer.update()
    assert np.abs(by_matrix(obj) - expected).max() > 1.0
    obj.data.attributes.remove(obj.data.attributes["pumice_index"])
    assert any("pumice_index" in line for line in lines_of(load, obj)), "a mesh that lost it says so"
    del obj.data["pumice_marked"]
    assert np.abs(in_scene(load, obj) - expected).max() > 1.0


def test_undo_and_redo_of_apply_keep_the_place(blender, load):
    create(load)
    bpy.ops.ed.undo_push(message="made")
    expected = in_scene(load, bpy.context.object)
    bpy.ops.object.transform_apply()
    bpy.ops.ed.undo_push(message="applied")
    for step in (bpy.ops.ed.undo, bpy.ops.ed.redo):
        step()
        obj = bpy.data.objects["cells"]
        assert np.allclose(in_scene(load, obj), expected, atol=1e-5)
    assert list(bpy.data.objects["cells"].scale) == [1.0, 1.0, 1.0], "the redo was one"


def test_parents_and_constraints_move_the_volume(blender, load):
    obj = create(load)
    bpy.ops.object.transform_apply()
    expected = in_scene(load, obj)
    parent = bpy.data.objects.new("parent", None)
    bpy.context.collection.objects.link(parent)
    parent.scale, parent.location = (1.0, 2.0, 1.0), (0.0, 0.0, 4.0)
    parent.rotation_euler = (0.0, 0.0, math.pi / 2)
    obj.parent = parent
    turned = np.stack([-2.0 * expected[:, 1], expected[:, 0], expected[:, 2] + 4.0], axis=1)
    assert np.allclose(in_scene(load, obj), turned, atol=1e-4)
    obj.parent = None
    limit = obj.constraints.new("LIMIT_LOCATION")
    limit.use_min_x, limit.min_x = True, 7.0
    assert np.allclose(in_scene(load, obj), expected + (7.0, 0.0, 0.0), atol=1e-5)


def lines_of(load, obj):
    return load("volume_place").read(obj, obj.matrix_world)[1]


def test_an_edited_mesh_is_said(blender, load):
    obj = create(load)
    middle = len(obj.data.vertices) // 2
    obj.data.vertices[middle].co.x += 0.05
    assert lines_of(load, obj) == [], "a twentieth of a voxel is nothing"
    obj.data.vertices[middle].co.x += 3.0
    (line,) = lines_of(load, obj)
    assert "vertices of its mesh were moved" in line and "cells" in line
    assert line in load("panels").not_drawn(bpy.context.scene, bpy.context.view_layer)
    obj.modifiers.new("smooth", "SUBSURF")
    assert any("modifiers" in line for line in lines_of(load, obj))


def test_a_joined_object_is_said(blender, load):
    obj = create(load)
    bpy.ops.mesh.primitive_cube_add(location=(20.0, 0.0, 0.0))
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.join()
    assert any("vertices of its mesh were moved" in line for line in lines_of(load, obj))


def test_what_tells_no_place_is_not_drawn_and_said(blender, load):
    obj = create(load)
    obj.scale.z = 0.0
    bpy.context.view_layer.update()
    placed, lines = load("sync.instances").placed(obj, obj.matrix_world, load("sync.instances").Styles(), 1.0)
    assert placed is None and any("scaled to nothing" in line for line in lines)
    bpy.ops.object.transform_apply()
    bpy.context.view_layer.update()
    placed, lines = load("sync.instances").placed(obj, obj.matrix_world, load("sync.instances").Styles(), 1.0)
    assert placed is None and any("scaled to nothing" in line for line in lines) and not any("moved" in line for line in lines)
    delete_vertices(obj, lambda index: index > 2)
    placed, lines = load("sync.instances").placed(obj, obj.matrix_world, load("sync.instances").Styles(), 1.0)
    assert placed is None and any("lost the vertices" in line for line in lines)


def test_a_proxy_that_was_replaced_by_another_mesh_is_said(blender, load):
    """As remeshing does: other vertices without attributes, in the mesh that is there."""
    obj = create(load)
    bpy.ops.object.transform_apply()
    other = bmesh.new()
    bmesh.ops.create_cube(other)
    other.to_mesh(obj.data)
    other.free()
    assert any("lost the vertices" in line for line in lines_of(load, obj)) and load("volume_place").fit(obj.data) is None


def test_the_display_scale_is_that_of_the_object_now(blender, load):
    obj = create(load)
    shown = load("panels")._display_scale
    first = obj.pumice.display_scale
    expected = [first * f for f in (2.0, 0.5, 3.0)]
    assert [float(text) for text in shown(obj).split(" × ")] == pytest.approx(expected, rel=1e-5)
    bpy.ops.object.transform_apply()
    bpy.context.view_layer.update()
    assert [float(text) for text in shown(obj).split(" × ")] == pytest.approx(expected, rel=1e-5)


def test_edit_mode_has_the_place_of_the_edited_mesh(blender, load):
    obj = create(load)
    bpy.ops.object.transform_apply()
    expected = in_scene(load, obj)
    bpy.ops.object.mode_set(mode="EDIT")
    assert np.array_equal(in_scene(load, obj), expected)
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0.0, 0.0, 2.0))
    assert np.allclose(in_scene(load, obj), expected + (0.0, 0.0, 2.0), atol=1e-5)
    bpy.ops.object.mode_set(mode="OBJECT")


def test_the_next_volume_is_aligned_with_one_that_was_moved_and_applied(blender, load):
    obj = create(load)
    bpy.ops.object.transform_apply()
    crop = np.diag([16.0, 16.0, 40.0, 1.0])
    crop[:3, 3] = [32 * 16.0, 0.0, 0.0]
    second = load("volume_object").create(
        bpy.context, Volume(world=crop), name="crop", filepath="/nowhere/b.pumice", source_path="", longest_side=1.0, placement="ALIGN"
    )
    first, corner = in_scene(load, obj), in_scene(load, second)
    # The crop begins in the middle of the first along x.
    assert np.allclose(corner[0], (first[0] + first[4]) / 2.0, atol=1e-4)
