# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole scene as one USD stage: Blender's own exporter writes what it knows, Pumice the volumes, and notes say what USD cannot.

    NAME.usdc             /root                  by Blender: objects with their names, meshes with UVs, materials, textures
                          /root/world            the world as a DomeLight, where it is one color or one picture
                          /root/pumice           note of the scene; refers to
    NAME-volumes.usdc     /Scene                 by Pumice: the surface of each volume, with labels and materials
    textures/             pictures

A `.usdz` holds all of them. Blender exports a scene that lacks the volumes' proxies, and in which curves, texts and surfaces are meshes,
as Cycles draws them; afterwards the scene is as before.
"""

import contextlib
import importlib.util
import json
import math
import os
import shutil
import sys
from pathlib import Path

import bpy

from . import scene_notes, volume_place
from .properties import is_volume
from .reports import Refused
from .sync import cuts, shader_notes, world

ROOT = "/root"
WORLD, HOLDER = f"{ROOT}/world", f"{ROOT}/pumice"
# Where Blender's exporter writes the name of an object; the prim of its data has another.
OBJECT_NAME, DATA_NAME = "userProperties:blender:object_name", "userProperties:blender:data_name"
# What has triangles and is no mesh: as curves these would arrive without their thickness, or not at all.
MADE_MESHES = {"CURVE", "SURFACE", "FONT"}
# Objects that Blender's exporter does not write, and that have a surface.
NOT_WRITTEN = {"GREASEPENCIL", "GPENCIL"}


def require():
    """Raises Refused where Blender has no USD, or no Python modules of it."""
    try:
        bpy.ops.wm.usd_export.get_rna_type()
    except KeyError:
        raise Refused("This Blender was built without USD") from None
    if not has_modules():
        raise Refused("This Blender lacks the Python modules of USD (pxr); Blender 5.0 has them")


def has_modules():
    """Whether USD's Python modules load. Blender as a Python module has them in a folder that is not searched."""
    if importlib.util.find_spec("pxr") is None:
        sys.path += [str(found) for found in Path(bpy.utils.resource_path("LOCAL")).glob("python/lib/python3*/site-packages")]
    return importlib.util.find_spec("pxr") is not None


def export_around(context, path):
    """Writes all but the volumes by Blender's own exporter. Returns {name of an exported object: object that it stands for}."""
    wishes = {
        "check_existing": False,
        "visible_objects_only": True,
        "evaluation_mode": "RENDER",
        "export_animation": False,
        "export_custom_properties": True,
        "author_blender_name": True,
        "root_prim_path": ROOT,
        "xform_op_mode": "MAT",
        "export_subdivision": "TESSELLATE",
        "convert_world_material": not _is_ours(context.scene.world),
        "generate_preview_surface": True,
        "export_textures_mode": "NEW",
        "overwrite_textures": True,
        "relative_paths": True,
    }
    with _only_what_travels(context) as stands_for:
        done = bpy.ops.wm.usd_export(filepath=path, **accepted(bpy.ops.wm.usd_export, wishes))
    if done != {"FINISHED"} or not os.path.exists(path):
        raise Refused(f"{path}: Blender's exporter wrote nothing; its messages say why")
    return stands_for


def accepted(operator, wishes):
    """Those arguments that this Blender's operator has."""
    return {name: value for name, value in wishes.items() if name in operator.get_rna_type().properties}


