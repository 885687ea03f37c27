# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests *Add › Pumice Cut*: where it stands, what it cuts, and that a volume which it does not name keeps its pixels.

The oracle of a cut is a loop over the columns of a small volume, seen straight from above: in each, the top of the highest part that is
left. Two volumes stand 20 units apart, farther than ambient occlusion reaches, so the cut of one cannot change the light of the other.
"""

import importlib

import numpy as np
import pytest
from mathutils import Matrix, Vector

from stand_ins import Engine
from test_real_volumes import exr, settle, viewport_of

SIDE, UNIT, PIXELS = 8, 1.25, (128, 64)
APART = 20.0


@pytest.fixture
def pair(blender, tmp_path):
    """(scene, labels by x, y, z, left volume, right volume): two objects of one volume of 8³ voxels, left and right of the middle."""
    random = np.random.default_rng(5)
    labels = random.integers(1, 5, (SIDE,) * 3) * (random.random((SIDE,) * 3) < 0.7)
    np.save(tmp_path / "block.npy", labels.astype(np.uint8))
    assert blender.ops.pumice.import_volume(filepath=str(tmp_path / "block.npy")) == {"FINISHED"}
    left, scene = blender.context.object, blender.context.scene
    right = left.copy()
    scene.collection.objects.link(right)
    for obj, x in ((left, -APART / 2), (right, APART / 2)):
        obj.matrix_world = Matrix.Translation((x, 0.0, 0.0)) @ obj.matrix_world
    camera = scene.camera
    camera.matrix_world = Matrix.Translation((0.0, 0.0, 30.0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 2 * APART
    camera.data.clip_start, camera.data.clip_end = 0.1, 100.0
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *PIXELS, 100
    if blender.app.version >= (5, 0, 0):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    render.image_settings.exr_codec = "NONE"
    render.filepath = str(tmp_path / "out.exr")
    wishes = scene.pumice
    wishes.mode, wishes.use_ao_distance, wishes.ao_distance = "AMBIENT_OCCLUSION", True, 2.0
    # All samples of a pixel lie within a hundredth of it around its middle, where the oracle looks.
    wishes.samples, wishes.filter_pixels, wishes.backend = 4, 0.01, "CPU"
    layer = blender.context.view_layer
    layer.use_pass_z, layer.pumice.use_pass_label = True, True
    layer.update()
    assert tuple(left.pumice.dims) == (SIDE,) * 3 and left.pumice.display_scale * left.pumice.spacing[0] == pytest.approx(UNIT)
    return scene, labels, left, right


def rendered(bpy):
    bpy.ops.render.render(write_still=True)
    return exr(bpy.context.scene.render.filepath)


def halves(picture):
    """The pixels of the left and of the right half: (channels, 64, 64)."""
    found = np.stack([picture[name] for name in ("Combined.R", "Combined.G", "Combined.B", "Combined.A", "Depth.Z", "Label.X")])
    return found[..., :64], found[..., 64:]


def heights(labels, is_removed):
    """Height above the volume's middle of the first part that is left, by row and column of a half of the picture; NaN where there is none.

    `is_removed` takes points about the volume's middle. Each column is looked through in steps of 1/32 voxel, from above.
    """
    found = np.full((64, 64), np.nan)
    levels = (np.arange(SIDE * 32, 0, -1) - 0.5) / 32
    for row in range(64):
        for column in range(64):
            # Four pixels a voxel; the middle of the volume is the middle of the half.
            x, y = (column + 0.5) / 4 - 8.0, 8.0 - (row + 0.5) / 4
            if max(abs(x), abs(y)) >= SIDE / 2:
                continue
            here = labels[int(x + SIDE / 2), int(y + SIDE / 2)]
            points = np.stack([np.full_like(levels, x), np.full_like(levels, y), levels - SIDE / 2], axis=1)
            left = (here[levels.astype(int)] > 0) & ~is_removed(points)
            if left.any():
                found[row, column] = levels[left.argmax()] - SIDE / 2
    return found


def seen(half):
    """Height above the middle, in voxels, of what a half of the picture shows."""
    depth = half[4].astype(float)
    return np.where(depth < 1e9, (30.0 - depth) / UNIT, np.nan)


def same(one, other):
    """Whether two height maps agree to the oracle's step; pixels on an edge of the cut may fall to either side."""
    both = np.isnan(one) == np.isnan(other)
    close = np.abs(np.nan_to_num(one) - np.nan_to_num(other)) <= 1 / 32
    return both & close


def add(bpy, volume, **how):
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    volume.select_set(True)
    bpy.context.view_layer.objects.active = volume
    assert bpy.ops.pumice.add_cut(**how) == {"FINISHED"}
    return bpy.context.object


