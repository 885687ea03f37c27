# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that a scene comes back from a USD stage as it was: every value without rendering, and Cycles' pictures in a fresh Blender.

The pictures are judged as in `test_cycles_agreement`: eight seeds of each, by the test of equality.
Two things must be convicted: Blender's importer without our notes, and one lamp of five turned by 5°.
"""

import json
import os
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest

import staged_scene
from staged_scene import FLOOR, LIGHTS, VOLUME, differences, labels, rendered, values

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests/python"))
from share import one_of_today  # noqa: E402


@pytest.fixture
def with_usd(blender, extension):
    """bpy with the Python modules of USD."""
    if not extension.export_scene.usd_stage.has_modules():
        assert blender.app.version < (5, 0, 0)
        pytest.skip("bpy 4.2 has no Python modules of USD")
    return blender


@pytest.fixture
def staged(with_usd, tmp_path):
    staged_scene.build(with_usd, tmp_path)
    return with_usd


def exported(blender, path, **wishes):
    assert blender.ops.pumice.export_scene(filepath=str(path), **wishes) == {"FINISHED"}
    assert path.is_file() and not list(path.parent.glob(".pumice-*"))
    return path


def reopened(blender, path):
    blender.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert blender.ops.pumice.import_scene(filepath=str(path)) == {"FINISHED"}


def brute_force(dense):
    """{label id: {(voxel, axis, side)}} of all faces towards background."""
    kept, faces = np.pad(dense.astype(np.int64), 1), {}
    for axis in range(3):
        for side in (0, 1):
            at = np.argwhere((kept != 0) & (np.roll(kept, 1 - 2 * side, axis) == 0))
            for voxel in at:
                faces.setdefault(int(kept[tuple(voxel)]), set()).add((*(voxel - 1).tolist(), axis, side))
    return faces


@pytest.mark.parametrize("ending", one_of_today(["usdc", "usdz", "usda"]))
def test_every_value_comes_back(staged, tmp_path, ending):
    volume = staged.data.objects[VOLUME]
    before, matrix = values(staged), np.array(volume.matrix_world)
    table = volume.pumice.table
    colors = np.empty(4 * len(table.vertices), np.float32)
    table.attributes["color"].data.foreach_get("color", colors)
    hidden = [o.name for o in staged.data.objects if o.hide_render]
    (tmp_path / "out").mkdir()
    path = exported(staged, tmp_path / "out" / f"scene.{ending}")
    # The exported scene is as it was.
    assert differences(before, values(staged)) == [] and [o.name for o in staged.data.objects if o.hide_render] == hidden
    if ending == "usdz":
        assert [p.name for p in path.parent.iterdir()] == ["scene.usdz"]
    reopened(staged, path)
    assert differences(before, values(staged)) == []
    assert staged.context.scene.render.engine == "CYCLES"
    # Nothing but the scene's own objects: no parents or empties that held the stage together.
    assert sorted(o.name for o in staged.data.objects) == sorted(["the camera", *LIGHTS, *staged_scene.PRINCIPLED, VOLUME])

    mesh_object = staged.data.objects[VOLUME]
    mesh = mesh_object.data
    assert np.allclose(np.array(mesh_object.matrix_world), matrix, rtol=0, atol=2e-6)
    rows = np.empty(len(mesh.polygons), np.int32)
    mesh.attributes["label"].data.foreach_get("value", rows)
    ids = [id for id, _, _ in json.loads(mesh_object["labels"])]
    assert ids == sorted(brute_force(labels())) and json.loads(mesh_object["labels"])[0][1] == "the first"
    # Rectangles cover as many faces of each label as the array has.
    area = np.array([polygon.area for polygon in mesh.polygons])
    for row, (_, faces) in enumerate(sorted(brute_force(labels()).items())):
        assert area[rows == row].sum() == pytest.approx(len(faces), abs=1e-3)
    # Each label has the color of the label table, in a Principled BSDF with the volume's roughness.
    slots = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("material_index", slots)
    for row in range(len(ids)):
        (slot,) = set(slots[rows == row].tolist())
        shader = next(n for n in mesh.materials[slot].node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        assert np.allclose(shader.inputs["Base Color"].default_value[:3], colors.reshape(-1, 4)[row, :3], atol=1e-6)
        assert shader.inputs["Roughness"].default_value == pytest.approx(0.45)
        assert shader.inputs["Specular IOR Level"].default_value == pytest.approx(0.35)


def test_the_stock_importer_alone_is_convicted(staged, tmp_path):
    """The control of the test above: what the notes are for."""
    before = values(staged)
    path = exported(staged, tmp_path / "scene.usdc")
    staged.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = staged.context.scene
    scene.world = staged.data.worlds.new("sky")
    staged.ops.wm.usd_import(filepath=str(path))
    scene.camera = next(o for o in staged.data.objects if o.type == "CAMERA")
    for obj in list(staged.data.objects):
        if "pumice" in obj:
            obj.name = json.loads(obj["pumice"])["name"]
    # Those materials that other programs have no word for lose their parameters.
    wrong = differences(before, values(staged))
    for what in ("film", "world", "glass/material", "the floor/material", "disk/size_y"):
        assert any(line.startswith(f"/{what}") for line in wrong), (what, wrong)


def test_other_programs_read_suns_and_spots_by_the_specification(staged, tmp_path):
    from pxr import Usd, UsdLux

    stage = Usd.Stage.Open(str(exported(staged, tmp_path / "scene.usda")))
    sun, spot = (next(p for p in stage.Traverse() if p.GetName() == name and not p.GetTypeName() == "Xform") for name in ("sun", "spot"))
    # UsdLux: the intensity of a normalised distant light, times two to its exposure, is irradiance; the angle is the diameter.
    light = UsdLux.LightAPI(sun)
    assert light.GetNormalizeAttr().Get() and light.GetIntensityAttr().Get() * 2 ** light.GetExposureAttr().Get() == pytest.approx(
        1.5 * 2**0.5
    )
    assert UsdLux.DistantLight(sun).GetAngleAttr().Get() == pytest.approx(np.degrees(0.2))
    # It fades from where Cycles' spot does: 1 - cos is 1 - blend of that of the edge.
    shaping = UsdLux.ShapingAPI(spot)
    half = np.radians(shaping.GetShapingConeAngleAttr().Get())
    start = half * (1 - shaping.GetShapingConeSoftnessAttr().Get())
    assert half == pytest.approx(0.45) and 1 - np.cos(start) == pytest.approx(0.6 * (1 - np.cos(half)), rel=1e-5)


def test_other_kinds_of_objects_and_what_is_lost(staged, extension, tmp_path):
    data, scene = staged.data, staged.context.scene
    text = data.objects.new("a text", data.curves.new("a text", "FONT"))
    text.data.body, text.data.extrude, text.location = "Ab", 0.1, (1.0, 2.0, 3.0)
    hidden = data.objects.new("unseen", data.meshes.new("unseen"))
    for obj in (text, hidden):
        scene.collection.objects.link(obj)
    hidden.hide_render = True
    scene.pumice.smooth_voxels = True
    data.objects["gold"].keyframe_insert("location", frame=1)
    tree = data.materials["glass"].node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    shader = next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
    tree.links.new(noise.outputs["Color"], shader.inputs["Base Color"])
    picture = data.images.new("checks", 8, 4)
    picture.pixels.foreach_set(np.tile(np.array([0.2, 0.6, 0.4, 1.0], np.float32), 32))
    picture.file_format, picture.filepath_raw = "PNG", str(tmp_path / "checks.png")
    picture.save()
    tree = data.materials[FLOOR].node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = data.images.load(str(tmp_path / "checks.png"))
    tree.links.new(texture.outputs["Color"], next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED").inputs["Base Color"])
    data.objects["bulb"].parent = data.objects[VOLUME]
    data.objects["disk"].parent = data.objects["spot"]
    staged.context.view_layer.update()
    places = {name: np.array(data.objects[name].matrix_world) for name in ("bulb", "spot", "disk")}
    lost = [
        "Material glass: what is linked to Base Color arrives as the file's own materials have it",
        "Material the floor: what is linked to Base Color arrives as the file's own materials have it",
        "Smooth Voxels is not in the file: volumes have flat faces",
        "unseen: hidden in renders, so not in the file",
        "gold: animated; the file has frame 7 alone",
    ]
    assert extension.export_scene.usd_stage.lacks_of(staged.context) == lost
    (tmp_path / "out").mkdir()
    path = exported(staged, tmp_path / "out" / "scene.usdc")
    assert data.objects["a text"].type == "FONT" and not data.objects["a text"].hide_render and len(data.curves) == 1
    staged.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    _, lines = extension.import_scene.restore(staged.context, str(path), True)
    assert lines == lost
    staged.context.view_layer.update()
    mesh = staged.data.objects["a text"]
    assert mesh.type == "MESH" and len(mesh.data.polygons) > 20 and tuple(mesh.location) == (1.0, 2.0, 3.0)
    assert "unseen" not in staged.data.objects
    # What hangs below a volume keeps its place, and so does a lamp with another below it.
    for name, place in places.items():
        assert np.allclose(np.array(staged.data.objects[name].matrix_world), place, atol=1e-5), name
        assert staged.data.objects[name].data.energy == LIGHTS[name][1]["energy"]
    shader = next(n for n in staged.data.materials["glass"].node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    assert shader.inputs["Transmission Weight"].default_value == 1.0
    # A picture on a mesh arrives with its UV map; the other inputs of the shader are as they were.
    floor = next(n for n in staged.data.materials[FLOOR].node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    (link,) = floor.inputs["Base Color"].links
    assert link.from_node.type == "TEX_IMAGE" and tuple(link.from_node.image.size) == (8, 4)
    assert floor.inputs["Sheen Weight"].default_value == np.float32(0.4) and len(staged.data.objects[FLOOR].data.uv_layers) == 1
    assert sorted(p.name for p in (tmp_path / "out" / "textures").iterdir()) == ["checks.png", "sky.exr"]


def test_a_volume_whose_axes_shear_keeps_its_shape(staged, tmp_path):
    import pumice

    world = np.array([[-2.0, 0.3, 0, 10], [0, 1.5, 0.2, 20], [0, 0, 3.0, 30], [0, 0, 0, 1]])
    pumice.compress(labels(), world_from_index=world, unit="nm").save(tmp_path / "sheared.pumice")
    assert staged.ops.pumice.import_volume(filepath=str(tmp_path / "sheared.pumice"), use_light=False, use_camera=False) == {"FINISHED"}
    staged.context.view_layer.update()
    matrix = np.array(staged.data.objects["sheared"].matrix_world)
    path = exported(staged, tmp_path / "scene.usdc")
    reopened(staged, path)
    staged.context.view_layer.update()
    found = staged.data.objects["sheared"]
    assert len(found.data.polygons) > 1000 and np.allclose(np.array(found.matrix_world), matrix, rtol=0, atol=1e-6)
    # One object, which has the notes of the labels, and the frame that shears; nothing else of the stage is left.
    assert "labels" in found and found.parent.name.startswith("sheared frame")
    assert not [o.name for o in staged.data.objects if o.name.startswith(("importing", "volume_", "surface"))]
    # Control: location, rotation and scale alone would be another matrix.
    assert not np.allclose(np.array(type(found.matrix_world).LocRotScale(*found.matrix_world.decompose())), matrix, rtol=0, atol=1e-3)


def cut_areas(dense, height):
    """{label id: area of its surface below the plane z = `height` (not whole), its cap included}, in faces of voxels."""
    layer, share = int(height), height - int(height)
    areas = {}
    for label, faces in brute_force(dense).items():
        side = [1.0 if face[2] < layer else share for face in faces if face[3] != 2 and face[2] <= layer]
        across = [face for face in faces if face[3] == 2 and face[2] + face[4] <= layer]
        areas[label] = sum(side) + len(across) + int((dense[:, :, layer] == label).sum())
    return {label: area for label, area in areas.items() if area > 0.0}


def areas_of(mesh_object):
    """{label id: area of its faces} of an imported volume, in faces of voxels."""
    mesh, ids = mesh_object.data, [id for id, _, _ in json.loads(mesh_object["labels"])]
    rows = np.empty(len(mesh.polygons), np.int32)
    mesh.attributes["label"].data.foreach_get("value", rows)
    area = np.array([polygon.area for polygon in mesh.polygons])
    return {ids[row]: area[rows == row].sum() for row in np.unique(rows)}


def test_what_cuts_leave_of_a_volume_comes_back(staged, extension, tmp_path):
    from mathutils import Matrix

    data, scene = staged.data, staged.context.scene
    volume, dense, height = data.objects[VOLUME], labels(), 9.25
    # The knife removes what is above a plane through voxels; its +z is the volume's, whose matrix turns and mirrors. A lamp hangs below it.
    # The bounding box of a mesh removes an edge of the volume, in voxels. The last one cuts nothing, because renders do not have it.
    knife, box, unused = (data.objects.new(name, one) for name, one in (("knife", None), ("box", data.meshes.new("box")), ("unused", None)))
    box.data.from_pydata([(20, 20, 0), (30, 30, 30)], [], [])
    for obj, cut, place in ((knife, "PLANE", (0, 0, height)), (box, "BOX", (0, 0, 0)), (unused, "PLANE", (0, 0, 3))):
        scene.collection.objects.link(obj)
        obj.pumice.cut, obj.matrix_world = cut, volume.matrix_world @ Matrix.Translation(place)
    unused.hide_render = True
    staged.context.view_layer.update()
    data.objects["bulb"].parent = knife
    before, matrix = values(staged), np.array(volume.matrix_world)
    names = sorted(o.name for o in data.objects)
    lost = ["knife, box: not in the file; the volumes are, as the cut leaves them"]
    assert extension.export_scene.usd_stage.lacks_of(staged.context) == lost
    path = exported(staged, tmp_path / "scene.usdc")
    # Controls: the plane a quarter of a voxel higher, and no cuts.
    knife.matrix_world = volume.matrix_world @ Matrix.Translation((0, 0, height + 0.25))
    moved = exported(staged, tmp_path / "moved.usdc")
    knife.pumice.cut = box.pumice.cut = "NONE"
    uncut = exported(staged, tmp_path / "uncut.usdc")
    knife.pumice.cut, box.pumice.cut = "PLANE", "BOX"
    knife.matrix_world = volume.matrix_world @ Matrix.Translation((0, 0, height))
    assert sorted(o.name for o in data.objects) == names and not knife.hide_render

    kept = dense.copy()
    kept[20:, 20:, :] = 0
    expected = cut_areas(kept, height)
    assert 0 < len(expected) < len(np.unique(dense)) - 1
    staged.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    _, lines = extension.import_scene.restore(staged.context, str(path), True)
    assert lines == lost and differences(before, values(staged)) == []
    # An empty in the knife's place holds the lamp.
    others = ["the camera", *LIGHTS, *staged_scene.PRINCIPLED]
    assert sorted(o.name for o in staged.data.objects) == sorted([*others, VOLUME, "knife frame"])
    found = staged.data.objects[VOLUME]
    assert np.allclose(np.array(found.matrix_world), matrix, rtol=0, atol=2e-6)
    # Corners on the cut are single precision: 24 · 2⁻²⁴ of a voxel, and the plane's matrix is single precision too.
    assert areas_of(found) == pytest.approx(expected, abs=1e-2)
    assert max(v.co.z for v in found.data.vertices) == pytest.approx(height, abs=1e-4)
    for control, rest in ((moved, cut_areas(kept, height + 0.25)), (uncut, {id: len(faces) for id, faces in brute_force(dense).items()})):
        reopened(staged, control)
        areas = areas_of(staged.data.objects[VOLUME])
        assert areas == pytest.approx(rest, abs=1e-2) and areas != pytest.approx(expected, abs=1.0), control


def test_errors_are_one_line_and_leave_nothing(staged, extension, monkeypatch, tmp_path):
    with monkeypatch.context() as lacking:
        lacking.setattr(extension.export_scene.usd_stage, "has_modules", lambda: False)
        with pytest.raises(RuntimeError, match="lacks the Python modules of USD"):
            staged.ops.pumice.export_scene(filepath=str(tmp_path / "scene.usdc"))
    with pytest.raises(RuntimeError, match="there is no such folder"):
        staged.ops.pumice.export_scene(filepath=str(tmp_path / "missing/scene.usdc"))
    with pytest.raises(RuntimeError, match="there is no such file"):
        staged.ops.pumice.import_scene(filepath=str(tmp_path / "missing.usdc"))
    (tmp_path / "junk.usdc").write_bytes(b"junk")
    world, count = staged.context.scene.world, len(staged.data.worlds)
    with pytest.raises(RuntimeError, match="junk.usdc: Blender's importer cannot read it"):
        staged.ops.pumice.import_scene(filepath=str(tmp_path / "junk.usdc"))
    assert staged.context.scene.world == world and len(staged.data.worlds) == count
    folder = tmp_path / "out"
    (folder / "textures").mkdir(parents=True)
    exported(staged, folder / "scene.usdc")
    (picture,) = (folder / "textures").iterdir()
    # The same picture may stand there already, another one is not replaced.
    exported(staged, folder / "scene.usdc")
    picture.write_bytes(b"another picture")
    with pytest.raises(RuntimeError, match="another picture has this name"):
        staged.ops.pumice.export_scene(filepath=str(folder / "other.usdc"))
    assert picture.read_bytes() == b"another picture"
    assert sorted(p.name for p in folder.iterdir()) == ["scene-volumes.usdc", "scene.usdc", "textures"]


def test_a_stage_without_notes_arrives_by_the_specification(with_usd, tmp_path):
    from test_usd_import import CLOSE, LAMPS, PARALLEL, SUNS, imported

    blender = with_usd
    # The command writes the stage, and the stock importer reads it wrong, which its own tests show.
    imported(blender, tmp_path, PARALLEL, (300, 500))
    reopened(blender, tmp_path / "scene.usdc")
    things, scene = blender.data.objects, blender.context.scene
    for number, sun in enumerate(SUNS):
        light = things[f"sun_{number}"].data
        assert [light.energy, light.angle] == pytest.approx([sun["strength"], sun["angle_rad"]], rel=CLOSE)
    for number, shape in enumerate(LAMPS):
        ((kind, shape),) = shape.items()
        light = things[f"lamp_{number}"].data
        assert light.energy == pytest.approx(100.0 * (number + 1), rel=CLOSE)
        if kind == "spot":
            assert light.spot_blend == pytest.approx(shape["blend"], rel=CLOSE)
        if kind == "area":
            assert light.spread == pytest.approx(shape["spread_rad"], rel=CLOSE)
        else:
            assert not light.use_soft_falloff
    camera = scene.camera.data
    assert camera.type == "ORTHO" and camera.ortho_scale == pytest.approx(24.0, rel=CLOSE) and camera.dof.use_dof
    assert (scene.render.resolution_x, scene.render.resolution_y) == (300, 500)
    nodes = {node.type: node for node in scene.world.node_tree.nodes}
    assert nodes["BACKGROUND"].inputs["Strength"].default_value == 1.5


def test_the_dialog_keeps_kind_and_ending_the_same(extension):
    operator = extension.export_scene.PUMICE_OT_export_scene
    dialog = types.SimpleNamespace(filepath="/x/a.json", kind="JSON", _kind_before="JSON")
    assert not operator.check(dialog, None) and (dialog.filepath, dialog.kind) == ("/x/a.json", "JSON")
    dialog.kind = "USDZ"
    assert operator.check(dialog, None) and dialog.filepath == "/x/a.usdz"
    # Another ending is typed; none; one that is none.
    for typed, expected, kind in [("/x/b.usda", "/x/b.usda", "USDA"), ("/x/c", "/x/c.usda", "USDA"), ("/x/d.1", "/x/d.1.usda", "USDA")]:
        dialog.filepath = typed
        assert operator.check(dialog, None) == (typed != expected) and (dialog.filepath, dialog.kind) == (expected, kind)


def in_a_fresh_blender(stage, out, first_seed, how):
    """(pictures, values) of the stage, opened and rendered in a process of its own."""
    done = subprocess.run(
        [sys.executable, staged_scene.__file__, str(stage), str(out), str(first_seed), how], capture_output=True, text=True, env=os.environ
    )
    assert done.returncode == 0 and out.is_file(), done.stdout[-2000:] + done.stderr[-4000:]
    with np.load(out) as file:
        return file["pictures"], json.loads(str(file["values"]))


@pytest.mark.full
def test_cycles_draws_the_same_in_a_fresh_blender(staged, tmp_path):
    from test_cycles_agreement import SEEDS, SIZE, judge

    assert SIZE == staged_scene.SIZE and SEEDS == 8
    path = exported(staged, tmp_path / "scene.usdc")
    before = values(staged)
    staged.context.view_layer.objects.active = staged.data.objects[VOLUME]
    staged.data.objects[VOLUME].select_set(True)
    assert staged.ops.pumice.make_exact_mesh() == {"FINISHED"}
    original = rendered(staged, tmp_path, range(1, 9))
    again, found = in_a_fresh_blender(path, tmp_path / "ours.npz", 101, "ours")
    assert differences(before, found) == []
    found = judge(again, original)
    assert found["agrees"], found
    for how in ("stock", "turned"):
        wrong, _ = in_a_fresh_blender(path, tmp_path / f"{how}.npz", 201, how)
        found = judge(wrong, original)
        assert found["ratio"] > found["ratio_by_chance"][1] and found["rejected"] > 3, (how, found)
