# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene with one of everything that goes through a USD stage, and its values as a test compares them.

`build` makes it with Blender's own functions; `values` reads a scene again, made or imported. Neither uses the extension's notes.
As a program (`python staged_scene.py STAGE OUT.npz SEEDS HOW`) it imports a stage in a fresh Blender and renders it with Cycles: HOW is
`ours`, `stock` (Blender's importer alone) or `turned` (ours, and a light turned by 5°).
"""

import json
import math
import os
import sys
from pathlib import Path

import numpy as np

SIZE, BOUNCES, SPP = (96, 72), 4, 64
VOLUME, FLOOR = "blobs", "the floor"
PRINCIPLED = {
    FLOOR: {
        "Base Color": (0.5, 0.35, 0.2, 1.0),
        "Roughness": 0.6,
        "Sheen Weight": 0.4,
        "Sheen Tint": (1.0, 0.5, 0.3, 1.0),
        "Coat Weight": 0.5,
        "Coat Roughness": 0.2,
        "Coat IOR": 1.7,
        "Coat Tint": (0.9, 1.0, 0.8, 1.0),
        "Anisotropic": 0.25,
    },
    "gold": {"Base Color": (1.0, 0.7, 0.3, 1.0), "Metallic": 1.0, "Roughness": 0.35, "Specular Tint": (0.9, 0.95, 1.0, 1.0)},
    "glass": {"Base Color": (0.8, 1.0, 0.9, 1.0), "Transmission Weight": 1.0, "IOR": 1.33, "Roughness": 0.3},
}
LIGHTS = {
    "sun": ("SUN", {"energy": 1.5, "angle": 0.2, "color": (1.0, 0.9, 0.7), "exposure": 0.5}),
    "bulb": ("POINT", {"energy": 120.0, "shadow_soft_size": 0.3, "use_soft_falloff": False, "color": (0.6, 0.8, 1.0)}),
    "spot": ("SPOT", {"energy": 400.0, "spot_size": 0.9, "spot_blend": 0.4, "shadow_soft_size": 0.2}),
    "panel": ("AREA", {"energy": 150.0, "shape": "RECTANGLE", "size": 2.0, "size_y": 0.5, "spread": 2.0}),
    "disk": ("AREA", {"energy": 80.0, "shape": "ELLIPSE", "size": 1.5, "size_y": 0.75}),
}
CAMERA = {
    "lens": 40.0,
    "sensor_fit": "VERTICAL",
    "sensor_height": 20.0,
    "shift_x": 0.08,
    "shift_y": -0.05,
    "clip_start": 0.25,
    "clip_end": 90.0,
}
LENS = {
    "use_dof": True,
    "focus_distance": 9.0,
    "aperture_fstop": 0.2,
    "aperture_blades": 5,
    "aperture_rotation": 0.3,
    "aperture_ratio": 1.5,
}


def labels():
    """Eight balls in a grid of 24³ voxels, two of them touching, the ids large and not in a row."""
    at = np.stack(np.meshgrid(*[np.arange(24) + 0.5] * 3, indexing="ij"), axis=-1)
    out = np.zeros((24, 24, 24), dtype=np.uint32)
    for number, corner in enumerate(np.ndindex(2, 2, 2)):
        centre = 6.5 + 11.0 * np.array(corner) - 0.75 * (number == 1) * np.array([0, 0, 2.0])
        out[np.linalg.norm(at - centre, axis=-1) < 4.6 + 0.3 * number] = 70000 + 37 * number
    return out


def build(bpy, folder):
    """Makes the scene around the volume, whose file it writes into a folder."""
    import pumice
    from mathutils import Euler, Matrix, Vector

    pumice.compress(labels(), spacing=(4, 4, 5), unit="nm", names={70000: "the first"}).save(folder / f"{VOLUME}.pumice")
    assert bpy.ops.pumice.import_volume(filepath=str(folder / f"{VOLUME}.pumice"), use_light=False, use_camera=False) == {"FINISHED"}
    scene, volume = bpy.context.scene, bpy.context.object
    placed = Matrix.LocRotScale(Vector((0.5, -0.3, 2.2)), Euler((0.3, 0.4, 0.5)), Vector((-0.15, 0.12, 0.13)))
    volume.matrix_world = placed @ Matrix.Translation((-12, -12, -12))

    def linked(name, data, place, turn=(0.0, 0.0, 0.0), scale=(1.0, 1.0, 1.0)):
        obj = bpy.data.objects.new(name, data)
        obj.matrix_world = Matrix.LocRotScale(Vector(place), Euler(turn), Vector(scale))
        scene.collection.objects.link(obj)
        return obj

    camera = linked("the camera", bpy.data.cameras.new("eye"), (2.0, -11.0, 5.0), (1.25, 0.0, 0.17))
    for owner, wanted in ((camera.data, CAMERA), (camera.data.dof, LENS)):
        for name, value in wanted.items():
            setattr(owner, name, value)
    scene.camera = camera
    places = {"sun": (0, 0, 9), "bulb": (-3, -2, 4), "spot": (3.5, -3, 6), "panel": (-4, 1, 5), "disk": (4, 2, 4)}
    turns = {"sun": (0.4, 0.3, 0.0), "bulb": (0, 0, 0), "spot": (0.6, 0.5, 0.1), "panel": (0.2, -0.8, 0.0), "disk": (-0.3, 0.9, 0.2)}
    for name, (kind, wanted) in LIGHTS.items():
        light = bpy.data.lights.new(name, kind)
        for key, value in wanted.items():
            if hasattr(light, key):
                setattr(light, key, value)
        linked(name, light, places[name], turns[name], (1.5, 1.0, 1.0) if name == "panel" else (1.0, 1.0, 1.0))
    bpy.data.objects["panel"].visible_camera = False

    for name, wanted in PRINCIPLED.items():
        material = bpy.data.materials.new(name)
        if bpy.app.version < (5, 0, 0):
            material.use_nodes = True
        shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        for key, value in wanted.items():
            shader.inputs[key].default_value = value
    next(n for n in bpy.data.materials["gold"].node_tree.nodes if n.type == "BSDF_PRINCIPLED").distribution = "GGX"
    bpy.ops.mesh.primitive_plane_add(size=16.0)
    bpy.context.object.name = FLOOR
    for name, place in (("gold", (-2.4, -1.5, 0.9)), ("glass", (2.2, -2.5, 1.0))):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12, radius=0.9, location=place)
        bpy.ops.object.shade_smooth()
        bpy.context.object.name = name
        bpy.context.object.scale = (1.0, 1.2, 1.0)
    for name in PRINCIPLED:
        bpy.data.objects[name].data.materials.append(bpy.data.materials[name])

    picture = bpy.data.images.new("sky", 32, 16, float_buffer=True)
    rows, columns = np.mgrid[0:16, 0:32]
    pixels = np.stack([0.2 + 0.02 * columns, 0.3 + 0.01 * rows, 0.5 + 0.0 * rows, np.ones((16, 32))], axis=-1)
    pixels[12:14, 20:23, :3] = 9.0
    picture.pixels.foreach_set(pixels.astype(np.float32).ravel())
    picture.file_format, picture.filepath_raw = "OPEN_EXR", str(folder / "sky.exr")
    picture.save()
    scene.world = bpy.data.worlds.new("the sky")
    if bpy.app.version < (5, 0, 0):
        scene.world.use_nodes = True
    tree = scene.world.node_tree
    tree.nodes.clear()
    background, output, node, turn, place = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("Background", "OutputWorld", "TexEnvironment", "Mapping", "TexCoord")
    )
    background.inputs["Strength"].default_value = 0.7
    node.image = bpy.data.images.load(str(folder / "sky.exr"))
    node.image.colorspace_settings.name = "Linear Rec.709"
    turn.inputs["Rotation"].default_value = (0.0, 0.0, 0.75)
    for one, socket, other, name in (
        (place, "Generated", turn, "Vector"),
        (turn, "Vector", node, "Vector"),
        (node, "Color", background, "Color"),
        (background, "Background", output, "Surface"),
    ):
        tree.links.new(one.outputs[socket], other.inputs[name])

    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *SIZE, 100
    render.pixel_aspect_x, render.fps, render.fps_base = 1.25, 30, 1.001
    scene.view_settings.view_transform, scene.view_settings.exposure = "Standard", 0.5
    scene.frame_current = 7
    cycles = scene.cycles
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = SPP, False, False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = BOUNCES
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", 1.25
    bpy.context.view_layer.update()
    return volume


def values(bpy):
    """What a scene is, by name: places, cameras, lights, materials, world, film."""
    scene, out = bpy.context.scene, {}
    bpy.context.view_layer.update()
    for name in ("the camera", *LIGHTS, *PRINCIPLED):
        obj = bpy.data.objects[name]
        out[name] = {"matrix": [list(row) for row in obj.matrix_world], "seen": obj.visible_camera}
    data = bpy.data.objects["the camera"].data
    out["camera"] = {name: getattr(data, name) for name in (*CAMERA, "type", "sensor_width")}
    out["lens"] = {name: getattr(data.dof, name) for name in LENS}
    for name, (kind, wanted) in LIGHTS.items():
        light = bpy.data.objects[name].data
        assert light.type == kind, (name, light.type)
        out[name].update({key: plain(getattr(light, key)) for key in wanted if hasattr(light, key)})
    for name in PRINCIPLED:
        obj = bpy.data.objects[name]
        (material,) = obj.data.materials
        shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        numbers = {s.identifier: plain(s.default_value) for s in shader.inputs if s.type in {"VALUE", "RGBA", "VECTOR"}}
        out[name]["material"] = {**numbers, "name": material.name, "distribution": shader.distribution}
        corners = np.array([obj.matrix_world @ v.co for v in obj.data.vertices])
        out[name]["mesh"] = [len(obj.data.polygons), corners.min(axis=0).tolist(), corners.max(axis=0).tolist(), len(obj.data.uv_layers)]
    nodes = {node.type: node for node in scene.world.node_tree.nodes}
    image = nodes["TEX_ENVIRONMENT"].image
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    out["world"] = {
        "name": scene.world.name,
        "strength": nodes["BACKGROUND"].inputs["Strength"].default_value,
        "turn": plain(nodes["MAPPING"].inputs["Rotation"].default_value),
        "picture": [*image.size, float(pixels.astype(np.float64).sum())],
    }
    render, cycles = scene.render, scene.cycles
    out["film"] = [render.resolution_x, render.resolution_y, render.resolution_percentage, render.pixel_aspect_x, render.pixel_aspect_y]
    out["film"] += [render.fps, render.fps_base, scene.frame_current, cycles.samples, cycles.max_bounces, cycles.filter_width]
    out["film"] += [cycles.use_adaptive_sampling, scene.view_settings.view_transform, scene.view_settings.exposure, scene.camera.name]
    return out


def plain(value):
    return value if isinstance(value, (bool, int, float, str)) else [plain(one) for one in value]


def differences(one, other, at=""):
    """Places at which two values differ by more than single precision explains."""
    if isinstance(one, dict):
        return [d for key in one for d in differences(one[key], other[key], f"{at}/{key}")]
    if isinstance(one, list):
        return [d for i, (a, b) in enumerate(zip(one, other, strict=True)) for d in differences(a, b, f"{at}/{i}")]
    if isinstance(one, float) and not isinstance(other, str):
        # A matrix is taken apart into location, rotation and scale and put together again: some ten roundings of 6e-8.
        return [] if abs(one - other) <= 2e-6 * max(1.0, abs(one)) else [f"{at}: {one} is {other}"]
    return [] if one == other else [f"{at}: {one} is {other}"]


def rendered(bpy, folder, seeds):
    """Pictures by Cycles, one for each seed: (seed, row, column, channel)."""
    import OpenImageIO

    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
    image = scene.render.image_settings
    if bpy.app.version >= (5, 0, 0):
        image.media_type = "IMAGE"
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR", "32", "NONE"
    scene.render.filepath = str(Path(folder) / "cycles.exr")
    out = []
    for seed in seeds:
        scene.cycles.seed = seed
        bpy.ops.render.render(write_still=True)
        file = OpenImageIO.ImageInput.open(scene.render.filepath)
        assert file is not None, OpenImageIO.geterror()
        out.append(file.read_image(0, 0, 0, file.spec().nchannels, "float")[..., :3].astype(np.float64))
        file.close()
    return np.array(out)


def main(stage, out, seeds, how):
    """See the top of the file."""
    import bpy  # noqa: I001
    import addon_utils  # bpy brings it
    from mathutils import Matrix

    for brought in Path(bpy.utils.resource_path("LOCAL")).glob("python/lib/python3*/site-packages"):
        sys.path.append(str(brought))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert addon_utils.enable("bl_ext.user_default.pumice", persistent=True) is not None
    scene = bpy.context.scene
    if how == "stock":
        scene.world = bpy.data.worlds.new("sky")
        assert bpy.ops.wm.usd_import(filepath=stage) == {"FINISHED"}
        scene.camera = next(o for o in bpy.data.objects if o.type == "CAMERA")
        scene.render.resolution_x, scene.render.resolution_y, scene.render.pixel_aspect_x = *SIZE, 1.25
        scene.cycles.samples, scene.cycles.use_adaptive_sampling, scene.cycles.use_denoising = SPP, False, False
    else:
        assert bpy.ops.pumice.import_scene(filepath=stage) == {"FINISHED"}
    if how == "turned":
        spot = bpy.data.objects["spot"]
        spot.matrix_world = spot.matrix_world @ Matrix.Rotation(math.radians(5.0), 4, "X")
    found = values(bpy) if how == "ours" else {}
    first = int(seeds)
    pictures = rendered(bpy, os.path.dirname(out), range(first, first + 8))
    np.savez(out, pictures=pictures, values=json.dumps(found))
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