def compose(path, volumes_name, scene, stands_for, volume_objects, lacks):
    """Adds world, volumes and notes to the stage that Blender wrote.

    `volumes_name` is the file of the volumes beside it, or None; `volume_objects` their objects by number of the instance; `lacks` what
    the stage lacks, which the import tells again.
    """
    from pxr import Sdf, Usd, UsdGeom

    stage = Usd.Stage.Open(path)

    def say(prim, name, what):
        prim.CreateAttribute(f"userProperties:{name}", Sdf.ValueTypeNames.String, True).Set(json.dumps(what, ensure_ascii=False))

    def frame_of(name):
        return {"name": f"{name} frame", "object": {}}

    gone = []
    for prim in list(stage.TraverseAll()):
        name = prim.GetAttribute(OBJECT_NAME).Get() if prim.HasAttribute(OBJECT_NAME) else None
        obj = stands_for.get(name) or bpy.data.objects.get(name) if name is not None else None
        replaced = obj in stands_for.values() and name not in stands_for
        if obj is not None and (is_volume(obj) or cuts.is_cut(obj) or obj.hide_render or replaced):
            gone.append(prim)
        elif obj is not None:
            if obj.type == "LIGHT":
                _to_specification(prim, obj.data)
            data = [child for child in prim.GetChildren() if not child.HasAttribute(OBJECT_NAME)]
            if data and len(prim.GetChildren()) > len(data):
                # Where other objects hang below it, the importer makes an empty of the Xform, and another object of its data.
                say(data[0], scene_notes.OBJECT, scene_notes.of_object(obj))
                say(prim, scene_notes.OBJECT, frame_of(name))
            else:
                say(prim, scene_notes.OBJECT, scene_notes.of_object(obj))
        elif prim.GetTypeName() == "Material":
            material = _material_of(prim)
            if material is not None:
                say(prim, scene_notes.MATERIAL, shader_notes.note(material)[0])
    for prim in reversed(gone):
        for child in prim.GetChildren():
            if not child.HasAttribute(OBJECT_NAME):
                stage.RemovePrim(child.GetPath())
        if not prim.GetChildren():
            stage.RemovePrim(prim.GetPath())
        else:
            # What hangs below it stays, and so does its place.
            say(prim, scene_notes.OBJECT, frame_of(prim.GetAttribute(OBJECT_NAME).Get()))

    said = scene_notes.of_scene(scene)
    said["world"] = _write_world(stage, scene.world, path) if _is_ours(scene.world) else None
    said["lacks"] = lacks
    holder = UsdGeom.Xform.Define(stage, HOLDER).GetPrim()
    say(holder, scene_notes.SCENE, said)
    if volumes_name is not None:
        # The volumes' stage is a component, and a component may hang below groups alone.
        Usd.ModelAPI(stage.GetPrimAtPath(ROOT)).SetKind("group")
        holder.GetReferences().AddReference(f"./{volumes_name}")
        # The camera and the black world without which no scene can be written.
        for name in ("camera", "world"):
            stage.OverridePrim(f"{HOLDER}/{name}").SetActive(False)
        for number, obj in volume_objects.items():
            place = volume_place.world_from_index(obj)
            say(stage.OverridePrim(f"{HOLDER}/volume_{number}"), scene_notes.OBJECT, scene_notes.of_object(obj, world=place))
    stage.GetRootLayer().Save()


def package(path, out):
    """Packs a stage and all that it refers to into a `.usdz` file."""
    from pxr import Sdf, UsdUtils

    if not UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(path), out):
        raise Refused(f"{out}: the stage could not be packed; .usdc keeps its parts beside it")


def move_into_place(folder, out_folder):
    """Moves the finished files out of a temporary folder. A picture is never replaced by another one of the same name."""
    pictures = os.path.join(folder, "textures")
    moves = []
    for name in sorted(os.listdir(pictures)) if os.path.isdir(pictures) else []:
        source, target = os.path.join(pictures, name), os.path.join(out_folder, "textures", name)
        if not os.path.exists(target):
            moves.append((source, target))
        elif not _same_bytes(source, target):
            raise Refused(f"{target}: another picture has this name already; choose another folder")
    if moves:
        os.makedirs(os.path.join(out_folder, "textures"), exist_ok=True)
    # The stage comes last: where it is, all that it refers to is.
    files = [name for name in os.listdir(folder) if os.path.isfile(os.path.join(folder, name))]
    files.sort(key=lambda name: (not os.path.splitext(name)[0].endswith("-volumes"), name))
    for source, target in [*moves, *((os.path.join(folder, name), os.path.join(out_folder, name)) for name in files)]:
        os.replace(source, target)


def lacks_of(context):
    """One line for each thing of a scene that its stage lacks."""
    scene, lacks = context.scene, []
    hidden, missing, moving, cutting, materials = [], [], [], [], {}
    for obj in scene.objects:
        if obj.hide_render:
            if not (is_volume(obj) or cuts.is_cut(obj)):
                hidden.append(obj.name)
            continue
        if obj.type in NOT_WRITTEN:
            missing.append(obj.name)
        if obj.animation_data is not None and (obj.animation_data.action is not None or len(obj.animation_data.drivers) > 0):
            moving.append(obj.name)
        if obj.type == "LIGHT":
            lacks += scene_notes.light_lacks(obj)
        if cuts.is_cut(obj):
            cutting.append(obj.name)
        elif not is_volume(obj):
            materials.update({slot.material.name: slot.material for slot in obj.material_slots if slot.material is not None})
    for name in sorted(materials):
        lacks += shader_notes.note(materials[name])[1]
    if scene.pumice.smooth_voxels and any(is_volume(obj) and not obj.hide_render for obj in scene.objects):
        lacks.append("Smooth Voxels is not in the file: volumes have flat faces")
    if scene.pumice_figure.use_backdrop:
        lacks.append("The figure's backdrop is not in the file: the camera sees the world")
    if not _is_ours(scene.world):
        lacks.append("World: it arrives as Blender's exporter writes it, which is its picture and strength at best")
    for names, what in (
        (hidden, "hidden in renders, so not in the file"),
        (missing, "not in the file, because USD or Blender's exporter has no such objects"),
        (cutting, "not in the file; the volumes are, as the cut leaves them"),
        (moving, f"animated; the file has frame {scene.frame_current} alone"),
    ):
        if names:
            lacks.append(f"{', '.join(names[:8])}{f' and {len(names) - 8} more' if len(names) > 8 else ''}: {what}")
    return lacks


