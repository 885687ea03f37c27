# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Selects labels by what the picture shows of them: the label under a pixel. `label_box` does it for a rectangle.

    pixel ──► label film ──► volume and row ──► column `select` of its label table, the active object, the place in the list

A picture may show several volumes. As Blender does with objects, a pick without Shift deselects what else is selected in all of them, and the
volume that was picked becomes the active object. What is selected is the same for objects that share a label table.
"""

import bpy
import numpy as np
from bpy.props import BoolProperty, IntProperty

from . import label_film, label_search, label_table, viewport
from .label_operators import OnLabels, own_table, selection, tag_users
from .reports import Refused, log, one_line


class OnPicture(OnLabels):
    """An operator on labels in the last picture, of whichever volume."""

    changes_table = False

    @classmethod
    def poll(cls, context):
        if context.mode != "OBJECT":
            cls.poll_message_set("Labels are picked in Object Mode")
            return False
        return True


def choose(context, film, found, extend, toggle=False):
    """Selects rows of the label tables of volume objects in a film, [(object, rows)]; without `extend`, all else is deselected."""
    rows = {}
    for obj, some in found:
        rows.setdefault(_group(obj), []).append(some)
    done = set()
    for obj in label_film.volumes(film.uids).values():
        group = _group(obj)
        if group in done or (extend and group not in rows):
            continue
        flags = label_table.selected(obj.pumice.table)
        chosen = selection(flags, np.unique(np.concatenate(rows.get(group, [np.zeros(0, dtype=np.int64)]))), extend, toggle)
        if not np.array_equal(flags, chosen):
            table = own_table(obj)
            label_table.set_selected(table, chosen)
            tag_users(table)
        done.add(_group(obj))


def make_active(context, obj):
    """Makes a volume the active object and selects it, as a click does with Blender's own tools; Refused if it is not in the view layer."""
    objects = context.view_layer.objects
    if objects.get(obj.name) != obj:
        raise Refused(f"{obj.name} is not in view layer {context.view_layer.name}, only instances of it are; its labels cannot be picked")
    if objects.active != obj:
        objects.active = obj
    if not obj.select_get():
        obj.select_set(True)


def line(table, row):
    """What is said of a label: id, name, type and number of voxels."""
    found = label_search.index(table)
    texts = [text for text in (found.names[row], found.types[row]) if text]
    voxels = int(table.attributes["voxels"].data[row].value)
    return " · ".join([f"Label {int(found.ids[row])}", *texts, f"{voxels:,} voxel{'' if voxels == 1 else 's'}"])


def _group(obj):
    """The same for objects whose selection is the same: they share the label table, and will when it changes."""
    return obj.pumice.table.session_uid, obj.data.session_uid


class PUMICE_OT_labels_pick(OnPicture, bpy.types.Operator):
    """Select the label under the mouse. Shift adds to the selection, or takes a selected label out of it"""

    bl_idname = "pumice.labels_pick"
    bl_label = "Pick Label"

    x: IntProperty(name="X", description="Pixel of the last picture, counted from the left", min=0, options={"SKIP_SAVE"})
    y: IntProperty(name="Y", description="Pixel of the last picture, counted from the top", min=0, options={"SKIP_SAVE"})
    extend: BoolProperty(name="Extend", description="Keep what is selected", default=False, options={"SKIP_SAVE"})
    toggle: BoolProperty(
        name="Toggle",
        description="With Extend: take the label out of the selection if it is in it already",
        default=False,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context, event):
        shown = viewport.of_region(context.region)
        if shown is None:
            self.report({"WARNING"}, "Labels are picked in Rendered shading with the render engine Pumice")
            return {"PASS_THROUGH"}
        try:
            size = (context.region.width, context.region.height)
            self.x, self.y = label_film.film_from_region(event.mouse_region_x, event.mouse_region_y, size, label_film.size_of(shown))
        except Exception as error:
            log(error)
            self.report({"ERROR"}, one_line(error))
            return {"CANCELLED"}
        self.extend = self.toggle = event.shift
        return self.execute(context)

    def change(self, context, _table):
        film = label_film.of_last_picture(context)
        seen = film.at(self.x, self.y)
        if seen is None:
            choose(context, film, [], self.extend)
            return None
        obj, row = seen
        make_active(context, obj)
        choose(context, film, [(obj, np.array([row]))], self.extend, self.toggle)
        label_search.refresh(context, row)
        return line(obj.pumice.table, row)


def register():
    bpy.utils.register_class(PUMICE_OT_labels_pick)


def unregister():
    bpy.utils.unregister_class(PUMICE_OT_labels_pick)
