"""Renders a white Lambert square under each kind of lamp with Cycles, and prints the means that `transport/tests/lamps.rs` expects.

Run it by hand now and then, with Blender's module (5.0.1). If the values change, Cycles has changed:

    target/venv-bpy/bin/python tests/python/cycles_lamps.py

The square reaches from -1 to 1 in the plane z = 0 and fills the picture of an orthographic camera above it: no bounces, a box filter,
32 x 32 pixels with 1,024 samples each.
"""

import math
import os
import sys
import tempfile

import bpy
import mathutils
import numpy as np

SIDE = 32
PLACE = mathutils.Matrix.Translation((0.3, 0.2, 1.5))
TILTED = PLACE @ mathutils.Matrix.Rotation(0.5, 4, "X") @ mathutils.Matrix.Rotation(0.3, 4, "Y")


def ball(radius, soft):
    return "POINT", {"shadow_soft_size": radius, "use_soft_falloff": soft}


def spot(radius, degrees, blend, soft):
    cone = {"spot_size": math.radians(degrees), "spot_blend": blend}
    return "SPOT", {"shadow_soft_size": radius, "use_soft_falloff": soft, **cone}


def area(shape, size, size_y, degrees):
    return "AREA", {"shape": shape, "size": size, "size_y": size_y, "spread": math.radians(degrees)}


LAMPS = {
    "a point": ball(0.0, False),
    "a soft ball": ball(0.5, True),
    "within a soft ball": ball(4.0, True),
    "a ball": ball(0.5, False),
    "within a ball": ball(4.0, False),
    "a spot": spot(0.0, 60.0, 0.4, False),
    "a soft spot": spot(0.2, 60.0, 0.4, True),
    "a sharp soft spot": spot(0.2, 50.0, 0.0, True),
    "a narrow soft spot": spot(0.6, 20.0, 1.0, True),
    "a half space of a soft spot": spot(0.6, 180.0, 0.15, True),
    "a spot's ball": spot(0.2, 60.0, 0.4, False),
    # With Multiple Importance off: with it, Cycles loses a part of this light (docs/cycles.md).
    "within a spot's ball": spot(4.0, 60.0, 0.4, False) + (False,),
    "a sharp spot's ball": spot(0.2, 50.0, 0.0, False),
    "a narrow spot's ball": spot(0.6, 20.0, 1.0, False),
    "a half space of a spot's ball": spot(0.6, 180.0, 0.15, False),
    "a square": area("SQUARE", 1.0, 1.0, 180.0),
    "a rectangle": area("RECTANGLE", 1.5, 0.5, 180.0),
    "a disk": area("DISK", 1.0, 1.0, 180.0),
    "an ellipse": area("ELLIPSE", 1.5, 0.5, 180.0),
    "a spread rectangle": area("RECTANGLE", 1.5, 0.5, 60.0),
    "a narrow disk": area("DISK", 1.0, 1.0, 5.0),
    "a spread ellipse": area("ELLIPSE", 1.5, 0.5, 90.0),
    "a beam": area("RECTANGLE", 1.5, 0.5, 0.0),
}


def scene():
    """A scene with the square under a black sky, seen from above."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples = "CPU", 1024
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.diffuse_bounces = 0
    cycles.pixel_filter_type = "BOX"
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    scene.render.resolution_x = scene.render.resolution_y = SIDE
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.world = bpy.data.worlds.new("black")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    mesh = bpy.data.meshes.new("square")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
    material = bpy.data.materials.new("white")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    diffuse, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    tree.links.new(diffuse.outputs[0], output.inputs[0])
    mesh.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("square", mesh))
    camera = bpy.data.cameras.new("above")
    camera.type, camera.ortho_scale = "ORTHO", 2.0
    above = bpy.data.objects.new("above", camera)
    above.location = (0.0, 0.0, 10.0)
    scene.collection.objects.link(above)
    scene.camera = above
    return scene


def mean(scene, folder, kind, properties, mis=True):
    """Mean value of the picture under one lamp of 100 W."""
    light = bpy.data.lights.new("lamp", kind)
    light.energy, light.cycles.use_multiple_importance_sampling = 100.0, mis
    for name, value in properties.items():
        setattr(light, name, value)
    lamp = bpy.data.objects.new("lamp", light)
    lamp.matrix_world = TILTED
    lamp.visible_camera = False
    scene.collection.objects.link(lamp)
    scene.render.filepath = os.path.join(folder, "picture.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.array(image.pixels[:]).reshape(SIDE, SIDE, 4)
    bpy.data.images.remove(image)
    scene.collection.objects.unlink(lamp)
    return pixels[:, :, 0].mean()


def main():
    stage = scene()
    with tempfile.TemporaryDirectory() as folder:
        for name, of_lamp in LAMPS.items():
            print(f"{name}: {mean(stage, folder, *of_lamp):.6f}", flush=True)


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    # Some versions crash when the interpreter shuts down.
    os._exit(0)
