# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the scale bar: as drawn by F12, it is as many pixels long as the camera's projection says of the length in its text.

The oracle is the closed form of a pinhole: pixels = length · scale of the object / distance · lens / sensor · pixels of the fitted side; without
the quotient lens / distance for an orthographic camera. The length is read from the text, as people do. The bar is black before white, so
what a row of pixels lacks of white is its length.
"""

import importlib
import re

import numpy as np
import pytest
from mathutils import Matrix, Vector

from test_real_volumes import exr

METERS = {"nm": 1e-9, "µm": 1e-6, "mm": 1e-3, "m": 1.0}
SIDE = 8


@pytest.fixture
def figure(blender, tmp_path):
    """A volume of 8³ voxels in a white world, seen by a camera in a general place; 300 × 200 pixels."""
    np.save(tmp_path / "block.npy", np.ones((SIDE,) * 3, dtype=np.uint8))
    assert blender.ops.pumice.import_volume(filepath=str(tmp_path / "block.npy"), use_spacing=True, spacing=(40.0, 40.0, 100.0)) == {"FINISHED"}
    scene = blender.context.scene
    for obj in [obj for obj in scene.objects if obj.type == "LIGHT"]:
        blender.data.objects.remove(obj)
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0,) * 4
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 300, 200, 100
    if blender.app.version >= (5, 0, 0):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    render.filepath = str(tmp_path / "out.exr")
    scene.pumice.samples, scene.pumice.backend, scene.pumice.bounces = 16, "CPU", 0
    scene.camera.matrix_world = Matrix.Translation((20.0, -30.0, 12.0)) @ Vector((20.0, -30.0, 12.0)).to_track_quat("Z", "Y").to_matrix().to_4x4()
    blender.context.object.pumice.unit = "nm"
    blender.context.view_layer.update()
    return scene


def add(bpy, **how):
    volume = next(o for o in bpy.data.objects if o.pumice.filepath)
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    bpy.context.view_layer.objects.active = volume
    assert bpy.ops.pumice.add_scale_bar(**how) == {"FINISHED"}
    bar = bpy.context.object
    bar.pumice_figure.text_mm = 2.0
    # The volume's own ink would count, so its label is hidden.
    show(volume, False)
    # Only the part of the picture that the bar is in is drawn.
    render, is_low = bpy.context.scene.render, bar.pumice_figure.corner.startswith("LOWER")
    render.use_border, render.use_crop_to_border, render.border_min_x, render.border_max_x = True, False, 0.0, 1.0
    render.border_min_y, render.border_max_y = (0.1, 0.35) if is_low else (0.55, 0.9)
    return volume, bar


def drawn_pixels(bpy, is_dark=True):
    """(length of the bar in the picture of F12, row and column where it ends): what a row lacks of white, or of black if the bar is white."""
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    return black_run(exr(bpy.context.scene.render.filepath), is_dark)


def show(volume, is_shown):
    importlib.import_module("bl_ext.user_default.pumice.label_table").set_visible(volume.pumice.table, [is_shown])
    volume.update_tag()


def black_run(found, is_dark=True):
    """`drawn_pixels` of the channels of a file."""
    ink = np.where(found["Combined.A"] > 0.5, 1.0 - found["Combined.R"] if is_dark else found["Combined.R"], 0.0)
    # The bar is the longest run of all rows; the text has gaps.
    runs = []
    for row, inked in enumerate(ink > 0.9):
        ends = np.flatnonzero(np.diff(np.concatenate([[0], inked.astype(int), [0]])))
        runs += [(int(b - a), row, int(a), int(b)) for a, b in zip(ends[::2], ends[1::2])]
    best = max(runs)[0]
    assert best > 10, "no bar"
    rows = [run for run in runs if run[0] >= best - 1]
    assert 6 <= len(rows) <= 9, "0.7 mm are 8.3 pixels"
    # The filter spreads each end over three pixels.
    lengths = [ink[row, a - 4 : b + 4].sum() for _, row, a, b in rows[1:-1]]
    return float(np.mean(lengths)), rows[len(rows) // 2][1], rows[0][3]


def told_length(bar):
    """(length in metres, rest of the text) that the text says."""
    number, unit, rest = re.fullmatch(r"([\d.]+) (nm|µm|mm|m)(.*)", bar.pumice_figure.text.data.body).groups()
    return float(number) * METERS[unit], rest


def expected_pixels(scene, volume, meters, file_unit, distance):
    """The closed form; `distance` is that of the plane along the camera's axis."""
    data, size = scene.camera.data, (scene.render.resolution_x, scene.render.resolution_y)
    # Voxels are 40 units of the file, and as long in the scene as the object's matrix makes them.
    world = meters / METERS[file_unit] * np.linalg.norm(np.array(volume.matrix_world)[:3, 0]) / 40.0
    fitted = {"HORIZONTAL": size[0], "VERTICAL": size[1], "AUTO": max(size)}[data.sensor_fit]
    if data.type == "ORTHO":
        return world / data.ortho_scale * fitted
    sensor = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
    return world / distance * data.lens / sensor * fitted


