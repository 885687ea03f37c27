# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of `window_drive` that go through time with the keyboard: the picture in the viewport follows the scene's frame.

A ball moves along x by the same way at each time step. Where it is on the screen is read from the label film.
"""

import bpy
import numpy as np

STEPS, DIMS, WAY = 4, (52, 24, 16), 12
BALL, FLOOR = 7, 3


def dense(step):
    """array[x, y, z] of ids at a time step."""
    x, y, z = np.indices(DIMS)
    ids = np.where(z < 3, FLOOR, 0).astype(np.uint8)
    ids[(x - 8 - WAY * step) ** 2 + (y - 12) ** 2 + (z - 9) ** 2 < 26] = BALL
    return ids


def steps(package, out, window, area, shown, converged, until, events, shot):
    """Steps through frames in the viewport of `area`; the other arguments are those of `window_pick`."""
    import pumice

    region = next(r for r in area.regions if r.type == "WINDOW")
    view, scene = area.spaces.active.region_3d, bpy.context.scene
    place = (region.x + region.width // 2, window.height - 1 - (region.y + region.height // 2))
    path = f"{out}/moving.pumice"
    pumice.compress_series([dense(step) for step in range(STEPS)], path)
    scene.frame_set(scene.frame_start)
    # The film of labels needs no more.
    samples, scene.pumice.viewport_samples = scene.pumice.viewport_samples, 4
    with bpy.context.temp_override(window=window, area=area, region=region):
        assert bpy.ops.pumice.import_volume(filepath=path, time_steps="all") == {"FINISHED"}
    obj = next(o for o in bpy.data.objects if o.pumice.filepath)
    row = package.label_table.ids(obj.pumice.table).tolist().index(BALL)
    # From above, with x to the right.
    view.view_perspective, view.view_rotation = "ORTHO", (1.0, 0.0, 0.0, 0.0)
    with bpy.context.temp_override(window=window, area=area, region=region, active_object=obj, selected_objects=[obj]):
        bpy.ops.view3d.view_selected()
    yield 0.5

    def ball():
        """Where the ball is across the picture, once that is done; None before."""
        area.tag_redraw()
        film = package.label_film.of_viewport(shown()) if shown() is not None and converged() else None
        across = [] if film is None else np.nonzero(film.pixels[..., 1] == row + 1)[1]
        return float(np.mean(across)) if len(across) else None

    places = []
    for step in range(STEPS):
        before = places[-1] if places else -1000.0
        moved = lambda: (at := ball()) is not None and abs(at - before) > 5.0  # noqa: B023, E731
        yield from until(moved, f"the ball of time step {step} is drawn")
        places.append(ball())
        shot(f"series_{step}")
        frame = scene.frame_current
        yield from events(place, "key Right")
        yield from until(lambda: scene.frame_current == frame + 1, "the arrow key steps to the next frame")  # noqa: B023
    ways = np.diff(places)
    assert ways.min() > 20.0 and np.ptp(ways) < 2.0, f"equal ways to the right: {places}"
    # After the last time step the picture holds.
    yield 1.0
    yield from until(lambda: ball() is not None, "the picture after the last time step is done")
    assert abs(ball() - places[-1]) < 1.0, "the last time step stays"
    # Back at the first frame the ball is where it began: the control that the film is not the last one for ever.
    scene.frame_set(scene.frame_start)
    yield from until(lambda: (at := ball()) is not None and abs(at - places[0]) < 1.0, "the first time step is drawn again")
    bpy.data.objects.remove(obj)
    scene.pumice.viewport_samples = samples
    yield 0.5
