# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that F12 gives the same picture with Pumice and with Cycles, from the same volume, camera, light, sky, materials and meshes. Cycles
gets the voxels as quads.

Both renderers are unbiased, so their pictures differ only by noise, which eight seeds of each measure. They are judged by the test of
equality of `pumice.agreement`: the ratio of the squared difference to the noise, within what random halves of the same pictures give; Welch's
t of each tile of 8 × 8 pixels, none beyond Šidák's bound at 1 % for all together; the mean within 4 standard errors, and within 0.1 %.

Measured once with 256 samples at 128 × 96: ratio 0.99, means equal to 7e-7. The ratio detects each control below.
"""

import numpy as np
import pumice
import pytest

from test_real_volumes import exr, imported

# (Cycles' first sample goes through the pixel's centre. With 64 samples the noise is low enough to show that.)
SIZE, SPP, SEEDS = (96, 72), 256, 8
BOUNCES = 3


@pytest.fixture
def crop(tmp_path, data):
    """A file with twelve neurites of the shipped cortex, 48³ voxels."""
    whole = pumice.open(data / "connectomics_32x32x40nm.nrrd").decode()
    cut = whole[100:148, 100:148, 200:248]
    ids, counts = np.unique(cut[cut > 0], return_counts=True)
    shown = ids[np.argsort(-counts)][3:15]
    labels = np.where(np.isin(cut, shown), cut, 0)
    path = tmp_path / "crop.pumice"
    pumice.compress(labels, spacing=(32, 32, 40), unit="nm").save(path)
    return path, labels


@pytest.fixture
def scene(blender, crop):
    path, labels = crop
    obj = imported(blender, path)
    scene = blender.context.scene
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *SIZE, 100
    if blender.app.version >= (5, 0, 0):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    render.image_settings.color_depth, render.image_settings.exr_codec = "32", "NONE"
    scene.camera.data.shift_x, scene.camera.data.lens = 0.03, 60.0

    # Makes Principled a Lambert material: no dielectric layer, full roughness.
    material = obj.active_material
    shader = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = (0.7, 0.5, 0.3, 1.0)
    shader.inputs["Roughness"].default_value = 1.0
    shader.inputs["Specular IOR Level"].default_value = 0.0
    material.pumice.colors_by_label = False

    quads = blender.data.objects.new("quads", faces(blender, labels))
    quads.matrix_world = obj.matrix_world
    quads.data.materials.append(material)
    scene.collection.objects.link(quads)

    scene.pumice.samples, scene.pumice.bounces, scene.pumice.backend = SPP, BOUNCES, "CPU"
    cycles = scene.cycles
    cycles.device, cycles.samples = "CPU", SPP
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = BOUNCES
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", 1.5
    scene["volume"], scene["quads"] = obj.name, quads.name
    return scene


def faces(bpy, labels):
    """A mesh in index space of all voxel faces towards empty voxels. (Faces between two labels are invisible.)"""
    solid = np.pad(labels > 0, 1)
    corners = []
    for axis in range(3):
        for side in (0, 1):
            beyond = np.roll(solid, -1 if side else 1, axis)
            low = np.argwhere(solid & ~beyond) - 1
            across, along = (axis + 1) % 3, (axis + 2) % 3
            ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
            for a, b in ring if side else ring[::-1]:
                corner = low.copy()
                corner[:, axis] += side
                corner[:, across] += a
                corner[:, along] += b
                corners.append(corner)
    points = np.concatenate([np.stack(corners[i : i + 4], axis=1) for i in range(0, len(corners), 4)]).reshape(-1, 3)
    count = len(points) // 4
    mesh = bpy.data.meshes.new("quads")
    mesh.vertices.add(4 * count)
    mesh.vertices.foreach_set("co", points.astype(np.float32).ravel())
    mesh.loops.add(4 * count)
    mesh.loops.foreach_set("vertex_index", np.arange(4 * count, dtype=np.int32))
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * count, 4, dtype=np.int32))
    # Without this attribute a mesh from arrays has smooth shading.
    mesh.attributes.new("sharp_face", "BOOLEAN", "FACE").data.foreach_set("value", np.ones(count, dtype=bool))
    mesh.update(calc_edges=True)
    return mesh


def pictures(bpy, scene, folder, engine, first_seed):
    """Renders SEEDS pictures: (seed, row, column, channel)."""
    volume, quads = bpy.data.objects[scene["volume"]], bpy.data.objects[scene["quads"]]
    volume.hide_render, quads.hide_render = engine == "CYCLES", engine != "CYCLES"
    scene.render.engine = engine
    scene.render.filepath = str(folder / "picture.exr")
    out = []
    for seed in range(first_seed, first_seed + SEEDS):
        scene.cycles.seed = scene.pumice.seed = seed
        bpy.ops.render.render(write_still=True)
        channels = exr(folder / "picture.exr")
        out.append(np.stack([channels[f"Combined.{c}"] for c in "RGB"], axis=-1).astype(np.float64))
    return np.array(out)


def judge(ours, theirs):
    """The test of equality of two sets of pictures."""
    found = pumice.agreement(ours, theirs)["equality"]
    print(found)
    assert found["tests"] > 60, "there are tiles with noise"
    return found


@pytest.mark.turn(1, 3)
def test_f12_agrees_with_cycles_and_faults_are_convicted(scene, blender, tmp_path):
    theirs = pictures(blender, scene, tmp_path, "CYCLES", 1)
    ours = pictures(blender, scene, tmp_path, "PUMICE", 101)
    found = judge(ours, theirs)
    assert found["agrees"] and abs(found["mean_difference"]) < 1e-3, found

    sun = next(o.data for o in blender.data.objects if o.type == "LIGHT")
    for name, wrong, right in [
        ("a bounce too few of four", lambda: setattr(scene.pumice, "bounces", 0), lambda: setattr(scene.pumice, "bounces", BOUNCES)),
        ("a wrong filter", lambda: setattr(scene.pumice, "filter_pixels", 2.5), lambda: setattr(scene.pumice, "filter_pixels", 1.5)),
        ("a sun 2 % too bright", lambda: setattr(sun, "energy", 1.02 * sun.energy), lambda: setattr(sun, "energy", sun.energy / 1.02)),
    ]:
        wrong()
        found = judge(pictures(blender, scene, tmp_path, "PUMICE", 201), theirs)
        right()
        assert found["ratio"] > found["ratio_by_chance"][1], (name, found)
