# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume objects as instances of the scene.

An object's matrix, times what was applied to its mesh (`volume_place`), is its `world_from_index`. Its material slots are the groups of its
labels, and its label table says to which of them each label belongs.
"""

import numpy as np

from .. import file_paths, label_table, properties, table_writes, time_settings, volume_place
from . import materials, matrix, object_rays
from .label_style import Columns, LabelStyle, MadeGroups, with_rows
from .parts import Placed

# The bits of 1 in single precision.
ONE_BITS = 0x3F800000


class Styles:
    """The last style of each volume object: reading it again gives the very same value while nothing changed.

    With `follows_writes`, a reading after writes of the extension itself takes these alone from a label table (`table_writes`). `owes_reading`
    says that the last one did: whoever reads then reads again soon."""

    def __init__(self, *, follows_writes=False):
        self._kept = {}
        self._follows_writes = follows_writes
        self._read = {}  # by object: (its table, number of slots, number of the last write before it was read)
        self.owes_reading = False

    def read(self, obj):
        """(style, what was left out) of an evaluated volume object. Its materials may be animated, so the evaluated ones count;
        the table is the original's, which nothing animates and which edits reach at once."""
        read = [materials.read(slot.material) for slot in obj.material_slots] or [materials.read(None)]
        dresses = tuple((fields, colored) for fields, colored, _ in read)
        left_out = [line for _, _, lines in read for line in lines]
        table = obj.original.pumice.table
        kept = self._kept.get(obj.original.session_uid)
        columns = self._columns(obj.original.session_uid, table, len(read), None if kept is None else kept.columns)
        if kept is not None and kept.columns is not None and columns is not None:
            columns = columns.unless_changed(kept.columns)
        if kept is None or kept.materials != dresses or kept.columns is not columns:
            made = MadeGroups() if kept is None else kept.made
            kept = self._kept[obj.original.session_uid] = LabelStyle(dresses, columns, made)
        if columns is not None:
            left_out += _unused(obj, columns.group)
        return kept, left_out


    def _columns(self, uid, table, slots, kept):
        """As `_columns`; where the extension's own writes alone came after an earlier reading, whose columns are `kept`, only they are read."""
        if not self._follows_writes or table is None:
            return _columns(table, slots)
        number = table_writes.now()
        *same, former = self._read.get(uid, (None, None, None))
        self._read[uid] = (table.session_uid, slots, number)
        is_known = kept is not None and same == [table.session_uid, slots] and len(table.vertices) == len(kept.ids)
        written = table_writes.since(table, former) if is_known else None
        if written is None:
            return _columns(table, slots)
        self.owes_reading = True
        visible = label_table.visible(table) if "visible" in written else kept.visible
        group = _groups(table, slots) if "slot" in written else kept.group
        color = kept.color
        if "color" in written:
            rows = written["color"]
            if rows is None:
                color = _colors(table)
            else:
                rows = np.unique(rows)
                color = with_rows(color, rows, _in_range(label_table.colors_of(table, rows)))
        return Columns(kept.ids, visible, group, color)


def left_out_of(obj):
    """What of a volume object's file, shape and materials is not drawn."""
    lines = [line for line in (file_paths.find(obj)[1],) if line] + _place(obj, obj.matrix_world)[1]
    lines += object_rays.left_out_of(obj, catches=False)
    lines += [line for slot in obj.material_slots for line in materials.read(slot.material)[2]]
    table = obj.pumice.table
    return lines if table is None else lines + _unused(obj, _groups(table, max(1, len(obj.material_slots))))


def placed(obj, world_from_object, styles, frame):
    """(Placed or None, what was left out) of an evaluated volume object at a frame; `world_from_object` is its matrix, or an instance's."""
    time_step = time_settings.shown(obj, frame)
    if time_step is None and time_settings.is_series(obj):
        return None, []
    world_from_index, left_out = _place(obj, world_from_object)
    path, elsewhere = file_paths.find(obj.original)
    left_out += [elsewhere] if elsewhere else []
    left_out += object_rays.left_out_of(obj, catches=False)
    if world_from_index is None:
        return None, left_out
    style, lines = styles.read(obj)
    volume = obj.original.pumice
    placed = Placed(path, matrix.twelve(world_from_index), style, volume.content_hash, tuple(volume.dims), time_step)
    return placed, left_out + lines


def _place(obj, world_from_object):
    """(map from voxels to the scene or None, what of the shape is not drawn)."""
    world_from_index, lines = volume_place.read(obj, world_from_object)
    if world_from_index is not None and not matrix.is_invertible(world_from_index):
        return None, [*lines, f"{obj.name}: scaled to nothing, so it is not drawn"]
    return world_from_index, lines


def is_volume(obj):
    """Whether the object shows a volume."""
    return properties.is_volume(obj)


def _columns(table, slots):
    """The columns of a label table that affect the scene; None without a table."""
    if table is None:
        return None
    return Columns(label_table.ids(table), label_table.visible(table), _groups(table, slots), _colors(table))


def _colors(table):
    return _in_range(label_table.colors(table))


def _in_range(color):
    """Colors from 0 to 1. Scripts alone exceed this range. The bits of a number above 1, below 0 or NaN, taken as a whole number, are above
    those of 1; to compare them takes a tenth of the time of clipping."""
    return color.clip(0.0, 1.0) if color.view(np.uint32).max(initial=0) > ONE_BITS else color


def _groups(table, slots):
    """The group of each label; as Blender does for faces, a slot that the object lacks is its last."""
    group = label_table.slots(table)
    # None is below 0, so the bits are those of the unsigned number.
    return np.minimum(group, slots - 1, out=group).view(np.uint32)


def _unused(obj, group):
    """A line for each material slot that no label uses, where there are several."""
    if len(obj.material_slots) < 2:
        return []
    used = np.bincount(group, minlength=len(obj.material_slots)) > 0
    return [
        f"{obj.name}: no label is in the group of slot {number} ({slot.name or 'empty'})"
        for number, (slot, is_used) in enumerate(zip(obj.material_slots, used), start=1)
        if not is_used
    ]
