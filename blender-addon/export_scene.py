# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Export > Pumice Scene: the current frame as the scene's JSON form, for `pumice render`, or as one USD stage.

The JSON form is exactly the scene that F12 draws: the same samples on the same device give the same pixels. Meshes become PLY files
beside it. The stage (`usd_stage`) is for other programs, and for Cycles in a fresh Blender, which opens it by File > Import > Pumice USD
Scene.
"""

import dataclasses
import os
import shlex
import tempfile

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from . import final_render, mesh_file, native, scene_reader, usd_stage
from .background import InBackground, Work
from .reports import Refused, log, one_line
from .sync import world

KINDS = (
    ("JSON", "Pumice Scene (.json)", "The scene that F12 draws, for `pumice render`", 0),
    ("USDC", "USD (.usdc)", "The whole scene for other programs and for Cycles; volumes as surfaces, in a file beside it", 1),
    ("USDA", "USD as Text (.usda)", "The same; all but the volumes as text", 2),
    ("USDZ", "USD in One File (.usdz)", "The same in one file, pictures included", 3),
)
# Forms of volumes that Cycles draws, from the finest on.
SURFACES = (
    ("voxels", "Exact Surface", "The surface of the voxels, as it is drawn", 0),
    ("cells4", "Cells", "The surface of cells of 4³ voxels: a fiftieth of the faces", 1),
    ("boxes", "Boxes", "The surface of the boxes: the fewest faces", 2),
)
STAGES = (".usdc", ".usda", ".usdz")


def parts_to_export(depsgraph):
    """(Parts, what was left out) of the frame that F12 draws; triangles are `mesh_file.Arrays`. Raises Refused where a volume's file is missing."""
    parts, left_out = final_render.parts_of_frame(depsgraph, as_rendered=True, kept=scene_reader.Kept(mesh_file.Arrays))
    for placed in parts.placed.values():
        if not native.is_on_server(placed.source) and not os.path.exists(placed.source):
            raise Refused(f"{placed.source}: the volume's file is missing; reload it from another place, or hide its object")
    return parts, left_out


def command(wishes, path):
    """The command that makes F12's picture of an exported scene."""
    limits = final_render.limits(wishes)
    words = ["pumice", "render", path, "--spp", str(limits["spp"])]
    if limits["error"] is not None:
        words += ["--error", f"{wishes.error_percent:.6g}%"]
    if limits["seconds"] is not None:
        words += ["--time", f"{limits['seconds']:.6g}"]
    if wishes.use_denoise:
        words += ["--denoise=oidn" if wishes.denoiser == "OIDN" else "--denoise"]
    return shlex.join([*words, "-o", "picture.exr"])


def save(parts, path):
    """Writes the scene, and a PLY file beside it for each mesh; a mesh with several instances is one file."""
    stem = os.path.splitext(os.path.basename(path))[0]
    names, placed = {}, {}
    for key in sorted(parts.meshes):
        mesh = parts.meshes[key]
        name = names.get(id(mesh.geometry))
        if name is None:
            plain = "".join(c if c.isalnum() or c in "-_" else "_" for c in mesh.name)
            name = names[id(mesh.geometry)] = f"{stem}-{len(names) + 1}-{plain}.ply"
            mesh_file.write(os.path.join(os.path.dirname(path), name), mesh.geometry)
        placed[key] = dataclasses.replace(mesh, name=name)
    dataclasses.replace(parts, meshes=placed).made(native.require()).save(path)


