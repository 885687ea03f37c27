# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests what the floor grid is made of: planes, steps and colors against Blender's rules, the numbers for the shader, when the depth is kept.

What the shader draws is compared with Blender's own grid in the window test.
"""

import types

import numpy as np
import pytest

from test_real_volumes import load

FLAGS = ("show_floor", "show_axis_x", "show_axis_y", "show_axis_z", "show_ortho_grid")
PERSPECTIVE = [[1.5, 0, 0.1, 0], [0, 2.0, -0.2, 0], [0, 0, -1.002, -0.2], [0, 0, -1, 0]]
PARALLEL = [[0.1, 0, 0, 0.3], [0, 0.2, 0, -0.4], [0, 0, -0.001, 0.1], [0, 0, 0, 1]]
# Looks down, along y, along −x.
TOP = [[1, 0, 0, 3], [0, 1, 0, 4], [0, 0, 1, 5], [0, 0, 0, 1]]
FRONT = [[1, 0, 0, 3], [0, 0, -1, -9], [0, 1, 0, 5], [0, 0, 0, 1]]
RIGHT = [[0, 0, 1, 9], [1, 0, 0, 4], [0, 1, 0, 5], [0, 0, 0, 1]]


@pytest.fixture
def grid(extension):
    return load(extension, "floor_grid")


def wishes(*on):
    return types.SimpleNamespace(**{flag: flag in on for flag in FLAGS})


def view(grid, place, window, is_side=False):
    return grid.View(place, window, is_side, False, 100.0)


def test_lines_of_each_view(grid):
    everything = wishes(*FLAGS)
    anywhere = grid.Lines(2, True, (True, True, False), False, True)
    assert grid.lines(view(grid, FRONT, PERSPECTIVE), everything) == anywhere
    assert grid.lines(view(grid, FRONT, PERSPECTIVE, is_side=True), everything) == anywhere, "a side view in perspective has the floor"
    assert grid.lines(view(grid, FRONT, PARALLEL), everything) == anywhere
    for place, across, axes in ((TOP, 2, (True, True, False)), (FRONT, 1, (True, False, True)), (RIGHT, 0, (False, True, True))):
        assert grid.lines(view(grid, place, PARALLEL, is_side=True), everything) == grid.Lines(across, True, axes, True, False)
        side = view(grid, place, PARALLEL, is_side=True)
        without = wishes("show_floor", "show_axis_x", "show_axis_y", "show_axis_z")
        assert grid.lines(side, without, has_own_axes=False)[0] is None
        assert grid.lines(side, without, has_own_axes=True) == grid.Lines(across, False, axes, True, False)
        alone = wishes("show_ortho_grid")
        assert grid.lines(side, alone, has_own_axes=False).axes == axes
        assert grid.lines(side, alone, has_own_axes=True) == grid.Lines(across, True, (False,) * 3, True, False)
    one = grid.lines(view(grid, FRONT, PARALLEL), wishes("show_axis_y"))
    assert one == grid.Lines(2, False, (False, True, False), False, False)
    nothing = grid.lines(view(grid, FRONT, PERSPECTIVE), wishes("show_ortho_grid"))
    assert nothing.across is None and not nothing.z_axis


def test_steps_are_those_of_the_units(grid):
    assert grid.steps("METRIC", 1.0, 1.0, 10, False) == [1.0, 10.0, 100.0, 1000.0, 1000.0, 1000.0, 1000.0, 1000.0]
    assert grid.steps("METRIC", 0.01, 2.0, 10, True) == pytest.approx([2e-4, 0.2, 2.0, 20.0, 200.0, 2000.0, 2e4, 2e5])
    feet = [0.3048, 0.9144, 20.1168, 201.168, 1609.344, 1609.344, 1609.344, 1609.344]
    assert grid.steps("IMPERIAL", 1.0, 1.0, 10, False) == feet
    assert grid.steps("NONE", 5.0, 1.0, 4, False) == [4.0**i for i in range(8)]
    assert grid.steps("NONE", 5.0, 1.0, 4, True) == pytest.approx([4.0 ** (i - 3) for i in range(8)])


def test_colors_are_mixed_and_linear(grid):
    axes = ((1.0, 0.2, 0.32), (0.54, 0.86, 0.0), (0.17, 0.56, 1.0))
    fine, coarse, x, _, _ = grid.colors((0.33, 0.33, 0.33, 0.5), (0.24, 0.24, 0.24), axes)
    encode = lambda v: 12.92 * v if v <= 0.0031308 else 1.055 * v ** (1 / 2.4) - 0.055  # noqa: E731
    assert encode(fine[0]) == pytest.approx(0.33 + 10 / 255) and fine[3] == 0.5
    assert encode(coarse[0]) == pytest.approx(0.33 + 20 / 255)
    assert encode(x[0]) == pytest.approx((0.33 + 1.0) / 2 - 10 / 255)
    assert encode(grid.colors((0.33, 0.33, 0.33, 0.5), (0.9, 0.9, 0.9), axes)[1][0]) == pytest.approx(0.33 - 10 / 255), "darker on light"


def test_colors_of_newer_themes(grid):
    axes = ((1.0, 0.2, 0.32), (0.54, 0.86, 0.0), (0.17, 0.56, 1.0))
    fine, coarse, x, _, z = grid.colors((0.33, 0.33, 0.33, 0.5), (0.24, 0.24, 0.24), axes, (0.4, 0.5, 0.6, 1.0), 0.46)
    assert coarse == pytest.approx([0.1329, 0.2140, 0.3185, 1.0], abs=1e-3) and fine[3] == 0.5
    assert x[0] == pytest.approx(0.54 * fine[0] + 0.46) and z[2] == pytest.approx(x[0]) and x[3] == 1.0


def test_numbers_are_as_many_as_the_shader_reads_and_say_where_pixels_are(grid, extension):
    """The middle of a pixel, by the formulas of the shader, is where the inverse of Blender's matrices says."""
    struct = load(extension, "grid_shader").STRUCT
    vectors = struct.count("vec4 ") + 2 + 1  # axis_color has three, steps two
    hues = [[0.1, 0.2, 0.3, 0.4]] * 5
    for place in (TOP, FRONT, RIGHT):
        for window in (PERSPECTIVE, PARALLEL):
            one = view(grid, place, window)
            drawn = grid.lines(one, wishes(*FLAGS))
            found = grid.numbers(one, drawn, list(range(8)), hues, None, (4, 3), 0.5)
            assert len(found) == 4 * vectors
            right, up, forward, origin, middle = (np.array(found[i : i + 4]) for i in range(0, 20, 4))
            clip_from_world = np.array(window) @ np.linalg.inv(np.array(place, dtype=float))
            for at in ((0.0, 0.0), (0.7, -0.4)):
                across, above = ((at[i] + middle[i]) * (right[3], up[3])[i] for i in range(2))
                aside = right[:3] * across + up[:3] * above
                is_perspective = forward[3] == 1.0
                for depth in (1.0, 7.0):
                    p = origin[:3] + forward[:3] * depth + aside * (depth if is_perspective else 1.0)
                    clip = clip_from_world @ [*p, 1.0]
                    assert clip[:2] / clip[3] == pytest.approx(at, abs=1e-9)
                    if not is_perspective:
                        assert middle[3] - middle[2] * depth == pytest.approx(clip[2])


