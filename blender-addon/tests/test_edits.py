# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the difference of two scenes: its edits, applied by a naive implementation of their definition, give the new scene."""

import copy
import dataclasses
import importlib

import numpy as np
import pytest

from stand_ins import Module


@pytest.fixture
def sync(extension):
    class Both:
        edits = importlib.import_module(f"{extension.__name__}.sync.edits")
        parts = importlib.import_module(f"{extension.__name__}.sync.parts")
        label_style = importlib.import_module(f"{extension.__name__}.sync.label_style")

    return Both


GREY, GLASS = {"roughness": 0.5}, {"transmission": 1.0}


def style(sync, materials=((GREY, True), (GLASS, False)), **over):
    """A look of three labels, two of them in the second group."""
    columns = dict(ids=[3, 17, 2**64 - 1], visible=[True] * 3, group=[0, 1, 1], color=[[0.1, 0.2, 0.3, 1.0]] * 3) | over
    kinds = dict(ids=np.uint64, visible=bool, group=np.uint32, color=np.float32)
    arrays = {name: np.array(values, dtype=kinds[name]) for name, values in columns.items()}
    return sync.label_style.LabelStyle(tuple(materials), sync.label_style.Columns(**arrays))


def looks(one):
    """A style as plain values."""
    return one.materials, None if one.columns is None else tuple(a.tolist() for a in vars(one.columns).values())


def scene(sync, **over):
    placed = sync.parts.Placed
    fields = {
        "camera": {"shift": [0.0, 0.0]},
        "film": {"width": 8},
        "world": {"environment": 1},
        "suns": [],
        "settings": {"seed": 1},
        "placed": {(1,): placed("a", [1.0] * 12, style(sync)), (2,): placed("b", [2.0] * 12, style(sync))},
    }
    return sync.parts.Parts(**{**fields, **over})


def apply(before, styles, changes, parts, numbers):
    """Applies edits to a scene and to the styles of its instances, straight from their definition."""
    after = copy.deepcopy(before)
    for number, new, shown, whole in changes.labels:
        old = styles[number]
        columns = new.columns if whole else old.columns
        visible = new.columns.visible if shown else old.columns.visible
        styles[number] = type(new)(new.materials if whole else old.materials, dataclasses.replace(columns, visible=visible))
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
        elif kind == "group_material":
            old = styles[edit["id"]]
            fields = list(old.materials)
            fields[edit["group"]] = (edit["material"], fields[edit["group"]][1])
            styles[edit["id"]] = dataclasses.replace(old, materials=tuple(fields))
        else:
            one["style"][kind] = edit[kind]
    for key in changes.added:
        after["instances"].append(parts.placed[key].instance(numbers[key]))
    # The session refuses a cut that names a volume which is not there, so the edits come first and the whole list after what is added.
    there = {one["id"] for one in after["instances"]}
    assert all(set(cut["instances"] or []) <= there for cut in after["cuts"]), "an edit names a volume that is gone"
    if changes.cuts_name_added:
        after["cuts"] = parts.cuts_of(parts.placed, numbers)
    return after


def restyled(**over):
    return lambda s, old: {"placed": {**old, (2,): s.parts.Placed("b", [2.0] * 12, style(s, **over))}}


