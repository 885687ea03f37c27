# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the legend: the swatches that F12 draws have the colors of the label table or of the material, whatever the light, and follow them.

The oracle is the place of a swatch on paper: 4 mm from the corner, 2.1 mm a side, 4.2 mm from line to line, at 300 dots an inch.
"""

import importlib
import types

import numpy as np
import pytest

from test_real_volumes import exr

PIXELS_A_MM = 300 / 25.4
COLORS = {1: (0.8, 0.1, 0.05), 2: (0.1, 0.6, 0.2), 3: (0.05, 0.2, 0.9), 7: (0.7, 0.7, 0.1)}


@pytest.fixture
def volume(blender, extension, tmp_path):
    """A volume with the labels 1, 2, 3, 7; the last two are in a second group."""
    labels = np.repeat(np.array([1, 2, 3, 7], dtype=np.uint8), 128).reshape(8, 8, 8)
    np.save(tmp_path / "block.npy", labels)
    assert blender.ops.pumice.import_volume(filepath=str(tmp_path / "block.npy")) == {"FINISHED"}
    obj, scene = blender.context.object, blender.context.scene
    table, tables = obj.pumice.table, importlib.import_module(f"{extension.__name__}.label_table")
    tables.set_names(table, ["alpha", "", "gamma", "delta"])
    for row, color in enumerate(COLORS.values()):
        tables.set_color(table, [row], color)
    obj.data.materials[0].name = "block axon"
    second = obj.data.materials[0].copy()
    second.name, second.pumice.colors_by_label = "glia", False
    second.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.3, 0.02, 0.5, 1.0)
    obj.data.materials.append(second)
    tables.set_slots(table, [2, 3], 1)
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 300, 300, 100
    if blender.app.version >= (5, 0, 0):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    render.filepath = str(tmp_path / "out.exr")
    # Only the column of the swatches is drawn.
    render.use_border, render.use_crop_to_border = True, False
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.13, 0.25, 0.0, 1.0
    scene.pumice.samples, scene.pumice.backend, scene.pumice.bounces = 4, "CPU", 0
    blender.context.view_layer.update()
    return obj


def legend(bpy, volume, **how):
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    bpy.context.view_layer.objects.active = volume
    assert bpy.ops.pumice.add_legend(**how) == {"FINISHED"}
    return bpy.context.object


def swatches(bpy, count):
    """Colors of F12's picture in the middle of the first `count` swatches."""
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    found = exr(bpy.context.scene.render.filepath)
    x = int((4.0 + 1.05) * PIXELS_A_MM)
    return [[float(found[f"Combined.{c}"][int((4.0 + 1.05 + 4.2 * i) * PIXELS_A_MM), x]) for c in "RGB"] for i in range(count)]


def lines(part):
    return part.pumice_figure.text.data.body.split("\n")


def close(found, wanted):
    # Single precision, and a mean of four equal samples.
    return np.allclose(found, wanted, rtol=1e-5, atol=1e-6)


def test_selected_labels_have_the_colors_of_the_table_and_follow_it(blender, extension, volume):
    blender.ops.pumice.labels_select(ids="1, 2")
    part = legend(blender, volume, entries="SELECTED")
    assert part.pumice_figure.labels == "1, 2" and lines(part) == ["alpha", "2"]
    assert close(swatches(blender, 2), [COLORS[1], COLORS[2]])
    blender.context.view_layer.objects.active = volume
    blender.ops.pumice.labels_color(color=(0.25, 0.5, 0.75))
    assert close(swatches(blender, 2), [(0.25, 0.5, 0.75)] * 2), "follows the table"
    # Another label, one of a group without colors of its labels: it is drawn in the material's.
    part.pumice_figure.labels = "7"
    blender.context.view_layer.update()
    assert lines(part) == ["delta"] and close(swatches(blender, 1), [(0.3, 0.02, 0.5)])
    assert len(part.data.materials) == 1 == len(part.data.polygons)
    volume.data.materials[1].node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    assert close(swatches(blender, 1), [(0.1, 0.2, 0.3)]), "follows the material"
    part.pumice_figure.labels = "7, 99, x, 18446744073709551616"
    blender.context.view_layer.update()
    gone = "the volume has no label"
    said = f"Legend: {gone} 99; {gone} x; {gone} 18446744073709551616"
    assert said in extension.panels.not_drawn(blender.context.scene, blender.context.view_layer)


