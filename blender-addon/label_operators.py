# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators on the labels of the active volume object: search, select, hide, isolate, color, assign to a group, frame, copy ids.

Each changes whole columns of the label table and is one undo step. A selection is a column too, so undo brings it back.
"""

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatVectorProperty, IntProperty, StringProperty

from . import active_volume, color_ramp, first_look, label_colors, label_search, label_table, native, registry, volume_place
from .reports import Refused, log, one_line

MOST_64 = (1 << 64) - 1


class OnLabels:
    """An operator on the labels of the active volume, as `active_volume` finds it; its `change` gets the table and returns what to tell the user."""

    bl_options = {"REGISTER", "UNDO"}
    changes_table = True

    @classmethod
    def poll(cls, context):
        if label_search.table_of(context) is None:
            cls.poll_message_set(active_volume.MAKE_ACTIVE)
            return False
        return True

    def execute(self, context):
        try:
            table = own_table(active_volume.of(context)) if self.changes_table else label_search.table_of(context)
            said = self.change(context, table)
        except Exception as error:
            log(error)
            self.report({"ERROR"}, one_line(error))
            return {"CANCELLED"}
        if said:
            self.report({"INFO"}, said)
        return {"FINISHED"}


def own_table(obj):
    """The label table of an object. One that was duplicated has a mesh of its own (Shift D), so it gets a table of its own before the first
    change, and so does a library override of a linked one; linked duplicates (Alt D) share the mesh and the table."""
    table = obj.pumice.table
    if obj.library is not None:
        raise Refused(f"{obj.name} is linked from {obj.library.filepath}; make a library override of it to change its labels here")
    if table.library is not None:
        obj.pumice.table = table.copy()
        return obj.pumice.table
    sharing = [other for other in bpy.data.objects if other.pumice.table == table]
    if any(other.data != obj.data for other in sharing):
        copy = table.copy()
        for other in sharing:
            if other.data == obj.data:
                other.pumice.table = copy
        table = copy
    return table


def selected(table):
    """The rows that are selected; Refused where none is."""
    rows = np.flatnonzero(label_table.selected(table))
    if not len(rows):
        raise Refused("No label is selected; click one in the list, or search and select the hits")
    return rows


def selection(flags, rows, extend, toggle=False):
    """Which labels are selected after some were chosen: these alone; with `extend` what `flags` says too; with `toggle`, where all of them
    were selected already, without them."""
    takes = not (extend and toggle and len(rows) and flags[rows].all())
    chosen = flags.copy() if extend else np.zeros_like(flags)
    chosen[rows] = takes
    return chosen


def tag_users(table):
    """Makes every object that shows the table, and the panel, follow it."""
    for obj in bpy.data.objects:
        if obj.pumice.table == table:
            obj.update_tag()
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PROPERTIES"}:
                area.tag_redraw()


def counted(count):
    """A number of labels, for people."""
    return f"{count:,} label{'' if count == 1 else 's'}"


def rows_of(table, text):
    """Rows of the ids in a text such as `17, 42`; Refused names the first that the table lacks."""
    ids, wanted = label_table.ids(table), []
    for word in text.replace(",", " ").split():
        if not word.isdecimal() or int(word) > MOST_64:
            raise Refused(f"ids: expected whole numbers from 0 to {MOST_64}, got {word!r}")
        wanted.append(int(word))
    rows = np.searchsorted(ids, np.array(wanted, dtype=np.uint64))
    for label, row in zip(wanted, rows.tolist()):
        if row == len(ids) or int(ids[row]) != label:
            raise Refused(f"ids: the volume has no label {label}")
    return rows


class PUMICE_OT_labels_search(OnLabels, bpy.types.Operator):
    """List the labels that a query finds, such as: glia voxels>1000"""

    bl_idname = "pumice.labels_search"
    bl_label = "Search Labels"
    bl_options = {"INTERNAL"}
    changes_table = False

    query: StringProperty(name="Query", description="Words of the name, ids, type:axon, voxels>1000")
    shown_only: BoolProperty(name="Shown Only", description="List only labels that are shown", default=False)

    def change(self, context, _table):
        search = context.window_manager.pumice_labels
        search.shown_only = self.shown_only
        search.query = self.query  # which fills the list
        if search.problem:
            raise Refused(search.problem)
        return f"{counted(search.count)} found"


class PUMICE_OT_labels_select(OnLabels, bpy.types.Operator):
    """Select labels by id. Shift adds to the selection, or takes a selected label out of it"""

    bl_idname = "pumice.labels_select"
    bl_label = "Select Labels"

    ids: StringProperty(name="Ids", description="Ids of labels, with commas or spaces between them")
    extend: BoolProperty(name="Extend", description="Keep what is selected", default=False)
    toggle: BoolProperty(name="Toggle", description="With Extend: take out of the selection what is in it already", default=False)

    def invoke(self, context, event):
        self.extend = self.toggle = event.shift
        return self.execute(context)

    def change(self, _context, table):
        rows = rows_of(table, self.ids)
        label_table.set_selected(table, selection(label_table.selected(table), rows, self.extend, self.toggle))
        tag_users(table)


class PUMICE_OT_labels_select_hits(OnLabels, bpy.types.Operator):
    """Select all labels that the search finds, also those beyond the list"""

    bl_idname = "pumice.labels_select_hits"
    bl_label = "Select All Hits"

    extend: BoolProperty(name="Extend", description="Keep what is selected", default=False)

    def change(self, context, table):
        flags = label_table.selected(table) if self.extend else np.zeros(len(table.vertices), dtype=bool)
        flags[label_search.rows(context)] = True
        label_table.set_selected(table, flags)
        tag_users(table)
        return f"{counted(int(flags.sum()))} selected"


class PUMICE_OT_labels_select_group(OnLabels, bpy.types.Operator):
    """Select the labels of the active material slot"""

    bl_idname = "pumice.labels_select_group"
    bl_label = "Select Labels of Group"

    slot: IntProperty(name="Slot", description="Material slot, counted from 0; -1 is the active one", default=-1, min=-1)
    deselect: BoolProperty(name="Deselect", description="Take the labels out of the selection", default=False)

    def change(self, context, table):
        flags = label_table.selected(table)
        flags[label_table.slots(table) == slot_of(active_volume.of(context), self.slot)] = not self.deselect
        label_table.set_selected(table, flags)
        tag_users(table)


class PUMICE_OT_labels_invert(OnLabels, bpy.types.Operator):
    """Select the shown labels that are not selected, and no others"""

    bl_idname = "pumice.labels_invert"
    bl_label = "Invert Selection"

    def change(self, _context, table):
        label_table.set_selected(table, label_table.visible(table) & ~label_table.selected(table))
        tag_users(table)


class PUMICE_OT_labels_hide(OnLabels, bpy.types.Operator):
    """Hide the selected labels"""

    bl_idname = "pumice.labels_hide"
    bl_label = "Hide Labels"

    unselected: BoolProperty(
        name="Unselected", description="Hide those that are not selected instead", default=False, options={"SKIP_SAVE"}
    )
    ids: StringProperty(name="Ids", description="Hide, or show again, these labels instead of the selection", options={"SKIP_SAVE"})

    def change(self, _context, table):
        flags = label_table.visible(table)
        if self.ids:
            rows = rows_of(table, self.ids)
            flags[rows] = ~flags[rows]
        else:
            rows = selected(table)
            hidden = np.zeros_like(flags)
            hidden[rows] = True
            flags &= hidden if self.unselected else ~hidden
        label_table.set_visible(table, flags)
        tag_users(table)


class PUMICE_OT_labels_isolate(OnLabels, bpy.types.Operator):
    """Show the selected labels and hide all others"""

    bl_idname = "pumice.labels_isolate"
    bl_label = "Isolate Labels"

    def change(self, _context, table):
        flags = np.zeros(len(table.vertices), dtype=bool)
        flags[selected(table)] = True
        label_table.set_visible(table, flags)
        tag_users(table)
        return f"{counted(int(flags.sum()))} shown"


class PUMICE_OT_labels_show_all(OnLabels, bpy.types.Operator):
    """Show all labels"""

    bl_idname = "pumice.labels_show_all"
    bl_label = "Show All Labels"

    def change(self, _context, table):
        label_table.set_visible(table, np.ones(len(table.vertices), dtype=bool))
        tag_users(table)


class PUMICE_OT_labels_color(OnLabels, bpy.types.Operator):
    """Give the selected labels one color"""

    bl_idname = "pumice.labels_color"
    bl_label = "Color Labels"

    color: FloatVectorProperty(
        name="Color", description="Base color", subtype="COLOR", size=3, min=0.0, max=1.0, default=(0.8, 0.25, 0.1)
    )

    def change(self, _context, table):
        if not np.isfinite(self.color).all():
            raise Refused(f"color: expected three finite numbers, got {tuple(self.color)}")
        label_table.set_color(table, selected(table), tuple(self.color))
        tag_users(table)


class PUMICE_OT_labels_recolor(OnLabels, bpy.types.Operator):
    """Give the selected labels, or all if none is selected, new colors of a palette"""

    bl_idname = "pumice.labels_recolor"
    bl_label = "Recolor Labels"

    palette: EnumProperty(name="Palette", description="Where the colors come from", items=label_colors.PALETTES, default="NEIGHBORS")
    column: StringProperty(name="Column", description="Column of numbers for the palette By Number", default="voxels")
    color_map: EnumProperty(name="Color Map", description="Colors for the palette By Number", items=color_ramp.MAPS, default="VIRIDIS")

    def invoke(self, context, event):
        if self.palette != "NUMBER":
            return self.execute(context)
        color_ramp.of_scene(context.scene)  # drawing may make none
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, context):
        layout, ramp = self.layout, context.scene.pumice.ramp
        layout.use_property_split = True
        layout.prop(self, "palette")
        if self.palette == "NUMBER":
            layout.prop_search(self, "column", label_search.table_of(context), "attributes")
            layout.prop(self, "color_map")
            if self.color_map == "RAMP" and ramp is not None:
                layout.template_color_ramp(ramp, "color_ramp", expand=True)

    def change(self, context, table):
        flags = label_table.selected(table)
        rows = np.flatnonzero(flags) if flags.any() else np.arange(len(flags))
        along = (self.column, self.color_map, context.scene)
        colors = label_colors.palette(self.palette, table, rows, lambda: _labels(context, table).auto_colors(), along)
        label_table.set_color(table, rows, colors, own=self.palette != "NEIGHBORS")
        tag_users(table)
        return f"{counted(len(rows))} recolored"


class PUMICE_OT_labels_assign(OnLabels, bpy.types.Operator):
    """Put the selected labels into the group of a material slot"""

    bl_idname = "pumice.labels_assign"
    bl_label = "Assign Labels to Group"

    slot: IntProperty(name="Slot", description="Material slot, counted from 0; -1 is the active one", default=-1, min=-1)

    def change(self, context, table):
        label_table.set_slots(table, selected(table), slot_of(active_volume.of(context), self.slot))
        tag_users(table)


class PUMICE_OT_labels_frame(OnLabels, bpy.types.Operator):
    """Frame the selected labels in the 3D viewport; without a viewport, move the scene's camera"""

    bl_idname = "pumice.labels_frame"
    bl_label = "Frame Labels"
    changes_table = False

    def change(self, context, table):
        rows = selected(table)
        labels = _labels(context, table, rows)
        obj = active_volume.of(context)
        rows = rows[labels.voxels[rows] > 0]
        if not len(rows):
            raise Refused(f"{obj.name}: the selected labels are not there at the time step that is shown")
        place = volume_place.world_from_index(obj)
        if place is None:
            raise Refused(f"{obj.name}: {volume_place.LOST}")
        low, high = labels.low[rows].min(axis=0).astype(float), labels.high[rows].max(axis=0) + 1.0
        corners = np.array([[(low, high)[bit >> axis & 1][axis] for axis in range(3)] for bit in range(8)])
        first_look.frame(context, corners @ place[:3, :3].T + place[:3, 3])


