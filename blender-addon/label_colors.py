# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Palettes for the labels of a table: linear Rec. 709 colors, one for each row."""

import numpy as np

from . import label_table
from .reports import Refused

PALETTES = (
    ("NEIGHBORS", "Unlike Neighbors", "Labels that touch get colors that differ, also for color-blind eyes", 0),
    ("TYPE", "By Type", "A color for each type of the label table", 1),
    ("NUMBER", "By Number", "A column of numbers, from dark blue (lowest) to yellow (highest): the color map viridis", 2),
)
# Nine sRGB steps of viridis (N. Smith, S. van der Walt, E. Firing; CC0).
VIRIDIS = np.array(
    [
        (68, 1, 84),
        (71, 44, 122),
        (59, 81, 139),
        (44, 113, 142),
        (33, 144, 141),
        (39, 173, 129),
        (92, 200, 99),
        (170, 220, 50),
        (253, 231, 37),
    ]
)
# Lightness and chroma of the colors of types in OKLCH, and the step of their hue: the golden angle keeps any number of them apart.
LIGHTNESS, CHROMA, HUE_STEP_DEG = 0.72, 0.13, 137.50776405
UNTYPED = (0.4, 0.4, 0.4)


def palette(which, table, of_neighbors, column):
    """Colors (n, 3) of a palette for all rows; `of_neighbors` makes those that differ between neighbors. Raises Refused."""
    if which == "NEIGHBORS":
        return of_neighbors()
    if which == "TYPE":
        names, types = label_table.type_names(table), label_table.types(table)
        if not names:
            raise Refused("By Type: no label of the table has a type")
        return np.array([hue(place) if name else UNTYPED for place, name in enumerate(names)])[types]
    numbers = label_table.numbers(table)
    if column not in numbers:
        raise Refused(f"By Number: the table has no column {column!r}; it has {', '.join(sorted(numbers))}")
    return by_number(numbers[column])


def by_number(values):
    """Colors along viridis, from the lowest to the highest number; those that are no number have a grey."""
    values = np.asarray(values, dtype=float)
    known = np.isfinite(values)
    low, high = (values[known].min(), values[known].max()) if known.any() else (0.0, 0.0)
    place = np.zeros(len(values))
    place[known] = (values[known] - low) / (high - low) if high > low else 0.5
    steps = np.linspace(0.0, 1.0, len(VIRIDIS))
    srgb = np.stack([np.interp(place, steps, VIRIDIS[:, axis] / 255.0) for axis in range(3)], axis=1)
    out = label_table.linear_from_srgb(srgb)
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
