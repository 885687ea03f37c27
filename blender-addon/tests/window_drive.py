# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the extension in a real Blender window: imports, orbits, edits, renders. Takes screenshots, writes measurements, and stops at the
first failure.

    blender --factory-startup … --python window_drive.py -- OUT VOLUME

Runs in Blender's own Python, with the extension installed. Writes a screenshot OUT/NAME.xwd of the whole screen after each step, and
OUT/figures.json:

    redraw_ms                 main-thread milliseconds of view_draw while it orbits: [median, largest]
    first_picture_seconds     from a camera change to the first frame of that camera: [median, largest]
    first_f12_frame_seconds   from the begin of a final render to its first frame in Blender's result
    hand_over_1080p_ms        a 1920×1080 frame from a session to a texture: [median, largest]

The exit status is 0 only if every step succeeds.
"""

import collections
import json
import os
import statistics
import subprocess
import sys
import threading
import time
import traceback

import addon_utils
import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Quaternion

OUT, VOLUME = sys.argv[sys.argv.index("--") + 1 :][:2]
EXTENSION = "bl_ext.user_default.pumice"
# Seconds to wait for a condition before it counts as failed. Software rendering on a busy machine is slow.
PATIENCE_SECONDS = 600.0

# --factory-startup leaves installed extensions disabled, and the splash screen would cover the viewport.
# `default_set` adds the extension to the preferences, in which the device is chosen.
addon_utils.enable(EXTENSION, default_set=True, persistent=True)
bpy.context.preferences.view.show_splash = False
figures = {"blender": bpy.app.version_string, "backend": None}
draw_ms = []


def view3d():
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
    return window, area, area.spaces.active


def shot(name):
    """Takes a screenshot with xwd, because bpy.ops.screen.screenshot is black with software OpenGL."""
    subprocess.run(["xwd", "-silent", "-root", "-out", f"{OUT}/{name}.xwd"], check=True)


def shown():
    viewports = list(sys.modules[EXTENSION].viewport._viewports.values())
    return viewports[0] if viewports else None


def until(claim, what):
    """Yields until the condition `claim` holds; fails after PATIENCE_SECONDS."""
    end = time.monotonic() + PATIENCE_SECONDS
    while not claim():
        assert time.monotonic() < end, f"not within {PATIENCE_SECONDS} s: {what}"
        yield 0.02


def converged():
    view = shown()
    return view is not None and view.session is not None and view.session.status.state == "converged"


def counted():
    """The session's counters; missing ones count as 0."""
    return collections.defaultdict(int, shown().session.status.counters)


def measure_draws():
    """Wraps the viewport's draw function to measure its time."""
    cls = sys.modules[EXTENSION].viewport.Viewport
    draw = cls.draw

    def timed(self, context, depsgraph):
        begin = time.perf_counter()
        draw(self, context, depsgraph)
        draw_ms.append(1000.0 * (time.perf_counter() - begin))

    cls.draw = timed


