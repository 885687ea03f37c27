# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the floor grid and the axes in viewports of which Pumice draws the overlays (`true_overlays`), hidden where its picture has something nearer.

    region: view, window matrix ─┐
    clip, units, theme           ├──► one triangle over the region; each pixel meets the plane of the grid, and that of the z axis
    label film: depth ───────────┘         grid_shader: lines by the distance from them in pixels, hidden by the depth of the first hit

Planes, steps, colors, widths and fading are Blender's (`overlay_grid.cc`, `overlay_grid_frag.glsl`, `ED_view3d_grid_steps` in its sources, 4.3):

    perspective, or view from anywhere      floor, x and y axis, z axis
    orthographic side view                  the grid of the view plane with its two axes, behind all that the picture shows

Blender hides its grid by the depth of meshes, of which the proxy is one. While the depth of a picture is not known, because the view has
moved, nothing hides the grid. After other changes the last depth does, as long as it was seen from the same place.
"""

import weakref
from typing import NamedTuple

import bpy
import gpu

from . import grid_shader, true_overlays, viewport
from .sync import matrix

# Blender's units of length from the largest to the smallest, and the place of the one it begins with in views that are along no axis.
METRIC = ((1e3, 1e2, 1e1, 1.0, 1e-1, 1e-2, 1e-3, 1e-6), 3)
IMPERIAL = ((1609.344, 201.168, 20.1168, 0.9144, 0.3048, 0.0254, 0.0000254), 4)
STEPS = 8

_handle = None
# The depth of the last picture of each viewport.
_depths = weakref.WeakKeyDictionary()


class View(NamedTuple):
    """View and projection of a region; matrices are lists of rows."""

    world_from_view: list
    window: list
    is_side: bool  # an orthographic view along an axis of the world
    is_camera: bool
    clip_end: float


class Lines(NamedTuple):
    """What is to be drawn: the axis across the plane of the grid (None where there is none), whether its lines and which axes on it are drawn, whether
    all of the picture is before it, and whether the z axis is drawn on a plane of its own."""

    across: int | None
    grid: bool
    axes: tuple
    is_back: bool
    z_axis: bool


def lines(view, wishes, has_own_axes=bpy.app.version >= (5, 1)):
    """The lines that Blender draws in a view; `wishes` has the flags of the overlays. Since 5.1 the axes of side views (`has_own_axes`) have the flags
    of the other axes, and are there without a grid."""
    is_perspective = view.window[3][3] == 0.0
    z_axis = wishes.show_axis_z and (is_perspective or not view.is_side)
    if is_perspective or not view.is_side:
        drawn = wishes.show_floor or wishes.show_axis_x or wishes.show_axis_y
        return Lines(2 if drawn else None, wishes.show_floor, (wishes.show_axis_x, wishes.show_axis_y, False), False, z_axis)
    forward = [abs(view.world_from_view[row][2]) for row in range(3)]
    across = max(range(3), key=forward.__getitem__)
    flags = (wishes.show_axis_x, wishes.show_axis_y, wishes.show_axis_z) if has_own_axes else (wishes.show_ortho_grid,) * 3
    axes = tuple(flags[axis] and axis != across for axis in range(3))
    drawn = wishes.show_ortho_grid or any(axes)
    return Lines(across if drawn else None, wishes.show_ortho_grid, axes, True, False)


def steps(system, scale_length, grid_scale, subdivisions, is_side):
    """The distances of lines from fine to coarse, as many as `STEPS`."""
    if system in {"METRIC", "IMPERIAL"}:
        units, base = METRIC if system == "METRIC" else IMPERIAL
        used = units if is_side else units[: base + 1]
        found = [unit * grid_scale / scale_length for unit in reversed(used)]
        return (found + [found[-1]] * STEPS)[:STEPS]
    # A view along an axis may be divided three times more.
    least = grid_scale / subdivisions**3 if is_side else grid_scale
    return [least * subdivisions**step for step in range(STEPS)]


def colors(grid, background, axes, major=None, brightness=None):
    """Linear colors of the lines, of every tenth line and of the three axes, from the theme's grid, background and axes as the screen shows them.

    `major` and `brightness` are the theme's color of every tenth line and brightness of the axes, which it has since Blender 5.2. How Blender mixes
    the axes with that was found from its pixels."""
    fine = _shaded(grid, 10)
    if major is not None:
        base, found = _in_linear(fine), [_in_linear(axis) for axis in axes]
        mixed = [[*(b + brightness * (a - b) for b, a in zip(base[:3], axis[:3])), 1.0] for axis in found]
        return [base, _in_linear(major), *mixed]
    is_background_darker = sum(fine[:3]) + 0.12 > sum(background[:3])
    coarse = _shaded(grid, 20 if is_background_darker else -10)
    mixed = [_shaded([*(0.5 * (g + a) for g, a in zip(grid[:3], axis)), 1.0], -10) for axis in axes]
    return [_in_linear(color) for color in (fine, coarse, *mixed)]


def _in_linear(color):
    """A color of a theme, with opacity 1 if it has none, in linear values."""
    return [*(_linear(value) for value in color[:3]), *(color[3:] or (1.0,))]


def _shaded(color, by):
    """A color lighter by so many of 255 steps."""
    return [*(min(max(value + by / 255.0, 0.0), 1.0) for value in color[:3]), color[3]]


def _linear(value):
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def numbers(view, drawn, distances, hues, camera, film_size, line_size):
    """The numbers of `grid_shader.STRUCT`. `camera` is the scene's, from which the film's depth is measured, and `film_size` the film's, None where
    nothing hides the grid."""
    window, axis_of = view.window, lambda column: [float(view.world_from_view[row][column]) for row in range(3)]
    right, up, back, origin = (axis_of(column) for column in range(4))
    forward = [-value for value in back]
    is_perspective = window[3][3] == 0.0
    along = [float(window[row][2 if is_perspective else 3]) * (1.0 if is_perspective else -1.0) for row in range(2)]
    before = 0.0
    if camera is not None:
        place = matrix.from_twelve(camera["world_from_camera"])
        before = sum((origin[row] - place[row][3]) * forward[row] for row in range(3))
    in_plane = [0.0 if axis == drawn.across else 1.0 for axis in range(3)]
    # The z axis lies on the plane that faces the viewer more. The half of it that is nearer than the floor is drawn over the grid.
    of_z = [1.0, 0.0, 1.0] if abs(forward[0]) < abs(forward[1]) else [0.0, 1.0, 1.0]
    is_above = origin[2] > 0.0 if is_perspective else forward[2] < 0.0
    width, height = film_size or (0, 0)
    return [
        *(*right, 1.0 / float(window[0][0])),
        *(*up, 1.0 / float(window[1][1])),
        *(*forward, 1.0 if is_perspective else 0.0),
        *(*origin, before),
        *(*along, float(window[2][2]), float(window[2][3])),
        *(view.clip_end / 2.0, line_size, 1.0 if view.is_camera else 0.0, 0.0),
        *(*in_plane, 0.0 if drawn.across is None else 1.0),
        *(*of_z, (1.0 if is_above else -1.0) if drawn.z_axis else 0.0),
        *(*(1.0 if axis else 0.0 for axis in drawn.axes), 1.0 if drawn.grid else 0.0),
        *(float(width), float(height), 1.0 if film_size else 0.0, 1.0 if drawn.is_back else 0.0),
        *(value for color in hues for value in color),
        *distances,
    ]


class Depth:
    """The depth of a viewport's picture on the graphics processor, and where it was seen from."""

    def __init__(self):
        self._of, self._seen_from = None, None
        self.texture = self.size = None

    def update(self, film, camera):
        """Takes the depth of a new film. Without one, keeps the former if it was seen from here; `camera` is the scene's."""
        if film is None:
            if self._seen_from != camera:
                self._of = self._seen_from = self.texture = self.size = None
        elif self._of is None or film.depth is not self._of and not _same_memory(film.depth, self._of):
            height, width = film.depth.shape
            buffer = gpu.types.Buffer("FLOAT", (height, width), film.depth)
            self.texture = gpu.types.GPUTexture((width, height), format="R32F", data=buffer)
            self._of, self._seen_from, self.size = film.depth, camera, (width, height)


