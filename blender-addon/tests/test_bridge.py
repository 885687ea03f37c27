# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the operators that lead to other programs: export to USD and glTF, and the comparison with Cycles, as a script calls them."""

import base64
import json
import re
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
    assert path.is_file() and len(list(tmp_path.glob("nuclei.*.bin"))) == (path.suffix == ".gltf")
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


def images(blender):
    """The images of the comparison by the ends of their names, row 0 at the top."""
    found = {}
    for image in blender.data.images:
        if image.name.startswith("Pumice verify: "):
            width, height = image.size
            values = np.empty(4 * width * height, np.float32)
            image.pixels.foreach_get(values)
            assert image.is_float
            found[image.name.removeprefix("Pumice verify: ")] = values.reshape(height, width, 4)[::-1]
    return found


def decoded(png, path):
    """The pixels of a PNG file, from 0 to 1, by OpenImageIO."""
    import OpenImageIO

    path.write_bytes(png)
    return np.asarray(OpenImageIO.ImageInput.open(str(path)).read_image(OpenImageIO.FLOAT))


def encoded(linear):
    """sRGB (IEC 61966-2-1)."""
    linear = np.clip(linear.astype(float), 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def test_the_picture_is_verified(blender, scene, tmp_path):
    page = tmp_path / "page.html"
    # A verdict takes longer (test_verify_render.py); what is kept of it does not depend on it.
    assert blender.ops.pumice.verify(filepath=str(page), seconds=4.0) == {"FINISHED"}
    assert scene.pumice.verdict.startswith(("Agrees: ", "Cannot tell yet: ")), scene.pumice.verdict
    assert scene.pumice.verdict_page == str(page) and scene.pumice.verdict in page.read_text()
    shown = images(blender)
    assert {i.shape for i in shown.values()} == {(32, 48, 4)}
    assert np.array_equal(shown["difference"][..., :3], shown["Pumice"][..., :3] - shown["Cycles"][..., :3])
    assert shown["Pumice"].mean() > 0.1 and shown["difference"].min() < 0 < shown["difference"].max()
    # Red where Pumice is brighter.
    mean, color = shown["difference"][..., :3].mean(axis=-1), shown["difference in color"]
    clear = np.abs(mean) > 0.2 * np.abs(mean).max()
    assert ((color[..., 0] > color[..., 2]) == (mean > 0))[clear].all()
    # They look as on the page, whose PNG files have the same numbers, encoded and rounded to 8 bits.
    embedded = re.findall(r'src="data:image/png;base64,([^"]*)"', page.read_text())
    for title, text in zip(["Cycles", "Pumice", "difference in color", "difference by tile", "t by tile", "FLIP"], embedded, strict=True):
        drawn = decoded(base64.b64decode(text), tmp_path / "map.png")
        assert np.abs(encoded(shown[title][..., :3]) - drawn).max() < 0.51 / 255, title
    with pytest.raises(RuntimeError, match="expected a name that ends in .html"):
        blender.ops.pumice.verify(filepath=str(tmp_path / "page.pdf"))
