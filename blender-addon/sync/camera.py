# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's camera from Blender's two ways to say what is seen.

Blender's camera has a lens in millimetres before a sensor; its *fit* says which side of the picture the sensor's size spans:

    fit HORIZONTAL  spanned = width          sensor = sensor_width
    fit VERTICAL    spanned = height         sensor = sensor_height
    fit AUTO        spanned = longer side    sensor = sensor_width

    tan(half angle over the spanned side) = sensor / 2 lens           (perspective)
    extent of the spanned side            = ortho_scale               (orthographic)
    lens shift moves the picture by shift × spanned side

The scene's camera is plainer: field of view, scale and shift are all of the longer side. With k = longer / spanned:

    tan(fov / 2) = k · sensor / 2 lens        scale = k · ortho_scale        shift = lens shift / k

A 3D viewport gives its projection as a matrix that holds everything already (fit, shift, zoom and offset of the camera view):

    perspective   P00 = 1 / half width at distance 1     P02 = centre across / half width
    orthographic  P00 = 1 / half width                   P03 = −centre across / half width

Pixels are square; who calls has refused anything else.
"""

import math

from . import matrix


def from_lens(
    world_from_camera, *, kind, lens_mm, ortho_scale, sensor_fit, sensor_mm, shift, clip, size
):
    """The camera of a Blender camera object for a picture of `size` pixels.

    `kind` is PERSP or ORTHO, `sensor_mm` width and height, `clip` near and far.
    """
    width, height = size
    longer = max(width, height)
    vertical = sensor_fit == "VERTICAL" or (sensor_fit == "AUTO" and height > width)
    spanned = height if vertical else width
    sensor = sensor_mm[1] if sensor_fit == "VERTICAL" else sensor_mm[0]
    if kind == "PERSP":
        half = 0.5 * sensor / lens_mm * longer / spanned
    else:
        half = 0.5 * ortho_scale * longer / spanned
    return _camera(
        matrix.unit_axes(world_from_camera), kind, half, [s * spanned / longer for s in shift], list(clip)
    )


def from_window(world_from_view, window, *, clip, size):
    """The camera of a 3D viewport of `size` pixels, from its view and projection.

    `clip` holds for a perspective view: single precision leaves little of the far plane in its matrix. A parallel view may begin
    behind its origin (Blender looks both ways there): the camera then stands farther back.
    """
    width, height = size
    across = (2.0 * max(width, height)) / (2.0 * width)
    scale = float(window[0][0])
    world_from_view = matrix.rows(world_from_view)
    half = across / scale
    if float(window[3][3]) == 0.0:
        centre = [float(window[0][2]) / scale, float(window[1][2]) / float(window[1][1])]
        kind, clip = "PERSP", list(clip)
    else:
        centre = [-float(window[0][3]) / scale, -float(window[1][3]) / float(window[1][1])]
        near = (float(window[2][3]) + 1.0) / float(window[2][2])
        far = (float(window[2][3]) - 1.0) / float(window[2][2])
        kind, clip = "ORTHO", [near, far]
        if near < 0.0:
            world_from_view = matrix.moved_back(world_from_view, -near)
            clip = [0.0, far - near]
    return _camera(world_from_view, kind, half, [c / (2.0 * half) for c in centre], clip)


def crop(camera, size, rect):
    """The camera that sees the part `rect` = (x0, y0, x1, y1) of a picture of `size` pixels, counted from the lower left."""
    x0, y0, x1, y1 = rect
    before, after = max(size), max(x1 - x0, y1 - y0)
    centre = [(x0 + x1 - size[0]) / 2.0, (y0 + y1 - size[1]) / 2.0]
    shift = [(s * before + c) / after for s, c in zip(camera["shift"], centre)]
    projection = camera["projection"]
    if "perspective" in projection:
        kind, half = "PERSP", math.tan(0.5 * projection["perspective"]["fov_rad"])
    else:
        kind, half = "ORTHO", 0.5 * projection["orthographic"]["scale"]
    part = _camera([], kind, half * after / before, shift, camera["clip"])
    return {**part, "world_from_camera": camera["world_from_camera"]}


def _camera(world_from_camera, kind, half, shift, clip):
    if kind == "PERSP":
        projection = {"perspective": {"fov_rad": 2.0 * math.atan(half)}}
    else:
        projection = {"orthographic": {"scale": 2.0 * half}}
    return {
        "world_from_camera": matrix.twelve(world_from_camera) if world_from_camera else [],
        "projection": projection,
        "shift": [float(s) for s in shift],
        "clip": [float(c) for c in clip],
    }
