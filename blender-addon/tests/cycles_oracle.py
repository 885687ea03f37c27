# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders small pictures with Cycles as an oracle for the meaning of Blender's data: a plane under a lamp, a ball, the sky."""

import math

import numpy as np
from mathutils import Euler, Matrix, Vector


def prepare(bpy, folder, size=8, samples=64):
    """Sets up the scene so that Cycles renders into an OpenEXR file of floats, without clamps, caustic tricks and denoising."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    render = scene.render
    render.resolution_x = render.resolution_y = size
    render.resolution_percentage = 100
    if bpy.app.version >= (5, 0, 0):
        render.image_settings.media_type = "IMAGE"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.image_settings.exr_codec = "NONE"
    render.filepath = str(folder / "cycles.exr")
    cycles = scene.cycles
    cycles.device, cycles.samples = "CPU", samples
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 8
    return scene


def picture(bpy, scene):
    """Renders; returns RGB, row 0 at the top."""
    import OpenImageIO

    bpy.ops.render.render(write_still=True)
    file = OpenImageIO.ImageInput.open(scene.render.filepath)
    assert file is not None, OpenImageIO.geterror()
    return file.read_image(0, 0, 0, file.spec().nchannels, "float")[..., :3].astype(np.float64)


def camera(bpy, place, turn, lens=None, ortho_scale=None):
    """Adds a camera that looks along its -z; `turn` are Euler angles."""
    data = bpy.data.cameras.new("eye")
    if ortho_scale is not None:
        data.type, data.ortho_scale = "ORTHO", ortho_scale
    if lens is not None:
        data.lens = lens
    obj = bpy.data.objects.new("eye", data)
    obj.matrix_world = Matrix.LocRotScale(Vector(place), Euler(turn), None)
    bpy.context.collection.objects.link(obj)
    bpy.context.scene.camera = obj
    return obj


def plane(bpy, albedo, half=50.0):
    """Adds a grey Lambert plane at z = 0, and a camera that sees a patch of it of 0.01 units."""
    mesh = bpy.data.meshes.new("floor")
    mesh.from_pydata([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [], [(0, 1, 2, 3)])
    material = bpy.data.materials.new("floor")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    shader.inputs["Color"].default_value = (albedo, albedo, albedo, 1.0)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    mesh.materials.append(material)
    floor = bpy.data.objects.new("floor", mesh)
    bpy.context.collection.objects.link(floor)
    # The camera looks obliquely from the side, below the lamps.
    camera(bpy, (0.0, -1.0, 1.0), (math.pi / 4, 0.0, 0.0), ortho_scale=0.01)
    return floor
