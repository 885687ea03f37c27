# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds what to send when a scene has changed: edits of the parts that differ, and nothing else.

    a part differs                          one edit of that part
    an instance differs                     one edit of its place, and those of its style
    the material of a volume without a      material, auto_color
    label table differs
    the material of a group differs         group_material
    other labels are drawn                  `labels`, with the columns that say which
    groups or colors of labels differ       `labels`, with the columns of all of them
    an instance is gone                     remove
    an instance is new, or has another      remove and add: it needs its volume, so it is not an edit; a file that was
    volume than before                      reloaded is another volume, and so are another time step and more labels
    the cuts differ, or one cuts a volume   cuts; again after the volume is added, because edits name no volume that is not there
    that is gone or new
    a mesh differs                          one edit for each of: place_mesh, mesh_materials
    a mesh is gone                          remove_mesh
    a mesh is new, or has other triangles   add_mesh, which replaces

Labels are 10⁵ rows, so they are sent as columns, by `Session.set_labels`, and never as edits in JSON.
"""

from dataclasses import dataclass, field

SINGLE_PARTS = ("camera", "film", "world", "suns", "lights", "settings")


@dataclass
class Changes:
    """Edits for `Session.edit`, keys of instances for `Session.add`, and of meshes for `Session.add_mesh`; for `Session.set_labels` numbers
    of instances with their style, whether other labels are drawn, and whether groups or colors differ; and whether the cuts must be sent
    once more when the volumes are added."""

    edits: list = field(default_factory=list)
    labels: list = field(default_factory=list)
    added: list = field(default_factory=list)
    removed: list = field(default_factory=list)
    added_meshes: list = field(default_factory=list)
    cuts_name_added: bool = False

    def __bool__(self):
        return bool(self.edits or self.labels or self.added or self.added_meshes)


def between(old, new, numbers):
    """The changes that turn `old` into `new`; `numbers` are the numbers of the instances by key, as they were sent."""
    changes = Changes()
    for part in SINGLE_PARTS:
        value = getattr(new, part)
        if value != getattr(old, part):
            changes.edits.append({"edit": part, part: value})
    for key, before in old.placed.items():
        after = new.placed.get(key)
        if after is None or _volume(after) != _volume(before):
            changes.edits.append({"edit": "remove", "id": numbers[key]})
            changes.removed.append(key)
        elif after is not before:
            _of_instance(changes, numbers[key], before, after)
    kept = set(old.placed) - set(changes.removed)
    changes.added = sorted(key for key in new.placed if key not in kept)
    cuts = new.cuts_of(sorted(kept), numbers)
    if cuts != old.cuts_of(old.placed, numbers):
        changes.edits.append({"edit": "cuts", "cuts": cuts})
    changes.cuts_name_added = any(cut.volumes and not set(cut.volumes).isdisjoint(changes.added) for cut in new.cuts)
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


def _volume(placed):
    """What tells the volume of an instance from others."""
    return placed.file(), placed.content, placed.part


def _of_mesh(number, before, after):
    edits = []
    if after.world_from_mesh != before.world_from_mesh:
        edits.append({"edit": "place_mesh", "id": number, "world_from_mesh": after.world_from_mesh})
    if after.materials != before.materials:
        edits.append({"edit": "mesh_materials", "id": number, "materials": after.materials})
    return edits


def _of_instance(changes, number, before, after):
    if after.world_from_index != before.world_from_index:
        changes.edits.append({"edit": "place", "id": number, "world_from_index": after.world_from_index})
    old, new = before.style, after.style
    if new is old:
        return
    was, now = old.fields(), new.fields()
    for part in ("material", "auto_color"):
        if now[part] != was[part]:
            changes.edits.append({"edit": part, "id": number, part: now[part]})
    if new.columns is None:
        return
    visibility = old.columns is None or not new.columns.same_visible(old.columns)
    # Groups take their colors, or do not: then other columns are sent.
    colored = [[colored for _, colored in style.materials] for style in (old, new)]
    groups = old.columns is None or colored[0] != colored[1] or not new.columns.same_groups(old.columns)
    if visibility or groups:
        changes.labels.append((number, new, visibility, groups))
    if not groups:
        for group, ((former, _), (material, _)) in enumerate(zip(old.materials, new.materials)):
            if material != former:
                changes.edits.append({"edit": "group_material", "id": number, "group": group, "material": material})
