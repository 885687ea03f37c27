# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the operators that lead to other programs: export to USD and glTF, and the comparison with Cycles, as a script calls them."""

import json
import struct

import numpy as np
import pytest


@pytest.fixture
def scene(blender, nuclei):
    """A small, quick scene with the nuclei."""
    assert blender.ops.pumice.import_volume(filepath=str(nuclei)) == {"FINISHED"}
    scene = blender.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 48, 32, 100
    scene.pumice.bounces, scene.pumice.backend = 1, "CPU"
    return scene


def test_a_scene_is_exported_and_imported_again(blender, scene, tmp_path):
    path = tmp_path / "nuclei.usdc"
    camera = np.array(scene.camera.matrix_world)
    lens, sun = scene.camera.data.lens, next(o.data.energy for o in scene.objects if o.type == "LIGHT")
    boxes = [obj for obj in scene.objects if obj.pumice.filepath]
    low = np.min([boxes[0].matrix_world @ type(boxes[0].location)(c) for c in boxes[0].bound_box], axis=0)
    assert blender.ops.pumice.export_usd(filepath=str(path), form="cells4", for_blender=True) == {"FINISHED"}
    blender.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert blender.ops.wm.usd_import(filepath=str(path)) == {"FINISHED"}
    objects = blender.data.objects
    (mesh,) = (o for o in objects if o.type == "MESH")
    assert len(mesh.data.polygons) > 50 and "label" in mesh.data.attributes
    corners = np.array([mesh.matrix_world @ v.co for v in mesh.data.vertices])
    # The surface begins within a cell of the volume's end; the longest side of the volume is 10 units.
    assert (np.abs(corners.min(axis=0) - low) < 2.0).all(), (corners.min(axis=0), low)
    (found,) = (o for o in objects if o.type == "CAMERA")
    # f32 on the way.
    assert np.abs(np.array(found.matrix_world) - camera).max() < 1e-5 * np.abs(camera).max()
    assert found.data.lens == pytest.approx(lens, rel=1e-5)
    assert [o.data.energy for o in objects if o.type == "LIGHT"] == [pytest.approx(sun, rel=1e-5)]


@pytest.mark.parametrize("name", ["nuclei.glb", "nuclei.gltf"])
def test_a_scene_is_exported_as_gltf_and_imported_again(blender, scene, tmp_path, name):
    path = tmp_path / name
    camera, lens = np.array(scene.camera.matrix_world), scene.camera.data.lens
    assert blender.ops.pumice.export_gltf(filepath=str(path), form="cells4") == {"FINISHED"}
    assert path.is_file() and path.with_suffix(".bin").is_file() == (path.suffix == ".gltf")
    blender.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert blender.ops.import_scene.gltf(filepath=str(path)) == {"FINISHED"}
    blender.context.view_layer.update()
    objects = blender.data.objects
    (mesh,) = (o for o in objects if o.type == "MESH")
    assert len(mesh.data.polygons) > 50 and "_LABEL" in mesh.data.attributes
    (found,) = (o for o in objects if o.type == "CAMERA")
    # f32 on the way, and an axis turned there and back; the importer asks for a sensor of its own, so the angle counts.
    assert np.abs(np.array(found.matrix_world) - camera).max() < 1e-5 * np.abs(camera).max()
    assert found.data.lens / found.data.sensor_width == pytest.approx(lens / 36, rel=1e-5)


def test_forms_of_gltf(blender, scene, tmp_path):
    faces = {}
    for form, plain in [("voxels", False), ("voxels", True), ("boxes", False), ("instances", False)]:
        path = tmp_path / f"{form}{plain}.glb"
        assert blender.ops.pumice.export_gltf(filepath=str(path), form=form, plain=plain) == {"FINISHED"}
        data = path.read_bytes()
        (length,) = struct.unpack_from("<I", data, 12)
        described = json.loads(data[20 : 20 + length])
        indices = {p["indices"] for m in described["meshes"] for p in m["primitives"]}
        faces[form, plain] = sum(described["accessors"][i]["count"] for i in indices) // 6
        assert ("EXT_mesh_gpu_instancing" in described["extensionsUsed"]) == (form == "instances")
    assert faces["voxels", True] > faces["voxels", False] > faces["boxes", False] > faces["instances", False] == 6


def test_what_cannot_be_exported_is_one_line(blender, scene, tmp_path):
    for name, what in [("n.xyz", "expected a name that ends in"), ("missing/n.usdc", "No such file")]:
        with pytest.raises(RuntimeError, match=what):
            blender.ops.pumice.export_usd(filepath=str(tmp_path / name))
        with pytest.raises(RuntimeError, match=what):
            blender.ops.pumice.export_gltf(filepath=str(tmp_path / name.replace("usdc", "glb")))
    assert not list(tmp_path.glob("n.*"))


def test_the_picture_is_verified(blender, scene, tmp_path):
    page = tmp_path / "page.html"
    assert blender.ops.pumice.verify(filepath=str(page), seconds=120.0) == {"FINISHED"}
    assert scene.pumice.verdict.startswith("Agrees: "), scene.pumice.verdict
    assert scene.pumice.verdict_page == str(page) and scene.pumice.verdict in page.read_text()
    with pytest.raises(RuntimeError, match="expected a name that ends in .html"):
        blender.ops.pumice.verify(filepath=str(tmp_path / "page.pdf"))