class PUMICE_OT_labels_copy_ids(OnLabels, bpy.types.Operator):
    """Copy the ids of the selected labels to the clipboard"""

    bl_idname = "pumice.labels_copy_ids"
    bl_label = "Copy Ids"
    bl_options = {"REGISTER"}
    changes_table = False

    def change(self, context, table):
        rows = selected(table)
        context.window_manager.clipboard = ", ".join(map(str, label_table.ids(table)[rows].tolist()))
        return f"{counted(len(rows))} copied"


def slot_of(obj, slot):
    """A material slot of an object; -1 is the active one. Refused where there is none."""
    slots = len(obj.material_slots)
    chosen = obj.active_material_index if slot < 0 else slot
    if chosen >= max(1, slots):
        raise Refused(f"slot: {obj.name} has {slots} material slots, got {chosen}; add one first")
    return chosen


def _labels(context, table, rows=None):
    """The labels of the active volume, at the time step that is shown, by the rows of its label table. Raises Refused. Bounds are known of those
    in `rows`, by default of those that are shown."""
    obj = active_volume.of(context)
    read = None
    if rows is not None:
        read = np.zeros(len(table.vertices), dtype=bool)
        read[rows] = True
    entry = registry.request_shown(obj, read)
    native.require()
    # A few seconds at most, once in a session: an operator must end before it returns.
    entry.done.wait()
    if entry.error:
        raise Refused(entry.error)
    label_table.require_rows(label_table.ids(table), entry.volume.labels, obj.name)
    return entry.volume.labels


CLASSES = (
    PUMICE_OT_labels_search,
    PUMICE_OT_labels_select,
    PUMICE_OT_labels_select_hits,
    PUMICE_OT_labels_select_group,
    PUMICE_OT_labels_invert,
    PUMICE_OT_labels_hide,
    PUMICE_OT_labels_isolate,
    PUMICE_OT_labels_show_all,
    PUMICE_OT_labels_color,
    PUMICE_OT_labels_recolor,
    PUMICE_OT_labels_assign,
    PUMICE_OT_labels_frame,
    PUMICE_OT_labels_copy_ids,
)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
