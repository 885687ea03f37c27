# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests a volume as an object: the place of its voxels in the scene, and what the import adds to a scene or leaves unchanged."""

import importlib

import numpy as np
import pytest
from mathutils import Vector

from stand_ins import Volume


@pytest.fixture
def modules(extension):
    return {n: importlib.import_module(f"{extension.__name__}.{n}") for n in ("volume_object", "first_look", "label_table")}


def create(bpy, modules, volume, placement="CENTER", longest=10.0):
    return modules["volume_object"].create(
        bpy.context,
        volume,
        name="cells",
        filepath="/nowhere/cells.pumice",
        source_path="/nowhere/cells.nrrd",
        longest_side=longest,
        placement=placement,
    )


def in_scene(obj, index):
    return np.array(obj.matrix_world @ Vector(index))


SKEW = [[0.9, 0.2, 0.0, 5.0], [0.0, 1.0, 0.4, -3.0], [0.1, 0.0, 2.0, 7.0], [0.0, 0.0, 0.0, 1.0]]
MIRROR = [[-16.0, 0, 0, 9e4], [0, -16.0, 0, 5e4], [0, 0, 40.0, -2e4], [0, 0, 0, 1]]
TURNED = [[0, 0, 40.0, 0], [16.0, 0, 0, 0], [0, -16.0, 0, 0], [0, 0, 0, 1]]


@pytest.mark.parametrize("world", [None, SKEW, MIRROR, TURNED], ids=["plain", "sheared", "mirrored", "turned"])
@pytest.mark.parametrize("placement", ["CENTER", "FILE"])
def test_voxels_are_where_the_file_and_the_display_scale_say(blender, modules, world, placement):
    volume = Volume(world=world)
    obj = create(blender, modules, volume, placement)
    blender.context.view_layer.update()
    world = volume.world_from_index
    corners = np.array([[x, y, z, 1] for x in (0, 64) for y in (0, 64) for z in (0, 32)])
    expected = (world @ corners.T).T[:, :3]
    scale = 10.0 / np.ptp(expected, axis=0).max()
    assert obj.pumice.display_scale == pytest.approx(scale, rel=1e-6)
    expected = expected * obj.pumice.display_scale
    if placement == "CENTER":
        expected -= (expected.min(axis=0) + expected.max(axis=0)) / 2.0
    got = np.array([in_scene(obj, c[:3]) for c in corners])
    # Blender's matrices have single precision.
    assert np.allclose(got, expected, atol=1e-6 * np.abs(expected).max() + 1e-5)
    assert list(obj.pumice.spacing) == pytest.approx([16.0, 16.0, 40.0])
    assert obj.pumice.unit == "nm" and list(obj.pumice.dims) == [64, 64, 32]


def test_a_crop_is_aligned_with_the_first_volume(blender, modules):
    first = create(blender, modules, Volume())
    moved = np.diag([16.0, 16.0, 40.0, 1.0])
    moved[:3, 3] = [32 * 16.0, 0.0, 0.0]
    second = create(blender, modules, Volume(world=moved), "ALIGN", longest=3.0)
    blender.context.view_layer.update()
    assert second.pumice.display_scale == first.pumice.display_scale
    assert np.allclose(in_scene(second, (0, 0, 0)), in_scene(first, (32, 0, 0)), atol=1e-5)


def test_the_first_look_frames_lights_and_colours(blender, modules):
    scene = blender.context.scene
    scene.world = None
    obj = create(blender, modules, Volume())
    modules["first_look"].prepare(blender.context, obj)
    blender.context.view_layer.update()
    assert any(o.type == "LIGHT" and o.data.type == "SUN" for o in scene.objects)
    background = next(n for n in scene.world.node_tree.nodes if n.bl_idname == "ShaderNodeBackground")
    assert list(background.inputs["Color"].default_value)[:3] == pytest.approx([0.46, 0.49, 0.53])
    assert obj.active_material.pumice.colors_by_label
    from bpy_extras.object_utils import world_to_camera_view

    drawn = [world_to_camera_view(scene, scene.camera, obj.matrix_world @ v.co) for v in obj.data.vertices]
    assert all(0 < s.x < 1 and 0 < s.y < 1 for s in drawn), "the whole proxy is in the picture"
    spans = [max(s[a] for s in drawn) - min(s[a] for s in drawn) for a in range(2)]
    assert max(spans) == pytest.approx(0.92, abs=1e-3), "and it fills the tighter direction"
    middle = [max(s[a] for s in drawn) + min(s[a] for s in drawn) for a in range(2)]
    assert middle == pytest.approx([1.0, 1.0], abs=0.25), "and it is about in the middle"
    data = scene.camera.data
    assert all(data.clip_start < s.z < data.clip_end for s in drawn)
    view = next(a for a in blender.context.window.screen.areas if a.type == "VIEW_3D").spaces.active
    assert Vector(view.region_3d.view_location).length < 1e-3 and view.clip_end >= 1000.0


def test_the_first_look_leaves_what_the_user_made(startup, modules):
    scene = startup.context.scene
    camera = scene.camera
    camera.location = (1.0, 2.0, 3.0)
    light = startup.data.lights.new("mine", "SUN")
    scene.collection.objects.link(startup.data.objects.new("mine", light))
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (0.2, 0.0, 0.0, 1.0)
    obj = create(startup, modules, Volume())
    modules["first_look"].prepare(startup.context, obj)
    assert list(camera.location) == [1.0, 2.0, 3.0] and scene.camera == camera
    assert sum(o.type == "LIGHT" and o.data.type == "SUN" for o in scene.objects) == 1
    assert background.inputs["Color"].default_value[0] == pytest.approx(0.2)


def test_the_first_look_takes_over_the_startup_scene(startup, modules):
    scene = startup.context.scene
    camera = scene.camera
    before = camera.location.copy()
    obj = create(startup, modules, Volume())
    modules["first_look"].prepare(startup.context, obj)
    assert scene.camera == camera and (camera.location - before).length > 1.0
    color = scene.world.node_tree.nodes["Background"].inputs["Color"].default_value
    assert list(color)[:3] == pytest.approx([0.46, 0.49, 0.53])


def test_remeshing_begins_with_as_many_cells_whatever_the_size(blender, modules):
    """Blender's default is 0.1 of the mesh's units, which are voxels: 5,120 cells along 512 of them, for which it runs out of memory."""
    volume = Volume()
    for dims in ((64, 64, 32), (64, 4000, 2), (1, 1, 1)):
        volume.dims = dims
        obj = create(blender, modules, volume)
        assert obj.data.remesh_voxel_size == pytest.approx(max(dims) / 128.0)
    # With faces: twice as many cells along a side are four times as many vertices.
    counts = []
    for cells in (1.0, 2.0):
        volume.dims = (400, 400, 400)
        obj = create(blender, modules, volume)
        size = obj.data.remesh_voxel_size
        obj.data.clear_geometry()
        corners = [(x, y, z) for z in (0, 400) for x, y in ((0, 0), (400, 0), (400, 400), (0, 400))]
        obj.data.from_pydata(corners, [], [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)])
        obj.data.remesh_voxel_size = size / cells * 4.0
        blender.context.view_layer.objects.active = obj
        assert blender.ops.object.voxel_remesh() == {"FINISHED"}
        counts.append(len(obj.data.vertices))
    assert 3.0 < counts[1] / counts[0] < 5.0 and 6 * 32**2 < counts[0] * 1.2