def steps():
    # Make one large viewport. screen_full_area crashes when a timer calls it, so close the other areas instead.
    window, area, space = view3d()
    for other in [a for a in window.screen.areas if a != area]:
        with bpy.context.temp_override(window=window, area=other):
            bpy.ops.screen.area_close()
    yield 0.3

    window, area, space = view3d()
    with bpy.context.temp_override(window=window, area=area, region=next(r for r in area.regions if r.type == "WINDOW")):
        assert bpy.ops.pumice.import_volume(filepath=VOLUME) == {"FINISHED"}
    assert bpy.context.scene.render.engine == "PUMICE" and space.shading.type == "RENDERED"
    space.shading.type = "SOLID"
    yield 0.5
    shot("solid")

    yield from panels(area)
    window, area, space = view3d()
    yield from cut_by_mouse(window, area)

    scene = bpy.context.scene
    scene.pumice.viewport_samples = 64
    space.shading.type = "RENDERED"
    yield from until(converged, "the viewport converges")
    yield 0.5
    shot("rendered")
    figures["backend"] = shown().session.status.backend

    # Orbit, and check that the picture follows.
    measure_draws()
    view = space.region_3d
    start = view.view_rotation.copy()
    for step in range(60):
        view.view_rotation = start @ Quaternion((0, 1, 0), 0.02 * step)
        area.tag_redraw()
        yield 0.0
    shot("moving")
    figures["redraw_ms"] = [statistics.median(draw_ms), max(draw_ms)]

    # Measure the time from a camera change to its first picture.
    waits = []
    for step in range(10):
        view.view_rotation = start @ Quaternion((0, 1, 0), 0.3 + 0.05 * step)
        area.tag_redraw()
        begin = time.perf_counter()
        before = shown().session.status.revision
        yield from until(lambda: shown().session.status.revision > before, "the camera is sent")  # noqa: B023
        wanted = shown().session.status.revision
        yield from until(
            lambda: shown().frame is not None and shown().frame.revision >= wanted, "a picture of it"  # noqa: B023
        )
        waits.append(time.perf_counter() - begin)
    figures["first_picture_seconds"] = [statistics.median(waits), max(waits)]

    # A change of one colour sends one edit.
    counters = counted()
    shader = bpy.context.object.active_material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 0.1
    yield from until(lambda: counted()["edits.group_material"] > counters["edits.group_material"], "an edit")
    after = counted()
    assert after["edits.group_material"] == counters["edits.group_material"] + 1 and after["edits.groups"] == counters["edits.groups"]
    assert after["edits.place"] == counters["edits.place"] and after["edits.world"] == counters["edits.world"]
    assert after["rebuilt.acceleration"] == counters["rebuilt.acceleration"]

    # Switch to the camera view, to orthographic, and back; each view converges.
    with bpy.context.temp_override(window=window, area=area, region=next(r for r in area.regions if r.type == "WINDOW")):
        bpy.ops.view3d.view_camera()
    yield from until(converged, "the camera view converges")
    yield 0.5
    shot("camera")
    view.view_perspective = "ORTHO"
    area.tag_redraw()
    yield from until(lambda: "orthographic" in shown().sent.camera["projection"], "an orthographic camera is sent")
    yield from until(converged, "the orthographic view converges")
    yield 0.5
    shot("orthographic")

    sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
    import window_drop
    import window_overlays
    import window_pick
    import window_stores

    yield from window_overlays.steps(sys.modules[EXTENSION], OUT, window, area, shown, converged, until, shot)
    yield from window_drop.steps(OUT, window, area, until, input_events, shot)
    yield from window_stores.steps(OUT, window, area, until, input_events, shot)
    yield from window_pick.steps(sys.modules[EXTENSION], OUT, window, area, shown, converged, until, input_events, shot)

    yield from other_device(area)

    # A finished picture is not redrawn.
    count = len(draw_ms)
    yield 2.0
    assert len(draw_ms) - count <= 2, f"{len(draw_ms) - count} redraws of a finished picture"

    # Undo, switch the engine while it renders, and delete the object.
    with bpy.context.temp_override(window=window, area=area):
        bpy.ops.ed.undo_push(message="before")
        bpy.context.object.location.x += 1.0
        bpy.ops.ed.undo_push(message="moved")
        yield 0.2
        bpy.ops.ed.undo()
    yield 0.5
    space.shading.type = "SOLID"
    yield 1.0
    space.shading.type = "RENDERED"
    yield 0.2
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    yield 1.5
    assert shown() is None, "no session without its engine"
    bpy.context.scene.render.engine = "PUMICE"
    yield from until(lambda: shown() is not None and shown().frame is not None, "a picture after the switch")

    figures["hand_over_1080p_ms"] = yield from hand_over()

    yield from final_render(window, area)
    yield from cancelled_import(window, area)
    yield from browsed_import(window, area)
    window, area, space = view3d()

    # A missing file gives a line of text and a box, and the volume returns with the file.
    obj = next(o for o in bpy.data.objects if o.pumice.filepath)
    os.rename(obj.pumice.filepath, obj.pumice.filepath + ".away")
    obj.update_tag()
    yield from until(lambda: shown().sent.placed == {}, "a missing volume leaves")
    yield 1.0
    shot("missing")
    os.rename(obj.pumice.filepath + ".away", obj.pumice.filepath)
    obj.update_tag()
    yield from until(lambda: len(shown().sent.placed) == 1, "it is back")

    bpy.data.objects.remove(obj)
    yield 1.0
    assert shown() is not None and shown().sent.placed == {}
    shot("deleted")

    import window_series

    yield from window_series.steps(sys.modules[EXTENSION], OUT, window, area, shown, converged, until, input_events, shot)
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    yield 1.0


