# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the difference of two scenes: its edits, applied by a naive implementation of their definition, give the new scene."""

import copy
import importlib

import pytest


@pytest.fixture
def sync(extension):
    class Both:
        edits = importlib.import_module(f"{extension.__name__}.sync.edits")
        parts = importlib.import_module(f"{extension.__name__}.sync.parts")

    return Both


def style(**over):
    plain = {"show": "all", "material": {"roughness": 0.5}, "auto_color": True, "materials": {"3": {"roughness": 0.1}}}
    return {**plain, **over}


def scene(sync, **over):
    placed = sync.parts.Placed
    fields = {
        "camera": {"shift": [0.0, 0.0]},
        "film": {"width": 8},
        "world": {"environment": 1},
        "suns": [],
        "settings": {"seed": 1},
        "placed": {(1,): placed("a", [1.0] * 12, style()), (2,): placed("b", [2.0] * 12, style())},
    }
    return sync.parts.Parts(**{**fields, **over})


def apply(before, changes, parts, numbers):
    """Applies edits to a scene, straight from their definition."""
    after = copy.deepcopy(before)
    for edit in changes.edits:
        kind = edit["edit"]
        if kind in ("camera", "film", "world", "suns", "lights", "cuts", "settings"):
            after[kind] = edit[kind]
            continue
        one = next(i for i in after["instances"] if i["id"] == edit["id"])
        if kind == "remove":
            after["instances"].remove(one)
        elif kind == "place":
            one["world_from_index"] = edit["world_from_index"]
        elif kind == "label_materials":
            for label, material in edit["materials"].items():
                if material is None:
                    del one["style"]["materials"][label]
                else:
                    one["style"]["materials"][label] = material
        else:
            one["style"][kind] = edit[kind]
    for key in changes.added:
        after["instances"].append(parts.placed[key].instance(numbers[key]))
    return after


CASES = {
    "camera": (lambda s, old: {"camera": {"shift": [0.1, 0.0]}}, ["camera"]),
    "film": (lambda s, old: {"film": {"width": 9}}, ["film"]),
    "light": (lambda s, old: {"world": {"environment": 2}, "suns": [{"strength": 1}]}, ["world", "suns"]),
    "lamp": (lambda s, old: {"lights": [{"power_w": 1}]}, ["lights"]),
    "cut": (lambda s, old: {"cuts": [{"shape": {}}]}, ["cuts"]),
    "nothing": (lambda s, old: {}, []),
    "place": (lambda s, old: {"placed": {**old, (1,): s.parts.Placed("a", [3.0] * 12, style())}}, ["place"]),
    "material": (
        lambda s, old: {"placed": {**old, (2,): s.parts.Placed("b", [2.0] * 12, style(material={"roughness": 1}))}},
        ["material"],
    ),
    "labels": (
        lambda s, old: {
            "placed": {**old, (2,): s.parts.Placed("b", [2.0] * 12, style(materials={"4": {}}, show={"only": [4]}))}
        },
        ["show", "label_materials"],
    ),
    "gone": (lambda s, old: {"placed": {(2,): old[(2,)]}}, ["remove"]),
    "another volume": (lambda s, old: {"placed": {**old, (1,): s.parts.Placed("c", [1.0] * 12, style())}}, ["remove"]),
    "new": (lambda s, old: {"placed": {**old, (0, 9): s.parts.Placed("c", [1.0] * 12, style())}}, []),
}


@pytest.mark.parametrize("name", CASES)
def test_the_changes_make_the_new_scene_and_no_more(sync, name):
    change, kinds = CASES[name]
    old = scene(sync)
    new = scene(sync, **change(sync, old.placed))
    numbers = {(1,): 1, (2,): 2}
    changes = sync.edits.between(old, new, numbers)
    assert [e["edit"] for e in changes.edits] == kinds

    for key in changes.removed:
        del numbers[key]
    for number, key in enumerate(changes.added, start=3):
        numbers[key] = number
    expected = new.scene(numbers)
    got = apply(old.scene({(1,): 1, (2,): 2}), changes, new, numbers)
    assert got == expected


def test_only_the_rows_that_differ_are_sent(sync):
    before = {str(i): {"roughness": 0.5} for i in range(1000)}
    after = dict(before, **{"7": {"roughness": 0.6}})
    del after["9"]
    assert sync.edits.changed_rows(before, after) == {"7": {"roughness": 0.6}, "9": None}
    assert sync.edits.changed_rows(before, before) == {}
