# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that the proxy, as Cycles draws it, looks like Pumice's picture: silhouettes and colors from three views.

Pumice's label pass says which label each pixel shows; the label table, which color that has. Cycles draws the proxy with its own material:
alpha is the silhouette, the pass of diffuse color the color. Silhouettes must overlap by 0.9 (intersection over union), and colors must be
right in 80 % of the pixels that both show: bars that were set before anything was measured. Measured: 0.93 to 0.95 and 0.87 to 0.90 with 32
neurites of the cortex in 48,908 faces.
"""

import math
import shutil

import numpy as np
import pytest

import cycles_oracle
from test_real_volumes import exr, imported, load

SIZE = 160
OVERLAP, RIGHT = 0.9, 0.8
# Largest difference of a color channel that counts as the same color: half-floats of the file and filtering are far below.
SAME = 0.02
# Turns of cameras: from above, from the front, and aslant.
VIEWS = ((0.0, 0.0, 0.0), (math.pi / 2, 0.0, 0.0), (math.radians(60), 0.0, math.radians(35)))


def prepare(bpy, obj):
    """Sets both engines to one sample at the middle of each pixel, and the material to a Lambert one, whose diffuse color is its base color."""
    shader = obj.active_material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value, shader.inputs["Specular IOR Level"].default_value = 1.0, 0.0
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.resolution_percentage, scene.render.film_transparent = 100, True
    if bpy.app.version >= (5, 0, 0):
        scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.pumice.samples, scene.pumice.bounces, scene.pumice.filter_pixels, scene.pumice.backend = 1, 0, 0.01, "CPU"
    scene.cycles.device, scene.cycles.samples, scene.cycles.max_bounces = "CPU", 1, 0
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    layer = bpy.context.view_layer
    layer.pumice.use_pass_label = layer.use_pass_diffuse_color = True


def look(bpy, obj, turn):
    """A camera that sees the whole object."""
    corners = np.array([obj.matrix_world @ v.co for v in obj.data.vertices])
    middle, radius = (corners.min(axis=0) + corners.max(axis=0)) / 2.0, np.linalg.norm(np.ptp(corners, axis=0)) / 2.0
    camera = cycles_oracle.camera(bpy, (0.0, 0.0, 0.0), turn, ortho_scale=1.6 * radius)
    camera.matrix_world.translation = [*middle] + np.array(camera.matrix_world.to_3x3())[:, 2] * 3.0 * radius
    camera.data.clip_end = 10.0 * radius


def rendered(bpy, folder, engine):
    scene = bpy.context.scene
    scene.render.engine, scene.render.filepath = engine, str(folder / f"{engine}.exr")
    bpy.ops.render.render(write_still=True)
    return exr(scene.render.filepath)


def ours(bpy, extension, obj, folder):
    """(pixels that show a label, color of each) in Pumice's picture."""
    rows = rendered(bpy, folder, "PUMICE")["Label.X"].astype(int)
    colors = load(extension, "label_table").colors(obj.pumice.table)[:, :3]
    return rows > 0, colors[rows - 1]


def of_cycles(bpy, folder):
    """The same of the proxy in Cycles' picture."""
    picture = rendered(bpy, folder, "CYCLES")
    return picture["Combined.A"] > 0.5, np.stack([picture[f"{NAMES[bpy.app.version >= (5, 0, 0)]}.{c}"] for c in "RGB"], axis=2)


NAMES = {False: "DiffCol", True: "Diffuse Color"}


def likeness(one, other):
    """(overlap of silhouettes, share of common pixels with the same color)."""
    both = one[0] & other[0]
    same = (np.abs(one[1] - other[1]) < SAME).all(axis=2)
    return both.sum() / (one[0] | other[0]).sum(), same[both].mean()


def shift(mesh, voxels):
    """Moves a mesh along x."""
    places = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", places)
    places[::3] += voxels
    mesh.vertices.foreach_set("co", places)
    mesh.update()