def test_the_half_of_the_z_axis_before_the_floor_is_drawn_over_it(grid):
    """The upper half seen from above, the lower one from below."""
    below = (np.diag([1.0, -1.0, -1.0, 1.0]) @ np.array(TOP, dtype=float)).tolist()
    for window in (PERSPECTIVE, PARALLEL):
        for place, sign in ((TOP, 1.0), (below, -1.0)):
            one = view(grid, place, window)
            drawn = grid.lines(one, wishes(*FLAGS))._replace(z_axis=True)
            assert grid.numbers(one, drawn, [1.0] * 8, [[0.0] * 4] * 5, None, (4, 3), 0.0)[31] == sign


def test_depth_is_measured_from_where_the_film_was_seen(grid):
    """A parallel view may begin behind its origin: the scene's camera then stands farther back."""
    one = view(grid, TOP, PARALLEL)
    camera = {"world_from_camera": [1, 0, 0, 0, 1, 0, 0, 0, 1, 3, 4, 25]}
    found = grid.numbers(one, grid.lines(one, wishes(*FLAGS)), [1.0] * 8, [[0.0] * 4] * 5, camera, (4, 3), 0.0)
    assert found[15] == 20.0


def test_a_depth_is_kept_while_the_view_stays(grid, monkeypatch):
    made = []
    monkeypatch.setattr(grid.gpu.types, "Buffer", lambda *arguments: arguments, raising=False)
    monkeypatch.setattr(grid.gpu.types, "GPUTexture", lambda *arguments, **named: made.append(arguments) or len(made), raising=False)
    film = types.SimpleNamespace(depth=np.ones((3, 4), dtype=np.float32))
    one, here, there = grid.Depth(), {"place": 1}, {"place": 2}
    one.update(None, here)
    assert one.texture is None
    one.update(film, here)
    one.update(types.SimpleNamespace(depth=film.depth[:]), here)
    assert one.texture == 1 and one.size == (4, 3), "made once"
    one.update(None, dict(here))
    assert one.texture == 1, "after an edit of what is seen the last depth hides the grid"
    one.update(None, there)
    assert one.texture is None and one.size is None, "another view has none"
    one.update(film, here)
    one.update(types.SimpleNamespace(depth=np.zeros((3, 4), dtype=np.float32)), there)
    assert one.texture == 3
