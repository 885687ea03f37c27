# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of the figure: size, presets, background and estimate in Output; the settings of a scale bar or a legend in Object."""

import textwrap

import bpy

from . import figure_follow, figure_operators, figure_settings


class PUMICE_OUTPUT_PT_figure(bpy.types.Panel):
    """Panel: the figure, in Output."""

    bl_label = "Figure"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "output"

    @classmethod
    def poll(cls, context):
        return context.engine == "PUMICE"

    def draw(self, context):
        layout, scene, figure = self.layout, context.scene, context.scene.pumice_figure
        layout.use_property_split = True
        layout.use_property_decorate = False
        row = layout.row(align=True)
        for preset, name, _, _ in figure_operators.PRESETS:
            row.operator("pumice.figure_preset", text=name).preset = preset
        column = layout.column(align=True)
        for name in ("width_mm", "height_mm", "dpi"):
            column.prop(figure, name)
        column = layout.column(align=True)
        column.label(text=figure_operators.size_line(scene))
        if not figure_settings.is_written(scene):
            column.label(text="Output has another size than the figure", icon="ERROR")
            row = column.row(align=True)
            row.operator("pumice.figure_size", text="Write Size").action = "WRITE"
            row.operator("pumice.figure_size", text="Take Size").action = "READ"
        layout.prop(scene.render, "film_transparent", text="Transparent")
        row = layout.row(heading="Backdrop")
        row.active = not scene.render.film_transparent
        row.prop(figure, "use_backdrop", text="")
        field = row.row()
        field.active = figure.use_backdrop
        field.prop(figure, "backdrop", text="")
        row = layout.row(align=True)
        row.operator("pumice.add_scale_bar", text="Scale Bar")
        row.operator("pumice.add_legend", text="Groups").entries = "GROUPS"
        row.operator("pumice.add_legend", text="Selected Labels").entries = "SELECTED"
        for line in figure_follow.problems(scene):
            layout.label(text=line, icon="ERROR")
        layout.operator("pumice.figure_estimate")
        column = layout.column(align=True)
        # Blender does not wrap labels.
        for line in textwrap.wrap(figure.estimate, 60):
            column.label(text=line)


class PUMICE_OBJECT_PT_figure(bpy.types.Panel):
    """Panel: a scale bar or a legend."""

    bl_label = "Pumice Figure"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.pumice_figure.kind != "NONE"

    def draw(self, context):
        layout, part = self.layout, context.object.pumice_figure
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(part, "volume")
        if part.kind == "SCALE_BAR":
            for name in ("length", "unit", "plane"):
                layout.prop(part, name)
            if part.plane == "DISTANCE":
                layout.prop(part, "distance")
            layout.prop(part, "names_plane")
        else:
            layout.prop(part, "labels")
        for name in ("corner", "margin_mm", "text_mm", "color"):
            layout.prop(part, name)


CLASSES = (PUMICE_OUTPUT_PT_figure, PUMICE_OBJECT_PT_figure)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
