# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares cameras with Blender's: `world_to_camera_view` and `Camera.calc_matrix_camera` give the place of a point in the picture.

These oracles share no code with the extension. `pixel` below implements the definition of a camera in docs/scene.md.
"""

import itertools
import math

import mathutils
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view

# For Blender's single precision: 24 bits, some tens of operations, pictures of up to 1000 pixels.
TOLERANCE_PIXELS = 2e-2
SIZES = [(640, 360), (360, 640), (500, 500)]
SHIFTS = [(0.0, 0.0), (0.21, -0.13)]


def pixel(camera, size, point, aspect=1.0):
    """Pixel coordinates, from the lower left corner, of a point of the world; `aspect` is the width of a pixel over its height."""
    columns = np.array(camera["world_from_camera"]).reshape(4, 3)
    p = np.linalg.solve(columns[:3].T, np.array(point) - columns[3])
    projection = camera["projection"]
    if "perspective" in projection:
        half = math.tan(projection["perspective"]["fov_rad"] / 2.0)
        p = p / -p[2]
    else:
        half = projection["orthographic"]["scale"] / 2.0
    sides = (size[0] * aspect, size[1])
    fitted = {"horizontal": sides[0], "vertical": sides[1], "auto": max(sides)}[camera["fit"]]
    seen = [(p[a] / half - 2.0 * camera["shift"][a]) * fitted / 2.0 + sides[a] / 2.0 for a in range(2)]
    return [seen[0] / aspect, seen[1]]


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


FITS = ("AUTO", "HORIZONTAL", "VERTICAL")
KINDS_AND_FITS = list(itertools.product(("PERSP", "ORTHO"), FITS))
CASES = list(itertools.product(("PERSP", "ORTHO"), FITS, SHIFTS, SIZES))


@pytest.mark.parametrize("kind,fit,shift,size", CASES)
def test_a_camera_object_sees_what_blender_says(blender, extension, kind, fit, shift, size):
    obj = make_camera(blender, kind, fit, shift, size)
    camera = extension.scene_reader.lens.read(obj)
    assert camera["clip"] == pytest.approx([0.2, 80.0])
    for point in points():
        ndc = world_to_camera_view(blender.context.scene, obj, mathutils.Vector(point))
        expected = [ndc.x * size[0], ndc.y * size[1]]
        assert pixel(camera, size, point) == pytest.approx(expected, abs=TOLERANCE_PIXELS)


def test_the_comparison_notices_wrong_cameras(blender, extension):
    """Negative control: each likely mistake moves a point by more than the tolerance."""
    size, shift = (360, 640), (0.21, -0.13)
    obj = make_camera(blender, "PERSP", "HORIZONTAL", shift, size)
    good = extension.scene_reader.lens.read(obj)
    wrong_shift = dict(good, shift=[-s for s in good["shift"]])
    scaled_shift = dict(good, shift=[s * 360 / 640 for s in shift])
    wrong_side = dict(good, fit="auto")
    for wrong in (wrong_shift, scaled_shift, wrong_side):
        moved = [np.subtract(pixel(wrong, size, p), pixel(good, size, p)) for p in points()]
        assert np.abs(moved).max() > 10 * TOLERANCE_PIXELS


def matrices(bpy, obj, size, zoom=1.0, offset=(0.0, 0.0)):
    """(view matrix, window matrix) of a 3D viewport. Zoom and offset of the camera view act on the picture after the lens."""
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
    # The clip range comes from the orthographic window matrix, within the 24-bit precision of the largest term.
    assert camera["clip"] == pytest.approx([0.2, 80.0], abs=80.0 * 2**-20)


def test_a_parallel_view_that_begins_behind_itself_moves_back(blender, extension):
    """Blender's orthographic views look in both directions from their origin."""
    math_of_camera = extension.scene_reader.camera_math
    half, far, size = 3.0, 1000.0, (400, 300)
    window = [[1 / half, 0, 0, 0], [0, 400 / 300 / half, 0, 0], [0, 0, -1 / far, 0], [0, 0, 0, 1]]
    identity = [[float(r == c) for c in range(4)] for r in range(4)]
    camera = math_of_camera.from_window(identity, window, clip=(0.1, far), size=size)
    assert camera["clip"] == pytest.approx([0.0, 2 * far])
    assert camera["world_from_camera"][9:] == pytest.approx([0.0, 0.0, far])
    assert pixel(camera, size, (1.5, -0.75, 30.0)) == pytest.approx([300.0, 100.0])


