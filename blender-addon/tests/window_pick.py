# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of `window_drive` that pick labels with the mouse, in several views, and look at the outline on the screen.

Every click goes through the window system. Where to click, and what must be selected then, is read from the label film, which other tests compare
with the Label pass.
"""

import struct

import bpy
import numpy as np

# Pixels of the region at each side that the toolbar, the header and the gizmos may cover.
COVERED = (120, 90)
SHIFT = ("keydown shift", "click 1", "keyup shift")


def steps(package, out, window, area, shown, converged, until, events, shot):
    """Picks in the viewport of `area`; `shown`, `converged`, `until`, `events` and `shot` are those of `window_drive`."""
    region = next(r for r in area.regions if r.type == "WINDOW")
    view, scene = area.spaces.active.region_3d, bpy.context.scene
    obj = bpy.context.object
    name, table_of = obj.name, package.label_table

    def selected():
        return set(np.flatnonzero(table_of.selected(bpy.data.objects[name].pumice.table)).tolist())

    def hidden():
        return set(np.flatnonzero(~table_of.visible(bpy.data.objects[name].pumice.table)).tolist())

    def film():
        """The label film of the picture, once the picture is done."""
        area.tag_redraw()
        yield from until(lambda: converged() and package.label_film.of_viewport(shown()) is not None, "the label film is there")
        return package.label_film.of_viewport(shown())

    def on_screen(x, y):
        """The place on the screen of a pixel of the film: the region has as many pixels."""
        return region.x + x, window.height - 1 - (region.y + region.height - 1 - y)

    def middles(of, count):
        """Rows of labels, and for each a pixel all of whose neighbors see the same label, away from what covers the picture."""
        label = of.pixels[..., 1]
        assert label.shape == (region.height, region.width), "the region is drawn with all its pixels"
        inner = np.zeros(label.shape, dtype=bool)
        inner[COVERED[1] : -COVERED[1], COVERED[0] : -COVERED[0]] = True
        for shift in ((0, 1), (0, -1), (1, 0), (-1, 0), (2, 2), (-2, -2)):
            inner &= (np.roll(label, shift, (0, 1)) == label) & (label > 0)
        found = {}
        for y, x in np.argwhere(inner).tolist():
            found.setdefault(int(label[y, x]) - 1, []).append((x, y))
        ranked = sorted(found.items(), key=lambda item: -len(item[1]))[:count]
        assert len(ranked) == count, f"{len(ranked)} labels are large enough to click"
        return [(row, pixels[len(pixels) // 2]) for row, pixels in ranked]

    samples, scene.pumice.viewport_samples = scene.pumice.viewport_samples, 4
    yield 0.5
    bpy.ops.ed.undo_push(message="before picking")
    with bpy.context.temp_override(window=window, area=area, region=region):
        assert bpy.ops.wm.tool_set_by_id(name="pumice.pick") == {"FINISHED"}
    yield 0.5

    # One click in each kind of view, after the status bar has named the label.
    camera = scene.camera.data
    for kind in ("ORTHO", "PERSP", "CAMERA"):
        view.view_perspective = kind
        camera.shift_x, scene.render.use_border = (0.1, True) if kind == "CAMERA" else (0.0, False)
        yield 0.5
        of = yield from film()
        for row, at in middles(of, 2):
            yield from events(on_screen(*at))
            label = int(table_of.ids(bpy.data.objects[name].pumice.table)[row])
            said = lambda: package.pick_tool._said or ""  # noqa: E731
            yield from until(lambda: said().split(" · ")[0] == f"Label {label}", "the status bar names the label")  # noqa: B023
            yield from events(on_screen(*at), "click 1")
            yield from until(lambda: selected() == {row}, f"a click selects the label in the view {kind}")  # noqa: B023
    camera.shift_x, scene.render.use_border = 0.0, False
    view.view_perspective = "PERSP"
    yield 0.5

    # Shift click adds, and the outline is where the film says, in the theme's color.
    of = yield from film()
    (first, at), (second, other) = middles(of, 2)
    yield from events(on_screen(*at), "click 1")
    yield from until(lambda: selected() == {first}, "a click selects the first label")
    yield from events(on_screen(*other), *SHIFT)
    yield from until(lambda: selected() == {first, second}, "Shift click adds the second label")
    yield 0.5
    shot("outline")
    edges = package.label_outline.mask(of.pixels, package.label_film.selections(of.uids))
    edges[: COVERED[1]] = edges[-COVERED[1] :] = edges[:, : COVERED[0]] = edges[:, -COVERED[0] :] = False
    color = np.array(bpy.context.preferences.themes[0].view_3d.object_active) * 255.0
    on = share_of_color(f"{out}/outline.xwd", edges, region, window, color)
    off = share_of_color(f"{out}/outline.xwd", np.roll(edges, (7, 9), (0, 1)), region, window, color)
    # Text and gizmos of the viewport may lie over a few; a shifted outline crosses the true one here and there.
    assert on > 0.97 and off < 0.3, f"of the outline's pixels {on:.3f} have its color, of as many beside it {off:.3f}"

    # Keys of the tool, and undo of each.
    yield from events(on_screen(*at), "key h")
    yield from until(lambda: hidden() == {first, second}, "H hides the selected labels")
    yield from film()
    shot("hidden")
    yield from events(on_screen(*at), "key alt+h")
    yield from until(lambda: hidden() == set(), "Alt H shows all")
    yield from events(on_screen(*at), "key shift+h")
    yield from until(lambda: hidden() and not hidden() & {first, second}, "Shift H hides the others")
    for wanted, picked in ((set(), {first, second}), ({first, second}, {first, second}), (set(), {first, second}), (set(), {first})):
        yield from events(on_screen(*at), "key ctrl+z")
        yield from until(lambda: hidden() == wanted and selected() == picked, f"undo gives {wanted} hidden, {picked} selected")  # noqa: B023
    assert not bpy.data.objects[name].hide_get(), "H hid labels and not the object"

    # A box selects all labels that are seen in it.
    of = yield from film()
    (x0, y0), (x1, y1) = (min(at[0], other[0]), min(at[1], other[1])), (max(at[0], other[0]) + 40, max(at[1], other[1]) + 40)
    drag = (f"mousemove {on_screen((x0 + x1) // 2, (y0 + y1) // 2)[0]} {on_screen(0, (y0 + y1) // 2)[1]}",)
    drag += (f"mousemove {on_screen(x1, y1)[0]} {on_screen(x1, y1)[1]}",)
    yield from events(on_screen(x0, y0), "mousedown 1", *drag)
    shot("box")
    yield from events(on_screen(x1, y1), "mouseup 1")
    wanted = set(np.unique(of.pixels[y0 : y1 + 1, x0 : x1 + 1, 1]).tolist()) - {0}
    yield from until(lambda: selected() == {row - 1 for row in wanted}, "a box selects what is seen in it")
    assert len(wanted) > 2

    # A click beside the volume deselects; another tool frees the status bar and gives H back to objects.
    y, x = next(place for place in np.argwhere(of.pixels[..., 1] == 0).tolist() if place[0] > COVERED[1] and place[1] > COVERED[0])
    yield from events(on_screen(x, y), "click 1")
    yield from until(lambda: selected() == set(), "a click beside the volume deselects")
    with bpy.context.temp_override(window=window, area=area, region=region):
        assert bpy.ops.wm.tool_set_by_id(name="builtin.select_box") == {"FINISHED"}
    yield from until(lambda: package.pick_tool._said is None, "the status bar is free again")
    yield from events(on_screen(*at), "key h")
    yield from until(lambda: bpy.data.objects[name].hide_get(), "H hides the object with another tool")
    yield from events(on_screen(*at), "key ctrl+z")
    yield from until(lambda: not bpy.data.objects[name].hide_get(), "undo shows it again")
    bpy.context.scene.pumice.viewport_samples = samples  # undo has made another `scene`
    yield 0.5
    yield from film()


def share_of_color(path, edges, region, window, color):
    """Share of the set pixels of a mask over a region that have a color on a screenshot (X Window Dump), within 24 of 255 in each channel:
    Blender smooths corners of what lies over the picture, which changed blue by up to 17 in 30 of 862 pixels."""
    close = (np.abs(screen_of(path, region, window).astype(float) - color) <= 24.0).all(axis=-1)
    return float(close[edges].mean())


def screen_of(path, region, window):
    """What a screenshot (X Window Dump) shows of a region: (height, width, 3) of 0 to 255, rows from the top."""
    with open(path, "rb") as file:
        data = file.read()
    words = struct.unpack(">25I", data[:100])
    width, height, pixel_bytes, line_bytes = words[4], words[5], words[11] // 8, words[12]
    start = words[0] + 12 * words[19]
    lines = np.frombuffer(data, np.uint8, line_bytes * height, start).reshape(height, line_bytes)
    screen = lines[:, : width * pixel_bytes].reshape(height, width, pixel_bytes)[..., 2::-1]
    top = window.height - region.y - region.height
    return screen[top : top + region.height, region.x : region.x + region.width]
