# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera against Blender's own: `world_to_camera_view` and `Camera.calc_matrix_camera` say where a point of the world appears.

The oracle shares no code with the extension. `pixel` below is the scene's definition of a camera (docs/scene.md), written out.
"""

import itertools
import math

import mathutils
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view

# Blender computes in single precision: 24 bits, some tens of operations, pictures of up to 1000 pixels.
TOLERANCE_PIXELS = 2e-2
SIZES = [(640, 360), (360, 640), (500, 500)]
SHIFTS = [(0.0, 0.0), (0.21, -0.13)]


def pixel(camera, size, point):
    """Pixel from the lower left corner at which the scene's camera sees a point of the world."""
    columns = np.array(camera["world_from_camera"]).reshape(4, 3)
    p = np.linalg.solve(columns[:3].T, np.array(point) - columns[3])
    projection = camera["projection"]
    if "perspective" in projection:
        half = math.tan(projection["perspective"]["fov_rad"] / 2.0)
        p = p / -p[2]
    else:
        half = projection["orthographic"]["scale"] / 2.0
    longer = max(size)
    return [(p[a] / half - 2.0 * camera["shift"][a]) * longer / 2.0 + size[a] / 2.0 for a in range(2)]


def points():
    random = np.random.default_rng(3)
    return random.uniform(-2.0, 2.0, (20, 3))


def make_camera(bpy, kind, fit, shift, size):
    data = bpy.data.cameras.new("eye")
    obj = bpy.data.objects.new("eye", data)
    bpy.context.collection.objects.link(obj)
    scene = bpy.context.scene
    scene.camera = obj
    data.type, data.sensor_fit = kind, fit
    data.lens, data.sensor_width, data.sensor_height, data.ortho_scale = 41.0, 33.0, 19.0, 7.5
    data.shift_x, data.shift_y = shift
    data.clip_start, data.clip_end = 0.2, 80.0
    obj.matrix_world = mathutils.Matrix.LocRotScale((6.0, -9.0, 5.0), mathutils.Euler((1.1, 0.1, 0.6)), (1.3, 1.3, 1.3))
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    bpy.context.view_layer.update()
    return obj


CASES = list(itertools.product(("PERSP", "ORTHO"), ("AUTO", "HORIZONTAL", "VERTICAL"), SHIFTS, SIZES))


@pytest.mark.parametrize("kind,fit,shift,size", CASES)
def test_a_camera_object_sees_what_blender_says(blender, extension, kind, fit, shift, size):
    obj = make_camera(blender, kind, fit, shift, size)
    camera = extension.scene_reader.from_camera(obj, size)
    assert camera["clip"] == pytest.approx([0.2, 80.0])
    for point in points():
        ndc = world_to_camera_view(blender.context.scene, obj, mathutils.Vector(point))
        expected = [ndc.x * size[0], ndc.y * size[1]]
        assert pixel(camera, size, point) == pytest.approx(expected, abs=TOLERANCE_PIXELS)


def test_the_comparison_notices_wrong_cameras(blender, extension):
    """Negative control: each mistake that is easily made moves a point by more than the tolerance."""
    size, shift = (360, 640), (0.21, -0.13)
    obj = make_camera(blender, "PERSP", "HORIZONTAL", shift, size)
    good = extension.scene_reader.from_camera(obj, size)
    wrong_shift = dict(good, shift=[-s for s in good["shift"]])
    unscaled_shift = dict(good, shift=list(shift))
    wrong_side = dict(good, projection={"perspective": {"fov_rad": obj.data.angle}})
    for wrong in (wrong_shift, unscaled_shift, wrong_side):
        moved = [np.subtract(pixel(wrong, size, p), pixel(good, size, p)) for p in points()]
        assert np.abs(moved).max() > 10 * TOLERANCE_PIXELS


def matrices(bpy, obj, size, zoom=1.0, offset=(0.0, 0.0)):
    """(view, window) as a 3D viewport has them; zoom and offset of the camera view act on the picture after the lens."""
    window = obj.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=size[0], y=size[1])
    after = mathutils.Matrix.Diagonal((zoom, zoom, 1.0, 1.0))
    after[0][3], after[1][3] = offset
    unscaled = obj.matrix_world.normalized()
    return unscaled.inverted(), after @ window


