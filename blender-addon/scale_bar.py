# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The scale bar: a bar of a round length with that length as text, which stands in a corner of the camera's view.

    ●────────────┊·················┊──────     The bar is as long in the picture as its length in the volume is at a plane across the
    camera      bar               plane        camera's axis. In an orthographic view it is true everywhere.

Its length follows from the volume's matrix, its voxel size and its unit; 1, 2 or 5 times a power of ten that fills at most a quarter of the
picture's width.
"""

import math

from mathutils import Vector

from . import figure_frame, figure_part, volume_place
from .reports import Refused

# Part of the picture's width that a bar of automatic length fills at most.
MOST_OF_WIDTH = 0.25
THICKNESS_MM = 0.7
GAP_MM = 0.8
# Height of capitals and figures of Blender's font, in its size.
CAPITAL = 0.69
# Metres in each unit, with the name that people write.
UNITS = (("nm", "nm", 1e-9), ("um", "µm", 1e-6), ("mm", "mm", 1e-3), ("m", "m", 1.0))
# Largest difference of the scales of the axes at which one bar is true along all of them: a hundredth of a pixel in a bar of 100.
MOST_UNEVEN = 1e-4
WHERE = {"MIDDLE": "middle", "FRONT": "front"}


def follow(obj, scene, depsgraph):
    """Makes a scale bar what camera, picture and volume ask for. Returns one line where it cannot be true, otherwise None."""
    settings = obj.pumice_figure
    if settings.volume is None or not settings.volume.pumice.filepath:
        return f"{obj.name}: its volume is gone; choose another, or delete the bar"
    frame, volume = figure_frame.Frame(scene, depsgraph), settings.volume.evaluated_get(depsgraph)
    distance = plane_distance(settings, volume, frame)
    problem = None
    if distance <= 0.0 and frame.is_perspective:
        problem = f"{obj.name}: the plane of the bar lies behind the camera"
        distance = 1.0
    unit_per_length, even = unit_length(volume)
    if not even:
        problem = f"{obj.name}: {volume.name} is scaled unevenly, so no bar is true; apply the same scale to its axes"
    length = settings.length or round_length(MOST_OF_WIDTH * frame.width_mm * frame.unit_per_mm(distance) / unit_per_length)
    length_mm = length * unit_per_length / frame.unit_per_mm(distance)

    said = "not to scale" if problem else length_text(length, volume.pumice.unit if settings.unit == "FILE" else settings.unit)
    if frame.is_perspective and settings.names_plane and not problem:
        said += f" ({WHERE.get(settings.plane) or f'at {settings.distance:.4g}'})"
    height = THICKNESS_MM + GAP_MM + CAPITAL * settings.text_mm
    x, y = frame.corner(settings.corner, settings.margin_mm, length_mm, height)
    figure_frame.attach(obj, frame, frame.camera_from_paper(frame.part_distance(distance), x, y))
    figure_part.set_rectangles(obj.data, [(0.0, 0.0, length_mm, THICKNESS_MM)])
    figure_part.set_colors(obj.data, obj.name, [tuple(settings.color)])
    text = figure_part.text_of(obj)
    if text is not None:
        # The text may be longer than the bar, so it ends at the side of the picture that the bar is at.
        is_left = settings.corner.endswith("LEFT")
        place = (0.0 if is_left else length_mm, THICKNESS_MM + GAP_MM)
        figure_part.set_text(text, said, size=settings.text_mm, place=place, align="LEFT" if is_left else "RIGHT")
        figure_part.set_colors(text.data, obj.name, [tuple(settings.color)])
    return problem


def plane_distance(settings, volume, frame):
    """Distance from the camera, along its axis, of the plane where a bar is true."""
    if settings.plane == "DISTANCE":
        return settings.distance
    dims, place = volume.pumice.dims, volume_place.known(volume)
    if settings.plane == "MIDDLE":
        return frame.distance_of(place @ (Vector(dims) / 2.0))
    corners = [Vector([dims[axis] * (bit >> axis & 1) for axis in range(3)]) for bit in range(8)]
    return min(frame.distance_of(place @ corner) for corner in corners)


def unit_length(volume):
    """(length in the scene of one unit of the file, whether it is the same along all axes of a volume)."""
    linear, spacing = volume_place.known(volume).to_3x3(), volume.pumice.spacing
    along = [linear.col[axis].length / spacing[axis] for axis in range(3)]
    middle = sum(along) / 3.0
    return middle, max(along) - min(along) <= MOST_UNEVEN * middle


def round_length(most):
    """The greatest 1, 2 or 5 times a power of ten that is at most `most`."""
    if not most > 0.0 or math.isinf(most):
        raise Refused(f"A scale bar needs a view of some width, got one of {most:g}")
    power = 10.0 ** math.floor(math.log10(most))
    # A hair of slack: 0.25 · 20 is not 5 in every rounding.
    return next((step * power for step in (5.0, 2.0) if step * power <= most * (1.0 + 1e-9)), power)


def length_text(length, unit):
    """A length in the unit in which it has the fewest digits before its point; `unit` is the file's name of it."""
    meters = next((size for name, _, size in UNITS if name == unit), None)
    if meters is None:
        return f"{length:.6g} units"
    fitting = [(said, size) for _, said, size in UNITS if length * meters >= size * (1.0 - 1e-9)] or [UNITS[0][1:]]
    said, size = fitting[-1]
    return f"{length * meters / size:.6g} {said}"
