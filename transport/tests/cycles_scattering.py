"""Renders a plane in Cycles, material by material, and writes what cycles_scattering.rs compares with.

    python cycles_scattering.py cycles_scattering.json          (a Python that has bpy; the materials are those in the file)

Each material is seen from three directions under each of three suns of angle 0. Only light sampling finds such light, so 16 samples are
as good as any number. "from_inside" materials are seen from behind the plane.
"""

import json
import math
import os
import sys

import bpy
import numpy as np
from mathutils import Matrix, Vector

PICTURE = os.path.abspath("cycles_scattering.exr")
INPUTS = {
    "metallic": "Metallic",
    "roughness": "Roughness",
    "specular": "Specular IOR Level",
    "ior": "IOR",
    "transmission": "Transmission Weight",
    "coat": "Coat Weight",
    "coat_roughness": "Coat Roughness",
    "coat_ior": "Coat IOR",
    "sheen": "Sheen Weight",
    "sheen_roughness": "Sheen Roughness",
    "alpha": "Alpha",
}
COLORS = {
    "base_color": "Base Color",
    "specular_tint": "Specular Tint",
    "coat_tint": "Coat Tint",
    "sheen_tint": "Sheen Tint",
}


def toward(z, azimuth, side):
    r = math.sqrt(1 - z * z)
    return Vector((r * math.cos(azimuth), r * math.sin(azimuth), side * z))


def scene_of_a_plane():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.render.filepath = PICTURE
    image = scene.render.image_settings
    image.file_format, image.color_depth, image.color_mode = "OPEN_EXR", "32", "RGBA"
    cycles = scene.cycles
    cycles.samples, cycles.max_bounces, cycles.blur_glossy = 16, 0, 0
    cycles.sample_clamp_indirect, cycles.use_adaptive_sampling, cycles.use_denoising = 0, False, False
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0
    mesh = bpy.data.meshes.new("plane")
    mesh.from_pydata([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [], [(0, 1, 2, 3)])
    material = bpy.data.materials.new("material")
    material.use_nodes = True
    mesh.materials.append(material)
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.ortho_scale = "ORTHO", 0.5
    sun = bpy.data.lights.new("sun", "SUN")
    sun.angle, sun.energy = 0, 1
    objects = [bpy.data.objects.new(data.name, data) for data in (mesh, camera, sun)]
    for one in objects:
        scene.collection.objects.link(one)
    scene.camera = objects[1]
    return material.node_tree.nodes["Principled BSDF"], objects[1], objects[2]


def place(one, direction, distance):
    turn = direction.to_track_quat("Z", "Y").to_matrix().to_4x4()
    one.matrix_world = Matrix.Translation(direction * distance) @ turn


def shown():
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(PICTURE)
    pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    bpy.data.images.remove(image)
    return [float(f"{c:.6g}") for c in pixels.mean(0)]


def main(path):
    with open(path, encoding="utf-8") as file:
        rows = json.load(file)
    bsdf, camera, sun = scene_of_a_plane()
    plain = {s.name: s.default_value for s in bsdf.inputs if s.type == "VALUE"}
    for row in rows:
        material, side = row["material"], -1 if row["from_inside"] else 1
        for name, socket in INPUTS.items():
            bsdf.inputs[socket].default_value = material.get(name, plain[socket])
        for name, socket in COLORS.items():
            bsdf.inputs[socket].default_value = (*material.get(name, [0.8 if name == "base_color" else 1] * 3), 1)
        emission = material.get("emission", [0, 0, 0])
        bsdf.inputs["Emission Color"].default_value = (*emission, 1)
        bsdf.inputs["Emission Strength"].default_value = 1 if any(emission) else 0
        bsdf.distribution = "MULTI_GGX" if material.get("multiscatter", True) else "GGX"
        row["sun"] = []
        for z in (0.95, 0.6, 0.25):
            place(camera, toward(z, 0.4, side), 5)
            for height, azimuth in ((0.9, 2.0), (0.5, 3.3), (0.3, 0.8)):
                place(sun, toward(height, azimuth, side), 0)
                row["sun"].append(shown())
    with open(path, "w", encoding="utf-8") as file:
        file.write("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]\n")
    os.remove(PICTURE)


main(sys.argv[1])
sys.stdout.flush()
os._exit(0)