@pytest.mark.parametrize("shape", ["PLANE", "BOX"])
def test_a_cut_of_one_volume_is_right_and_leaves_the_other_bit_for_bit(blender, pair, shape):
    scene, labels, left, _ = pair
    whole = halves(rendered(blender))
    cut = add(blender, left, shape=shape, volumes="ACTIVE")
    # About the middle, so that a plane removes all of the other volume where it cuts that too.
    turn, there = Matrix.Rotation(0.5, 4, Vector((1.0, 2.0, 0.5)).normalized()), Matrix.Translation(left.matrix_world @ Vector([4.0] * 3))
    cut.matrix_world = there @ turn @ there.inverted() @ cut.matrix_world
    blender.context.view_layer.update()
    cut_open = halves(rendered(blender))
    assert np.array_equal(cut_open[1].view(np.uint32), whole[1].view(np.uint32)), "the other volume"

    to_cut = np.array(cut.matrix_world.inverted())
    middle = np.array(left.matrix_world @ Vector([SIDE / 2] * 3))
    inside = {"PLANE": lambda p: p[:, 2] > 0.0, "BOX": lambda p: (np.abs(p) < 1.0).all(axis=1)}[shape]

    def is_removed(points):
        return inside((points * UNIT + middle) @ to_cut[:3, :3].T + to_cut[:3, 3])

    good = same(seen(cut_open[0]), heights(labels, is_removed))
    # A pixel whose middle lies within a hundredth of a pixel of an edge may differ: fewer than one in a hundred.
    assert good.mean() > 0.99, (shape, good.mean())
    assert same(seen(whole[0]), heights(labels, lambda p: np.zeros(len(p), bool))).mean() > 0.99
    # Negative controls: the uncut volume, and the cut of all volumes, are told apart.
    assert same(seen(whole[0]), heights(labels, is_removed)).mean() < 0.99
    cut.pumice.cut_volumes = None
    cuts_both = not np.array_equal(halves(rendered(blender))[1], whole[1])
    assert cuts_both == (shape == "PLANE"), "the box does not reach the other volume"