def other_device(area):
    """Vulkan, chosen in the preferences, renders while Blender itself may use Vulkan; then switches back to automatic."""
    package = sys.modules[EXTENSION]
    preferences = bpy.context.preferences.addons[EXTENSION].preferences
    names = [choice[0] for choice in package.preferences._choices(preferences)]
    scene = bpy.context.scene
    samples, scene.pumice.viewport_samples = scene.pumice.viewport_samples, 2
    for backend in ("vulkan-compute", "vulkan-rt"):
        preferences.device = next(name for name in names if name.startswith(backend + ":"))
        yield from until(lambda: shown().session.status.backend == backend, f"{backend} draws")  # noqa: B023
        yield from until(lambda: converged() and shown().frame.spp == 2, f"the picture of {backend} is done")  # noqa: B023
        area.tag_redraw()
        yield 0.5
        status = shown().session.status
        line = package.overlay.line(status, shown().frame, shown().notes)
        assert line.startswith(f"{backend} on {package.devices.short(status.device)} · 2 samples"), line
        assert status.notices == [], status.notices
        shot(backend)
    preferences.device, scene.pumice.viewport_samples = "auto", samples
    yield from until(lambda: converged() and shown().frame.spp == samples, "the automatic device draws again")
    yield 0.5


def panels(area):
    """Shows every tab of the properties editor that has a panel of the extension, for inspection of screenshots and stderr."""
    area.type = "PROPERTIES"
    yield 0.5
    for tab in ("RENDER", "OUTPUT", "VIEW_LAYER", "WORLD", "DATA", "MATERIAL"):
        area.spaces.active.context = tab
        area.tag_redraw()
        yield 0.5
        shot(f"panel_{tab.lower()}")
        # Panels at the end of a tab are drawn only when one scrolls there.
        yield from input_events((640, 500), *["click 5"] * 12)
        shot(f"panel_{tab.lower()}_end")
    area.type = "VIEW_3D"
    yield 0.5


def cut_by_mouse(window, area):
    """Drags the arrow of a cut: it moves along its normal, in one undo step."""
    region = next(r for r in area.regions if r.type == "WINDOW")
    context = dict(window=window, area=area, region=region)
    with bpy.context.temp_override(**context):
        assert bpy.ops.pumice.add_cut(shape="PLANE", orientation="X") == {"FINISHED"}
        bpy.ops.ed.undo_push(message="cut")
    name = bpy.context.object.name
    yield 1.0
    shot("cut")
    place = bpy.context.object.matrix_world
    origin, normal = place.translation.copy(), place.col[2].to_3d()
    on_screen = lambda point: location_3d_to_region_2d(region, area.spaces.active.region_3d, point)  # noqa: E731
    right = area.spaces.active.region_3d.view_matrix.to_3x3().row[0]
    unit = (on_screen(origin + right) - on_screen(origin)).length
    # An arrow is 75 pixels long where it lies across the view.
    points = [on_screen(origin + normal * (length / unit)) for length in (60.0, 140.0)]
    start, end = ((round(region.x + p.x), round(window.height - region.y - p.y)) for p in points)
    yield from input_events(start, "mousedown 1", f"mousemove {(start[0] + end[0]) // 2} {(start[1] + end[1]) // 2}", f"mousemove {end[0]} {end[1]}")
    shot("cut_moving")
    yield from input_events(end, "mouseup 1")
    yield 0.5
    moved = bpy.data.objects[name].matrix_world.translation - origin
    assert moved.length * unit > 40.0, f"the arrow was dragged by 80 pixels, the cut moved by {moved.length * unit}"
    assert moved.cross(normal).length < 1e-3 * moved.length, "the cut left its normal"
    with bpy.context.temp_override(**context):
        bpy.ops.ed.undo()
    yield 0.5
    assert (bpy.data.objects[name].matrix_world.translation - origin).length < 1e-5, "one undo brings it back"
    bpy.data.objects.remove(bpy.data.objects[name])
    bpy.context.view_layer.objects.active = next(o for o in bpy.data.objects if o.pumice.filepath)
    yield 0.5