# What changes, the edits that this makes, and for the labels of volume 2 whether other ones are drawn and whether they look different.
CASES = {
    "camera": (lambda s, old: {"camera": {"shift": [0.1, 0.0]}}, ["camera"], None),
    "film": (lambda s, old: {"film": {"width": 9}}, ["film"], None),
    "light": (lambda s, old: {"world": {"environment": 2}, "suns": [{"strength": 1}]}, ["world", "suns"], None),
    "lamp": (lambda s, old: {"lights": [{"power_w": 1}]}, ["lights"], None),
    "cut": (lambda s, old: {"cuts": [s.parts.PlacedCut({"plane": 1})]}, ["cuts"], None),
    "cut of one": (lambda s, old: {"cuts": [s.parts.PlacedCut({"plane": 1}, ((2,),))]}, ["cuts"], None),
    "nothing": (lambda s, old: {}, [], None),
    "place": (lambda s, old: {"placed": {**old, (1,): s.parts.Placed("a", [3.0] * 12, old[(1,)].style)}}, ["place"], None),
    "the same anew": (restyled(), [], None),
    "first material": (restyled(materials=(({"roughness": 1}, True), (GLASS, False))), ["group_material"], None),
    "second material": (restyled(materials=((GREY, True), ({"alpha": 0.5}, False))), ["group_material"], None),
    "colored": (restyled(materials=((GREY, True), (GLASS, True))), [], (False, True)),
    "one more group": (restyled(materials=((GREY, True), (GLASS, False), (GREY, True))), [], (False, True)),
    "hidden": (restyled(visible=[True, False, True]), [], (True, False)),
    "another group": (restyled(group=[0, 0, 1]), [], (False, True)),
    "a color": (restyled(color=[[0.1, 0.2, 0.3, 1.0]] * 2 + [[0.9, 0.2, 0.3, 1.0]]), [], (False, True)),
    "other labels": (restyled(ids=[3, 18, 19]), [], (True, True)),
    "gone": (lambda s, old: {"placed": {(2,): old[(2,)]}}, ["remove"], None),
    "another volume": (lambda s, old: {"placed": {**old, (1,): s.parts.Placed("c", [1.0] * 12, old[(1,)].style)}}, ["remove"], None),
    "new": (lambda s, old: {"placed": {**old, (0, 9): s.parts.Placed("c", [1.0] * 12, old[(1,)].style)}}, [], None),
}


# The same for a scene in which a cut names volume 1.
CUT_CASES = {
    "moved": (lambda s, old: {"cuts": [s.parts.PlacedCut({"plane": 2}, ((1,),))]}, ["cuts"], None),
    "of all": (lambda s, old: {"cuts": [s.parts.PlacedCut({"plane": 1})]}, ["cuts"], None),
    "gone": (lambda s, old: {"cuts": [], "placed": {(2,): old[(2,)]}}, ["remove", "cuts"], None),
    "not open": (lambda s, old: {"placed": {(2,): old[(2,)]}}, ["remove", "cuts"], None),
    "another volume": (lambda s, old: {"placed": {**old, (1,): s.parts.Placed("c", [1.0] * 12, old[(1,)].style)}}, ["remove", "cuts"], None),
    "of a new one": (
        lambda s, old: {
            "cuts": [s.parts.PlacedCut({"plane": 1}, ((0, 9), (1,)))],
            "placed": {**old, (0, 9): s.parts.Placed("c", [1.0] * 12, old[(1,)].style)},
        },
        [],
        None,
    ),
    "nothing": (lambda s, old: {}, [], None),
}


def test_columns_read_again_share_the_arrays_that_did_not_change(sync):
    kept, same = style(sync).columns, style(sync).columns
    assert same is not kept and same.unless_changed(kept) is kept
    for name, values in (("ids", [3, 17, 18]), ("visible", [True, False, True]), ("group", [1, 1, 1]), ("color", [[0.5] * 4] * 3)):
        new = style(sync, **{name: values}).columns
        shared = new.unless_changed(kept)
        assert looks(sync.label_style.LabelStyle((), shared)) == looks(sync.label_style.LabelStyle((), new))
        assert [field for field in vars(kept) if getattr(shared, field) is not getattr(kept, field)] == [name]


def test_rows_of_other_colors_are_those_of_the_columns_that_are_asked(sync):
    """The last answer is kept; the naive loop is the oracle, also where columns are asked in turn and are gone in between."""
    rng = np.random.default_rng(3)
    many = 50
    columns = lambda color: style(sync, ids=range(1, many + 1), visible=[True] * many, group=[0] * many, color=color).columns  # noqa: E731
    made = [columns(np.ones((many, 4)))]
    for _ in range(5):
        color = made[-1].color.copy()
        color[rng.random((many, 4)) < 0.05] = rng.random()
        made.append(columns(color))
    for _ in range(200):
        one, other = (made[i] for i in rng.integers(len(made), size=2))
        naive = [row for row in range(many) if one.color[row].tolist() != other.color[row].tolist()]
        assert one.recolored(other).tolist() == naive == one.recolored(other).tolist()
        assert one.same_groups(other) == (not naive)
        # Arrays that are freed make room for others at their addresses.
        made[rng.integers(len(made))] = columns(other.color.copy())


