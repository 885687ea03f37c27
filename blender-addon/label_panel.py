# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel of labels: a search line, the list of what it finds, and operators on the selection; in the viewport's sidebar and in Object Data.

Drawing reads the table and writes nothing: Blender forbids it, and the list has at most a few hundred rows.
"""

import bpy

from . import active_volume, label_search, label_table
from .properties import is_volume


class PUMICE_UL_labels(bpy.types.UIList):
    """The labels that the search finds: whether each is shown, its color, its id and its name."""

    def draw_item(self, context, layout, _data, item, _icon, _active_data, _active_name):
        table = label_search.table_of(context)
        if table is None or item.row >= len(table.vertices):
            return
        found = label_search.index(table)
        label, name = str(int(found.ids[item.row])), found.names[item.row]
        at = {one: table.attributes[one].data[item.row] for one in ("visible", "select", "color")}
        row = layout.row(align=True)
        shown = at["visible"].value
        row.operator("pumice.labels_hide", text="", icon="HIDE_OFF" if shown else "HIDE_ON", emboss=False).ids = label
        swatch = row.row()
        swatch.ui_units_x, swatch.enabled = 1.2, False
        swatch.prop(at["color"], "color", text="")
        pick = row.operator("pumice.labels_select", text=f"{label}  {name}", emboss=at["select"].value, depress=at["select"].value)
        pick.ids = label

    def draw_filter(self, _context, _layout):
        """The search line above the list is the filter."""

    def filter_items(self, _context, data, name):
        return [self.bitflag_filter_item] * len(getattr(data, name)), []


class _Labels:
    bl_label = "Labels"

    @classmethod
    def poll(cls, context):
        return label_search.table_of(context) is not None

    def draw(self, context):
        layout, search, table = self.layout, context.window_manager.pumice_labels, label_search.table_of(context)
        row = layout.row(align=True)
        row.prop(search, "query", text="", icon="VIEWZOOM")
        row.prop(search, "shown_only", text="", icon="HIDE_OFF")
        if search.problem:
            layout.label(text=search.problem, icon="ERROR")
        layout.template_list("PUMICE_UL_labels", "", search, "hits", search, "active", rows=6)
        row = layout.row(align=True)
        row.operator("pumice.labels_select_hits", text=f"Select All {search.count:,} Hits")
        row.operator("pumice.labels_invert", text="", icon="ARROW_LEFTRIGHT")
        if search.count > len(search.hits):
            layout.label(text=f"{len(search.hits):,} of them are listed")
        shown, chosen = int(label_table.visible(table).sum()), int(label_table.selected(table).sum())
        layout.label(text=f"{shown:,} shown, {chosen:,} selected, {len(table.vertices):,} in all")

        column = layout.column(align=True)
        row = column.row(align=True)
        row.operator("pumice.labels_hide", text="Hide")
        row.operator("pumice.labels_isolate", text="Isolate")
        row.operator("pumice.labels_show_all", text="Show All")
        row = column.row(align=True)
        row.operator("pumice.labels_color", text="Color")
        row.operator_menu_enum("pumice.labels_recolor", "palette", text="Recolor")
        row = column.row(align=True)
        row.operator("pumice.labels_frame", text="Frame")
        row.operator("pumice.labels_copy_ids", text="Copy Ids")
        row = column.row(align=True)
        row.operator("pumice.labels_import", text="Import Table")
        row.operator("pumice.labels_export", text="Export Table")


class PUMICE_VIEW3D_PT_labels(_Labels, bpy.types.Panel):
    """Panel: labels, in the viewport's sidebar."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Pumice"


class PUMICE_OBJECT_PT_labels(_Labels, bpy.types.Panel):
    """Panel: labels, in Object Data, which shows the active object's alone."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.object == active_volume.of(context)


class PUMICE_MATERIAL_PT_groups(bpy.types.Panel):
    """Panel: the labels of a material slot, as for faces in edit mode."""

    bl_label = "Group of Labels"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "material"

    @classmethod
    def poll(cls, context):
        obj = context.object
        return obj is not None and is_volume(obj) and obj.pumice.table is not None and bool(obj.material_slots)

    def draw(self, context):
        obj = context.object
        slots = label_table.slots(obj.pumice.table)
        last, active = len(obj.material_slots) - 1, obj.active_material_index
        count = int((slots.clip(max=last) == active).sum())
        self.layout.label(text=f"{count:,} of {len(slots):,} labels are in slot {active + 1}")
        row = self.layout.row(align=True)
        row.operator("pumice.labels_assign", text="Assign").slot = active
        row.operator("pumice.labels_select_group", text="Select").slot = active
        remove = row.operator("pumice.labels_select_group", text="Deselect")
        remove.slot, remove.deselect = active, True


CLASSES = (PUMICE_UL_labels, PUMICE_VIEW3D_PT_labels, PUMICE_OBJECT_PT_labels, PUMICE_MATERIAL_PT_groups)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