def _same_memory(some, others):
    return some.__array_interface__["data"] == others.__array_interface__["data"]


def draw_grid():
    """Draws it in the region of the context."""
    context = bpy.context
    shown, space = viewport.of_region(context.region), context.space_data
    if shown is None or not space.overlay.show_overlays:
        return
    wishes = true_overlays.wishes_of(space)
    if wishes is None:
        return
    view = view_of(context)
    drawn = lines(view, wishes)
    if drawn.across is None and not drawn.z_axis:
        return
    camera = shown.sent.camera if shown.sent is not None else None
    depth = _depths.setdefault(shown, Depth())
    depth.update(shown.labels(), camera)
    units = context.scene.unit_settings
    distances = steps(units.system, units.scale_length, space.overlay.grid_scale, space.overlay.grid_subdivisions, view.is_side)
    theme = context.preferences.themes[0]
    interface = theme.user_interface
    axes = [tuple(axis) for axis in (interface.axis_x, interface.axis_y, interface.axis_z)]
    since_5_2 = (tuple(theme.view_3d.grid_major), theme.view_3d.grid_axis_brightness) if hasattr(theme.view_3d, "grid_major") else ()
    hues = colors(tuple(theme.view_3d.grid), theme.view_3d.space.gradients.high_gradient, axes, *since_5_2)
    line_size = max(0.0, context.preferences.system.pixel_size - 1.0) * 0.5
    grid_shader.draw(numbers(view, drawn, distances, hues, camera, depth.size, line_size), depth.texture)


def view_of(context):
    """View and projection of the region of a context."""
    region, space = context.region_data, context.space_data
    is_camera = region.view_perspective == "CAMERA" and space.camera is not None and space.camera.type == "CAMERA"
    return View(
        matrix.inverse_rigid(matrix.rows(region.view_matrix)),
        matrix.rows(region.window_matrix),
        region.is_orthographic_side_view,
        is_camera,
        space.camera.data.clip_end if is_camera else space.clip_end,
    )


def _draw():
    draw_grid()


def register():
    global _handle
    _handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")


def unregister():
    global _handle
    bpy.types.SpaceView3D.draw_handler_remove(_handle, "WINDOW")
    _handle = None
    _depths.clear()
    grid_shader.forget()
