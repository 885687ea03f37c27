# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels: settings of the scene, facts of a volume, what is not drawn, and those of Blender's own panels that apply to Pumice."""

import textwrap

import bpy
import numpy as np

from . import native, passes, preferences, scene_reader, time_settings, verify_maps, volume_object, volume_place
from .properties import is_volume
from .sync import cuts, drawn, instances, lights, materials, meshes, world

# Panels that Blender shows for its own engine and that have no meaning for Pumice.
NOT_OURS = {
    "RENDER_PT_color_management_curves",
    "RENDER_PT_simplify",
    "RENDER_PT_stereoscopy",
    "VIEWLAYER_PT_filter",
    "VIEWLAYER_PT_layer_passes",
}
# Panels of EEVEE that edit Blender's data as such: nodes of materials and worlds, lights.
ALSO_OURS = {
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
    "DATA_PT_EEVEE_light",
}


class _OfScene:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {"PUMICE"}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES


class PUMICE_RENDER_PT_state(_OfScene, bpy.types.Panel):
    """Problems that keep the user from the expected picture."""

    bl_label = "Not Drawn"
    bl_order = 0

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES and bool(not_drawn(context.scene, context.view_layer))

    def draw(self, context):
        column = self.layout.column(align=True)
        for line in not_drawn(context.scene, context.view_layer):
            column.label(text=line, icon="ERROR")


class PUMICE_RENDER_PT_sampling(_OfScene, bpy.types.Panel):
    """Panel: samples, error and time limits."""

    bl_label = "Sampling"
    bl_order = 1

    def draw(self, context):
        layout, wishes = self.layout, context.scene.pumice
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(wishes, "viewport_samples", text="Viewport")
        layout.prop(wishes, "use_viewport_denoise")
        layout.prop(wishes, "samples", text="Render")
        layout.prop(wishes, "use_denoise")
        field = layout.column()
        field.active = wishes.use_denoise
        field.prop(wishes, "denoiser")
        for use, value, heading in (("use_error", "error_percent", "Error"), ("use_time", "time_seconds", "Time Limit")):
            row = layout.row(heading=heading)
            row.prop(wishes, use, text="")
            field = row.row()
            field.active = getattr(wishes, use)
            field.prop(wishes, value, text="")
        if drawn.ADAPTIVE:
            row = layout.row(heading="Noise Threshold")
            row.prop(wishes, "use_adaptive", text="")
            field = row.row()
            field.active = wishes.use_adaptive
            field.prop(wishes, "adaptive_threshold", text="")
            field = layout.column()
            field.active = wishes.use_adaptive
            field.prop(wishes, "adaptive_min_samples")
        layout.prop(wishes, "seed")
        layout.prop(wishes, "filter_pixels")


class PUMICE_RENDER_PT_light(_OfScene, bpy.types.Panel):
    """Panel: which light the picture shows."""

    bl_label = "Light Paths"
    bl_order = 2

    def draw(self, context):
        layout, wishes = self.layout, context.scene.pumice
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(wishes, "mode")
        if wishes.mode == "PATH":
            layout.prop(wishes, "bounces")
        if drawn.CLAMPS and wishes.mode != "AMBIENT_OCCLUSION":
            column = layout.column(heading="Clamp")
            column.prop(wishes, "clamp_direct")
            column.prop(wishes, "clamp_indirect")
        if wishes.mode == "AMBIENT_OCCLUSION":
            row = layout.row(heading="Reach")
            row.prop(wishes, "use_ao_distance", text="")
            field = row.row()
            field.active = wishes.use_ao_distance
            field.prop(wishes, "ao_distance", text="")


