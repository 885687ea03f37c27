"""Renders glowing cubes in a black world with Cycles, through one camera of each kind.

    python draw.py OUT.npy        with Blender 5.0.1 as the module bpy

The array is float32, kind by kind as in KINDS, rows from the top: the share of each pixel that the cubes fill. They emit a radiance
of 1 and reflect nothing, so a sample is 0 or 1.
"""

import math
import os
import sys
import tempfile

import bpy
import numpy
from mathutils import Matrix

WIDTH, HEIGHT, SAMPLES = 48, 32, 1024

# Centres of the cubes, whose edges have length 1.
CUBES = [(-2.4, -1.2, -5.0), (0.1, 0.3, -8.0), (2.2, 1.4, -6.5), (1.1, -2.2, -10.0), (-1.9, 2.1, -12.0), (3.9, -1.0, -9.0)]

# The camera is rotated a little, so that its axes differ from the world's.
TURN = Matrix.Rotation(0.05, 4, "X") @ Matrix.Rotation(-0.04, 4, "Y") @ Matrix.Rotation(0.1, 4, "Z")

# lens_unit FOV: angle, radians, over the fitted side. fstop: radius = lens / (2 fstop), or 1 / (2 fstop) for parallel rays.
KINDS = {
    "auto": {},
    "horizontal, portrait": {"sensor_fit": "HORIZONTAL", "portrait": True},
    "vertical, shifted": {"sensor_fit": "VERTICAL", "shift": (0.1, -0.15)},
    "wide pixels, shifted": {"aspect": (1.6, 1.0), "shift": (-0.12, 0.08)},
    "parallel, tall pixels": {"ortho": 9.0, "aspect": (1.0, 1.7), "shift": (0.05, 0.1)},
    "clipped": {"clip": (6.0, 10.0)},
    "disk": {"fstop": 0.05, "focus": 8.0},
    "five blades, turned": {"fstop": 0.03, "focus": 6.0, "blades": 5, "rotation": 0.5},
    "three blades, narrow": {"fstop": 0.04, "focus": 11.0, "blades": 3, "rotation": -0.9, "ratio": 2.0, "shift": (0.1, 0.0)},
    "parallel, four blades, clipped": {"ortho": 10.0, "fstop": 0.6, "focus": 9.0, "blades": 4, "ratio": 0.5, "clip": (5.0, 9.3)},
}


def build():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    world = bpy.data.worlds.new("black")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    scene.world = world
    material = bpy.data.materials.new("glow")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    glow = tree.nodes.new("ShaderNodeEmission")
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(glow.outputs[0], out.inputs[0])
    for centre in CUBES:
        bpy.ops.mesh.primitive_cube_add(size=1.0, location=centre)
        bpy.context.object.data.materials.append(material)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_percentage = 100
    cycles.samples = SAMPLES
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.pixel_filter_type = "BOX"
    cycles.max_bounces = 0
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.image_settings.color_mode = "RGB"
    return scene, camera


def draw(scene, camera, folder, kind):
    portrait = kind.get("portrait", False)
    render, data = scene.render, camera.data
    render.resolution_x, render.resolution_y = (HEIGHT, WIDTH) if portrait else (WIDTH, HEIGHT)
    render.pixel_aspect_x, render.pixel_aspect_y = kind.get("aspect", (1.0, 1.0))
    camera.matrix_world = Matrix.Translation((0.2, -0.1, 0.3)) @ TURN
    data.sensor_fit = kind.get("sensor_fit", "AUTO")
    data.sensor_width, data.sensor_height = 36.0, 24.0
    data.type = "ORTHO" if "ortho" in kind else "PERSP"
    data.ortho_scale = kind.get("ortho", 6.0)
    data.lens = 35.0
    data.shift_x, data.shift_y = kind.get("shift", (0.0, 0.0))
    data.clip_start, data.clip_end = kind.get("clip", (0.1, 100.0))
    data.dof.use_dof = "fstop" in kind
    data.dof.aperture_fstop = kind.get("fstop", 2.8)
    data.dof.focus_distance = kind.get("focus", 10.0)
    data.dof.aperture_blades = kind.get("blades", 0)
    data.dof.aperture_rotation = kind.get("rotation", 0.0)
    data.dof.aperture_ratio = kind.get("ratio", 1.0)
    render.filepath = os.path.join(folder, "picture.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(render.filepath)
    pixels = numpy.array(image.pixels[:], dtype=numpy.float32).reshape(image.size[1], image.size[0], -1)
    bpy.data.images.remove(image)
    return pixels[::-1, :, 0]


def main():
    scene, camera = build()
    with tempfile.TemporaryDirectory() as folder:
        pictures = [draw(scene, camera, folder, kind).ravel() for kind in KINDS.values()]
    assert all(math.isfinite(p.sum()) for p in pictures)
    numpy.save(sys.argv[1], numpy.stack(pictures).astype("<f4"))
    sys.stdout.flush()
    os._exit(0)


main()