class PUMICE_OT_export_scene(InBackground, bpy.types.Operator, ExportHelper):
    """Export the current frame, as the active camera sees it, for the command `pumice render`, or as a USD stage of the whole scene"""

    bl_idname = "pumice.export_scene"
    bl_label = "Export Pumice Scene"

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json;*.usdc;*.usda;*.usdz", options={"HIDDEN"})
    kind: EnumProperty(name="File", description="What is written; a script chooses it by the name's ending", items=KINDS, default="JSON")
    form: EnumProperty(name="Volumes", description="How a USD stage has the volumes", items=SURFACES, default="voxels")
    plain: BoolProperty(
        name="A Square for Each Face",
        description="Do not merge neighboring faces into rectangles in a USD stage. Takes two to four times the space",
        default=False,
    )

    _kind_before = "JSON"

    def invoke(self, context, event):
        self._interactive, self._kind_before = True, self.kind
        return ExportHelper.invoke(self, context, event)

    def check(self, _context):
        """Keeps the chosen kind and the ending of the name in the dialog the same, whichever of them the user has changed."""
        stem, ending = os.path.splitext(self.filepath)
        typed = ending[1:].upper()
        is_known = typed in {kind for kind, *_ in KINDS}
        if is_known and self.kind == self._kind_before:
            self.kind = typed
        self._kind_before = self.kind
        renamed = (stem if is_known else self.filepath) + f".{self.kind.lower()}"
        changed, self.filepath = renamed.lower() != self.filepath.lower(), renamed
        return changed

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "kind")
        column = layout.column()
        column.active = self.kind != "JSON"
        column.prop(self, "form")
        column.prop(self, "plain")

    def execute(self, context):
        if os.path.splitext(self.filepath)[1].lower() in STAGES:
            return super().execute(context)
        try:
            # Blender offers only this graph outside a render; `as_rendered` applies the visibility of renders.
            parts, left_out = parts_to_export(context.evaluated_depsgraph_get())
            save(parts, self.filepath)
        except Exception as error:
            log(error)
            self.report({"ERROR"}, one_line(error))
            return {"CANCELLED"}
        for line in left_out:
            self.report({"WARNING"}, line)
        render = context.scene.render
        if render.use_border and not render.use_crop_to_border:
            self.report({"WARNING"}, "The scene is the render region alone, which F12 draws into the whole picture")
        self.report({"INFO"}, f"F12's picture: {command(context.scene.pumice, self.filepath)}")
        return {"FINISHED"}

    def begin(self, context):
        """Blender's own exporter runs at once; the surfaces of the volumes are found in the background."""
        pumice = native.require()
        path = os.path.abspath(bpy.path.abspath(self.filepath))
        stem, ending = os.path.splitext(os.path.basename(path))
        if not os.path.isdir(os.path.dirname(path)):
            raise Refused(f"{os.path.dirname(path)}: there is no such folder")
        usd_stage.require()
        parts, _ = parts_to_export(context.evaluated_depsgraph_get())
        self._path, self._lacks = path, usd_stage.lacks_of(context)
        # Beside the target, so that finished files are only renamed.
        self._folder = tempfile.TemporaryDirectory(prefix=".pumice-", dir=os.path.dirname(path))
        self._stage = os.path.join(self._folder.name, stem + (".usdc" if ending.lower() == ".usdz" else ending.lower()))
        try:
            self._stands_for = usd_stage.export_around(context, self._stage)
            numbers = parts.numbers()
            objects = {o.session_uid: o for o in bpy.data.objects}
            # The last object of a key is the volume's own; those before it make instances of it.
            self._volumes = {numbers[key]: objects[key[0] if len(key) == 1 else key[1]] for key in parts.placed}
            if not parts.placed:
                return Work(f"Exporting {stem}", lambda job: None)
            alone = dataclasses.replace(parts, meshes={}, suns=[], lights=[], world=world.BLACK)
            scene_file = os.path.join(self._folder.name, "scene.json")
            save(alone, scene_file)
        except BaseException:
            self._folder.cleanup()
            raise
        volumes = os.path.join(self._folder.name, f"{stem}-volumes.usdc")
        wishes = {"form": self.form, "plain": self.plain}

        def call(job):
            report = pumice.export(scene_file, volumes, job=job, **wishes)
            os.remove(scene_file)
            return report

        return Work(f"Exporting {os.path.basename(path)}", call)

    def finish(self, context, report):
        path, stage = self._path, self._stage
        stem = os.path.splitext(os.path.basename(stage))[0]
        name = f"{stem}-volumes.usdc" if report is not None else None
        usd_stage.compose(stage, name, context.scene, self._stands_for, self._volumes, self._lacks)
        if path.lower().endswith(".usdz"):
            packed = os.path.join(self._folder.name, "packed", os.path.basename(path))
            os.mkdir(os.path.dirname(packed))
            usd_stage.package(stage, packed)
            os.replace(packed, path)
        else:
            usd_stage.move_into_place(self._folder.name, os.path.dirname(path))
        for line in self._lacks:
            self.report({"WARNING"}, line)
        faces = f", {report['faces']} faces of volumes" if report is not None else ""
        self.report({"INFO"}, f"{os.path.basename(path)}{faces}; File › Import › Pumice USD Scene opens it for Cycles")

    def ended(self):
        """Removes the temporary folder, whatever happened."""
        self._folder.cleanup()


def _menu(self, _context):
    self.layout.operator(PUMICE_OT_export_scene.bl_idname, text="Pumice Scene (.json, .usdc, .usda, .usdz)")


def register():
    bpy.utils.register_class(PUMICE_OT_export_scene)
    bpy.types.TOPBAR_MT_file_export.append(_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(_menu)
    bpy.utils.unregister_class(PUMICE_OT_export_scene)