class PUMICE_RENDER_PT_verify(_OfScene, bpy.types.Panel):
    """Panel: whether Cycles draws the same."""

    bl_label = "Verify against Cycles"
    bl_order = 4
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, wishes = self.layout, context.scene.pumice
        layout.operator("pumice.verify")
        if wishes.verdict:
            column = layout.column(align=True)
            # Blender does not wrap labels.
            for line in textwrap.wrap(wishes.verdict, 60):
                column.label(text=line)
            layout.operator("wm.path_open", text="Open the Page", icon="URL").filepath = wishes.verdict_page
        if verify_maps.are_kept():
            layout.operator_menu_enum("pumice.show_verify_map", "which", text="Show a Picture or Map", icon="IMAGE_DATA")


class PUMICE_RENDER_PT_performance(_OfScene, bpy.types.Panel):
    """Panel: device and level of detail."""

    bl_label = "Performance"
    bl_order = 3

    def draw(self, context):
        layout, wishes = self.layout, context.scene.pumice
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(wishes, "backend")
        if wishes.backend == "AUTO" and preferences.backend(wishes) != "auto":
            layout.label(text=f"Preferences: {preferences.backend(wishes)}")
        if drawn.SMOOTH_VOXELS:
            layout.prop(wishes, "smooth_voxels")
        layout.prop(wishes, "lod")
        if wishes.lod == "DISTANCE":
            layout.prop(wishes, "lod_pixels")


class PUMICE_VIEWLAYER_PT_passes(_OfScene, bpy.types.Panel):
    """Panel: the passes of a render."""

    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(heading="Include")
        column.prop(context.view_layer, "use_pass_combined")
        for one in {one.chosen: one for one in passes.TABLE if one.ours in drawn.PASSES}.values():
            column.prop(one.owner(context.view_layer), one.chosen)
        layout.prop(context.view_layer, "pass_cryptomatte_depth", text="Cryptomatte Levels")


class PUMICE_OBJECT_PT_volume(bpy.types.Panel):
    """Panel: facts of a volume, shown with every render engine."""

    bl_label = "Pumice Volume"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return context.object is not None and is_volume(context.object)

    def draw(self, context):
        layout, volume = self.layout, context.object.pumice
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(volume, "filepath")
        layout.prop(volume, "source_path")
        layout.operator("pumice.reload", text="Reload", icon="FILE_REFRESH")
        facts = layout.column(align=True)
        facts.label(text=f"{volume.dims[0]} × {volume.dims[1]} × {volume.dims[2]} voxels, {volume.labels} labels")
        size = " × ".join(f"{s:.6g}" for s in volume.spacing)
        facts.label(text=f"Voxel size {size} {_unit(volume.unit)}")
        facts.label(text=f"Display scale: 1 {_unit(volume.unit)} is {_display_scale(context.object)} Blender units")
        row = layout.row(align=True)
        row.prop(volume, "proxy_faces")
        row.operator("pumice.update_proxy", text="", icon="FILE_REFRESH")
        layout.operator("pumice.make_exact_mesh")
        layout.operator_menu_enum("pumice.add_cut", "shape")


class PUMICE_OBJECT_PT_time(bpy.types.Panel):
    """Panel: how a volume with several time steps follows the scene's frame, with the words of Blender's volume sequences."""

    bl_label = "Time"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"
    bl_parent_id = "PUMICE_OBJECT_PT_volume"

    @classmethod
    def poll(cls, context):
        return context.object is not None and is_volume(context.object) and time_settings.is_series(context.object)

    def draw(self, context):
        layout, of = self.layout, context.object.pumice_time
        layout.use_property_split = True
        for name in ("frame_duration", "frame_start", "frame_offset", "frame_step", "sequence_mode"):
            layout.prop(of, name)
        shown = time_settings.shown(context.object, time_settings.now(context.scene))
        layout.label(text=f"Time step {shown} of 0 to {of.time_steps - 1}" if shown is not None else "Nothing is shown at this frame")


