# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reload: reads the source of the active volume again, after it has changed, and keeps what was done to the volume and its labels.

    source ──► compressed form, as for an import (thread, progress, ESC) ──► proxy in the same mesh   what was applied to it stays applied
                                                                             label table              by id, see `label_carry`
                                                                             place                    where the file says now

Of a source on a server, only what describes the store tells whether it has changed. Linked duplicates follow, because they share the mesh. The compressed form from before stays beside the source: undo shows it again.
"""

import json
import os

import bpy
import numpy as np

from . import file_paths, label_carry, label_table, native, online_access, opening, proxy_update, registry, time_settings, viewport, volume_object, volume_place
from .background import InBackground, Work
from .properties import is_volume
from .reports import Refused

# Most ids that are named in one line.
MOST_IDS = 8


class PUMICE_OT_reload(InBackground, bpy.types.Operator):
    """Read the changed source of the volume again; labels keep color, group, visibility and name by id. Takes as long as the import"""

    bl_idname = "pumice.reload"
    bl_label = "Reload Volume"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        if context.object is None or not is_volume(context.object):
            cls.poll_message_set("The active object is no volume")
            return False
        return True

    def invoke(self, context, event):
        self._interactive = True
        return self.execute(context)

    def begin(self, context):
        obj = context.object
        owner = next((block for block in (obj, obj.data, obj.pumice.table) if block is not None and block.library is not None), None)
        if owner is not None:
            raise Refused(f"{obj.name}: {owner.name} is linked from {owner.library.filepath}; reload it in that file")
        if obj.mode != "OBJECT":
            raise Refused(f"{obj.name}: leave {obj.mode.lower()} mode first, because Reload replaces the mesh")
        if obj.pumice.table is None:
            raise Refused(f"{obj.name}: it has no label table to keep; import the volume instead")
        name = "source_path" if obj.pumice.source_path else "filepath"
        source, elsewhere = file_paths.find(obj, name)
        online_access.check([source])
        if not native.is_on_server(source) and not os.path.exists(source):
            raise Refused(f"{source}: the source is missing; set Source in the object's Pumice panel")
        if elsewhere:
            self.report({"WARNING"}, elsewhere)
        self._obj = obj.name
        choice = json.loads(obj.get("pumice_choice", "{}"))
        folder = bpy.utils.extension_path_user(__package__, path="volumes", create=False)
        played = [time_settings.playback(obj), time_settings.now(context.scene)] if time_settings.is_series(obj) else []
        wanted = [opening.Wanted(source, choice, folder, *played, memory=registry.page_memory())]
        call = lambda job, tell: opening.open_all(wanted, job, tell)  # noqa: E731
        return Work("Reading", call, tells=True, asks_server=opening.asks_server(wanted))

    def finish(self, context, opened):
        [one] = opened
        volume, filepath = one.volume, one.filepath
        obj = bpy.data.objects.get(self._obj)
        if obj is None or not is_volume(obj):
            raise Refused(f"{self._obj}: the object was deleted or renamed while its source was read; nothing is reloaded")
        for line in one.warnings:
            self.report({"WARNING"}, line)
        registry.adopt(filepath, volume)
        is_same = volume.time_steps is None and obj.pumice.content_hash == volume.content_hash and len(obj.pumice.table.vertices) == len(volume.labels.ids)
        users = [other for other in bpy.data.objects if other.data == obj.data]
        same, left_out = _relabel(obj, users, volume)
        applied, off_voxels = _applied(obj, volume)
        if off_voxels > volume_place.MOST_OFF_VOXELS:
            self.report({"WARNING"}, f"{obj.name}: its mesh was edited; Reload has made it anew")
        for other in users:
            other.pumice.filepath = filepath
            volume_object.describe(other, volume)
            time_settings.describe(other, volume)
            other.update_tag()
        proxy_update.refresh(obj, volume, applied)
        registry.forget_unused()
        viewport.redraw_all()
        for name in left_out:
            self.report({"WARNING"}, f"{obj.name}: column {name} of the label table is not kept; it is neither numbers, flags nor colors")
        self.report({"INFO"}, f"{obj.name}: {said(same)}" + ("; its voxels are as before" if is_same else ""))


def said(same):
    """Which labels are new and which are gone, in one line."""
    parts = [f"{len(ids):,} {what} ({listed(ids)})" if len(ids) else f"none {what}" for ids, what in ((same.added, "new"), (same.gone, "gone"))]
    return f"{len(same.new_rows):,} labels kept, {', '.join(parts)}"


def listed(ids):
    """The first ids, and how many there are beyond them."""
    more = f" and {len(ids) - MOST_IDS:,} more" if len(ids) > MOST_IDS else ""
    return ", ".join(map(str, ids[:MOST_IDS].tolist())) + more


def _relabel(obj, users, volume):
    """Makes the label table anew; returns (`label_carry.Match`, columns that are not kept)."""
    former = obj.pumice.table
    table = label_table.create(obj.name, volume.labels)
    found = label_carry.everything(former, table, volume)
    name = former.name
    for other in users:
        other.pumice.table = table
    if former.users == 0:
        bpy.data.meshes.remove(former)
        table.name = name
    return found


def _applied(obj, volume):
    """What was applied to the mesh of an object, and where the file is now: the map from voxels to the object's space, (4, 4); and how far the
    mesh was edited, in voxels."""
    found = volume_place.fit(obj.data) or volume_place.Fit(np.eye(4), np.inf)
    before, applied = volume_object.file_from_index(obj), found.object_from_index
    if before is not None:
        applied = applied @ np.linalg.inv(before) @ volume.world_from_index
    return applied, found.off_voxels


def register():
    bpy.utils.register_class(PUMICE_OT_reload)


def unregister():
    bpy.utils.unregister_class(PUMICE_OT_reload)