def distance_to(scene, point):
    place = np.array(scene.camera.matrix_world)
    axis = place[:3, 2] / np.linalg.norm(place[:3, 2])
    return float(axis @ (place[:3, 3] - np.array(point)))


def middle_of(volume):
    return np.array(volume.matrix_world @ Vector([SIDE / 2] * 3))


# Some six rows of 16 stratified samples a pixel leave a few hundredths of a pixel at each end.
PIXELS = 0.25

CASES = {
    "perspective": {},
    "orthographic": {"type": "ORTHO", "ortho_scale": 17.0},
    "shifted": {"shift_x": 0.2, "shift_y": -0.1, "lens": 70.0},
    "vertical": {"sensor_fit": "VERTICAL", "sensor_height": 20.0},
    "sharp at a distance": {"dof.use_dof": True, "dof.focus_distance": 4.0, "dof.aperture_fstop": 128.0},
}


@pytest.mark.parametrize("case,unit", [*((case, "nm") for case in CASES), ("perspective", "um"), ("orthographic", "mm")])
def test_the_bar_is_as_long_as_its_text_says(figure, blender, case, unit):
    scene, camera = figure, figure.camera
    for name, value in CASES[case].items():
        owner = camera.data.dof if name.startswith("dof.") else camera.data
        setattr(owner, name.removeprefix("dof."), value)
    volume, bar = add(blender)
    volume.pumice.unit = unit
    volume.scale *= 1.7
    blender.context.view_layer.update()
    meters, rest = told_length(bar)
    assert rest == ("" if camera.data.type == "ORTHO" else " (middle)")
    digits = f"{meters:.6e}"
    assert digits[0] in "125" and set(digits[1:8]) <= {".", "0"}, f"{meters} is no round length"
    pixels, row, end = drawn_pixels(blender)
    file_unit = {"nm": "nm", "um": "µm", "mm": "mm"}[unit]
    expected = expected_pixels(scene, volume, meters, file_unit, distance_to(scene, middle_of(volume)))
    assert pixels == pytest.approx(expected, abs=PIXELS)
    # The next round length would not fit into a quarter of the width.
    assert expected <= 75 + PIXELS < 2.5 * expected
    # Lower right, 4 mm of 300 dots an inch from both sides.
    assert end == pytest.approx(300 - 4 / 25.4 * 300, abs=1.5) and row == pytest.approx(200 - 4.35 / 25.4 * 300, abs=1.5)
    # Negative control: a hundredth of the bar is more than what the tolerance allows.
    assert abs(pixels - 1.01 * expected) > PIXELS or expected < 30


@pytest.mark.parametrize("plane", ["MIDDLE", "FRONT", "DISTANCE"])
def test_in_perspective_the_bar_is_true_at_its_plane(figure, blender, plane):
    volume, bar = add(blender, corner="UPPER_LEFT")
    settings = bar.pumice_figure
    settings.plane, settings.distance, settings.length = plane, 20.0, 90.0
    blender.context.view_layer.update()
    corners = [volume.matrix_world @ Vector((x, y, z)) for x in (0, SIDE) for y in (0, SIDE) for z in (0, SIDE)]
    distance = {
        "MIDDLE": distance_to(figure, middle_of(volume)),
        "FRONT": min(distance_to(figure, corner) for corner in corners),
        "DISTANCE": 20.0,
    }
    meters, rest = told_length(bar)
    assert meters == pytest.approx(90e-9) and rest == {"MIDDLE": " (middle)", "FRONT": " (front)", "DISTANCE": " (at 20)"}[plane]
    pixels, _, _ = drawn_pixels(blender)
    expected = {name: expected_pixels(figure, volume, meters, "nm", value) for name, value in distance.items()}
    assert pixels == pytest.approx(expected[plane], abs=PIXELS)
    assert min(abs(expected[plane] - value) for name, value in expected.items() if name != plane) > 4 * PIXELS, "planes are told apart"
    settings.names_plane = False
    blender.context.view_layer.update()
    assert told_length(bar)[1] == ""


