# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the outline of selected labels: its mask against a naive loop, the rectangles against the mask, when it is made anew."""

import numpy as np
import pytest

from test_real_volumes import load


@pytest.fixture
def outline(extension):
    return load(extension, "label_outline")


def naive(pixels, selections):
    """A pixel is in the outline if one of its four neighbors sees something else, and it or that neighbor sees a selected label."""

    def selected(x, y):
        instance, label = pixels[y, x]
        return label > 0 and any(instance in numbers and label <= len(flags) and flags[label - 1] for numbers, flags in selections)

    height, width = pixels.shape[:2]
    out = np.zeros((height, width), dtype=bool)
    for y in range(height):
        for x in range(width):
            for u, v in ((x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)):
                if 0 <= u < width and 0 <= v < height and tuple(pixels[y, x]) != tuple(pixels[v, u]):
                    out[y, x] |= selected(x, y) or selected(u, v)
    return out


def films():
    """Random films: of large patches, and of single pixels; some labels are beyond their table."""
    rng = np.random.default_rng(4)
    for patch, size in ((4, (28, 20)), (1, (17, 9)), (1, (1, 1)), (2, (2, 40))):
        labels = rng.integers(0, 5, (size[0] // patch + 1, size[1] // patch + 1, 2)).astype(np.uint32)
        labels[labels.min(axis=2) == 0] = 0
        pixels = labels.repeat(patch, axis=0).repeat(patch, axis=1)[: size[0], : size[1]].copy()
        yield pixels, [([1, 4], np.array([True, False, True])), ([3, 90], np.array([False, True, False, True, True]))]
        yield pixels, [([2], np.array([False, False, False, True]))]


def test_the_mask_is_that_of_a_naive_loop(outline):
    total = 0
    for pixels, selections in films():
        found, expected = outline.mask(pixels, selections), naive(pixels, selections)
        assert np.array_equal(found, expected)
        total += expected.sum()
        if expected.any():
            assert not np.array_equal(outline.mask(pixels, selections[:-1]), expected), "the comparison notices a label"
    assert total > 200


def test_a_mask_without_a_selected_label_is_empty(outline):
    pixels = np.ones((4, 5, 2), dtype=np.uint32)
    assert not outline.mask(pixels, []).any()
    assert not outline.mask(pixels, [([1], np.array([True]))]).any(), "a label that fills the picture has no edge"
    assert all(len(part) == 0 for part in outline.rectangles(np.zeros((4, 5), dtype=bool)))


def filled(corners, triangles, shape):
    """How often each pixel's center lies in a triangle, rows from the top; by the signs of cross products."""
    height, width = shape
    x, y = np.meshgrid(np.arange(width) + 0.5, height - 0.5 - np.arange(height))
    count = np.zeros(shape, dtype=int)
    for a, b, c in corners[triangles].astype(float):
        # The center of a pixel may lie on a diagonal: moved by less than any other distance here, it lies on one side.
        u, v = x + 1e-4, y + 3e-4
        sides = [(q[0] - p[0]) * (v - p[1]) - (q[1] - p[1]) * (u - p[0]) for p, q in ((a, b), (b, c), (c, a))]
        count += np.all(np.sign(sides) == np.sign(sides[0]), axis=0)
    return count


def test_the_rectangles_cover_each_pixel_of_the_mask_once_and_no_other(outline):
    rng = np.random.default_rng(7)
    for shape in ((1, 1), (5, 9), (12, 3), (8, 8)):
        for share in (0.0, 0.3, 0.8, 1.0):
            edges = rng.random(shape) < share
            corners, triangles = outline.rectangles(edges)
            assert corners.shape[1] == 3 and not corners[:, 2].any()
            assert np.array_equal(filled(corners, triangles, shape), edges)
            if edges.any():
                assert not np.array_equal(filled(corners + [1, 0, 0], triangles, shape), edges), "the comparison notices a shift"


def test_the_rectangles_are_made_anew_for_another_film_or_selection_alone(outline, monkeypatch):
    made = []
    monkeypatch.setattr(outline.gpu.shader, "from_builtin", lambda name: name)
    monkeypatch.setattr(outline, "batch_for_shader", lambda *arguments, **named: made.append((arguments, named)) or len(made))
    pixels = np.zeros((12, 16, 2), dtype=np.uint32)
    pixels[3:6, 5:9] = (1, 1)
    pixels[5, 7:9] = 0
    one = outline.Outline()
    one.update(pixels, [([1], np.array([True]))])
    (shader, form, content), named = made[0]
    assert (shader, form) == ("UNIFORM_COLOR", "TRIS")
    assert np.array_equal(filled(content["pos"], named["indices"], (12, 16)), outline.mask(pixels, [([1], np.array([True]))]))
    one.update(pixels[:], [([1], np.array([True]))])
    assert len(made) == 1, "the same film and selection"
    one.update(pixels, [([1], np.array([True])), ([2], np.array([True]))])
    one.update(pixels.copy(), [([1], np.array([True])), ([2], np.array([True]))])
    assert len(made) == 3, "another selection, another film"
    one.update(pixels, [([1], np.array([False]))])
    assert one._batch is None and len(made) == 3


def test_undo_draws_the_outline_again(blender, outline):
    for handlers in (blender.app.handlers.undo_post, blender.app.handlers.redo_post):
        assert outline._redraw in handlers