@contextlib.contextmanager
def _only_what_travels(context):
    """Hides volumes and cuts, and puts meshes in the place of curves, while Blender exports; yields what the meshes stand for."""
    depsgraph, scene = context.evaluated_depsgraph_get(), context.scene
    hidden, made, stands_for = [], [], {}
    try:
        for obj in [o for o in scene.objects if not o.hide_render]:
            if obj.type in MADE_MESHES:
                mesh = bpy.data.meshes.new_from_object(obj.evaluated_get(depsgraph), depsgraph=depsgraph)
                stand_in = bpy.data.objects.new(obj.name, mesh)
                made.append(stand_in)
                stands_for[stand_in.name] = obj
                stand_in.matrix_world = obj.matrix_world
                scene.collection.objects.link(stand_in)
            elif not (is_volume(obj) or cuts.is_cut(obj)):
                continue
            obj.hide_render = True
            hidden.append(obj)
        yield stands_for
    finally:
        for obj in hidden:
            obj.hide_render = False
        for stand_in in made:
            mesh = stand_in.data
            bpy.data.objects.remove(stand_in)
            bpy.data.meshes.remove(mesh)


def _is_ours(of_scene):
    """Whether a world is one that Pumice draws exactly, so that it writes it too."""
    return of_scene is None or not world.read(of_scene)[1]


def _write_world(stage, of_scene, path):
    """Writes a world as a DomeLight, a picture beside the stage; returns its note. The pole of USD's pictures is +y, ours +z."""
    from pxr import Gf, Sdf, UsdGeom, UsdLux

    read = world.read(of_scene)[0]
    dome = UsdLux.DomeLight.Define(stage, WORLD)
    said = {"name": of_scene.name if of_scene is not None else "World", "is_seen": read["backdrop"] is None}
    ((kind, values),) = read["environment"].items()
    said[kind] = {name: value for name, value in values.items() if name != "path"}
    if kind == "constant":
        brightest = max(values["radiance"])
        dome.CreateIntensityAttr(brightest)
        dome.CreateColorAttr(Gf.Vec3f(*(c / brightest for c in values["radiance"])) if brightest > 0.0 else Gf.Vec3f(1.0))
        return said
    folder = os.path.join(os.path.dirname(path), "textures")
    os.makedirs(folder, exist_ok=True)
    shutil.copyfile(values["path"], os.path.join(folder, os.path.basename(values["path"])))
    dome.CreateIntensityAttr(values["strength"])
    dome.CreateTextureFileAttr(Sdf.AssetPath(f"./textures/{os.path.basename(values['path'])}"))
    dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    s, c = math.sin(values["rotation_rad"]), math.cos(values["rotation_rad"])
    turn = UsdGeom.Xformable(dome).MakeMatrixXform()
    turn.Set(Gf.Matrix4d(-s, c, 0, 0, 0, 0, 1, 0, c, s, 0, 0, 0, 0, 0, 1))
    return said


def _to_specification(prim, light):
    """Sets what Blender's exporter writes as its own importer takes it: other programs keep to the specification of UsdLux.

    A sun has a quarter of its strength and half its angle; the softness of a spot is Cycles' blend, over cosines instead of angles.
    """
    from pxr import UsdLux

    for child in prim.GetChildren():
        if child.IsA(UsdLux.DistantLight) and light.type == "SUN":
            UsdLux.LightAPI(child).CreateIntensityAttr(light.energy)
            UsdLux.DistantLight(child).CreateAngleAttr(math.degrees(light.angle))
        elif child.HasAPI(UsdLux.ShapingAPI) and light.type == "SPOT":
            half = 0.5 * light.spot_size
            start = 2.0 * math.asin(math.sqrt(1.0 - light.spot_blend) * math.sin(0.5 * half))
            UsdLux.ShapingAPI(child).CreateShapingConeSoftnessAttr(1.0 - start / half if half > 0.0 else light.spot_blend)


def _material_of(prim):
    """The Blender material that a prim was written from; None for one that was not."""
    if prim.HasAttribute(DATA_NAME):
        return bpy.data.materials.get(prim.GetAttribute(DATA_NAME).Get())
    from pxr import Tf

    found = [m for m in bpy.data.materials if Tf.MakeValidIdentifier(m.name) == prim.GetName()]
    return found[0] if len(found) == 1 else None


def _same_bytes(one, other):
    if os.path.getsize(one) != os.path.getsize(other):
        return False
    with open(one, "rb") as a, open(other, "rb") as b:
        return all(x == y for x, y in zip(iter(lambda: a.read(1 << 20), b""), iter(lambda: b.read(1 << 20), b"")))
