# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that each level of detail is what the exported file shows: Pumice draws a scene at a level, Cycles draws the file of that level after
Blender's own import, and the pictures agree by the test of `pumice verify-render`."""

import json
import math
import subprocess

import numpy as np
import pumice
import pytest

from cycles_oracle import picture, prepare

LEVELS = {"boxes": 16, "cells4": 4, "voxels": 1}
SIZE, SPP, SEEDS, BOUNCES = (64, 48), 1024, 8, 2
# Of a dull surface Cycles' and Pumice's materials are the same after any format: the shape is what is tested.
DULL = {"base_color": [0.7, 0.5, 0.3], "specular": 0.0, "roughness": 1.0, "metallic": 0.0}


@pytest.fixture
def scene(pumice_command, data, tmp_path):
    """Some dull neurites under a sun and a grey sky."""
    path = tmp_path / "scene.json"
    shown = ["--pick", "6", "--size", "x".join(map(str, SIZE)), "--spp", "1", "--backend", "cpu", "--save-scene", path]
    run(pumice_command, "render", data / "connectomics_32x32x40nm.nrrd", "-o", tmp_path / "p.png", *shown)
    fields = json.loads(path.read_text())
    fields["instances"][0]["style"] |= {"auto_color": False, "material": DULL}
    fields["film"] = {"width": SIZE[0], "height": SIZE[1], "filter": {"box": {"width": 1.0}}}
    fields["world"] = {"environment": {"constant": {"radiance": [0.5, 0.6, 0.8]}}}
    fields["suns"] = [{"direction": [0.5, 0.4, -1.0], "strength": 2.0, "angle_rad": 0.3}]
    fields["settings"] |= {"bounces": BOUNCES}
    path.write_text(json.dumps(fields))
    return path


def run(command, *arguments):
    done = subprocess.run([command, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def by_pumice(command, scene, lod, folder):
    """Pictures of Pumice at a level of detail, of different seeds."""
    import OpenImageIO

    pictures = []
    for seed in range(SEEDS):
        out = folder / "ours.exr"
        run(command, "render", scene, "-o", out, "--lod", lod, "--spp", SPP, "--seed", 7919 * seed + 1, "--backend", "cpu")
        file = OpenImageIO.ImageInput.open(str(out))
        pictures.append(file.read_image(0, 0, 0, file.spec().nchannels, "float")[..., :3])
        out.unlink()
    return np.array(pictures)


def by_cycles(bpy, path, scene, folder):
    """Pictures of Cycles of what Blender's importer makes of a file, of different seeds."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    settings = prepare(bpy, folder, samples=SPP)
    settings.render.resolution_x, settings.render.resolution_y = SIZE
    settings.cycles.pixel_filter_type = "BOX"
    settings.cycles.max_bounces = settings.cycles.diffuse_bounces = BOUNCES
    # The importers of both formats need a world, or bring none.
    settings.world = bpy.data.worlds.new("sky")
    fields = json.loads(scene.read_text())
    if bpy.app.version < (5, 0, 0):
        settings.world.use_nodes = True
    background = next(node for node in settings.world.node_tree.nodes if node.type == "BACKGROUND")
    if path.suffix == ".glb":
        bpy.ops.import_scene.gltf(filepath=str(path))
        background.inputs["Color"].default_value = [*fields["world"]["environment"]["constant"]["radiance"], 1.0]
        # glTF's suns have no size.
        (sun,) = (thing.data for thing in bpy.data.objects if thing.type == "LIGHT")
        sun.angle = fields["suns"][0]["angle_rad"]
    else:
        bpy.ops.wm.usd_import(filepath=str(path))
    (settings.camera,) = (thing for thing in bpy.data.objects if thing.type == "CAMERA")
    settings.camera.data.dof.use_dof = False
    for material in bpy.data.materials:
        for node in material.node_tree.nodes if material.node_tree else ():
            if node.type == "BSDF_PRINCIPLED":
                # UsdPreviewSurface has no level of specular reflection.
                node.inputs["Specular IOR Level"].default_value = DULL["specular"]
    pictures = []
    for seed in range(SEEDS):
        settings.cycles.seed = 104729 * (seed + 1) % (1 << 31)
        pictures.append(picture(bpy, settings))
    return np.array(pictures)


@pytest.mark.full
@pytest.mark.parametrize("ending", ["usdc", "glb"])
@pytest.mark.parametrize("form", LEVELS)
def test_a_level_is_what_its_file_shows(blender, pumice_command, scene, tmp_path, form, ending):
    out = tmp_path / f"{form}.{ending}"
    flags = ["--for", "blender"] if ending == "usdc" else []
    run(pumice_command, "export", scene, "-o", out, "--form", form, *flags)
    theirs = by_cycles(blender, out, scene, tmp_path)
    found = pumice.agreement(by_pumice(pumice_command, scene, LEVELS[form], tmp_path), theirs)
    assert found["verdict"] == "agrees", found["sentence"]
    # Control: the next level is another picture.
    other = {16: 4, 4: 1, 1: 4}[LEVELS[form]]
    assert pumice.agreement(by_pumice(pumice_command, scene, other, tmp_path), theirs)["verdict"] == "differs"


@pytest.mark.full
@pytest.mark.parametrize("form", ["boxes", "voxels"])
def test_a_cut_scene_is_what_its_file_shows(blender, pumice_command, scene, tmp_path, form):
    fields = json.loads(scene.read_text())
    matrix = np.array(fields["instances"][0]["world_from_index"]).reshape(4, 3)
    dims = pumice.open(fields["instances"][0]["source"]).dims
    middle = matrix[3] + 0.5 * np.array(dims) @ matrix[:3]
    eye = np.array(fields["camera"]["world_from_camera"]).reshape(4, 3)[3]
    # Takes the half that is nearer to the camera, tilted.
    normal = (eye - middle) / math.dist(eye, middle) + [0.2, -0.3, 0.1]
    fields["cuts"] = [{"shape": {"plane": {"point": middle.tolist(), "normal": normal.tolist()}}}]
    cut = scene.with_name("cut.json")
    cut.write_text(json.dumps(fields))
    out = tmp_path / f"{form}.usdc"
    run(pumice_command, "export", cut, "-o", out, "--form", form, "--for", "blender")
    theirs = by_cycles(blender, out, cut, tmp_path)
    found = pumice.agreement(by_pumice(pumice_command, cut, LEVELS[form], tmp_path), theirs)
    assert found["verdict"] == "agrees", found["sentence"]
    # Control: without the cut it is another picture.
    assert pumice.agreement(by_pumice(pumice_command, scene, LEVELS[form], tmp_path), theirs)["verdict"] == "differs"
