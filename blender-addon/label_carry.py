# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What labels have goes from one table to another by id: when a volume is reloaded, and when the next volume of a series is imported.

    kept      a label with this id is in both tables: it has the columns of the former table (color, visibility, group, selection, numbers)
    new       only the new volume has the id: its color is the file's, or the one that is farthest from those of its neighbors; its group is
              that of the kept labels of its type, where these are in one group, else the first
    gone      only the former table has the id: nothing is left of it

Numbers of voxels, bounds and columns that the new volume has itself are the new volume's. Whole columns are copied, so that 10⁵ labels take a
fraction of a second.
"""

from typing import NamedTuple

import numpy as np

from . import label_table

# Columns that describe a volume, and no choice of the user's.
OF_VOLUME = {"id_low", "id_high", "voxels", "type", "position"}
# Field, numbers and kind of the numbers of an attribute, by its type.
COLUMN_TYPES = {
    "INT": ("value", 1, np.int32),
    "FLOAT": ("value", 1, np.float32),
    "BOOLEAN": ("value", 1, bool),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
}


class Match(NamedTuple):
    """Rows of labels that are in both tables, in `new` and in `old` side by side; ids that only one of them has."""

    new_rows: np.ndarray
    old_rows: np.ndarray
    added: np.ndarray
    gone: np.ndarray


def match(old, new):
    """Which labels of two tables have the same ids."""
    before, now = label_table.ids(old), label_table.ids(new)
    _, new_rows, old_rows = np.intersect1d(now, before, assume_unique=True, return_indices=True)
    return Match(new_rows, old_rows, np.setdiff1d(now, before, assume_unique=True), np.setdiff1d(before, now, assume_unique=True))


def colors(old, new, volume):
    """Gives the labels of a table the colors that the same ids have in another, and new ones a color unlike their neighbors'. Returns the
    `Match`."""
    same = match(old, new)
    color, own = label_table.colors(new)[:, :3], label_table.own_color(new)
    known = np.where(own[:, None], color, np.float32(np.nan))
    known[same.new_rows] = label_table.colors(old)[same.old_rows, :3]
    own[same.new_rows] = label_table.own_color(old)[same.old_rows]
    label_table.set_color(new, slice(None), volume.labels.auto_colors(known=known), own=own)
    return same


def everything(old, new, volume):
    """Gives the labels of a reloaded volume's table all that the same ids have in the former table. Returns (`Match`, names of columns that
    are not kept)."""
    same, left_out = colors(old, new, volume), []
    of_file = set(getattr(volume.labels, "columns", {}))
    for attribute in old.attributes:
        name = attribute.name
        if name in OF_VOLUME or name in ("color", "own_color") or name in of_file or attribute.is_internal:
            continue
        if attribute.domain != "POINT" or attribute.data_type not in COLUMN_TYPES:
            left_out.append(name)
            continue
        _copy_column(attribute, new, same)
    label_table.set_names(new, _texts(label_table.names(old), label_table.names(new), same, len(new.vertices)))
    label_table.set_types(new, _texts(_types(old), _types(new), same, len(new.vertices)))
    _join_types(new, same)
    return same, left_out


def _join_types(new, same):
    """Puts new labels into the group of the kept labels of their type, where all of these are in one."""
    kinds = label_table.type_names(new)
    if not kinds:
        return
    slots, of, is_new = label_table.slots(new), label_table.types(new), np.ones(len(new.vertices), dtype=bool)
    is_new[same.new_rows] = False
    lowest, highest = np.full(len(kinds), np.iinfo(np.int32).max), np.full(len(kinds), -1)
    np.minimum.at(lowest, of[~is_new], slots[~is_new])
    np.maximum.at(highest, of[~is_new], slots[~is_new])
    rows = np.flatnonzero(is_new & (lowest == highest)[of])
    label_table.set_slots(new, rows, lowest[of[rows]])


def _copy_column(attribute, new, same):
    field, width, kind = COLUMN_TYPES[attribute.data_type]
    before = np.empty(len(attribute.data) * width, dtype=kind)
    attribute.data.foreach_get(field, before)
    there = new.attributes.get(attribute.name)
    if there is None or there.data_type != attribute.data_type:
        if there is not None:
            new.attributes.remove(there)
        there = new.attributes.new(attribute.name, attribute.data_type, "POINT")
        # A number that nobody gave is none, as in a table that was imported.
        now = np.full(len(new.vertices) * width, np.nan if kind == np.float32 and width == 1 else 0, dtype=kind)
    else:
        now = np.empty(len(new.vertices) * width, dtype=kind)
        there.data.foreach_get(field, now)
    now.reshape(-1, width)[same.new_rows] = before.reshape(-1, width)[same.old_rows]
    if len(now):
        there.data.foreach_set(field, now)


def _texts(before, now, same, count):
    """Texts by row of the new table: those of the former where it has one."""
    texts = list(now) or [""] * count
    if before:
        for new_row, old_row in zip(same.new_rows.tolist(), same.old_rows.tolist()):
            texts[new_row] = before[old_row] or texts[new_row]
    return texts


def _types(mesh):
    """The types by row, as texts; empty where no label has one."""
    kinds = label_table.type_names(mesh)
    return [kinds[place] for place in label_table.types(mesh).tolist()] if kinds else []