class PUMICE_OBJECT_PT_cut(_OfScene, bpy.types.Panel):
    """Panel: whether an object cuts volumes, and whether it is a shadow catcher."""

    bl_label = "Pumice"
    bl_context = "object"

    @classmethod
    def poll(cls, context):
        obj = context.object
        wanted = drawn.CUTS and context.engine in cls.COMPAT_ENGINES and obj is not None
        return wanted and obj.type in {"EMPTY", *meshes.KINDS} and not is_volume(obj)

    def draw(self, context):
        obj = context.object
        self.layout.use_property_split = True
        if obj.type in {"EMPTY", "MESH"}:
            self.layout.prop(obj.pumice, "cut")
        if cuts.is_cut(obj):
            self.layout.prop(obj.pumice, "cut_volumes")
            row = self.layout.row(align=True)
            row.operator("pumice.cut_volumes", text="Cut Selected Only").volumes = "SELECTED"
            row.operator("pumice.cut_volumes", text="Cut All").volumes = "ALL"
        if drawn.SHADOW_CATCHER and obj.type in meshes.KINDS:
            # Blender's own, which it shows with Cycles alone.
            self.layout.prop(obj, "is_shadow_catcher")


class PUMICE_MATERIAL_PT_labels(_OfScene, bpy.types.Panel):
    """Panel: how a material applies to labels."""

    bl_label = "Pumice Labels"
    bl_context = "material"

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES and context.material is not None

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.prop(context.material.pumice, "colors_by_label")


def not_drawn(scene, view_layer):
    """One line for each thing in a scene and its view layer that Pumice does not draw."""
    if native.MISSING:
        return [native.MISSING]
    lines = scene_reader.render_warnings(scene, view_layer) + passes.left_out_of(view_layer) + world.read(scene.world)[1]
    others, dresses, keys = [], materials.Dresses(), [(obj.session_uid,) for obj in scene.objects if is_volume(obj)]
    for obj in scene.objects:
        if obj.hide_render:
            continue
        slots = obj.material_slots
        if obj.type == "LIGHT":
            lines += lights.read(obj, obj.matrix_world)[2]
        elif is_volume(obj):
            lines += instances.left_out_of(obj)
        elif drawn.CUTS and cuts.is_cut(obj):
            lines += cuts.read(obj, obj.matrix_world)[1] + cuts.targets(obj, keys)[1]
        elif drawn.MESHES and obj.type in meshes.KINDS:
            lines += meshes.left_out_of(obj)
            for slot in slots:
                lines += dresses.read(slot.material)[1]
        elif obj.type in scene_reader.DRAWN_BY_OTHERS:
            others.append(obj.name)
    lines += scene_reader.others_left_out(others)
    return list(dict.fromkeys(lines))


def _display_scale(obj):
    """Blender units per unit of the file as the object is now: one number, or one for each axis of the file where they differ."""
    world, of_file = volume_place.world_from_index(obj), volume_object.file_from_index(obj)
    if world is None or of_file is None:
        return f"{obj.pumice.display_scale:.6g}"
    lengths = np.linalg.norm((world @ np.linalg.inv(of_file))[:3, :3], axis=0)
    is_even = np.ptp(lengths) <= 1e-4 * lengths.max()
    return f"{lengths.mean():.6g}" if is_even else " × ".join(f"{length:.6g}" for length in lengths)


def _unit(unit):
    return unit if unit and unit != "unknown" else "unit"


CLASSES = (
    PUMICE_RENDER_PT_state,
    PUMICE_RENDER_PT_sampling,
    PUMICE_RENDER_PT_light,
    PUMICE_RENDER_PT_performance,
    PUMICE_RENDER_PT_verify,
    PUMICE_VIEWLAYER_PT_passes,
    PUMICE_OBJECT_PT_volume,
    PUMICE_OBJECT_PT_time,
    PUMICE_OBJECT_PT_cut,
    PUMICE_MATERIAL_PT_labels,
)


def _shared_panels():
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if engines is None:
            continue
        if ("BLENDER_RENDER" in engines and panel.__name__ not in NOT_OURS) or panel.__name__ in ALSO_OURS:
            yield panel


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.add("PUMICE")


def unregister():
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.discard("PUMICE")
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