def test_the_bar_follows_everything_and_also_without_an_update(figure, blender):
    """Scripts may change a scene and render at once; then the bar is right in that picture already."""
    volume, bar = add(blender)
    camera = figure.camera
    bar.pumice_figure.length = 250.0

    def check():
        pixels, _, _ = drawn_pixels(blender)
        meters, _ = told_length(bar)
        blender.context.view_layer.update()
        assert pixels == pytest.approx(expected_pixels(figure, volume, meters, "nm", distance_to(figure, middle_of(volume))), abs=PIXELS)
        return pixels

    first = check()
    camera.data.lens *= 1.5
    assert check() == pytest.approx(1.5 * first, abs=3 * PIXELS)
    figure.render.resolution_x, figure.render.resolution_y = 240, 320
    camera.scale = (2.0, 2.0, 2.0)
    check()
    camera.data.type, camera.data.ortho_scale = "ORTHO", 30.0
    check()
    other = camera.copy()
    other.data = camera.data.copy()
    figure.collection.objects.link(other)
    other.data.ortho_scale, figure.camera = 25.0, other
    check()
    # An animated lens, in the second of two frames.
    other.data.type = "PERSP"
    for frame, lens in ((1, 40.0), (2, 60.0)):
        other.data.lens = lens
        other.data.keyframe_insert("lens", frame=frame)
    for frame in (1, 2):
        figure.frame_set(frame)
        check()
    # A rendered animation, in which the volume moves too.
    for frame, y in ((1, 0.0), (2, 5.0)):
        volume.location.y = y
        volume.keyframe_insert("location", frame=frame)
    figure.frame_start, figure.frame_end, target = 1, 2, figure.render.filepath
    figure.render.filepath = target.replace("out.exr", "frame")
    assert blender.ops.render.render(animation=True) == {"FINISHED"}
    found = [black_run(exr(target.replace("out", f"frame{frame:04}")))[0] for frame in (1, 2)]
    meters, _ = told_length(bar)
    for frame, pixels in zip((1, 2), found):
        figure.frame_set(frame)
        assert pixels == pytest.approx(expected_pixels(figure, volume, meters, "nm", distance_to(figure, middle_of(volume))), abs=PIXELS), frame
    assert abs(found[1] - 1.5 * found[0]) > 4 * PIXELS, "the volume's way is seen"


def test_nothing_hides_the_bar(figure, blender):
    """The volume fills the picture and is dim; the white bar before it is as long as it is."""
    volume, bar = add(blender)
    figure.camera.data.lens = 200.0
    show(volume, True)
    figure.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.01
    bar.pumice_figure.color, bar.pumice_figure.text.hide_render = (1.0, 1.0, 1.0), True
    blender.context.view_layer.update()
    meters, _ = told_length(bar)
    pixels, _, _ = drawn_pixels(blender, is_dark=False)
    assert pixels == pytest.approx(expected_pixels(figure, volume, meters, "nm", distance_to(figure, middle_of(volume))), abs=PIXELS)


def test_a_bar_that_cannot_be_true_says_so_in_the_picture(figure, blender, extension):
    volume, bar = add(blender)
    volume.scale.x *= 1.01
    blender.context.view_layer.update()
    assert bar.pumice_figure.text.data.body == "not to scale"
    lines = extension.panels.not_drawn(figure, blender.context.view_layer)
    assert [line for line in lines if "scaled unevenly" in line] == [
        f"Scale Bar: {volume.name} is scaled unevenly, so no bar is true; apply the same scale to its axes"
    ]
    volume.scale.x /= 1.01
    figure.camera.location = -figure.camera.location
    blender.context.view_layer.update()
    assert any("behind the camera" in line for line in extension.panels.not_drawn(figure, blender.context.view_layer))
    blender.data.objects.remove(volume)
    blender.context.view_layer.update()
    assert any("its volume is gone" in line for line in extension.panels.not_drawn(figure, blender.context.view_layer))
    blender.data.objects.remove(bar.pumice_figure.text)
    blender.data.objects.remove(bar)
    blender.context.view_layer.update()
    assert not [line for line in extension.panels.not_drawn(figure, blender.context.view_layer) if "Bar" in line]


def test_a_settled_bar_is_not_written_again(figure, blender, extension):
    """What follows must come to rest: an update that changes nothing tags nothing."""
    add(blender)
    update = blender.context.view_layer.update
    update()
    seen = []
    handlers = blender.app.handlers.depsgraph_update_post
    spy = lambda _scene, depsgraph: seen.append({update.id.name for update in depsgraph.updates})  # noqa: E731
    handlers.append(spy)
    try:
        for camera_moves in (False, True):
            figure.camera.location.x += 0.1 * camera_moves
            update()
            seen.clear()
            importlib.import_module(f"{extension.__name__}.figure_follow").follow(figure, blender.context.evaluated_depsgraph_get())
            update()
            assert seen == [], "what follows has written something that is right already"
        figure.camera.location.x += 0.1
        update()
        assert seen, "negative control: a change is seen"
    finally:
        handlers.remove(spy)


@pytest.mark.parametrize(
    "length,unit,text",
    [(500.0, "nm", "500 nm"), (2000.0, "nm", "2 µm"), (1.0, "um", "1 µm"), (0.2, "um", "200 nm"), (5e6, "nm", "5 mm"), (0.05, "nm", "0.05 nm")]
    + [(2.0, "m", "2 m"), (50.0, "unknown", "50 units"), (1e3, "um", "1 mm")],
)
def test_a_length_is_said_in_its_best_unit(extension, blender, length, unit, text):
    assert importlib.import_module(f"{extension.__name__}.scale_bar").length_text(length, unit) == text


def test_who_has_no_volume_or_camera_is_refused(figure, blender):
    blender.context.view_layer.objects.active = figure.camera
    with pytest.raises(RuntimeError, match="Make a volume active first"):
        blender.ops.pumice.add_scale_bar()
    blender.context.view_layer.objects.active = next(o for o in blender.data.objects if o.pumice.filepath)
    figure.camera = None
    with pytest.raises(RuntimeError, match="no camera"):
        blender.ops.pumice.add_scale_bar()
