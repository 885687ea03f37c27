# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds what to send when a scene has changed: edits of the parts that differ, and nothing else.

    a part differs                          one edit of that part
    an instance differs                     one edit for each of: place, show, material, auto_color, label_materials
    an instance is gone                     remove
    an instance is new, or has another      remove and add: it needs its volume, so it is not an edit
    volume than before
    a mesh differs                          one edit for each of: place_mesh, mesh_materials
    a mesh is gone                          remove_mesh
    a mesh is new, or has other triangles   add_mesh, which replaces

Labels' materials are a table that may be long: only its rows that differ are sent, `None` for those that are gone.
"""

from dataclasses import dataclass, field

SINGLE_PARTS = ("camera", "film", "world", "suns", "lights", "cuts", "settings")


@dataclass
class Changes:
    """Edits for `Session.edit`, keys of instances for `Session.add`, and of meshes for `Session.add_mesh`."""

    edits: list = field(default_factory=list)
    added: list = field(default_factory=list)
    removed: list = field(default_factory=list)
    added_meshes: list = field(default_factory=list)

    def __bool__(self):
        return bool(self.edits or self.added or self.added_meshes)


def between(old, new, numbers):
    """The changes that turn `old` into `new`; `numbers` are the numbers of the instances by key, as they were sent."""
    changes = Changes()
    for part in SINGLE_PARTS:
        value = getattr(new, part)
        if value != getattr(old, part):
            changes.edits.append({"edit": part, part: value})
    for key, before in old.placed.items():
        after = new.placed.get(key)
        if after is None or after.source != before.source:
            changes.edits.append({"edit": "remove", "id": numbers[key]})
            changes.removed.append(key)
        elif after is not before:
            changes.edits += _of_instance(numbers[key], before, after)
    kept = set(old.placed) - set(changes.removed)
    changes.added = sorted(key for key in new.placed if key not in kept)
    for key, before in old.meshes.items():
        after = new.meshes.get(key)
        if after is None:
            changes.edits.append({"edit": "remove_mesh", "id": numbers[key]})
            changes.removed.append(key)
        elif after.geometry is not before.geometry or after.shadow_catcher != before.shadow_catcher:
            changes.added_meshes.append(key)
        else:
            changes.edits += _of_mesh(numbers[key], before, after)
    changes.added_meshes += [key for key in new.meshes if key not in old.meshes]
    changes.added_meshes.sort()
    return changes


def _of_mesh(number, before, after):
    edits = []
    if after.world_from_mesh != before.world_from_mesh:
        edits.append({"edit": "place_mesh", "id": number, "world_from_mesh": after.world_from_mesh})
    if after.materials != before.materials:
        edits.append({"edit": "mesh_materials", "id": number, "materials": after.materials})
    return edits


def _of_instance(number, before, after):
    edits = []
    if after.world_from_index != before.world_from_index:
        edits.append({"edit": "place", "id": number, "world_from_index": after.world_from_index})
    for part in ("show", "material", "auto_color"):
        value = after.style[part]
        if value != before.style[part]:
            edits.append({"edit": part, "id": number, part: value})
    rows = changed_rows(before.style["materials"], after.style["materials"])
    if rows:
        edits.append({"edit": "label_materials", "id": number, "materials": rows})
    return edits


def changed_rows(before, after):
    """The rows of `after` that differ from `before`, and None for those that were removed."""
    if after is before:
        return {}
    rows = {label: material for label, material in after.items() if before.get(label) != material}
    rows.update({label: None for label in before if label not in after})
    return rows
