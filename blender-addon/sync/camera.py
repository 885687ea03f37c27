# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Computes the scene's camera from a Blender camera object or from a 3D viewport.

Blender's camera has a lens in millimetres before a sensor; its *fit* says which side of the picture the sensor's size spans. The
scene's camera has the same fit, and a field of view, a scale and a shift of that side:

    fit HORIZONTAL  fitted = width          sensor = sensor_width          tan(fov / 2) = sensor / 2 lens
    fit VERTICAL    fitted = height         sensor = sensor_height         scale = ortho_scale
    fit AUTO        fitted = longer side    sensor = sensor_width          shift = lens shift

The longer side is that of the picture as it is looked at: pixels may be wider than high (`aspect` is width over height).

A 3D viewport gives its projection as a matrix that holds everything already (fit, shift, zoom and offset of the camera view):

    perspective   P00 = 1 / half width at distance 1     P02 = centre across / half width
    orthographic  P00 = 1 / half width                   P03 = −centre across / half width

From it comes a camera of fit AUTO; a viewport's pixels are square.
"""

import math

from . import matrix


def from_lens(
    world_from_camera, *, kind, lens_mm, ortho_scale, sensor_fit, sensor_mm, shift, clip, aperture=None
):
    """The camera of a Blender camera object.

    `kind` is PERSP or ORTHO, `sensor_mm` width and height, `clip` near and far, `aperture` the scene's or None.
    """
    sensor = sensor_mm[1] if sensor_fit == "VERTICAL" else sensor_mm[0]
    half = 0.5 * sensor / lens_mm if kind == "PERSP" else 0.5 * ortho_scale
    made = _camera(matrix.unit_axes(world_from_camera), kind, half, shift, clip, sensor_fit.lower())
    return {**made, "aperture": aperture} if aperture is not None else made


def from_window(world_from_view, window, *, clip, size, aperture=None):
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
            if aperture is not None:
                aperture = {**aperture, "focus_distance": aperture["focus_distance"] - near}
    made = _camera(world_from_view, kind, half, [c / (2.0 * half) for c in centre], clip, "auto")
    return {**made, "aperture": aperture} if aperture is not None else made


def aperture(*, kind, lens_mm, fstop, focus_distance, blades, rotation_rad, ratio):
    """The scene's aperture of a Blender camera's *Depth of Field*.

    Cycles takes the lens as a length in metres whatever the scene's unit is, and 1 for a parallel projection. Its least f-stop and
    distance are 1e-5. Fewer than three blades make a disk.
    """
    return {
        "radius": (lens_mm * 1e-3 if kind == "PERSP" else 1.0) / (2.0 * max(fstop, 1e-5)),
        "focus_distance": max(float(focus_distance), 1e-5),
        "blades": int(blades) if blades >= 3 else 0,
        "rotation_rad": float(rotation_rad),
        "ratio": max(float(ratio), 1e-5),
    }


def distance_along(world_from_camera, point):
    """Distance of a point of the world from the camera along its view axis, in front of it or behind it."""
    camera = matrix.unit_axes(world_from_camera)
    return abs(sum(camera[r][2] * (camera[r][3] - point[r]) for r in range(3)))


def fitted(fit, size, aspect=1.0):
    """Length of the fitted side, in pixels' heights."""
    width, height = size[0] * aspect, size[1]
    return {"horizontal": width, "vertical": height}.get(fit, max(width, height))


def crop(camera, size, rect, aspect=1.0):
    """The camera that sees the part `rect` = (x0, y0, x1, y1) of a picture of `size` pixels, counted from the lower left."""
    x0, y0, x1, y1 = rect
    fit = camera["fit"]
    before, after = fitted(fit, size, aspect), fitted(fit, (x1 - x0, y1 - y0), aspect)
    centre = [(x0 + x1 - size[0]) / 2.0 * aspect, (y0 + y1 - size[1]) / 2.0]
    shift = [(s * before + c) / after for s, c in zip(camera["shift"], centre)]
    projection = camera["projection"]
    if "perspective" in projection:
        kind, half = "PERSP", math.tan(0.5 * projection["perspective"]["fov_rad"])
    else:
        kind, half = "ORTHO", 0.5 * projection["orthographic"]["scale"]
    part = _camera([], kind, half * after / before, shift, camera["clip"], fit)
    return {**camera, "projection": part["projection"], "shift": part["shift"]}


def _camera(world_from_camera, kind, half, shift, clip, fit):
    if kind == "PERSP":
        projection = {"perspective": {"fov_rad": 2.0 * math.atan(half)}}
    else:
        projection = {"orthographic": {"scale": 2.0 * half}}
    return {
        "world_from_camera": matrix.twelve(world_from_camera) if world_from_camera else [],
        "projection": projection,
        "fit": fit,
        "shift": [float(s) for s in shift],
        "clip": [float(c) for c in clip],
    }