@pytest.mark.parametrize("kind,fit,shift,size", CASES)
@pytest.mark.parametrize("zoom,offset", [(1.0, (0.0, 0.0)), (0.6, (0.3, -0.2))])
def test_a_viewport_sees_what_its_matrices_say(blender, extension, kind, fit, shift, size, zoom, offset):
    obj = make_camera(blender, kind, fit, shift, size)
    view, window = matrices(blender, obj, size, zoom, offset)
    math_of_camera = extension.scene_reader.camera_math
    matrix = math_of_camera.matrix
    world_from_view = matrix.inverse_rigid(matrix.rows(view))
    camera = math_of_camera.from_window(world_from_view, matrix.rows(window), clip=(0.2, 80.0), size=size)
    for point in points():
        seen = window @ view @ mathutils.Vector((*point, 1.0))
        expected = [(seen[a] / seen.w + 1.0) / 2.0 * size[a] for a in range(2)]
        assert pixel(camera, size, point) == pytest.approx(expected, abs=TOLERANCE_PIXELS)
    # An orthographic window matrix tells its own range: within a 24 bit number of the largest term.
    assert camera["clip"] == pytest.approx([0.2, 80.0], abs=80.0 * 2**-20)


def test_a_parallel_view_that_begins_behind_itself_moves_back(blender, extension):
    """Blender's parallel views look both ways from their origin."""
    math_of_camera = extension.scene_reader.camera_math
    half, far, size = 3.0, 1000.0, (400, 300)
    window = [[1 / half, 0, 0, 0], [0, 400 / 300 / half, 0, 0], [0, 0, -1 / far, 0], [0, 0, 0, 1]]
    identity = [[float(r == c) for c in range(4)] for r in range(4)]
    camera = math_of_camera.from_window(identity, window, clip=(0.1, far), size=size)
    assert camera["clip"] == pytest.approx([0.0, 2 * far])
    assert camera["world_from_camera"][9:] == pytest.approx([0.0, 0.0, far])
    assert pixel(camera, size, (1.5, -0.75, 30.0)) == pytest.approx([300.0, 100.0])


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
@pytest.mark.parametrize("rect", [(0, 0, 640, 360), (100, 30, 220, 330), (600, 0, 640, 20)])
def test_a_part_of_the_picture_is_that_part(blender, extension, kind, rect):
    size = (640, 360)
    whole = extension.scene_reader.from_camera(make_camera(blender, kind, "AUTO", (0.21, -0.13), size), size)
    part = extension.scene_reader.camera_math.crop(whole, size, rect)
    part_size = (rect[2] - rect[0], rect[3] - rect[1])
    for point in points():
        x, y = pixel(whole, size, point)
        assert pixel(part, part_size, point) == pytest.approx([x - rect[0], y - rect[1]], abs=1e-6)


def test_a_view_matrix_is_inverted_exactly_enough(blender, extension):
    obj = make_camera(blender, "PERSP", "AUTO", (0.0, 0.0), (640, 360))
    matrix = extension.scene_reader.matrix if hasattr(extension.scene_reader, "matrix") else None
    matrix = matrix or extension.scene_reader.camera_math.matrix
    back = matrix.inverse_rigid(matrix.rows(obj.matrix_world.normalized()))
    assert np.allclose(back, np.array(obj.matrix_world.normalized().inverted()), atol=1e-5)
    assert matrix.from_twelve(matrix.twelve(obj.matrix_world)) == matrix.rows(obj.matrix_world)


def test_what_is_not_drawn_is_refused(blender, extension):
    refused = extension.scene_reader.Refused
    obj = make_camera(blender, "PANO", "AUTO", (0.0, 0.0), (640, 360))
    with pytest.raises(refused, match="panoramas"):
        extension.scene_reader.from_camera(obj, (640, 360))
    render = blender.context.scene.render
    render.pixel_aspect_x = 2.0
    with pytest.raises(refused, match="Pixel aspect 2 : 1"):
        extension.scene_reader.final_frame(render)
    blender.context.scene.camera = None
    with pytest.raises(refused, match="no camera"):
        extension.scene_reader.final_camera(blender.context.evaluated_depsgraph_get(), (8, 8), (0, 0, 8, 8))
