"""The steps of `blender_pictures.py`, in Blender's window: the first figure of `docs/blender.md`, from the import to F12, with a screenshot of
each stage.

    blender --factory-startup … --python blender_window.py -- OUT VOLUME

Writes OUT/NAME.xwd of the whole screen and OUT/crops.json, which says what of each is kept: name → [left, top, right, bottom] in pixels.
"""

import json
import os
import subprocess
import sys
import time
import traceback

import addon_utils
import bpy
import numpy as np

OUT, VOLUME = sys.argv[sys.argv.index("--") + 1 :][:2]
EXTENSION = "bl_ext.user_default.pumice"
# Software rendering on a busy machine is slow.
PATIENCE_SECONDS = 900.0
# Samples of the viewport, and of the figure.
VIEW_SAMPLES, FIGURE_SAMPLES = 48, 96
# Of the thirty neurites, those that are picked.
LEGEND_LABELS = 3

addon_utils.enable(EXTENSION, default_set=True, persistent=True)
bpy.context.preferences.view.show_splash = False
crops = {}


def window():
    return bpy.context.window_manager.windows[0]


def area_of(kind):
    return next(area for area in window().screen.areas if area.type == kind)


def region_of(area, kind="WINDOW"):
    return next(region for region in area.regions if region.type == kind)


def in_view():
    """An override of the context: the 3D viewport, as if the mouse were there."""
    view = area_of("VIEW_3D")
    return bpy.context.temp_override(window=window(), area=view, region=region_of(view))


def viewport():
    return next(iter(sys.modules[EXTENSION].viewport._viewports.values()), None)


def until(claim, what):
    end = time.monotonic() + PATIENCE_SECONDS
    while not claim():
        assert time.monotonic() < end, f"not within {PATIENCE_SECONDS} s: {what}"
        yield 0.1


def done():
    """Waits for the finished picture of what the scene is now."""
    area_of("VIEW_3D").tag_redraw()
    yield 1.0
    yield from until(lambda: viewport() and viewport().session and viewport().session.status.state == "converged", "the picture is done")
    area_of("VIEW_3D").tag_redraw()
    yield 1.0


def events(*actions):
    """Mouse and keys through the window system."""
    for action in actions:
        subprocess.run(["xdotool", *action.split()], check=True)
        yield 0.4


def shot(name, crop=None):
    """Takes a screenshot, of which the part `crop` is kept: left, top, right, bottom in pixels from the upper left; all without it."""
    subprocess.run(["xwd", "-silent", "-root", "-out", f"{OUT}/{name}.xwd"], check=True)
    crops[name] = crop or (0, 0, window().width, window().height)
    print(name, time.strftime("%X"), flush=True)


def box(of):
    """An area or region, as `shot` takes it."""
    top = window().height - of.y - of.height
    return of.x, top, of.x + of.width, top + of.height


def show_tab(context):
    """Shows the end of a tab of the properties editor, where the extension's panels are."""
    properties = area_of("PROPERTIES")
    properties.spaces.active.context = context
    properties.tag_redraw()
    yield 1.0
    left, top, right, bottom = box(properties)
    yield from events(f"mousemove {(left + right) // 2} {(top + bottom) // 2}", *["click 5"] * 25, "mousemove 560 860")
    yield 1.0


def label_at(row):
    """A place on the screen where the label of a row is seen, deep inside of what is seen of it."""
    film = sys.modules[EXTENSION].label_film.of_viewport(viewport())
    seen, region = film.pixels[..., 1] == row + 1, region_of(area_of("VIEW_3D"))
    inner = seen.copy()
    inner[:90], inner[:, :120], inner[:, -340:] = False, False, False
    while True:
        smaller = inner & np.roll(inner, 1, 0) & np.roll(inner, -1, 0) & np.roll(inner, 1, 1) & np.roll(inner, -1, 1)
        if not smaller.any():
            break
        inner = smaller
    y, x = np.argwhere(inner)[0].tolist()
    return region.x + x, window().height - 1 - (region.y + region.height - 1 - y)


