# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that Blender's own importer reads what `pumice export` writes as USD: objects, faces, materials, labels, scale and orientation."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
VOLUME = ROOT / "data" / "slicer_Segmentation.seg.nrrd"
LABELS = 7


def exported(out, *more):
    command = os.environ.get("PUMICE", ROOT / "target" / "debug" / "pumice")
    report = out.with_suffix(".json")
    subprocess.run([command, "export", VOLUME, "-o", out, "--json", report, *more], check=True, capture_output=True)
    return json.loads(report.read_text())


@pytest.mark.parametrize("form", ["voxels", "cells4", "boxes"])
@pytest.mark.parametrize("ending", ["usda", "usdc"])
def test_a_surface_arrives_whole(blender, tmp_path, form, ending):
    import pumice

    out = tmp_path / f"ct.{ending}"
    report = exported(out, "--form", form)
    blender.ops.wm.usd_import(filepath=str(out))
    (thing,) = (o for o in blender.data.objects if o.type == "MESH")
    mesh = thing.data
    assert len(mesh.polygons) == report["faces"]
    labels = np.empty(len(mesh.polygons), np.int32)
    mesh.attributes["label"].data.foreach_get("value", labels)
    materials = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("material_index", materials)
    if form == "voxels":
        assert set(labels.tolist()) == set(range(LABELS))
    # One material a label in this volume: faces of a label have one, and faces of different labels different ones.
    pairs = {*zip(labels.tolist(), materials.tolist(), strict=True)}
    assert len(pairs) == len(set(labels.tolist())) == len(set(materials.tolist()))
    for slot in mesh.materials:
        shader = next(node for node in slot.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        assert 0 < shader.inputs["Roughness"].default_value < 1
    assert len({tuple(next(n for n in m.node_tree.nodes if n.type == "BSDF_PRINCIPLED").inputs["Base Color"].default_value)
                for m in mesh.materials}) == len(mesh.materials)
    # Flat faces: the corners' normals are those of their faces.
    normals = np.empty(3 * len(mesh.loops), np.float32)
    mesh.corner_normals.foreach_get("vector", normals)
    flat = np.empty(3 * len(mesh.polygons), np.float32)
    mesh.polygons.foreach_get("normal", flat)
    assert np.abs(normals.reshape(-1, 4, 3) - flat.reshape(-1, 1, 3)).max() < 1e-3
    # Scale and orientation: the object's matrix is that of the volume in the world, and the points are voxels.
    volume = pumice.open(VOLUME)
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    points = points.reshape(-1, 3)
    assert (points == points.round()).all() and (points.max(axis=0) <= volume.dims).all()
    notes = json.loads(thing["labels"])
    assert [id for id, _, _ in notes] == volume.labels.ids.tolist() and all(name for _, name, _ in notes)
    scene = json.loads(scene_of(tmp_path))
    (instance,) = scene["instances"]
    expected = np.array(instance["world_from_index"]).reshape(4, 3)
    got = np.array(thing.matrix_world)
    assert np.allclose(got[:3, :].T, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def scene_of(folder):
    """The scene that the command makes of the volume."""
    command = os.environ.get("PUMICE", ROOT / "target" / "debug" / "pumice")
    saved = folder / "scene.json"
    arguments = ["-o", folder / "p.png", "--size", "8x8", "--spp", "1", "--backend", "cpu", "--save-scene", saved]
    subprocess.run([command, "render", VOLUME, *arguments], check=True, capture_output=True)
    return saved.read_text()


def test_instances_arrive_with_their_materials(blender, tmp_path):
    out = tmp_path / "boxes.usdc"
    report = exported(out, "--form", "instances")
    blender.ops.wm.usd_import(filepath=str(out))
    cubes = [o for o in blender.data.objects if o.type == "MESH" and o.name.startswith("cube_")]
    assert len(cubes) == LABELS and all(len(cube.data.materials) == 1 for cube in cubes)
    graph = blender.context.evaluated_depsgraph_get()
    placed = [i for i in graph.object_instances if i.is_instance]
    assert len(placed) == report["boxes"], "an instance a box"
