# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Palettes for the labels of a table: linear Rec. 709 colors, one for each row."""

import numpy as np

from . import color_ramp, label_table, native
from .reports import Refused

PALETTES = (
    ("NEIGHBORS", "Unlike Neighbors", "Labels that touch get colors that differ, also for color-blind eyes", 0),
    ("TYPE", "By Type", "A color for each type of the label table", 1),
    ("NUMBER", "By Number", "A column of numbers, along a color map or the color ramp of the scene", 2),
    ("GLASBEY", "Distinct", "Each label gets a color as far as possible from the former ones; 256 of them, then again", 3),
    ("SAFE", "Color-Blind Safe", "The same for eyes without red or green cones: 12 labels or fewer are told apart well", 4),
)
# Lightness and chroma of the colors of types in OKLCH, and the step of their hue: the golden angle keeps any number of them apart.
LIGHTNESS, CHROMA, HUE_STEP_DEG = 0.72, 0.13, 137.50776405
UNTYPED = (0.4, 0.4, 0.4)
# As many as `pumice.distinct_colors` has.
MOST_DISTINCT = 256


def palette(which, table, rows, of_neighbors, along):
    """Colors (n, 3) of a palette for rows of a table. `of_neighbors()` are colors of all labels that differ between neighbors; `along` is
    (column, color map, scene) for the palette NUMBER. Raises Refused."""
    if which == "NEIGHBORS":
        return of_neighbors()[rows]
    if which in ("GLASBEY", "SAFE"):
        count = min(len(rows), MOST_DISTINCT)
        return native.require().distinct_colors(count, color_blind_safe=which == "SAFE")[np.arange(len(rows)) % max(1, count)]
    if which == "TYPE":
        names, types = label_table.type_names(table), label_table.types(table)
        if not names:
            raise Refused("By Type: no label of the table has a type")
        return np.array([hue(place) if name else UNTYPED for place, name in enumerate(names)])[types[rows]]
    (column, color_map, scene), numbers = along, label_table.numbers(table)
    if column not in numbers:
        raise Refused(f"By Number: the table has no column {column!r}; it has {', '.join(sorted(numbers))}")
    return by_number(numbers[column], color_map, scene)[rows]


def by_number(values, color_map, scene):
    """Colors along a color map, from the lowest to the highest number; those that are no number have a grey."""
    values = np.asarray(values, dtype=float)
    known = np.isfinite(values)
    low, high = (values[known].min(), values[known].max()) if known.any() else (0.0, 0.0)
    place = np.zeros(len(values))
    place[known] = (values[known] - low) / (high - low) if high > low else 0.5
    out = color_ramp.colors(color_map, place, scene)
    out[~known] = UNTYPED
    return out


def hue(number):
    """The color with this number, from 0: equal lightness and chroma, hues apart by the golden angle. (OKLab: B. Ottosson, 2020.)"""
    angle = np.radians(number * HUE_STEP_DEG)
    a, b = CHROMA * np.cos(angle), CHROMA * np.sin(angle)
    l, m, s = (
        (LIGHTNESS + 0.3963377774 * a + 0.2158037573 * b) ** 3,
        (LIGHTNESS - 0.1055613458 * a - 0.0638541728 * b) ** 3,
        (LIGHTNESS - 0.0894841775 * a - 1.2914855480 * b) ** 3,
    )
    rgb = (
        4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
        -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
        -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s,
    )
    return tuple(float(np.clip(c, 0.0, 1.0)) for c in rgb)
