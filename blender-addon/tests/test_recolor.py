# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the palettes of Recolor: color maps and the scene's ramp along a column, and sequences of distinct colors, for the selection or for all."""

import importlib

import bpy
import numpy as np
import pytest

from test_real_volumes import imported


@pytest.fixture
def load(extension):
    return lambda name: importlib.import_module(f"{extension.__name__}.{name}")


@pytest.fixture
def table(blender, load, tmp_path):
    """40 labels, with a column `depth` from 0 to 1 and one label without a number."""
    import pumice

    pumice.compress(np.arange(1, 41, dtype=np.uint16).reshape(5, 4, 2).repeat(2, 0)).save(tmp_path / "forty.pumice")
    obj = imported(blender, tmp_path / "forty.pumice")
    load("label_table").set_number(obj.pumice.table, "depth", [*np.linspace(0.0, 1.0, 39), np.nan])
    return obj.pumice.table


def colors(load, table):
    return load("label_table").colors(table)[:, :3]


def recolor(**options):
    assert bpy.ops.pumice.labels_recolor(**options) == {"FINISHED"}


# First and last color of matplotlib's maps, in sRGB bytes.
ENDS = {
    "VIRIDIS": ((68, 1, 84), (253, 231, 37)),
    "MAGMA": ((0, 0, 4), (252, 253, 191)),
    "INFERNO": ((0, 0, 4), (252, 255, 164)),
    "PLASMA": ((13, 8, 135), (240, 249, 33)),
}


@pytest.mark.parametrize("which", ENDS)
def test_a_color_map_runs_from_its_first_to_its_last_color_and_grows_lighter(table, load, which):
    recolor(palette="NUMBER", column="depth", color_map=which)
    found = colors(load, table)
    linear = lambda byte: byte / 255 / 12.92 if byte / 255 <= 0.04045 else ((byte / 255 + 0.055) / 1.055) ** 2.4  # noqa: E731
    for row, end in zip((0, 38), ENDS[which]):
        assert found[row] == pytest.approx([linear(byte) for byte in end], abs=1e-6)
    assert found[39] == pytest.approx([0.4] * 3), "no number is grey"
    # What makes these maps maps: lightness, here luminance by Rec. 709, rises all along.
    assert (np.diff(found[:39] @ (0.2126, 0.7152, 0.0722)) > 0.0).all()


def test_the_ramp_of_the_scene_colors_by_number(table, load, tmp_path):
    recolor(palette="NUMBER", column="depth", color_map="RAMP")
    begun = colors(load, table)
    recolor(palette="NUMBER", column="depth", color_map="VIRIDIS")
    # Between its nine stops the ramp is linear in light, and the map in sRGB.
    assert np.allclose(begun, colors(load, table), atol=0.06) and np.allclose(begun[0], colors(load, table)[0], atol=1e-6)
    ramp = bpy.context.scene.pumice.ramp.color_ramp
    while len(ramp.elements) > 2:
        ramp.elements.remove(ramp.elements[1])
    ramp.elements[0].position, ramp.elements[1].position = 0.25, 0.75
    ramp.elements[0].color, ramp.elements[1].color = (1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0)
    recolor(palette="NUMBER", column="depth", color_map="RAMP")
    part = np.clip((np.linspace(0.0, 1.0, 39) - 0.25) / 0.5, 0.0, 1.0)
    expected = np.stack([1.0 - part, 0.0 * part, part], axis=1)
    assert np.allclose(colors(load, table)[:39], expected, atol=1e-6)

    # It belongs to the scene: saved, and used again.
    blend = str(tmp_path / "ramp.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    bpy.ops.wm.open_mainfile(filepath=blend)
    assert [e.position for e in bpy.context.scene.pumice.ramp.color_ramp.elements] == [0.25, 0.75]
    assert len(bpy.data.textures) == 1


@pytest.mark.parametrize("palette,is_safe", [("GLASBEY", False), ("SAFE", True)])
def test_distinct_colors_begin_anew_with_the_selection(table, load, palette, is_safe):
    import pumice

    recolor(palette=palette)
    assert np.array_equal(colors(load, table), pumice.distinct_colors(40, color_blind_safe=is_safe))
    assert len(np.unique(colors(load, table), axis=0)) == 40
    before = colors(load, table)
    bpy.ops.pumice.labels_select(ids="5, 7, 30")
    recolor(palette=palette)
    after = colors(load, table)
    assert np.array_equal(after[[4, 6, 29]], pumice.distinct_colors(3, color_blind_safe=is_safe))
    rest = np.setdiff1d(np.arange(40), [4, 6, 29])
    assert np.array_equal(after[rest], before[rest])
    assert load("label_table").own_color(table).all()


def test_more_labels_than_distinct_colors_repeat_them(blender, load, tmp_path):
    import pumice

    pumice.compress(np.arange(1, 601, dtype=np.uint16).reshape(6, 10, 10)).save(tmp_path / "many.pumice")
    table = imported(blender, tmp_path / "many.pumice").pumice.table
    recolor(palette="GLASBEY")
    found = colors(load, table)
    assert np.array_equal(found[256:512], found[:256]) and len(np.unique(found, axis=0)) == 256


def test_colors_that_scripts_put_out_of_range_are_drawn_at_its_ends(table, load):
    """A renderer refuses a color above 1. Those in range are the attribute's own, to the bit."""
    read = lambda: load("sync.instances")._columns(table, 1).color  # noqa: E731
    inside = load("label_table").colors(table)
    assert np.array_equal(read(), inside)
    for channel, value, end in ((0, 1.5, 1.0), (1, -0.25, 0.0)):
        color = list(table.attributes["color"].data[7].color)
        color[channel] = value
        table.attributes["color"].data[7].color = color
        inside[7, channel] = end
        assert np.array_equal(read(), inside)