def most_seen(count):
    """Rows of the labels that are seen largest, largest first."""
    film = sys.modules[EXTENSION].label_film.of_viewport(viewport())
    rows, pixels = np.unique(film.pixels[90:, 120:-340, 1], return_counts=True)
    return [int(row) - 1 for row in rows[np.argsort(-pixels)] if row][:count]


def steps():
    yield 1.0
    scene, view = bpy.context.scene, area_of("VIEW_3D")
    space = view.spaces.active
    scene.pumice.viewport_samples = VIEW_SAMPLES
    bpy.context.preferences.view.render_display_type = "NONE"
    space.show_region_hud = False
    # A wider properties editor: its border is dragged to the left.
    border = view.x + view.width
    yield from events(f"mousemove {border} 600", "mousedown 1", f"mousemove {border - 60} 600", f"mousemove {border - 130} 600", "mouseup 1")
    yield 0.5

    # The dialog of the import, around the mouse; Return confirms it.
    yield from events("mousemove 560 330")
    with in_view():
        bpy.ops.pumice.import_volume("INVOKE_DEFAULT", filepath=VOLUME, pick=30)
    yield 1.5
    shot("blender-import", (90, 250, 660, 710))
    yield from events("mousemove 560 334", "key Return")
    yield from until(lambda: any(obj.pumice.filepath for obj in bpy.data.objects), "the volume is there")
    name = next(obj.name for obj in bpy.data.objects if obj.pumice.filepath)
    volume = lambda: bpy.data.objects[name]  # noqa: E731
    table_of = sys.modules[EXTENSION].label_table

    # The first picture, with the sidebar open.
    space.show_region_ui = True
    yield 1.0
    sidebar = region_of(view, "UI")
    sidebar.active_panel_category = "Pumice"
    yield from events("mousemove 560 860")
    yield from done()
    shot("blender-first")

    # Outline and grid as Pumice draws them, and their boxes.
    space.show_region_ui = False
    yield from events("mousemove 560 180")
    yield from done()
    with in_view():
        bpy.ops.wm.call_panel(name="VIEW3D_PT_overlay_guides", keep_open=True)
    yield 1.5
    shot("blender-overlays", (90, 60, 900, 640))
    yield from events("key Escape", "mousemove 560 860")
    space.show_region_ui = True
    yield 1.0

    # Search among the shown labels, and select the hits. The outline of the object would hide those of labels.
    sys.modules[EXTENSION].true_overlays.wishes_of(space).show_outline_selected = False
    assert bpy.ops.pumice.labels_search(query="voxels>100000", shown_only=True) == {"FINISHED"}
    with in_view():
        bpy.ops.pumice.labels_select_hits()
    yield from done()
    left, top, right, _ = box(sidebar)
    shot("blender-labels", (left - 260, top, right, top + 400))

    # Pick labels with the tool, and let the status bar name the last one.
    assert bpy.ops.pumice.labels_search(query="", shown_only=True) == {"FINISHED"}
    with in_view():
        bpy.ops.wm.tool_set_by_id(name="pumice.pick")
    yield from done()
    yield from until(lambda: sys.modules[EXTENSION].label_film.of_viewport(viewport()) is not None, "the label film is there")
    rows = most_seen(LEGEND_LABELS)
    places = [label_at(row) for row in rows]
    for count, (x, y) in enumerate(places, start=1):
        click = ("keydown shift", "click 1", "keyup shift") if count > 1 else ("click 1",)
        yield from events(f"mousemove {x + 3} {y}", f"mousemove {x} {y}", *click)
        yield from until(lambda: set(np.flatnonzero(table_of.selected(volume().pumice.table))) == set(rows[:count]), "clicks select")  # noqa: B023
    yield from done()
    # The reports of clicks leave the status bar.
    yield 12.0
    yield from events(f"mousemove {x + 1} {y}")
    shot("blender-pick")

    # The figure: size, backdrop, camera, legend, scale bar, estimate.
    figure, turn, distance = scene.pumice_figure, space.region_3d.view_rotation.copy(), space.region_3d.view_distance
    with in_view():
        bpy.ops.pumice.figure_preset(preset="FIGURE")
        figure.width_mm, figure.height_mm, figure.use_backdrop, figure.backdrop = 85.0, 60.0, True, (1.0, 1.0, 1.0)
        scene.view_settings.view_transform = "Standard"
        bpy.ops.view3d.camera_to_view_selected()
        scene.camera.data.lens = 46.0
        bpy.ops.pumice.add_legend(entries="SELECTED")
        bpy.context.view_layer.objects.active = volume()
        bpy.ops.pumice.add_scale_bar()
        for obj in bpy.context.selected_objects:
            obj.select_set(False)
        bpy.context.view_layer.objects.active = volume()
        bpy.ops.view3d.view_camera()
    yield from done()
    with in_view():
        bpy.ops.pumice.figure_estimate("INVOKE_DEFAULT")
    yield from until(lambda: figure.estimate, "the estimate")
    # The sidebar would cover the right end of the frame.
    space.show_region_ui = False
    yield from show_tab("OUTPUT")
    yield 12.0
    yield from done()
    shot("blender-figure-panel", box(area_of("PROPERTIES")))
    shot("blender-camera")

    # F12, in fewer pixels and samples than for print.
    figure.dpi, scene.pumice.samples, scene.pumice.use_error = 200, FIGURE_SAMPLES, False
    ended = []
    bpy.app.handlers.render_complete.append(lambda *_: ended.append(True))
    space.shading.type = "SOLID"
    with in_view():
        bpy.ops.render.render("INVOKE_DEFAULT")
    yield from until(lambda: ended, "the figure is done")
    yield 1.0
    bpy.data.images["Render Result"].save_render(f"{OUT}/blender-figure.png")

    # A group: all shown labels but for the picked ones become a ghost.
    bpy.data.collections["Figure"].hide_viewport, figure.use_backdrop = True, False
    scene.view_settings.view_transform = "AgX"
    space.shading.type, space.show_region_ui = "RENDERED", False
    space.region_3d.view_perspective, space.region_3d.view_rotation, space.region_3d.view_distance = "PERSP", turn, distance
    ghost = bpy.data.materials.new("Ghost")
    ghost.use_nodes = True
    shader = ghost.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value, shader.inputs["Alpha"].default_value = (0.25, 0.45, 0.75, 1.0), 0.25
    ghost.pumice.colors_by_label = False
    volume().data.materials.append(ghost)
    volume().active_material_index = 1
    with in_view():
        bpy.ops.pumice.labels_invert()
        bpy.ops.pumice.labels_assign(slot=1)
        bpy.ops.pumice.labels_select(ids="")
        bpy.ops.wm.tool_set_by_id(name="builtin.select_box")
    yield from show_tab("MATERIAL")
    yield from done()
    shot("blender-groups")

    # A cut through the whole block, and its handles.
    with in_view():
        bpy.ops.pumice.labels_select_group(slot=1)
        bpy.ops.pumice.labels_assign(slot=0)
        bpy.ops.pumice.labels_select(ids="")
        volume().data.materials.pop(index=1)
        bpy.ops.pumice.labels_show_all()
        bpy.ops.pumice.add_cut(shape="PLANE", orientation="X")
    yield from show_tab("OBJECT")
    yield from done()
    shot("blender-cut")


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
    with open(f"{OUT}/crops.json", "w") as file:
        json.dump(crops, file, indent=1)
    sys.stdout.flush()
    os._exit(code)


bpy.app.timers.register(tick, first_interval=0.5, persistent=True)
