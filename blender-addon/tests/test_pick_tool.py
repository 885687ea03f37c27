# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the tool in the toolbar and its keymap: there while the extension is enabled, gone afterwards, and keys nowhere else."""

import addon_utils
import pytest

from conftest import EXTENSION
from test_real_volumes import load

NAME = "3D View Tool: Object, Pick Labels"


def toolbar():
    """Idnames of the tools of the 3D viewport in Object Mode."""
    from bl_ui.space_toolsystem_common import ToolSelectPanelHelper

    cls = ToolSelectPanelHelper._tool_class_from_space_type("VIEW_3D")
    return [item.idname for item in ToolSelectPanelHelper._tools_flatten(cls._tools["OBJECT"]) if item is not None]


def keys(blender):
    """{(operator, type, value, shift, alt): properties that are set, since the others would be those of the last call} of the tool's keymap; None without it."""
    keymap = blender.context.window_manager.keyconfigs.addon.keymaps.get(NAME)
    if keymap is None:
        return None
    named = {"labels_hide": ("unselected",)}
    found = {}
    for item in keymap.keymap_items:
        operator = item.idname.removeprefix("pumice.")
        values = {name: getattr(item.properties, name) for name in named.get(operator, ()) if item.properties.is_property_set(name)}
        found[operator, item.type, item.value, bool(item.shift), bool(item.alt)] = values
    return found


def test_the_tool_comes_and_goes_with_the_extension(blender):
    assert toolbar().count("pumice.pick") == 1
    assert keys(blender) is not None
    try:
        addon_utils.disable(EXTENSION)
        assert "pumice.pick" not in toolbar() and keys(blender) is None
        assert not hasattr(blender.types, "PUMICE_OT_labels_pick")
    finally:
        addon_utils.enable(EXTENSION, persistent=True)
    assert toolbar().count("pumice.pick") == 1 and keys(blender) is not None


def test_the_keys_are_blenders_own(blender):
    found = keys(blender)
    assert found["labels_hide", "H", "PRESS", False, False] == {"unselected": False}
    assert found["labels_hide", "H", "PRESS", True, False] == {"unselected": True}
    assert ("labels_show_all", "H", "PRESS", False, True) in found
    for shift in (False, True):
        assert ("labels_pick", "LEFTMOUSE", "CLICK", shift, False) in found
        assert ("labels_select_box", "LEFTMOUSE", "CLICK_DRAG", shift, False) in found


def test_no_other_keymap_has_keys_of_ours(blender):
    configs = blender.context.window_manager.keyconfigs
    for keymap in [*configs.addon.keymaps, *configs.default.keymaps]:
        for item in keymap.keymap_items:
            assert keymap.name == NAME or not item.idname.startswith("pumice."), (keymap.name, item.idname)


def test_the_status_bar_is_free_again_without_the_tool(blender, extension, monkeypatch):
    tool, texts = load(extension, "pick_tool"), []

    class Workspace:
        status_text_set = staticmethod(texts.append)

    tool.say(Workspace, "Label 3")
    tool.say(Workspace, "Label 3")
    assert texts == ["Label 3"] and blender.app.timers.is_registered(tool._look)
    monkeypatch.setattr(tool, "_is_active", lambda _window: True)
    assert tool._look() == tool.LOOK_SECONDS and tool._said == "Label 3"
    monkeypatch.setattr(tool, "_is_active", lambda _window: False)
    assert tool._look() is None and tool._said is None and tool._look() is None


@pytest.mark.parametrize("operator", ["labels_pick", "labels_select_box", "labels_hover"])
def test_operators_of_the_tool_have_a_name_and_say_what_they_do(blender, operator):
    of = getattr(blender.ops.pumice, operator).get_rna_type()
    assert of.name and of.description and not of.description.endswith(".")
