# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where parts of a figure stand: the camera's frame, in which one unit is a millimeter on paper.

    y ▲ ┌───────────────┐  height_mm        The frame lies across the camera's axis at a distance. A part that is laid out in
      │ │               │                   millimeters from the lower left corner has the matrix `camera_from_paper`. In a
      │ │      ═════    │                   perspective view all frames give the same picture, whatever their distance.
      └─┴───────────────┴──► x  width_mm

Parts are drawn right before the camera, at a hundredth of the distance of what they measure: nothing hides them, and what they
shadow or light is as small as a hundredth, squared. With depth of field they stand where the picture is sharp, and may be hidden.
"""

from mathutils import Matrix, Vector

from . import figure_settings
from .reports import Refused
from .sync import camera as camera_math
from .sync import lens

# Parts stand at this share of the distance of the volume.
NEAR = 0.01
# A little beyond where the camera begins to see.
BEYOND_CLIP = 1.05


class Frame:
    """The frame of the scene's camera, as a dependency graph has it evaluated: in a rendered animation the original lags behind."""

    def __init__(self, scene, depsgraph):
        if scene.camera is None or scene.camera.type != "CAMERA":
            raise Refused("The scene has no camera; a scale bar and a legend stand in its view")
        self.camera, self._depsgraph = scene.camera.evaluated_get(depsgraph), depsgraph
        self.is_perspective = lens.require_flat(self.camera).type == "PERSP"
        self.width_mm, self.height_mm = figure_settings.size_mm(scene)
        corners = self.camera.data.view_frame(scene=scene)
        # Of a perspective camera the corners are those of the frame at distance −z, of an orthographic one those of every frame.
        self._unit = 1.0 / -corners[0].z if self.is_perspective else 1.0
        self._low = [min(corner[axis] for corner in corners) * self._unit for axis in range(2)]
        self._width = (max(corner.x for corner in corners) - min(corner.x for corner in corners)) * self._unit

    def unit_per_mm(self, distance):
        """Length in the scene, at a distance from the camera, of a millimeter on paper."""
        return self._width * (distance if self.is_perspective else 1.0) / self.width_mm

    def camera_from_paper(self, distance, x_mm, y_mm):
        """The matrix of a part at a distance from the camera, whose origin is this far from the lower left corner."""
        reach = distance if self.is_perspective else 1.0
        scale = self.unit_per_mm(distance)
        place = Vector((self._low[0] * reach + x_mm * scale, self._low[1] * reach + y_mm * scale, -distance))
        return Matrix.Translation(place) @ Matrix.Scale(scale, 4)

    def part_distance(self, measured):
        """The distance at which parts are drawn that measure what is `measured` away."""
        data = self.camera.data
        if data.dof.use_dof:
            return lens.focus_distance(self.camera, self._depsgraph)
        return max(data.clip_start * BEYOND_CLIP, NEAR * abs(measured), 1e-6)

    def distance_of(self, point):
        """The distance of a point of the scene along the camera's axis; below 0 behind it."""
        back = self.world_from_camera().col[2].to_3d()
        return back.dot(self.camera.matrix_world.translation - point)

    def world_from_camera(self):
        """The camera's place without its scale, as renders take it."""
        return Matrix(camera_math.matrix.unit_axes(self.camera.matrix_world))

    def corner(self, corner, margin_mm, width_mm, height_mm):
        """Where the lower left corner of a rectangle on paper is that stands in a corner of the frame."""
        x = margin_mm if corner.endswith("LEFT") else self.width_mm - margin_mm - width_mm
        y = margin_mm if corner.startswith("LOWER") else self.height_mm - margin_mm - height_mm
        return x, y


def attach(obj, frame, matrix):
    """Makes an object follow the camera at a matrix of the camera's space. Writes only what differs."""
    if obj.parent != frame.camera.original:
        obj.parent = frame.camera.original
    if obj.matrix_parent_inverse != Matrix.Identity(4):
        obj.matrix_parent_inverse = Matrix.Identity(4)
    # The parent's scale counts for its children and not for the picture.
    wanted = frame.camera.matrix_world.inverted_safe() @ frame.world_from_camera() @ matrix
    if unlike(obj.matrix_basis, wanted):
        obj.matrix_basis = wanted


def unlike(one, other):
    """Whether two matrices differ by more than single precision leaves when Blender takes them apart into location, rotation, scale."""
    return any(_differ([m[row][column] for row in range(3) for column in columns] for m in (one, other)) for columns in ((0, 1, 2), (3,)))


def _differ(pair):
    a, b = pair
    return max(abs(x - y) for x, y in zip(a, b)) > 4e-6 * max(map(abs, b))
