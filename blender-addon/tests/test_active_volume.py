# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests which volume the sidebar and the operators on labels work on while a cut, a legend or a scale bar is the active object."""

import importlib

import bpy
import numpy as np
import pytest

from test_real_volumes import imported


@pytest.fixture
def volumes(blender, tmp_path):
    """Volumes of three and of four labels; the second was active last. A camera looks at them."""
    import pumice

    made = []
    for name, count in (("three", 3), ("four", 4)):
        pumice.compress(np.arange(1, count + 1, dtype=np.uint8).reshape(1, 1, count).repeat(4, 0)).save(tmp_path / f"{name}.pumice")
        made.append(imported(blender, tmp_path / f"{name}.pumice"))
    blender.context.view_layer.update()
    return made


@pytest.fixture
def shown(extension):
    """The number of labels in the sidebar's panel; None where Blender hides the tab."""
    panel = importlib.import_module(f"{extension.__name__}.label_panel").PUMICE_VIEW3D_PT_labels
    search = importlib.import_module(f"{extension.__name__}.label_search")
    return lambda: len(search.table_of(bpy.context).vertices) if panel.poll(bpy.context) else None


def make_active(obj):
    bpy.context.view_layer.objects.active = obj
    obj.update_tag()
    bpy.context.view_layer.update()


def add_cut(volume, **options):
    make_active(volume)
    assert bpy.ops.pumice.add_cut(shape="PLANE", **options) == {"FINISHED"}
    bpy.context.view_layer.update()
    return bpy.context.object


def test_the_panel_goes_on_showing_the_volume_that_was_active_last_while_a_cut_is_active(volumes, shown):
    three, four = volumes
    cut = add_cut(three)
    assert bpy.context.object == cut and shown() == 3
    make_active(four)
    make_active(cut)
    assert shown() == 4
    assert bpy.ops.pumice.labels_select(ids="4") == {"FINISHED"}, "operators work on it too"
    assert bpy.ops.pumice.labels_hide() == {"FINISHED"}
    assert [one.value for one in four.pumice.table.attributes["visible"].data] == [True] * 3 + [False]
    # Control: an object that belongs to no volume has no panel.
    make_active(bpy.context.scene.camera)
    assert shown() is None
    with pytest.raises(RuntimeError, match="Make a volume active first"):
        bpy.ops.pumice.labels_hide(ids="1")


def test_a_cut_of_chosen_volumes_shows_one_of_these(volumes, shown):
    three, four = volumes
    cut = add_cut(three)
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    three.select_set(True)
    assert bpy.ops.pumice.cut_volumes(volumes="SELECTED") == {"FINISHED"}
    make_active(four)
    make_active(cut)
    assert shown() == 3, "the other one was active last, and is not cut"


def test_without_a_last_one_the_only_volume_is_shown_and_of_two_none(volumes, shown, extension):
    cut = add_cut(volumes[0])
    forget = importlib.import_module(f"{extension.__name__}.active_volume").forget
    forget()
    assert shown() is None, "of two nobody knows which"
    bpy.data.objects.remove(volumes[1])
    make_active(cut)
    forget()
    assert shown() == 3


def test_the_name_of_a_volume_that_is_gone_says_nothing(volumes, shown):
    three, four = volumes
    other = three.copy()
    bpy.context.collection.objects.link(other)
    cut = add_cut(four)
    name = four.name
    bpy.data.objects.remove(four)
    three.name = name
    make_active(cut)
    assert shown() is None, "of two nobody knows which, though one has the name of the last now"
    bpy.data.objects.remove(other)
    make_active(cut)
    assert shown() == 3, "as the only one"


def test_a_legend_and_its_text_show_their_own_volume(volumes, shown):
    three, four = volumes
    make_active(three)
    assert bpy.ops.pumice.labels_select(ids="1") == {"FINISHED"}
    assert bpy.ops.pumice.add_legend(entries="SELECTED") == {"FINISHED"}
    legend = bpy.context.object
    make_active(four)
    make_active(legend)
    assert shown() == 3
    make_active(legend.pumice_figure.text)
    assert shown() == 3
    for collection in list(three.users_collection):
        collection.objects.unlink(three)
    make_active(legend)
    assert shown() is None


def test_object_data_shows_the_active_object_alone(volumes, extension):
    panel = importlib.import_module(f"{extension.__name__}.label_panel").PUMICE_OBJECT_PT_labels
    cut = add_cut(volumes[0])
    assert not panel.poll(bpy.context) and bpy.context.object == cut
    make_active(volumes[0])
    assert panel.poll(bpy.context)
