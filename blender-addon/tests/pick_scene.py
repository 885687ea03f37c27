# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A small scene for tests of picking: two volumes, a linked duplicate of one, a mesh in front, a hidden label and a cut."""

import numpy as np
import pumice
from mathutils import Euler, Vector

from test_real_volumes import exr, imported

SIZE = (60, 44)
FIRST_IDS, SECOND_IDS = (3, 17, 2**40), (5, 6, 7, 8, 9)


def block(ids, path, names):
    """A volume of 24 × 12 × 12 voxels, filled but for its borders, whose labels lie in slabs along x."""
    dense = np.zeros((24, 12, 12), dtype=np.uint64)
    for place, label in enumerate(ids):
        low, high = (2 + 20 * edge // len(ids) for edge in (place, place + 1))
        dense[low:high, 2:10, 2:10] = label
    pumice.compress(dense, names=names, types={ids[0]: "axon"}).save(path)
    return path


def made(bpy, folder):
    """(first, duplicate, second) volume objects in front of a camera, in a scene that F12 renders in a moment. They do not overlap: a cap of
    two solids that a plane cuts would be as near as the other."""
    first = imported(bpy, block(FIRST_IDS, folder / "first.pumice", {3: "Axon one", 17: "glia"}), longest_side=6.0)
    second = imported(bpy, block(SECOND_IDS, folder / "second.pumice", {}), longest_side=6.0, placement="CENTER")
    duplicate = first.copy()
    scene = bpy.context.scene
    scene.collection.objects.link(duplicate)
    for obj, place, turn in ((first, (-1, 0, 1), 0.4), (duplicate, (2.5, 4.5, -1.5), -0.8), (second, (1, -5, 1.5), 0.2)):
        obj.location, obj.rotation_euler = obj.location + Vector(place), Euler((turn, 0.3, -turn))
    mesh = bpy.data.meshes.new("screen")
    mesh.from_pydata([(-3, -8, -2), (-1, -8, -2), (-1, -8, 2), (-3, -8, 2)], [], [(0, 1, 2, 3)])
    scene.collection.objects.link(bpy.data.objects.new("screen", mesh))

    camera = scene.camera
    camera.location, camera.rotation_euler = (0, -20, 3), Euler((1.4, 0, 0))
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *SIZE, 100
    scene.pumice.samples, scene.pumice.bounces, scene.pumice.backend = 1, 0, "CPU"
    if bpy.app.version >= (5, 0, 0):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    render.image_settings.color_depth = "32"
    layer = bpy.context.view_layer
    layer.pumice.use_pass_label, layer.use_pass_z = True, True
    layer.update()
    return first, duplicate, second


def knife(bpy):
    """An empty that cuts the upper parts of two volumes off."""
    empty = bpy.data.objects.new("knife", None)
    bpy.context.scene.collection.objects.link(empty)
    empty.pumice.cut = "PLANE"
    empty.location, empty.rotation_euler = (0.0, 0.0, 1.2), (0.2, 0.1, 0.0)
    bpy.context.view_layer.update()


def look_perspective(_bpy):
    """The camera as it is made."""


def look_orthographic(bpy):
    bpy.context.scene.camera.data.type = "ORTHO"
    bpy.context.scene.camera.data.ortho_scale = 11.0


def look_shifted(bpy):
    data = bpy.context.scene.camera.data
    data.shift_x, data.shift_y, data.sensor_fit = 0.12, -0.07, "VERTICAL"


def look_cropped(bpy):
    render = bpy.context.scene.render
    render.use_border, render.use_crop_to_border = True, True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.2, 0.9, 0.15, 0.8


VIEWS = {"perspective": look_perspective, "orthographic": look_orthographic, "shifted": look_shifted, "cropped": look_cropped}


def passes(bpy, folder):
    """(Label, Depth) passes of F12, rows from the top."""
    path = folder / "picture.exr"
    bpy.context.scene.render.filepath = str(path)
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    found = exr(path)
    label = next(plane for name, plane in found.items() if name.startswith("Label"))
    depth = next(plane for name, plane in found.items() if name.startswith("Depth"))
    return label.astype(np.int64), depth


def seen(bpy, folder, objects):
    """The index into `objects` that each pixel sees, -1 where it sees none of them, from a picture of each alone: the nearest one counts."""
    nearest, owner = None, None
    for place, obj in enumerate(objects):
        for other in objects:
            other.hide_render = other.hide_viewport = other != obj
        label, depth = passes(bpy, folder)
        depth = np.where(label > 0, depth, np.inf)
        if nearest is None:
            nearest, owner = np.full_like(depth, np.inf), np.full(depth.shape, -1)
        owner[depth < nearest] = place
        nearest = np.minimum(nearest, depth)
    for obj in objects:
        obj.hide_render = obj.hide_viewport = False
    bpy.context.view_layer.update()
    return owner
