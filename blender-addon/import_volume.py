# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Import > Label Volume, also for files dropped on a 3D viewport.

A thread of the compiled module reads and compresses; the operator only watches it. ESC cancels: the thread ends within a moment,
nothing is written under the final name, and no object is made. If a script calls the operator, it waits until the import is done.

    source ──► is its compressed form there? ──yes──► open
                  │no
                  └──► compress (progress, ESC) ──► save ──► object, material, light, view
"""

import json
import os
import threading

import bpy
import numpy as np
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, FloatVectorProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from . import cache, first_look, label_files, label_table, native, proxy_update, registry, viewport, volume_object
from .reports import log, one_line

ENDINGS = (".pumice", ".nrrd", ".nhdr", ".nii", ".gz", ".hdr", ".tif", ".tiff", ".npy", ".npz", ".mha", ".mhd")
PLACEMENTS = (
    ("CENTER", "Centered", "The middle of the volume comes to the scene's origin", 0),
    ("ALIGN", "With the First Volume", "Scaled and moved as the first volume of the scene: crops of one data set fit together", 1),
    ("FILE", "As in the File", "Where the file says, times the display scale", 2),
)


class Opening:
    """A volume being opened: a thread that compresses or opens it, and its result. Does not use Blender."""

    def __init__(self, source, choice, paths):
        self.source, self.choice, self.paths = source, choice, paths
        self.pumice = native.require()
        self.job = self.pumice.Job()
        self.volume = self.filepath = self.error = None
        self.stage = "Reading"
        self.thread = threading.Thread(target=self._run, name="pumice import", daemon=True)
        self.thread.start()

    def _run(self):
        try:
            if cache.is_compressed(self.source) and not self.choice:
                self.volume, self.filepath = self.pumice.open(self.source, job=self.job), self.source
                return
            kept = cache.existing(self.paths)
            if kept is not None:
                self.volume, self.filepath = self.pumice.open(kept, job=self.job), kept
                return
            target = cache.writable(self.paths)
            self.stage = "Compressing"
            volume = self.pumice.compress(self.source, job=self.job, **self.choice)
            self.stage = "Saving"
            volume.save(target, job=self.job)
            self.volume, self.filepath = volume, target
        except BaseException as error:  # an exception cannot leave the thread: the operator reads it here
            self.error = error

    @property
    def cancelled(self):
        return isinstance(self.error, self.pumice.Cancelled)


class PUMICE_OT_import_volume(bpy.types.Operator, ImportHelper):
    """Import a label volume, which has one integer per voxel. Takes time and disk space to compress it once"""

    bl_idname = "pumice.import_volume"
    bl_label = "Import Label Volume"
    # Not REGISTER: the panel that changes options afterwards would run the whole import again for each.
    bl_options = {"UNDO", "PRESET"}

    filename_ext = ""
    # Without SKIP_SAVE the file of the last import would look like one that was dropped.
    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE", "HIDDEN"})
    filter_glob: StringProperty(default=";".join("*" + e for e in ENDINGS), options={"HIDDEN"})
    directory: StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE", "HIDDEN"})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"SKIP_SAVE", "HIDDEN"})

    longest_side: FloatProperty(
        name="Longest Side",
        description="Size of the volume's longest side in the scene; the display scale follows from it",
        min=1e-6,
        default=10.0,
        subtype="DISTANCE",
    )
    placement: EnumProperty(name="Place", description="Where the volume is placed in the scene", items=PLACEMENTS, default="CENTER")
    use_spacing: BoolProperty(
        name="Own Voxel Size", description="Set the size of a voxel, for files that state none or a wrong one", default=False
    )
    spacing: FloatVectorProperty(
        name="Voxel Size", description="Size of a voxel along x, y and z", size=3, min=1e-12, default=(1.0, 1.0, 1.0)
    )
    layer: IntProperty(name="Layer", description="Layer to read, if the file has several; -1 if it has one", min=-1, default=-1)
    time: IntProperty(name="Time Step", description="Time step to read, if the file has several; -1 if it has one", min=-1, default=-1)
    channel: IntProperty(name="Channel", description="Channel to read, if the file has several; -1 if it has one", min=-1, default=-1)
    array: StringProperty(name="Array", description="Array to read, if the file has several; empty if it has one", default="")
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
    use_engine: BoolProperty(
        name="Render with Pumice", description="Set the scene's render engine to Pumice", default=True
    )
    use_light: BoolProperty(
        name="Light", description="Add a sun and a light sky if the scene has none of its own", default=True
    )
    use_camera: BoolProperty(
        name="Frame Camera",
        description="Add a camera if there is none, or move the one of Blender's startup file to frame the volume",
        default=True,
    )

    _interactive = False
    _opening = None
    _queue = ()
    _timer = None

    def invoke(self, context, event):
        # A script that calls the operator waits for it; a user does not.
        self._interactive = True
        return self.invoke_popup(context)  # the options where a file was dropped, else the file browser

    def execute(self, context):
        try:
            self._queue = self._paths()
            self._begin()
        except Exception as error:
            log(error)
            self.report({"ERROR"}, one_line(error))
            return {"CANCELLED"}
        if not self._interactive or bpy.app.background:
            return self._blocking(context)
        manager = context.window_manager
        manager.progress_begin(0, 1000)
        self._timer = manager.event_timer_add(0.1, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self._opening.job.cancel()
            self._queue = []
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        opening = self._opening
        if opening.thread.is_alive():
            done = opening.job.fraction
            context.window_manager.progress_update(int(1000 * (done or 0.0)))
            percent = f" {100 * done:.0f} %" if done is not None else ""
            name = os.path.basename(opening.source)
            context.workspace.status_text_set(f"{opening.stage} {name}{percent}   ESC: cancel")
            return {"RUNNING_MODAL"}
        finished = self._finish(context)
        if finished == {"FINISHED"} and self._queue:
            self._begin()
            return {"RUNNING_MODAL"}
        self._end(context)
        return finished

    def cancel(self, context):
        """Called when Blender ends the operator, because a file is loaded or the window is closed."""
        # The dialog of options may have been cancelled before anything began.
        if self._opening is not None:
            self._opening.job.cancel()
            self._end(context)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(heading="Display")
        column.prop(self, "placement")
        column.prop(self, "longest_side")
        column = layout.column(heading="Voxel Size")
        column.prop(self, "use_spacing", text="")
        row = column.column()
        row.active = self.use_spacing
        row.prop(self, "spacing", text="")
        column = layout.column(heading="Labels")
        column.prop(self, "pick")
        column.prop(self, "table")
        column = layout.column(heading="Scene")
        column.prop(self, "use_engine")
        column.prop(self, "use_light")
        column.prop(self, "use_camera")
        header, body = layout.panel("pumice_choice", default_closed=True)
        header.label(text="Several Volumes in One File")
        if body is not None:
            for name in ("layer", "time", "channel", "array"):
                body.prop(self, name)

    # Inside

    def _paths(self):
        names = [f.name for f in self.files if f.name]
        paths = [os.path.join(self.directory, n) for n in names] if self.directory and names else [self.filepath]
        return [os.path.abspath(bpy.path.abspath(p)) for p in paths]

    def _choice(self):
        choice = {n: getattr(self, n) for n in ("layer", "time", "channel") if getattr(self, n) >= 0}
        if self.array:
            choice["array"] = self.array
        if self.use_spacing:
            choice["spacing"] = tuple(self.spacing)
        return choice

    def _begin(self):
        source, choice = self._queue.pop(0), self._choice()
        folder = bpy.utils.extension_path_user(__package__, path="volumes", create=False)
        self._opening = Opening(source, choice, cache.candidates(source, choice, folder))

    def _blocking(self, context):
        while True:
            self._opening.thread.join()
            finished = self._finish(context)
            if finished != {"FINISHED"} or not self._queue:
                return finished
            self._begin()

    def _finish(self, context):
        """Makes the object of an opened volume, or reports why there is none."""
        opening = self._opening
        if opening.cancelled:
            self.report({"WARNING"}, f"Cancelled: {os.path.basename(opening.source)} is not imported")
            return {"CANCELLED"}
        if opening.error is not None:
            log(opening.error)
            self.report({"ERROR"}, one_line(opening.error))
            return {"CANCELLED"}
        try:
            obj = self._make(context, opening)
        except Exception as error:
            log(error)
            self.report({"ERROR"}, one_line(error))
            return {"CANCELLED"}
        settings = obj.pumice
        self.report(
            {"INFO"},
            f"{obj.name}: {settings.labels} labels, 1 {settings.unit} is {settings.display_scale:.6g} Blender units",
        )
        return {"FINISHED"}

    def _make(self, context, opening):
        registry.adopt(opening.filepath, opening.volume)
        # Before anything is made: a table that cannot be read leaves nothing behind.
        annotations = label_files.read(bpy.path.abspath(self.table)) if self.table else None
        name = os.path.basename(os.path.normpath(opening.source)).split(".")[0]
        obj = volume_object.create(
            context,
            opening.volume,
            name=name,
            filepath=opening.filepath,
            source_path=opening.source,
            longest_side=self.longest_side,
            placement=self.placement,
        )
        obj["pumice_choice"] = json.dumps(opening.choice)
        if annotations is not None:
            table, left_out = annotations
            for line in left_out + label_files.annotate(obj.pumice.table, table):
                self.report({"WARNING"}, f"{os.path.basename(self.table)}: {line}")
        volume_object.group_by_type(obj)
        if self.pick:
            style = native.require().figure(opening.volume, pick=self.pick).to_dict()["instances"][0]["style"]
            label_table.set_visible(obj.pumice.table, np.isin(label_table.ids(obj.pumice.table), np.array(style["show"]["only"], dtype=np.uint64)))
        proxy_update.refresh(obj, opening.volume)
        if self.use_engine:
            context.scene.render.engine = "PUMICE"
        for other in context.selected_objects:
            other.select_set(False)
        obj.select_set(True)
        context.view_layer.objects.active = obj
        first_look.prepare(context, obj, frame_camera=self.use_camera, light=self.use_light)
        viewport.redraw_all()
        return obj

    def _end(self, context):
        manager = context.window_manager
        if self._timer is not None:
            manager.event_timer_remove(self._timer)
            self._timer = None
            manager.progress_end()
        if context.workspace is not None:
            context.workspace.status_text_set(None)


class PUMICE_FH_volume(bpy.types.FileHandler):
    """Label volumes dropped on a 3D viewport."""

    bl_idname = "PUMICE_FH_volume"
    bl_label = "Label Volume"
    bl_import_operator = "pumice.import_volume"
    bl_file_extensions = ";".join(ENDINGS)

    @classmethod
    def poll_drop(cls, context):
        return context.area is not None and context.area.type == "VIEW_3D"


CLASSES = (PUMICE_OT_import_volume, PUMICE_FH_volume)


def _menu(self, _context):
    self.layout.operator(PUMICE_OT_import_volume.bl_idname, text="Label Volume (Pumice)")


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.TOPBAR_MT_file_import.append(_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(_menu)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