def test_the_cut_stands_at_the_middle_before_the_viewer(blender, pair):
    scene, _, left, right = pair
    middle = left.matrix_world @ Vector([SIDE / 2] * 3)
    plane = add(blender, left, shape="PLANE")
    assert plane.pumice.cut == "PLANE" and plane.pumice.cut_volumes is None and plane.type == "EMPTY"
    assert (plane.matrix_world.translation - middle).length < 1e-5
    assert plane.matrix_world.col[2].to_3d().dot(Vector((0.0, 0.0, 1.0))) > 0.99999, "the camera looks down"
    for axis in "XYZ":
        plane = add(blender, left, shape="PLANE", orientation=axis)
        normal = plane.matrix_world.col[2].to_3d()
        assert abs(normal["XYZ".index(axis)]) > 0.99999
    assert normal.z > 0.0
    scene.camera.matrix_world = Matrix.Translation((0.0, 0.0, -30.0)) @ Matrix.Rotation(np.pi, 4, "X")
    assert add(blender, left, shape="PLANE", orientation="Z").matrix_world.col[2].z < -0.99999, "it takes the viewer's side"
    scene.camera.location = (10.0, -30.0, 20.0)
    scene.camera.rotation_euler = (Vector((10.0, -30.0, 20.0)) - right.matrix_world @ Vector([4.0] * 3)).to_track_quat("Z", "Y").to_euler()
    blender.context.view_layer.update()
    box = add(blender, right, shape="BOX", volumes="SELECTED")
    assert list(box.pumice.cut_volumes.all_objects) == [right]
    corners = [box.matrix_world @ Vector((x, y, z)) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    middle = right.matrix_world @ Vector([SIDE / 2] * 3)
    assert min((corner - middle).length for corner in corners) < 1e-5, "one corner is the middle"
    low, high = (Vector([pick(c[i] for c in corners) for i in range(3)]) for pick in (min, max))
    half = SIDE / 2 * UNIT
    assert high.z > middle.z + half and low.y < middle.y - half, "it takes what is before the camera"


def test_who_is_cut_can_be_chosen_and_undone(blender, pair):
    _, _, left, right = pair
    blender.ops.ed.undo_push(message="before")
    cut = add(blender, left, shape="PLANE")
    left.select_set(True)
    assert blender.ops.pumice.cut_volumes(volumes="SELECTED") == {"FINISHED"}
    assert list(cut.pumice.cut_volumes.all_objects) == [left]
    assert blender.ops.pumice.cut_volumes(volumes="ALL") == {"FINISHED"} and cut.pumice.cut_volumes is None
    left.select_set(False)
    with pytest.raises(RuntimeError, match="No volume is selected"):
        blender.ops.pumice.cut_volumes(volumes="SELECTED")
    for name in ("PUMICE_OT_add_cut", "PUMICE_OT_cut_volumes"):
        assert "UNDO" in blender.types.Operator.bl_rna_get_subclass_py(name).bl_options
    copy = cut.copy()
    assert copy.pumice.cut == "PLANE"
    count = len(blender.data.objects)
    blender.ops.ed.undo_push(message="cut")
    blender.ops.ed.undo()
    assert len(blender.data.objects) < count
    blender.context.view_layer.objects.active = blender.context.scene.camera
    with pytest.raises(RuntimeError, match="Make a volume active first"):
        blender.ops.pumice.add_cut()
    with pytest.raises(RuntimeError, match="Make an object that cuts active first"):
        blender.ops.pumice.cut_volumes()


def test_a_cut_of_an_empty_collection_says_that_it_cuts_nothing(blender, extension, pair):
    scene, _, left, _ = pair
    cut = add(blender, left, shape="PLANE")
    cut.pumice.cut_volumes = blender.data.collections.new("nobody")
    blender.context.view_layer.update()
    lines = extension.panels.not_drawn(scene, blender.context.view_layer)
    assert [line for line in lines if "nobody" in line] == [f"Object {cut.name}: collection nobody has no volume, so it cuts nothing"]
    whole = halves(rendered(blender))
    cut.pumice.cut = "NONE"
    assert np.array_equal(halves(rendered(blender))[0], whole[0])


def test_a_live_viewport_follows_who_is_cut(blender, extension, monkeypatch, pair):
    """Volumes that a cut names come and go; the session takes every edit, and its last picture is that of the last scene."""
    scene, _, left, right = pair
    scene.pumice.viewport_samples = 4
    monkeypatch.setattr(importlib.import_module("test_real_volumes"), "SIZE", PIXELS)
    context, view = viewport_of(blender, extension, monkeypatch, Engine())
    pixels = lambda: np.array(np.asarray(settle(blender, view, context)))  # noqa: E731
    whole = pixels()
    cut = add(blender, left, shape="PLANE", volumes="ACTIVE")
    one = pixels()
    assert not np.array_equal(one, whole)
    third = right.copy()
    third.location.y += 6.0
    scene.collection.objects.link(third)
    cut.pumice.cut_volumes.objects.link(third)
    both = pixels()
    assert not np.array_equal(both, one)
    view.close()
    context, view = viewport_of(blender, extension, monkeypatch, Engine(6))
    assert np.array_equal(pixels(), both), "edits lead where a new session begins"
    cut.pumice.cut_volumes.objects.unlink(left)
    pixels()
    blender.data.objects.remove(third)
    assert np.array_equal(pixels(), whole), "nobody is cut"
    cut.pumice.cut_volumes.objects.link(left)
    blender.data.objects.remove(right)
    last = pixels()
    view.close()
    context, view = viewport_of(blender, extension, monkeypatch, Engine(5))
    assert np.array_equal(pixels(), last), "edits lead where a new session begins"
    assert view.notes == []


def test_the_handles_stand_at_the_cut_and_are_unregistered(blender, extension, pair):
    _, _, left, _ = pair
    cut = add(blender, left, shape="BOX")
    cut.matrix_world = Matrix.LocRotScale(Vector((1, 2, 3)), Matrix.Rotation(0.7, 3, "X").to_quaternion(), Vector((2.0, 1.0, 0.5)))
    gizmo = importlib.import_module(f"{extension.__name__}.cut_gizmo")
    for _, axis in gizmo.HANDLES["BOX"]:
        place = gizmo.place(cut, axis)
        assert (place.translation - Vector((1, 2, 3))).length < 1e-6
        assert place.col[2].to_3d().dot(cut.matrix_world.col[axis].to_3d().normalized()) > 0.99999 and place.determinant() == pytest.approx(1.0)
    assert gizmo.PUMICE_GGT_cut.poll(blender.context)
    cut.select_set(False)
    assert not gizmo.PUMICE_GGT_cut.poll(blender.context)
    cut.select_set(True)
    cut.pumice.cut = "NONE"
    assert not gizmo.PUMICE_GGT_cut.poll(blender.context)
    found = lambda: blender.types.GizmoGroup.bl_rna_get_subclass_py("PUMICE_GGT_cut")  # noqa: E731
    assert found() is gizmo.PUMICE_GGT_cut
    gizmo.unregister()
    try:
        assert found() is None
    finally:
        gizmo.register()
    assert found() is gizmo.PUMICE_GGT_cut