def input_events(place, *actions):
    """Sends mouse and key events through the window system, and yields after each so that Blender handles it.

    Blender's simulated events would not do, since only the window system's ESC stops a render.
    """
    for action in (f"mousemove {place[0]} {place[1]}", *actions):
        subprocess.run(["xdotool", *action.split()], check=True)
        yield 0.2


VIEW = (430, 330)
ESCAPE = (VIEW, "keydown Escape", "keyup Escape")


def final_render(window, area):
    """Starts F12 as a user does, with the live viewport open: once to its end, once cancelled after it has grown for a while. ESC leaves what
    there is."""
    ended, begun, seen = [], [], []
    growing = sys.modules[EXTENSION].render_result.Growing
    show_frame = growing.show_frame

    def shown_frame(self, frame):
        show_frame(self, frame)
        if not seen:
            figures["first_f12_frame_seconds"] = time.monotonic() - begun[-1]
        seen.append(frame.coarse)

    growing.show_frame = shown_frame
    bpy.app.handlers.render_pre.append(lambda *_: begun.append(time.monotonic()))
    bpy.app.handlers.render_complete.append(lambda *_: ended.append("complete"))
    bpy.app.handlers.render_cancel.append(lambda *_: ended.append("cancel"))
    scene = bpy.context.scene
    scene.render.resolution_percentage = 20
    bpy.context.preferences.view.render_display_type = "NONE"
    for samples, press, wanted in ((4, None, "complete"), (1 << 20, ESCAPE, "cancel")):
        scene.pumice.samples = samples
        with bpy.context.temp_override(window=window, area=area):
            bpy.ops.render.render("INVOKE_DEFAULT")
        yield 2.0
        if press:
            seen.clear()
            yield from until(lambda: len(seen) >= 2, "the picture grows")
            assert not ended, "a million samples take longer"
            yield from input_events(*press)
        yield from until(lambda: ended, f"the render ends: {wanted}")
        assert ended == [wanted], ended
        ended.clear()
        yield 0.5
        picture = saved_result(wanted)
        assert np.isfinite(picture).all() and (picture[..., :3].max(axis=2) > 0.02).mean() > 0.5, "the sky and the volume are there"
        # The last row of each picture: it is a picture of the whole film, not of a part.
        assert picture[0].max() > 0.02 and picture[-1].max() > 0.02
    growing.show_frame = show_frame


