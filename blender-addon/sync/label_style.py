# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the labels of a volume look: a group of labels for each material slot, and for each label its group, its color and whether it is drawn.

    label table ──► columns (numpy, one value a label) ──► pumice.LabelGroups ──► scene: groups of the instance's style
    material slots ──► materials, one a group ─────────────┘

Columns travel as arrays: an edit makes no object for a single label, and a change of a material sends the material alone. Where colors alone
differ from the groups that were made before, only the rows that differ travel.
"""

import weakref
from dataclasses import dataclass, field, fields

import numpy as np

from .surface import PLAIN


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of a label table, in its order: ids (uint64, rising), whether each is drawn, its group (uint32), its linear color (n, 4)."""

    ids: np.ndarray
    visible: np.ndarray
    group: np.ndarray
    color: np.ndarray

    def same_groups(self, other):
        """Whether all labels have the same groups and colors."""
        rows = self.recolored(other)
        return rows is not None and not len(rows)

    def unless_changed(self, kept):
        """These columns with the arrays of others, `kept`, where they are equal; `kept` itself where all are. What compares columns later
        then finds the same arrays, and need not look into them."""
        arrays = [(getattr(kept, column.name), getattr(self, column.name)) for column in fields(self)]
        is_same = [_same([old], [new]) for old, new in arrays[:-1]]
        is_same.append(len(self.color) == len(kept.color) and not len(_rows_of_other_colors(self.color, kept.color)))
        return kept if all(is_same) else Columns(*(old if same else new for same, (old, new) in zip(is_same, arrays)))

    def same_visible(self, other):
        """Whether the same labels are drawn."""
        return _same((self.visible, self.ids), (other.visible, other.ids))

    def recolored(self, other):
        """The rows whose colors differ from those of `other`; None where the ids or the groups differ."""
        if not _same((self.ids, self.group), (other.ids, other.group)):
            return None
        return _rows_of_other_colors(self.color, other.color)


def _same(some, others):
    return all(a is b or np.array_equal(a, b) for a, b in zip(some, others))


# Weak references to the two arrays that were compared last, and the rows.
_compared = (lambda: None, lambda: None, None)


def _rows_of_other_colors(color, former):
    """The rows in which two arrays of equally many colors differ. Reading, finding the edits and sending them ask the same, so the last answer
    is kept: nothing writes into columns."""
    global _compared
    if color is former:
        return np.zeros(0, dtype=int)
    one, other, rows = _compared
    if one() is not color or other() is not former:
        # Four numbers are two of 64 bits, which is half of the work, and tells apart what is equal as numbers: that only sends a row more.
        differ = np.ascontiguousarray(color).view(np.uint64) != np.ascontiguousarray(former).view(np.uint64)
        rows = np.flatnonzero(differ.view(np.uint16))
        _compared = weakref.ref(color), weakref.ref(former), rows
    return rows


def with_rows(former, rows, colors):
    """Colors (n, 4) with others in some rows, which rise; `former` itself where they are the same. Which rows differ is known then."""
    global _compared
    differ = rows[(former[rows] != colors).any(axis=1)]
    if not len(differ):
        return former
    color = former.copy()
    color[rows] = colors
    _compared = weakref.ref(color), weakref.ref(former), differ
    return color


class MadeGroups:
    """The groups that were made last of the labels of a volume object, from which the next ones are made where only colors differ."""

    def __init__(self):
        self._materials = self._columns = self._groups = None

    def of(self, materials, columns, pumice):
        """The `pumice.LabelGroups` of these materials, as `LabelStyle` has them, and columns."""
        rows = columns.recolored(self._columns) if self._materials == materials else None
        if rows is None:
            dresses, colored = zip(*materials)
            self._groups = pumice.LabelGroups(columns.ids, columns.group, columns.color, dresses, colored=colored)
        elif len(rows):
            self._groups = self._groups.with_colors(columns.ids[rows], columns.color[rows])
        self._materials, self._columns = materials, columns
        return self._groups


@dataclass(frozen=True, eq=False)
class LabelStyle:
    """The look of all labels: (fields of the material, whether labels' colors replace its base color) for each group; the columns, or None
    for a volume without a table, whose labels all have the first material; and what earlier looks of the same object have made."""

    materials: tuple
    columns: Columns | None = None
    made: MadeGroups = field(default_factory=MadeGroups)

    def fields(self):
        """The style of the scene's JSON form, without the groups."""
        material, colored = self.materials[0] if self.columns is None else (PLAIN, False)
        return {"show": "all", "material": dict(material), "auto_color": colored, "materials": {}}

    def visible(self):
        """Which labels are drawn, as `pumice.Scene.with_labels` takes it."""
        return (self.columns.ids, self.columns.visible)

    def groups(self, pumice):
        """The groups as `pumice.Scene.with_labels` takes them."""
        return self.made.of(self.materials, self.columns, pumice)

    def on(self, scene, number, pumice):
        """A `pumice.Scene` with this look of the labels of an instance."""
        if self.columns is None:
            return scene
        return scene.with_labels(number, visible=self.visible(), groups=self.groups(pumice))