def exchange_colors(mesh, a, b):
    """Gives the faces of two labels the color of the other."""
    labels = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.attributes["label"].data.foreach_get("value", labels)
    layer = mesh.color_attributes["Label Color"].data
    colors = np.empty((len(labels), 4, 4), dtype=np.float32)
    layer.foreach_get("color", colors.ravel())
    of = [colors[labels == label][0, 0] for label in (a, b)]
    colors[labels == a], colors[labels == b] = of[1], of[0]
    layer.foreach_set("color", colors.ravel())
    mesh.update()


@pytest.mark.parametrize("name", ["nuclei", pytest.param("cortex", marks=pytest.mark.full)])
def test_in_cycles_the_proxy_looks_as_in_pumice(blender, extension, nuclei, data, tmp_path, name):
    if name == "cortex":
        obj = imported(blender, shutil.copy(data / "connectomics_32x32x40nm.nrrd", tmp_path), pick=32)
    else:
        obj = imported(blender, nuclei)
    prepare(blender, obj)
    found = []
    for turn in VIEWS:
        look(blender, obj, turn)
        one, other = ours(blender, extension, obj, tmp_path), of_cycles(blender, tmp_path)
        found.append(likeness(one, other))
    assert np.min(found, axis=0)[0] >= OVERLAP and np.min(found, axis=0)[1] >= RIGHT, found

    # Controls, in the last view: what is not so is noticed.
    rows, counts = np.unique(rendered(blender, tmp_path, "PUMICE")["Label.X"].astype(int), return_counts=True)
    a, b = rows[1:][np.argsort(-counts[1:])][:2] - 1
    exchange_colors(obj.data, a, b)
    colors = likeness(one, of_cycles(blender, tmp_path))
    lost = np.sort(counts[1:])[-2:].sum() / counts[1:].sum()
    assert colors[0] == found[-1][0] and colors[1] < found[-1][1] - 0.8 * lost
    shift(obj.data, 3.0)
    moved = likeness(one, of_cycles(blender, tmp_path))
    assert moved[0] < OVERLAP


def test_cycles_draws_what_the_table_says_when_it_renders(blender, extension, nuclei, tmp_path):
    """Without a window no timer runs: the proxy is made before the render."""
    obj = imported(blender, nuclei)
    prepare(blender, obj)
    look(blender, obj, VIEWS[0])
    every = ours(blender, extension, obj, tmp_path)
    ids = load(extension, "label_table").ids(obj.pumice.table)
    blender.ops.pumice.labels_select(ids=", ".join(map(str, ids[::2])))
    assert blender.ops.pumice.labels_isolate() == {"FINISHED"}
    assert blender.ops.pumice.labels_color(color=(0.1, 0.6, 0.3)) == {"FINISHED"}
    some = ours(blender, extension, obj, tmp_path)
    assert 0.2 < some[0].sum() / every[0].sum() < 0.8
    overlap, right = likeness(some, of_cycles(blender, tmp_path))
    assert overlap >= OVERLAP and right >= RIGHT
    assert likeness(every, of_cycles(blender, tmp_path))[0] < OVERLAP, "labels that are hidden would be noticed"
    # The other colors of the table are not those of the picture.
    material = obj.active_material
    material.pumice.colors_by_label = False
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.7, 0.2, 0.1, 1.0)
    shown, colors = of_cycles(blender, tmp_path)
    assert np.allclose(colors[shown], (0.7, 0.2, 0.1), atol=SAME)


def test_the_operator_makes_the_proxy_and_is_one_undo_step(blender, extension, nuclei):
    obj = imported(blender, nuclei)
    faces = len(obj.data.polygons)
    blender.ops.ed.undo_push(message="imported")
    obj.pumice.proxy_faces = 3000
    assert blender.ops.pumice.update_proxy() == {"FINISHED"}
    assert 1000 < len(obj.data.polygons) <= 3000 < faces
    blender.ops.ed.undo_push(message="proxy")
    blender.ops.ed.undo()
    assert len(blender.context.object.data.polygons) == faces