def saved_result(name):
    """The pixels of Blender's Render Result, as it saves them."""
    path = f"{OUT}/{name}.png"
    bpy.data.images["Render Result"].save_render(path)
    image = bpy.data.images.load(path)
    pixels = np.empty(4 * image.size[0] * image.size[1], dtype=np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return pixels


def compressing():
    return any(t.name == "pumice work" for t in threading.enumerate())


def noise_volume(folder):
    """Writes a volume of noise, which takes longest to compress, so that there is time to cancel."""
    os.makedirs(folder)
    path = os.path.join(folder, "noise.npy")
    np.save(path, np.random.default_rng(1).integers(1, 255, (320, 320, 320), dtype=np.uint8))
    return path


def cancelled_import(window, area):
    """Drops a file, confirms its options with Enter, and presses ESC while it compresses. Nothing may be left."""
    folder = os.path.join(OUT, "noise")
    noise = noise_volume(folder)
    before = sorted(os.listdir(folder))
    count = len(bpy.data.objects)
    yield from input_events(VIEW)  # the dialog opens around the mouse
    with bpy.context.temp_override(window=window, area=area, region=next(r for r in area.regions if r.type == "WINDOW")):
        bpy.ops.pumice.import_volume("INVOKE_DEFAULT", filepath=noise)
    yield 0.7
    shot("import_options")

    def running():
        return "PUMICE_OT_import_volume" in [o.bl_idname for o in window.modal_operators] and compressing()

    yield from input_events((VIEW[0], VIEW[1] + 4), "keydown Return", "keyup Return")
    yield from until(running, "the volume is being compressed")
    shot("import_progress")
    assert running(), "there is no time to cancel: take a larger volume"
    yield from input_events(*ESCAPE)
    yield from until(lambda: not window.modal_operators, "the import ends")
    yield 0.5
    assert len(bpy.data.objects) == count, "no object of a cancelled import"
    assert sorted(os.listdir(folder)) == before, "no file of a cancelled import"


def browsed_import(window, area):
    """Chooses a file in the file browser, as the menu does, and confirms the dialog that follows with Enter."""

    def browser():
        found = [(w, a) for w in bpy.context.window_manager.windows for a in w.screen.areas if a.type == "FILE_BROWSER"]
        return found[0] if found else None

    def region(of):
        return next(r for r in of.regions if r.type == "WINDOW")

    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"
    before = set(bpy.data.objects)
    with bpy.context.temp_override(window=window, area=area, region=region(area)):
        bpy.ops.pumice.import_volume("INVOKE_DEFAULT")
    yield from until(browser, "the file browser opens")
    yield 0.5
    chosen, files = browser()
    files.spaces.active.params.directory = os.path.dirname(VOLUME).encode()
    files.spaces.active.params.filename = os.path.basename(VOLUME)
    yield 0.5
    chosen, files = browser()
    with bpy.context.temp_override(window=chosen, area=files, region=region(files)):
        bpy.ops.file.execute("INVOKE_DEFAULT")
    yield from until(lambda: not browser(), "the file browser closes")
    yield from input_events(VIEW)
    yield 0.5
    shot("import_dialog")
    assert set(bpy.data.objects) == before, "nothing is imported before the dialog is confirmed"
    yield from input_events((VIEW[0], VIEW[1] + 4), "keydown Return", "keyup Return")
    yield from until(lambda: set(bpy.data.objects) != before, "the volume is imported")
    for obj in set(bpy.data.objects) - before:
        bpy.data.objects.remove(obj)
    yield 0.5


def hand_over():
    """Measures the milliseconds of uploading a full-HD frame to a texture (without Blender's drawing into the window)."""
    import pumice

    texture = sys.modules[EXTENSION].picture_texture
    view = shown()
    scene = pumice.Scene.from_dict(dict(view.sent.scene(view.numbers), film=dict(view.sent.film, width=1920, height=1080)))
    volumes = [sys.modules[EXTENSION].registry.request(*p.file()).volume for p in view.sent.placed.values()]
    session = pumice.Session(scene, volumes, meshes=view.sent.geometries(view.numbers), spp=1)
    frame = None
    end = time.monotonic() + PATIENCE_SECONDS
    while frame is None or frame.width < 1920:
        assert time.monotonic() < end, "no full-HD frame"
        newest = session.latest()
        frame = newest if newest is not None else frame
        yield 0.05
    session.stop()
    took = []
    for _ in range(10):
        begin = time.perf_counter()
        texture.upload(frame)
        took.append(1000.0 * (time.perf_counter() - begin))
    return [statistics.median(took), max(took)]


run = steps()


def tick():
    try:
        return next(run)
    except StopIteration:
        code = 0
    except BaseException:
        traceback.print_exc()
        shot("failed")
        code = 1
    with open(f"{OUT}/figures.json", "w") as file:
        json.dump(figures, file, indent=1)
    sys.stdout.flush()
    os._exit(code)


bpy.app.timers.register(tick, first_interval=0.5, persistent=True)
