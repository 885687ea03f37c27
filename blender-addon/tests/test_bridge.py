# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the operators that lead to other programs: export to USD, and the comparison with Cycles, as a script calls them."""

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


def test_what_cannot_be_exported_is_one_line(blender, scene, tmp_path):
    for name, what in [("n.xyz", "expected a name that ends in"), ("missing/n.usdc", "No such file")]:
        with pytest.raises(RuntimeError, match=what):
            blender.ops.pumice.export_usd(filepath=str(tmp_path / name))
    assert not list(tmp_path.glob("n.*"))


def test_the_picture_is_verified(blender, scene, tmp_path):
    page = tmp_path / "page.html"
    assert blender.ops.pumice.verify(filepath=str(page), seconds=120.0) == {"FINISHED"}
    assert scene.pumice.verdict.startswith("Agrees: "), scene.pumice.verdict
    assert scene.pumice.verdict_page == str(page) and scene.pumice.verdict in page.read_text()
    with pytest.raises(RuntimeError, match="expected a name that ends in .html"):
        blender.ops.pumice.verify(filepath=str(tmp_path / "page.pdf"))
