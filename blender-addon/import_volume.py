# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Import > Label Volume, also for files dropped on a 3D viewport.

    file browser, drop, URL ──► headers ──► dialog: facts, menus, options ──► volumes (a thread, ESC) ──► objects, first look

Before the dialog only headers are read (`file_facts`). A thread then compresses or opens the volumes (`opening`), and the operator only watches
it. ESC cancels: the thread ends within a moment, nothing is written under a final name, and no object is made. All files of one import become
objects together, or none does. If a script calls the operator, it waits until the import is done.
"""

import json
import os

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from . import cache, file_facts, first_look, label_files, label_table, native, online_access, opening, proxy_update, registry, time_settings, units, viewport, volume_object
from .background import InBackground, Work
from .import_dialog import ImportDialog, draw_scene_options
from .reports import Refused

ENDINGS = (".pumice", ".nrrd", ".nhdr", ".nii", ".gz", ".hdr", ".tif", ".tiff", ".npy", ".npz", ".mha", ".mhd", ".h5", ".hdf5", ".hdf")
# Folders, which can be dropped; in the file browser a file in them stands for them.
FOLDER_ENDINGS = (".zarr", ".n5", ".precomputed")
PLACEMENTS = (
    ("CENTER", "Centered", "The middle of the volume comes to the scene's origin; several files keep their places to each other", 0),
    ("ALIGN", "With the First Volume", "Scaled and moved as the first volume of the scene: crops of one data set fit together", 1),
    ("FILE", "As in the File", "Where the file says, times the display scale", 2),
)


class PUMICE_OT_import_volume(ImportDialog, InBackground, bpy.types.Operator):
    """Import a label volume, which has one integer per voxel. Takes time and disk space to compress it once"""

    bl_idname = "pumice.import_volume"
    bl_label = "Import Label Volume"
    # Not REGISTER: the panel that changes options afterwards would run the whole import again for each.
    bl_options = {"UNDO", "PRESET"}

    filename_ext = ""
    filter_glob: StringProperty(default=";".join(["*" + e for e in ENDINGS + FOLDER_ENDINGS] + list(file_facts.DESCRIPTIONS)), options={"HIDDEN"})

    longest_side: FloatProperty(
        name="Longest Side",
        description="Size of the volume's longest side in the scene; the display scale follows from it",
        min=0.0,
        soft_min=1e-6,
        default=10.0,
        subtype="DISTANCE",
    )
    placement: EnumProperty(name="Place", description="Where the volume is placed in the scene", items=PLACEMENTS, default="CENTER")
    pick: IntProperty(
        name="Pick",
        description="Show only so many labels, long ones that lie apart, as `pumice render --pick` does; 0 shows all",
        min=0,
        default=0,
    )
    table: StringProperty(
        name="Label Table",
        description="File with names, types, colors and numbers of the labels: CSV, TSV, ITK-SNAP, FreeSurfer, 3D Slicer, Neuroglancer",
        subtype="FILE_PATH",
        default="",
        options={"SKIP_SAVE"},
    )
    use_known_colors: BoolProperty(
        name="Known Colors",
        description=(
            "Give labels the colors that the same ids have in the active volume, or in the first of the scene: for the next volume of a "
            "series. New ids get colors unlike their neighbors'"
        ),
        default=False,
    )
    use_engine: BoolProperty(
        name="Render with Pumice",
        description="Set the scene's render engine to Pumice, and the viewports to Rendered, if it is the first volume of the scene",
        default=True,
    )
    use_light: BoolProperty(
        name="Light",
        description="Add a sun and a light sky if the scene has none of its own, and the volume is its first",
        default=True,
    )
    use_camera: BoolProperty(
        name="Frame Camera",
        description="Add a camera if there is none, or move the one of Blender's startup file to frame the first volume of the scene",
        default=True,
    )

    def begin(self, context):
        online_access.check(self.paths())
        if self.longest_side <= 0.0:
            raise Refused("Longest Side: expected a length above 0")
        wanted = self.wanted(context.scene)
        call = lambda job, tell: opening.open_all(wanted, job, tell)  # noqa: E731
        return Work("Reading", call, tells=True, asks_server=opening.asks_server(wanted))

    def finish(self, context, opened):
        # Before anything is made: a table that cannot be read leaves nothing behind.
        annotations = label_files.read(bpy.path.abspath(self.table)) if self.table else None
        is_first = not any(o.pumice.filepath for o in context.scene.objects)
        if not self.asked:
            for one in opened:
                for line in one.warnings:
                    # The reader names options of the command, which are properties here.
                    self.report({"WARNING"}, line.replace("(give --", "(give "))
        if units.differ_unknown([one.volume.unit for one in opened]):
            self.report({"WARNING"}, "Some of the files state no unit: their lengths are taken in the unit of the others")
        volumes = [one.volume for one in opened]
        made = [self._make(context, one, volumes, annotations) for one in opened]
        for other in context.selected_objects:
            other.select_set(False)
        for obj in made:
            obj.select_set(True)
        context.view_layer.objects.active = made[0]
        if is_first:
            if self.use_engine:
                context.scene.render.engine = "PUMICE"
            first_look.prepare(context, *made, frame_camera=self.use_camera, light=self.use_light, rendered=self.use_engine)
        viewport.redraw_all()
        for settings, name in ((obj.pumice, obj.name) for obj in made):
            steps = settings.id_data.pumice_time.time_steps
            said = f"{settings.labels} labels" + (f" at {steps} time steps" if steps else "")
            self.report({"INFO"}, f"{name}: {said}, 1 {settings.unit} is {settings.display_scale:.6g} Blender units")

    def draw_options(self, context, layout):
        column = layout.column(heading="Labels")
        column.prop(self, "pick")
        column.prop(self, "table")
        column.prop(self, "use_known_colors")
        column = layout.column(heading="Display")
        column.prop(self, "placement")
        column.prop(self, "longest_side")
        draw_scene_options(self, context, layout)

    # Inside

    def _make(self, context, opened, volumes, annotations):
        """The object of an opened volume, one of `volumes`."""
        registry.adopt(opened.filepath, opened.volume)
        obj = volume_object.create(
            context,
            opened.volume,
            name=cache.base_name(opened.source).split(".")[0],
            filepath=opened.filepath,
            source_path=opened.source,
            longest_side=self.longest_side,
            placement=self.placement,
            among=volumes,
            former=_former_table(context) if self.use_known_colors else None,
        )
        obj["pumice_choice"] = json.dumps(opened.choice)
        time_settings.describe(obj, opened.volume, opened.playback)
        if annotations is not None:
            table, left_out = annotations
            for line in left_out + label_files.annotate(obj.pumice.table, table):
                self.report({"WARNING"}, f"{os.path.basename(self.table)}: {line}")
        volume_object.group_by_type(obj)
        if self.pick:
            style = native.require().figure(opened.volume, pick=self.pick).to_dict()["instances"][0]["style"]
            label_table.set_visible(obj.pumice.table, np.isin(label_table.ids(obj.pumice.table), np.array(style["show"]["only"], dtype=np.uint64)))
        proxy_update.refresh(obj, opened.volume)
        return obj


def _former_table(context):
    """The label table whose colors the next volume of a series gets: the active volume's, or that of the first in the scene; None without."""
    chosen = [context.view_layer.objects.active, *context.scene.objects]
    return next((obj.pumice.table for obj in chosen if obj is not None and obj.pumice.table is not None), None)


class PUMICE_FH_volume(bpy.types.FileHandler):
    """Label volumes dropped on a 3D viewport."""

    bl_idname = "PUMICE_FH_volume"
    bl_label = "Label Volume"
    bl_import_operator = "pumice.import_volume"
    bl_file_extensions = ";".join(ENDINGS + FOLDER_ENDINGS)

    @classmethod
    def poll_drop(cls, context):
        return context.area is not None and context.area.type == "VIEW_3D"


CLASSES = (PUMICE_OT_import_volume, PUMICE_FH_volume)


def _menu_entry(self, _context):
    self.layout.operator(PUMICE_OT_import_volume.bl_idname, text="Label Volume (Pumice)")


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.TOPBAR_MT_file_import.append(_menu_entry)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(_menu_entry)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
