# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Import > Pumice USD Scene: a stage of `pumice.export_scene`, so that Cycles draws what it drew where the stage was written.

    Blender's importer       objects, meshes, textures, places
    notes (scene_notes)      then set what it reads wrong or not at all: names, cameras, lights, shaders, the world, the scene

A stage without notes, such as one of `pumice export`, gets by `usd_values` what USD's specification says of it.
"""

import json
import os

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ImportHelper
from mathutils import Matrix

from . import scene_notes, usd_stage, usd_values, volume_object
from .reports import Refused, log, one_line
from .sync import dressing, matrix, nodes, shader_notes

# The user property with all fields of a material that the compiled module wrote.
FIELDS = "material"


def restore(context, path, use_scene):
    """Imports a stage and sets what its notes say. Returns (its objects, lines for the user)."""
    scene = context.scene
    before = {uid(block) for blocks in (bpy.data.objects, bpy.data.materials) for block in blocks}
    try:
        bpy.ops.wm.usd_import.get_rna_type()
    except KeyError:
        raise Refused("This Blender was built without USD") from None
    former = scene.world
    if use_scene:
        # The importer fills the world that is there, and makes none.
        scene.world = bpy.data.worlds.new("World")
        nodes.ensure(scene.world)
    wishes = {
        "property_import_mode": "USER",
        "attr_import_mode": "USER",
        "set_frame_range": False,
        "create_world_material": use_scene,
    }
    accepted = usd_stage.accepted(bpy.ops.wm.usd_import, wishes)
    try:
        result = bpy.ops.wm.usd_import(filepath=path, **accepted)
    except RuntimeError:
        # What the importer reports as an error.
        result = {"CANCELLED"}
    if result != {"FINISHED"}:
        if use_scene:
            bpy.data.worlds.remove(scene.world)
            scene.world = former
        raise Refused(f"{path}: Blender's importer cannot read it; its messages say why")
    context.view_layer.update()
    objects = [obj for obj in bpy.data.objects if uid(obj) not in before]
    refused = []
    for material in [m for m in bpy.data.materials if uid(m) not in before]:
        refused += _dress(material)
    holder = next((obj for obj in objects if scene_notes.SCENE in obj), None)
    if holder is None:
        if use_scene:
            scene.render.engine = "CYCLES"
        if not usd_stage.has_modules():
            return objects, [
                f"{os.path.basename(path)}: lights and camera are as Blender's importer reads them; it lacks USD's Python modules"
            ]
        return objects, usd_values.set_all(scene, path, objects, use_scene)
    said = json.loads(holder[scene_notes.SCENE])
    by_name, missing = _objects(context, objects, holder)
    refused += missing
    if use_scene:
        refused += _scene(scene, said, by_name)
    lines = list(said["lacks"])
    if refused:
        lines.append(f"This Blender lacks {', '.join(sorted(set(refused)))}: these values are not set")
    return list(by_name.values()), lines


def uid(block):
    """What tells a data block from all others while Blender runs; names change, and may be given again."""
    return (type(block).__name__, block.session_uid)


def _dress(material):
    """Makes a material what its note says, or what the compiled module says of it; returns the names of refused values."""
    if scene_notes.MATERIAL in material:
        said = json.loads(material[scene_notes.MATERIAL])
        del material[scene_notes.MATERIAL]
        material.name = said["name"]
        return shader_notes.apply(material, said)
    if isinstance(material.get(FIELDS), str):
        fields = json.loads(material[FIELDS])
        if isinstance(fields, dict) and "base_color" in fields:
            del material[FIELDS]
            dressing.dress(material, fields)
    return []


def _objects(context, objects, holder):
    """Sets objects from their notes, and removes what only held them together. Returns ({noted name: object}, names of refused values)."""
    by_name, focuses, refused, kept = {}, {}, [], []
    noted = [(obj, _note_of(obj)) for obj in objects]
    noted = [(obj, said) for obj, said in noted if said is not None]
    for number, (obj, _) in enumerate(noted):
        # Out of the way of the names that others of them get.
        obj.name = f"importing {number}"
    for obj, said in noted:
        if _is_below(obj, holder):
            world = obj.matrix_world.copy()
            obj.parent = None
            obj.matrix_world = world
        if "matrix" in said:
            obj = _one_object(obj, [other for other, _ in noted])
        refused += scene_notes.set_object(obj, said)
        if "matrix" in said:
            # The importer gives location, rotation and scale, which cannot shear.
            obj.parent, obj.matrix_basis = None, Matrix()
            volume_object.place(context, obj, matrix.from_twelve(said["matrix"]))
        kept.append(obj)
        by_name.setdefault(said["name"], obj)
        if said.get("focus") is not None:
            focuses[obj] = said["focus"]
    for camera, name in focuses.items():
        camera.data.dof.focus_object = by_name.get(name)
    # What the scene had has a note: other empties held the stage together, such as the scope of the materials.
    for obj in [o for o in objects if o.type == "EMPTY" and o not in kept and not _holds(o, kept)]:
        bpy.data.objects.remove(obj)
    return by_name, refused


def _one_object(obj, noted):
    """The object that has the mesh of a noted object. A volume whose matrix shears arrives as two objects, an empty and, with the rest of the
    matrix, the mesh below it, which has no note; the empty then gives its properties to the mesh, and goes with what else held the stage
    together."""
    if obj.type != "EMPTY" or len(obj.children) != 1 or obj.children[0].type != "MESH" or obj.children[0] in noted:
        return obj
    body = obj.children[0]
    for name, value in obj.items():
        body[name] = value
    body.parent = None
    return body


def _note_of(obj):
    """The note of an object, which it keeps no longer; None where it has none. An object that is not merged with its Xform has it in its
    data."""
    for owner in (obj, obj.data):
        if owner is not None and scene_notes.OBJECT in owner:
            said = json.loads(owner[scene_notes.OBJECT])
            del owner[scene_notes.OBJECT]
            return said
    return None


def _holds(obj, others):
    return any(_is_below(other, obj) for other in others)


def _is_below(obj, holder):
    parent = obj.parent
    while parent is not None:
        if parent == holder:
            return True
        parent = parent.parent
    return False


def _scene(scene, said, by_name):
    """Sets the scene from its note; returns the names of refused values."""
    refused = scene_notes.set_scene(scene, said)
    scene.render.engine = "CYCLES"
    if said["camera"] in by_name:
        scene.camera = by_name[said["camera"]]
    if said["world"] is not None:
        _world(scene.world, said["world"])
    return refused


def _world(made, said):
    """Makes the world that is noted: one color, or the picture that the importer has found, turned about the vertical axis."""
    tree = nodes.ensure(made)
    image = next((node.image for node in tree.nodes if node.type == "TEX_ENVIRONMENT"), None)
    tree.nodes.clear()
    background, output = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
    output.location = (300.0, 0.0)
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    made.name = said["name"]
    visibility = getattr(made, "cycles_visibility", None)
    if visibility is not None:
        visibility.camera = said["is_seen"]
    if "constant" in said:
        background.inputs["Color"].default_value = (*said["constant"]["radiance"], 1.0)
        background.inputs["Strength"].default_value = 1.0
        return
    background.inputs["Strength"].default_value = said["image"]["strength"]
    if image is None:
        raise Refused(f"World {said['name']}: its picture is not where the stage says; keep the folder textures beside the file")
    picture, turn, place = (tree.nodes.new(f"ShaderNode{name}") for name in ("TexEnvironment", "Mapping", "TexCoord"))
    for node, left in ((picture, -300.0), (turn, -500.0), (place, -700.0)):
        node.location = (left, 0.0)
    picture.image = image
    image.colorspace_settings.name = "Linear Rec.709"
    turn.vector_type = "POINT"
    # The direction is turned back before it is looked up.
    turn.inputs["Rotation"].default_value = (0.0, 0.0, -said["image"]["rotation_rad"])
    tree.links.new(place.outputs["Generated"], turn.inputs["Vector"])
    tree.links.new(turn.outputs["Vector"], picture.inputs["Vector"])
    tree.links.new(picture.outputs["Color"], background.inputs["Color"])


class PUMICE_OT_import_scene(bpy.types.Operator, ImportHelper):
    """Import a USD stage that Pumice has exported, so that Cycles draws the same picture. Takes 570 bytes of memory for each face"""

    bl_idname = "pumice.import_scene"
    bl_label = "Import Pumice USD Scene"
    bl_options = {"UNDO"}

    filename_ext = ".usdc"
    filter_glob: StringProperty(default="*.usdc;*.usda;*.usdz;*.usd", options={"HIDDEN"})
    use_scene: BoolProperty(
        name="Scene Settings",
        description="Take the active camera, world, film, frame, color management and settings of Cycles from the file",
        default=True,
    )

    def execute(self, context):
        path = os.path.abspath(bpy.path.abspath(self.filepath))
        try:
            if not os.path.isfile(path):
                raise Refused(f"{path}: there is no such file")
            objects, lines = restore(context, path, self.use_scene)
        except Exception as error:
            log(error)
            self.report({"ERROR"}, one_line(error))
            return {"CANCELLED"}
        for line in lines:
            self.report({"WARNING"}, line)
        self.report({"INFO"}, f"{os.path.basename(path)}: {len(objects)} objects")
        return {"FINISHED"}


def _menu(self, _context):
    self.layout.operator(PUMICE_OT_import_scene.bl_idname, text="Pumice USD Scene (.usdc, .usda, .usdz)")


def register():
    bpy.utils.register_class(PUMICE_OT_import_scene)
    bpy.types.TOPBAR_MT_file_import.append(_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(_menu)
    bpy.utils.unregister_class(PUMICE_OT_import_scene)
