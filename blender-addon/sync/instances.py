# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume objects as instances of the scene.

An object's matrix is its `world_from_index` unchanged: its mesh, like the volume, has one unit per voxel. The style comes from the first
material slot and the label table. The table may be long, so its JSON form is cached and rebuilt only when a byte of the table differs.
"""

from .. import label_table, properties
from . import materials, matrix
from .parts import Placed


class Styles:
    """The last style of each volume object: reading it again gives the very same value while nothing changed."""

    def __init__(self):
        self._kept = {}

    def read(self, obj):
        """(style, what was left out) of an evaluated volume object. Its material may be animated, so the evaluated one counts;
        the table is the original's, which nothing animates and which edits reach at once."""
        slots = obj.material_slots
        material, by_label, left_out = materials.read(slots[0].material if slots else None)
        table = obj.original.pumice.table
        state = (material, by_label, _bytes(table))
        key = obj.original.session_uid
        kept = self._kept.get(key)
        if kept is None or kept[0] != state:
            kept = (state, _style(material, by_label, table))
            self._kept[key] = kept
        return kept[1], left_out


def placed(obj, world_from_index, styles, resolve):
    """(Placed, what was left out) of an evaluated volume object; `resolve` makes its path absolute."""
    style, left_out = styles.read(obj)
    volume = obj.original.pumice
    return Placed(resolve(volume.filepath), matrix.twelve(world_from_index), style, volume.content_hash, tuple(volume.dims)), left_out


def is_volume(obj):
    """Whether the object shows a volume."""
    return properties.is_volume(obj)


def _bytes(table):
    """The columns of the label table that affect the scene; None without a table."""
    if table is None:
        return None
    parts = (label_table.visible(table), label_table.own_color(table), label_table.colors(table))
    return b"".join(p.tobytes() for p in parts)


def _style(material, by_label, table):
    style = {"show": "all", "material": material, "auto_color": by_label, "materials": {}}
    if table is None:
        return style
    ids = label_table.ids(table)
    seen = label_table.visible(table)
    hidden = int(len(ids) - seen.sum())
    if hidden:
        # Whichever list is shorter.
        shown_only = 2 * hidden > len(ids)
        style["show"] = {"only": ids[seen].tolist()} if shown_only else {"except": ids[~seen].tolist()}
    if by_label:
        own = label_table.own_color(table)
        linear = label_table.colors(table)[own, :3].clip(0.0, 1.0).astype(float).tolist()
        style["materials"] = {
            str(label): dict(material, base_color=color) for label, color in zip(ids[own].tolist(), linear)
        }
    return style
