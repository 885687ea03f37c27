# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the outline of selected objects: its mask against a naive loop, which instances are selected, when it is made anew."""

import numpy as np
import pytest

from test_label_outline import filled
from test_real_volumes import load


@pytest.fixture
def outline(extension):
    return load(extension, "object_outline")


def naive(instance, chosen):
    height, width = instance.shape
    out = np.zeros((height, width), dtype=np.uint8)
    for y in range(height):
        for x in range(width):
            around = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)]
            others = [instance[v, u] for u, v in around if 0 <= u < width and 0 <= v < height and instance[v, u] != instance[y, x]]
            mine = chosen.get(int(instance[y, x]), 0)
            if others:
                out[y, x] = mine or max(chosen.get(int(other), 0) for other in others)
    return out


def test_the_mask_is_that_of_a_naive_loop(outline):
    rng, total = np.random.default_rng(3), {1: 0, 2: 0}
    for patch, size in ((4, (28, 20)), (1, (17, 9)), (1, (1, 1)), (2, (2, 40))):
        instance = rng.integers(0, 5, (size[0] // patch + 1, size[1] // patch + 1)).astype(np.uint32)
        instance = instance.repeat(patch, axis=0).repeat(patch, axis=1)[: size[0], : size[1]].copy()
        for chosen in ({1: 1, 2: 2}, {4: 2}, {3: 1, 90: 1}, {}):
            found, expected = outline.mask(instance, chosen), naive(instance, chosen)
            assert np.array_equal(found, expected)
            for state in total:
                total[state] += (expected == state).sum()
            if (expected == 2).any():
                assert not np.array_equal(outline.mask(instance, dict.fromkeys(chosen, 1)), expected), "the comparison notices a color"
                assert not np.array_equal(outline.mask(np.roll(instance, 1, 1), chosen), expected), "the comparison notices a shift"
    assert min(total.values()) > 100


def test_instances_are_selected_with_what_makes_them(outline):
    owners = {1: 10, 2: 20, 3: 20, 4: 30}
    assert outline.states(owners, {10, 20}, 20) == {1: 1, 2: 2, 3: 2}
    assert outline.states(owners, {10}, 30) == {1: 1}, "an active object that is not selected has no outline"
    assert outline.states(owners, set(), 10) == {}


def test_owners_are_objects_and_instancers(extension):
    import types

    sent = types.SimpleNamespace(placed={(7,): None, (9, 7, 0): None}, meshes={(8,): None})
    shown = types.SimpleNamespace(sent=sent, numbers={(7,): 1, (9, 7, 0): 2, (8,): 3, (6,): 4})
    film = load(extension, "label_film")
    assert film.owners_of(shown) == {1: 7, 2: 9, 3: 8}
    assert film.owners_of(types.SimpleNamespace(sent=None, numbers={})) == {}


def test_objects_in_other_modes_have_no_outline(blender, outline):
    bpy = blender
    for name in ("one", "two"):
        obj = bpy.data.objects.new(name, bpy.data.meshes.new(name))
        bpy.context.collection.objects.link(obj)
        obj.select_set(True)
    bpy.context.view_layer.objects.active = bpy.data.objects["two"]
    uids = {name: bpy.data.objects[name].session_uid for name in ("one", "two")}
    assert outline.selection(bpy.context) == (set(uids.values()), uids["two"])
    bpy.ops.object.mode_set(mode="EDIT")
    chosen, _ = outline.selection(bpy.context)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert uids["two"] not in chosen


def test_the_rectangles_are_made_anew_for_another_film_or_selection_alone(outline, monkeypatch):
    made = []
    monkeypatch.setattr(outline.gpu.shader, "from_builtin", lambda name: name)
    monkeypatch.setattr(outline, "batch_for_shader", lambda *arguments, **named: made.append((arguments, named)) or len(made))
    pixels = np.zeros((12, 16, 2), dtype=np.uint32)
    pixels[3:6, 5:9, 0], pixels[7:9, 5:9, 0] = 1, 2
    one = outline.Outline()
    one.update(pixels, {1: 1, 2: 2})
    expected = outline.mask(pixels[..., 0], {1: 1, 2: 2})
    for (arguments, named), state in zip(made, (1, 2), strict=True):
        assert np.array_equal(filled(arguments[2]["pos"], named["indices"], (12, 16)), expected == state)
    one.update(pixels[:], {1: 1, 2: 2})
    assert len(made) == 2, "the same film and selection"
    one.update(pixels, {1: 2})
    one.update(pixels.copy(), {1: 2})
    assert len(made) == 4, "another selection, another film"
    one.update(pixels, {})
    assert one._batches == {} and len(made) == 4