def real_style(sync, pumice_fields=({"roughness": 0.5}, {"alpha": 0.5}), *, color, made, **over):
    """A style of three labels with their colors, whose materials the compiled module takes."""
    rough, ghost = pumice_fields
    base = style(sync, materials=((rough, True), (ghost, False)), color=color, **over)
    return dataclasses.replace(base, made=made)


def test_groups_with_changed_colors_are_those_that_are_made_anew(sync):
    """Of a row of steps, each from the one before, with the compiled module; the groups of each step, made of nothing, are the oracle."""
    import pumice

    scene = pumice.figure(pumice.compress(np.arange(1, 9, dtype=np.uint8).reshape(2, 2, 2)), source="v.pumice", size=(8, 8))
    text = lambda groups: scene.with_labels(1, groups=groups).to_json()  # noqa: E731
    red, green, half = [1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.5, 1.0]
    steps = [
        dict(color=[red, red, red]),
        dict(color=[green, red, red]),
        dict(color=[green, red, red]),
        # Only the lower and only the upper half of the four numbers differ; the second label's group has no colors.
        dict(color=[red, green, half]),
        dict(color=[half, green, half], group=[1, 0, 0]),
        dict(color=[green, green, red], group=[1, 0, 0]),
        dict(color=[green, red, red], group=[1, 0, 0], pumice_fields=({"roughness": 0.9}, {"alpha": 0.5})),
        dict(color=[green, green, green], group=[1, 0, 0], pumice_fields=({"roughness": 0.9}, {"alpha": 0.5})),
        dict(color=[red, green, green], ids=[3, 18, 19]),
    ]
    made, seen = sync.label_style.MadeGroups(), []
    for step in steps:
        expected = text(real_style(sync, **step, made=sync.label_style.MadeGroups()).groups(pumice))
        assert text(real_style(sync, **step, made=made).groups(pumice)) == expected, step
        seen.append(expected)
    # Negative control: the steps differ, where they ought to.
    assert [a == b for a, b in zip(seen, seen[1:])] == [False, True, False, False, False, False, False, False]


def test_only_rows_whose_color_differs_are_sent(sync):
    many = 1000
    columns = dict(ids=np.arange(many), visible=[True] * many, group=np.arange(many) % 2)
    made, color, module = sync.label_style.MadeGroups(), np.full((many, 4), 0.5), Module()
    look = lambda **over: dataclasses.replace(style(sync, color=color, **(columns | over)), made=made).groups(module)  # noqa: E731
    first = look()
    assert not hasattr(first, "sent") and look() is first
    color[[3, 700], [0, 2]] = 0.25
    assert look().sent == 2 and np.array_equal(look().colors, np.float32(color))
    assert not hasattr(look(group=np.zeros(many)), "sent"), "labels of another group are sent with all others"


@pytest.mark.parametrize("name", CUT_CASES)
def test_a_cut_never_names_a_volume_that_is_not_there(sync, name):
    check_changes(sync, CUT_CASES[name], cuts=[sync.parts.PlacedCut({"plane": 1}, ((1,),))])


@pytest.mark.parametrize("name", CASES)
def test_the_changes_make_the_new_scene_and_no_more(sync, name):
    check_changes(sync, CASES[name])


def check_changes(sync, case, **over):
    """Checks the edits from a scene to the changed one."""
    change, kinds, labels = case
    old = scene(sync, **over)
    new = scene(sync, **{**over, **change(sync, old.placed)})
    numbers = {(1,): 1, (2,): 2}
    styles = {number: old.placed[key].style for key, number in numbers.items()}
    changes = sync.edits.between(old, new, numbers)
    assert [e["edit"] for e in changes.edits] == kinds
    assert [(number, shown, looks) for number, _, shown, looks in changes.labels] == ([(2, *labels)] if labels else [])

    for key in changes.removed:
        del numbers[key]
    for number, key in enumerate(changes.added, start=3):
        numbers[key] = number
        styles[number] = new.placed[key].style
    got = apply(old.scene({(1,): 1, (2,): 2}), styles, changes, new, numbers)
    assert got == new.scene(numbers)
    for key, number in numbers.items():
        assert looks(styles[number]) == looks(new.placed[key].style)