def test_groups_have_one_color_or_are_named(blender, extension, volume):
    table, tables = volume.pumice.table, importlib.import_module(f"{extension.__name__}.label_table")
    part = legend(blender, volume)
    not_drawn = lambda: extension.panels.not_drawn(blender.context.scene, blender.context.view_layer)  # noqa: E731
    assert lines(part) == ["glia"], "the labels of axon have two colors"
    assert [line for line in not_drawn() if "axon" in line] == ["Legend: axon: its labels have several colors; give them one, or choose labels"]
    tables.set_color(table, [0, 1], (0.9, 0.4, 0.2))
    volume.update_tag()
    blender.context.view_layer.update()
    assert lines(part) == ["axon", "glia"] and not [line for line in not_drawn() if "axon" in line]
    assert close(swatches(blender, 2), [(0.9, 0.4, 0.2), (0.3, 0.02, 0.5)])
    # A group of which nothing is shown leaves, and comes back.
    tables.set_visible(table, [False, False, True, True])
    volume.update_tag()
    blender.context.view_layer.update()
    assert lines(part) == ["glia"] and close(swatches(blender, 1), [(0.3, 0.02, 0.5)])
    tables.set_visible(table, [True] * 4)
    volume.update_tag()
    assert close(swatches(blender, 2), [(0.9, 0.4, 0.2), (0.3, 0.02, 0.5)])
    # A name of a material.
    volume.data.materials[1].name = "astrocytes"
    blender.context.view_layer.update()
    swatches(blender, 0)
    assert lines(part) == ["axon", "astrocytes"]


def test_light_and_camera_do_not_change_a_swatch(blender, volume):
    blender.ops.pumice.labels_select(ids="1, 2")
    legend(blender, volume, entries="SELECTED")
    scene = blender.context.scene
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 20.0
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 30.0
    assert close(swatches(blender, 2), [COLORS[1], COLORS[2]])


def test_a_duplicate_has_colors_of_its_own(blender, volume):
    blender.ops.pumice.labels_select(ids="1")
    part = legend(blender, volume, entries="SELECTED")
    copy = part.copy()
    copy.data = part.data.copy()
    part.users_collection[0].objects.link(copy)
    copy.pumice_figure.labels = "2"
    blender.context.view_layer.update()
    node = lambda one: one.data.materials[0].node_tree.nodes["Emission"].inputs["Color"].default_value[:3]  # noqa: E731
    assert close(node(part), COLORS[1]) and close(node(copy), COLORS[2])
    assert lines(part) == ["alpha"], "its text is not that of a duplicate that has none"


def test_a_button_in_output_knows_the_active_volume(blender, extension, volume):
    """There Blender's `context.object` is None."""
    operators = importlib.import_module(f"{extension.__name__}.figure_operators")
    in_output = types.SimpleNamespace(object=None, view_layer=blender.context.view_layer, scene=blender.context.scene)
    assert operators.PUMICE_OT_add_legend.poll(in_output) and operators.PUMICE_OT_add_scale_bar.poll(in_output)


def test_what_cannot_be_a_legend_is_refused(blender, extension, volume):
    with pytest.raises(RuntimeError, match="No label is selected"):
        blender.ops.pumice.add_legend(entries="SELECTED")
    count = len(blender.data.objects)
    importlib.import_module(f"{extension.__name__}.label_table").set_visible(volume.pumice.table, [True, True, False, False])
    with pytest.raises(RuntimeError, match="axon: its labels have several colors"):
        blender.ops.pumice.add_legend()
    assert len(blender.data.objects) == count
    legend_module = importlib.import_module(f"{extension.__name__}.legend")
    many = blender.data.meshes.new("many")
    many.vertices.add(40)
    for name, values in (("id_low", np.arange(40)), ("id_high", np.zeros(40))):
        many.attributes.new(name, "INT", "POINT").data.foreach_set("value", values.astype(np.int32))
    many.attributes.new("select", "BOOLEAN", "POINT").data.foreach_set("value", np.ones(40, dtype=bool))
    with pytest.raises(Exception, match="at most 32 entries, and 40 labels are selected"):
        legend_module.selected(many)


def test_a_scale_bar_follows_a_legend_without_activating_the_volume_again(blender, volume):
    shown = legend(blender, volume)
    assert blender.context.view_layer.objects.active == shown
    assert blender.ops.pumice.add_scale_bar() == {"FINISHED"}
    bar = blender.context.object
    assert bar != shown and bar.pumice_figure.kind == "SCALE_BAR" and bar.pumice_figure.volume == volume
    for collection in list(volume.users_collection):
        collection.objects.unlink(volume)
    with pytest.raises(RuntimeError, match="Make a volume active first"):
        blender.ops.pumice.add_scale_bar()
    blender.context.view_layer.objects.active = blender.context.scene.camera
    with pytest.raises(RuntimeError, match="Make a volume active first"):
        blender.ops.pumice.add_scale_bar()