# Square pixels, wide ones (of pictures that are wide in pixels, or only by their pixels' shape), high ones.
@pytest.mark.parametrize("aspect", [(1.0, 1.0), (1.5, 1.0), (2.0, 1.0), (1.0, 1.3)])
@pytest.mark.parametrize("kind,fit", KINDS_AND_FITS)
@pytest.mark.parametrize("size", [(640, 360), (360, 640)])
def test_pixels_that_are_not_square_see_what_blender_says(blender, extension, drawn, kind, fit, aspect, size):
    obj = make_camera(blender, kind, fit, (0.21, -0.13), size)
    render = blender.context.scene.render
    render.pixel_aspect_x, render.pixel_aspect_y = aspect
    camera, wide = extension.scene_reader.lens.read(obj), extension.scene_reader.pixel_aspect(render)
    for point in points():
        ndc = world_to_camera_view(blender.context.scene, obj, mathutils.Vector(point))
        # `world_to_camera_view` ignores the pixels' shape; the matrix includes it.
        clip = obj.calc_matrix_camera(
            blender.context.evaluated_depsgraph_get(), x=size[0], y=size[1], scale_x=aspect[0], scale_y=aspect[1]
        )
        seen = clip @ obj.matrix_world.normalized().inverted() @ mathutils.Vector((*point, 1.0))
        expected = [(seen[a] / seen.w + 1.0) / 2.0 * size[a] for a in range(2)]
        assert pixel(camera, size, point, wide) == pytest.approx(expected, abs=TOLERANCE_PIXELS)
        if wide == 1.0:
            assert expected == pytest.approx([ndc.x * size[0], ndc.y * size[1]], abs=TOLERANCE_PIXELS)


@pytest.mark.parametrize("kind,fit", KINDS_AND_FITS)
@pytest.mark.parametrize("rect", [(0, 0, 640, 360), (100, 30, 220, 330), (600, 0, 640, 20)])
@pytest.mark.parametrize("aspect", [1.0, 1.7])
def test_a_part_of_the_picture_is_that_part(blender, extension, kind, fit, rect, aspect):
    size = (640, 360)
    whole = extension.scene_reader.lens.read(make_camera(blender, kind, fit, (0.21, -0.13), size))
    part = extension.scene_reader.camera_math.crop(whole, size, rect, aspect)
    part_size = (rect[2] - rect[0], rect[3] - rect[1])
    for point in points():
        x, y = pixel(whole, size, point, aspect)
        assert pixel(part, part_size, point, aspect) == pytest.approx([x - rect[0], y - rect[1]], abs=1e-6)


def focused(bpy, kind):
    """A camera with depth of field, and an object off its axis to focus on."""
    obj = make_camera(bpy, kind, "AUTO", (0.0, 0.0), (640, 360))
    dof = obj.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, 2.0, 3.5
    dof.aperture_blades, dof.aperture_rotation, dof.aperture_ratio = 6, 0.4, 1.5
    target = bpy.data.objects.new("target", None)
    bpy.context.collection.objects.link(target)
    target.location = (1.0, -0.5, 0.7)
    return obj, target


@pytest.mark.parametrize("kind,radius", [("PERSP", 0.041 / 4.0), ("ORTHO", 1.0 / 4.0)])
def test_depth_of_field_is_that_of_the_lens(blender, extension, drawn, kind, radius):
    obj, target = focused(blender, kind)
    depsgraph = blender.context.evaluated_depsgraph_get()
    read = lambda: extension.scene_reader.lens.read(obj, depsgraph)["aperture"]  # noqa: E731
    wanted = {"radius": radius, "focus_distance": 3.5, "blades": 6, "rotation_rad": 0.4, "ratio": 1.5}
    assert read() == pytest.approx(wanted)
    # The distance to a focus object counts along the axis; Blender gives it as the third coordinate of `world_to_camera_view`.
    obj.data.dof.focus_object = target
    blender.context.view_layer.update()
    depth = world_to_camera_view(blender.context.scene, obj, target.matrix_world.translation).z
    assert read()["focus_distance"] == pytest.approx(depth, rel=1e-5)
    assert depth < (obj.matrix_world.translation - target.matrix_world.translation).length, "it is off the axis"
    obj.data.dof.aperture_blades, obj.data.dof.use_dof = 2, True
    assert read()["blades"] == 0
    obj.data.dof.use_dof = False
    assert "aperture" not in extension.scene_reader.lens.read(obj, depsgraph)


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
        extension.scene_reader.lens.read(obj)
    render = blender.context.scene.render
    render.use_multiview = True
    with pytest.raises(refused, match="Stereoscopy"):
        extension.scene_reader.final_frame(render)
    blender.context.scene.camera = None
    with pytest.raises(refused, match="no camera"):
        extension.scene_reader.final_camera(blender.context.evaluated_depsgraph_get(), (8, 8), (0, 0, 8, 8))
