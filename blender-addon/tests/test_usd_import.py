# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that Blender's own importer reads what `pumice export` writes as USD: objects, faces, materials, labels, scale and orientation; and
camera, world, suns, lamps and meshes with the numbers of the scene."""

import json
import math
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
    # Colour and roughness of each label are those of the scene.
    (instance,) = json.loads(scene_of(tmp_path))["instances"]
    notes = json.loads(thing["labels"])
    for label, place in pairs:
        shader = next(node for node in mesh.materials[place].node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        given = instance["style"]["materials"][str(notes[label][0])]
        assert np.allclose(shader.inputs["Base Color"].default_value, [*given["base_color"], 1.0], rtol=CLOSE, atol=0)
        assert shader.inputs["Roughness"].default_value == pytest.approx(given["roughness"], rel=CLOSE)
    colors = {tuple(given["base_color"]) for given in instance["style"]["materials"].values()}
    assert len(colors) == LABELS, "so that a colour of another label is noticed"
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
    assert [id for id, _, _ in notes] == volume.labels.ids.tolist() and all(name for _, name, _ in notes)
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


# Columns that are neither at right angles nor of one length, mirrored.
SHEARED = [-2.0, 0.3, 0.1, 0.5, 1.5, -0.4, 0.2, 0.7, 3.0, 10.0, 20.0, 30.0]


@pytest.mark.parametrize("form", ["voxels", "smooth", "instances"])
def test_what_shears_arrives_in_its_place(blender, tmp_path, form):
    """A volume and a mesh whose matrices are more than location, rotation and scale, which is all that the importer keeps of a prim."""
    scene = json.loads(scene_of(tmp_path))
    scene["instances"][0]["world_from_index"] = SHEARED
    (tmp_path / "roof.ply").write_text(ROOF)
    scene["meshes"] = [{"id": 4, "source": "roof.ply", "world_from_mesh": SHEARED, "materials": [{"base_color": [0.5, 0.5, 0.5]}]}]
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    command = os.environ.get("PUMICE", ROOT / "target" / "debug" / "pumice")
    out = tmp_path / "scene.usdc"
    subprocess.run([command, "export", tmp_path / "scene.json", "-o", out, "--form", form], check=True, capture_output=True)
    blender.ops.wm.usd_import(filepath=str(out))
    placed = {thing.name: np.array(thing.matrix_world)[:3].T for thing in blender.data.objects}
    expected = np.reshape(SHEARED, (4, 3))
    for name in ("boxes" if form == "instances" else "surface", "mesh"):
        assert np.allclose(placed[name], expected, rtol=0, atol=1e-5), name
    if form == "instances":
        # The boxes themselves, too: a cube's edges are those of the matrix, as often as the box is wide.
        graph = blender.context.evaluated_depsgraph_get()
        edges = np.array([np.array(i.matrix_world)[:3, 0] for i in graph.object_instances if i.is_instance])
        lengths = np.linalg.norm(edges, axis=1) / np.linalg.norm(expected[0])
        assert np.allclose(edges / lengths[:, None], expected[0], rtol=0, atol=1e-4) and np.allclose(lengths, lengths.round(), atol=1e-4)


def test_a_smoothed_surface_arrives_closed_with_its_normals(blender, tmp_path):
    out = tmp_path / "smooth.usdc"
    report = exported(out, "--form", "smooth")
    blender.ops.wm.usd_import(filepath=str(out))
    (thing,) = (o for o in blender.data.objects if o.type == "MESH")
    mesh = thing.data
    assert len(mesh.polygons) == report["faces"] and len(mesh.materials) == LABELS
    assert (thing.get("not_exact") or mesh.get("not_exact")).startswith("smoothed")
    edges = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("edge_index", edges)
    counts = np.bincount(edges, minlength=len(mesh.edges))
    assert (counts % 2 == 0).all() and counts.min() == 2, "no edge is open"
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    assert 0.1 < np.abs(points - points.round()).max() < 0.401
    normals, flat = np.empty(3 * len(mesh.loops), np.float32), np.empty(3 * len(mesh.polygons), np.float32)
    mesh.corner_normals.foreach_get("vector", normals)
    mesh.polygons.foreach_get("normal", flat)
    cosines = (normals.reshape(-1, 4, 3) * flat.reshape(-1, 1, 3)).sum(axis=-1)
    # Smooth, and on the side of their faces, but for corners at which voxels of this rough volume touch alone (1.7 %).
    assert 0.8 < cosines.mean() < 0.999 and (cosines > 0).mean() > 0.97


def test_glass_of_an_obj_arrives(blender, tmp_path):
    scene = json.loads(scene_of(tmp_path))
    (style,) = (instance["style"] for instance in scene["instances"])
    first = next(iter(style["materials"]))
    style["materials"][first].update(transmission=0.75, ior=1.33)
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    command = os.environ.get("PUMICE", ROOT / "target" / "debug" / "pumice")
    out = tmp_path / "ct.obj"
    subprocess.run([command, "export", tmp_path / "scene.json", "-o", out, "--form", "voxels"], check=True, capture_output=True)
    blender.ops.wm.obj_import(filepath=str(out))
    found = [next(n for n in m.node_tree.nodes if n.type == "BSDF_PRINCIPLED").inputs for m in blender.data.materials]
    glass = [(i["Transmission Weight"].default_value, i["IOR"].default_value) for i in found if i["Transmission Weight"].default_value]
    assert len(found) == LABELS and np.allclose(glass, [(0.75, 1.33)], rtol=CLOSE, atol=0)


# Each number passes through at most four roundings to single precision, of 6e-8 each.
CLOSE = 1e-6
POSE = [0.8, 0.6, 0.0, -0.36, 0.48, 0.8, 0.48, -0.64, 0.6, 30.0, -40.0, 20.0]
PLACED = [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 5.0, 6.0, 7.0]
AREA = {"world_from_light": PLACED, "size": [2.0, 3.0], "spread_rad": math.pi}
BALL = {"position": [1.0, 2.0, 3.0], "radius": 0.25}
SPOT = {**BALL, "direction": [1.0, -2.0, -3.0], "angle_rad": 1.25, "blend": 0.375}
LAMPS = [{"point": BALL}, {"point": {**BALL, "radius": 0.0}}, {"spot": SPOT}, {"area": {**AREA, "outline": "rectangle"}},
         {"area": {**AREA, "outline": "ellipse"}}]
SUNS = [{"direction": [0.5, -1.0, -2.0], "strength": 3.5, "color": [1.0, 0.5, 0.25], "angle_rad": 0.125},
        {"direction": [0.0, 0.0, -1.0], "strength": 2.0, "angle_rad": 0.0}]
# A roof of two triangles; its corners' normals point up, and two of them aside.
ROOF = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float nx
property float ny
property float nz
element face 2
property list uchar int vertex_indices
end_header
0 0 0 -0.6 0 0.8
1 0 1 0 0 1
1 2 1 0 0 1
2 0 0 0.6 0 0.8
3 0 1 2
3 1 3 2
"""
PERSPECTIVE = {"projection": {"perspective": {"fov_rad": 0.75}}, "shift": [0.125, -0.0625], "clip": [0.5, 500.0]}
PARALLEL = {"projection": {"orthographic": {"scale": 24.0}}, "clip": [0.5, 500.0]}


def imported(blender, folder, camera, size, *flags):
    """What Blender has after the import of a scene that the command wrote: objects by name."""
    scene = json.loads(scene_of(folder))
    opening = {"radius": 0.5, "focus_distance": 40.0}
    scene["camera"] = {"world_from_camera": POSE, "aperture": opening, **camera}
    scene["film"].update(zip(("width", "height"), size, strict=True))
    lights = [{"shape": shape, "power_w": 100.0 * (i + 1), "color": [1.0, 0.5, 0.25]} for i, shape in enumerate(LAMPS)]
    (folder / "roof.ply").write_text(ROOF)
    roof = {"id": 4, "source": "roof.ply", "world_from_mesh": PLACED, "materials": [{"roughness": 0.25}]}
    scene.update(suns=SUNS, lights=lights, meshes=[roof])
    picture = blender.data.images.new("sky", 64, 32, float_buffer=True)
    picture.file_format = "OPEN_EXR"
    picture.filepath_raw = str(folder / "sky.exr")
    picture.save()
    scene["world"] = {"environment": {"image": {"path": "sky.exr", "rotation_rad": 0.75, "strength": 1.5}}}
    (folder / "scene.json").write_text(json.dumps(scene))
    command = os.environ.get("PUMICE", ROOT / "target" / "debug" / "pumice")
    out = folder / "scene.usdc"
    subprocess.run([command, "export", folder / "scene.json", "-o", out, *flags], check=True, capture_output=True)
    # The importer fills the world that is there, and makes none.
    blender.context.scene.world = blender.data.worlds.new("sky")
    blender.ops.wm.usd_import(filepath=str(out))
    return {thing.name: thing for thing in blender.data.objects}


def along(thing):
    """Where a lamp of Blender shines: along its −z."""
    return -np.array(thing.matrix_world)[:3, 2] / np.linalg.norm(np.array(thing.matrix_world)[:3, 2])


def unit(vector):
    return np.array(vector) / np.linalg.norm(vector)


def test_for_blender_the_camera_arrives(blender, tmp_path):
    things = imported(blender, tmp_path, PERSPECTIVE, (640, 480), "--for", "blender")
    camera = things["camera"].data
    assert camera.type == "PERSP" and camera.sensor_fit == "HORIZONTAL"
    got = [camera.lens, camera.sensor_width, camera.sensor_height, camera.shift_x, camera.shift_y, camera.clip_start, camera.clip_end]
    expected = [18.0 / math.tan(0.375), 36.0, 27.0, 0.125, -0.0625, 0.5, 500.0]
    assert np.allclose(got, expected, rtol=CLOSE, atol=0)
    # Blender's f-stop N gives a radius of focal length / (2 N).
    assert camera.lens * 1e-3 / (2 * camera.dof.aperture_fstop) == pytest.approx(0.5, rel=CLOSE)
    assert camera.dof.focus_distance == 40.0
    assert camera.dof.use_dof or blender.app.version < (5, 0)
    pose = np.array(things["camera"].matrix_world)
    # A matrix of Blender is single precision: 6e-8 of its largest entry.
    assert np.allclose(pose[:3].T, np.reshape(POSE, (4, 3)), rtol=0, atol=1e-5)


def test_for_blender_an_orthographic_camera_arrives(blender, tmp_path):
    camera = imported(blender, tmp_path, PARALLEL, (300, 500), "--for", "blender")["camera"].data
    assert camera.type == "ORTHO" and camera.sensor_fit == "VERTICAL"
    assert camera.ortho_scale == pytest.approx(24.0, rel=CLOSE)
    # Blender's f-stop of an orthographic camera is 1 / (2 radius).
    assert 1 / (2 * camera.dof.aperture_fstop) == pytest.approx(0.5, rel=CLOSE)


def test_for_blender_suns_lamps_and_world_arrive(blender, tmp_path):
    things = imported(blender, tmp_path, PERSPECTIVE, (64, 48), "--for", "blender")
    for number, sun in enumerate(SUNS):
        lamp = things[f"sun_{number}"]
        assert lamp.data.energy == pytest.approx(sun["strength"], rel=CLOSE)
        assert lamp.data.angle == pytest.approx(sun["angle_rad"], rel=CLOSE)
        assert np.allclose(lamp.data.color, sun.get("color", [1.0] * 3), rtol=CLOSE)
        assert np.allclose(along(lamp), unit(sun["direction"]), rtol=0, atol=1e-6)
    kinds = ["POINT", "POINT", "SPOT", "AREA", "AREA"]
    for number, (kind, shape) in enumerate(zip(kinds, LAMPS, strict=True)):
        thing, shape = things[f"lamp_{number}"], next(iter(shape.values()))
        lamp = thing.data
        assert lamp.type == kind and lamp.energy == pytest.approx(100.0 * (number + 1), rel=CLOSE)
        assert np.allclose(lamp.color, [1.0, 0.5, 0.25], rtol=CLOSE)
        assert np.allclose(thing.location, shape.get("position", [5.0, 6.0, 7.0]), rtol=CLOSE)
        if kind == "AREA":
            size_y = lamp.size if lamp.shape == "DISK" else lamp.size_y
            sides = np.array([lamp.size, size_y]) * np.array(thing.scale)[:2]
            assert np.allclose(sides, shape["size"], rtol=CLOSE) and lamp.shape == ("RECTANGLE" if number == 3 else "DISK")
            assert np.allclose(along(thing), [0, 0, -1], rtol=0, atol=1e-6)
        else:
            assert lamp.shadow_soft_size == shape["radius"]
        if kind == "SPOT":
            assert lamp.spot_size == pytest.approx(1.25, rel=CLOSE) and lamp.spot_blend == pytest.approx(0.375, rel=CLOSE)
            assert np.allclose(along(thing), unit(shape["direction"]), rtol=0, atol=1e-6)
    nodes = {node.type: node for node in blender.context.scene.world.node_tree.nodes}
    assert nodes["BACKGROUND"].inputs["Strength"].default_value == 1.5
    assert tuple(nodes["TEX_ENVIRONMENT"].image.size) == (64, 32)
    # A Mapping node (of points) that turns by −r about z turns the picture by r, as the scene's rotation does.
    turn = np.array(nodes["MAPPING"].inputs["Rotation"].default_value)
    assert np.allclose(turn, [0, 0, -0.75], rtol=0, atol=1e-6)


def test_meshes_arrive_smooth_in_their_place(blender, tmp_path):
    thing = imported(blender, tmp_path, PERSPECTIVE, (64, 48))["mesh_4"]
    mesh = thing.data
    assert np.allclose(np.array(thing.matrix_world)[:3].T, np.reshape(PLACED, (4, 3)), rtol=0, atol=1e-6)
    assert [list(polygon.vertices) for polygon in mesh.polygons] == [[0, 1, 2], [1, 3, 2]]
    normals = np.empty(3 * len(mesh.loops), np.float32)
    mesh.corner_normals.foreach_get("vector", normals)
    expected = np.array([[-0.6, 0, 0.8], [0, 0, 1], [0, 0, 1], [0, 0, 1], [0.6, 0, 0.8], [0, 0, 1]])
    # Pumice keeps normals in 32 bits (7e-5), Blender custom normals in two of 16 bits (1e-4).
    assert np.allclose(normals.reshape(-1, 3), expected, rtol=0, atol=3e-4)
    shader = next(node for node in mesh.materials[0].node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    assert shader.inputs["Roughness"].default_value == 0.25


def test_a_file_for_all_programs_arrives_as_documented(blender, tmp_path):
    """The control: what the flag is for, and what the documentation says of Blender."""
    things = imported(blender, tmp_path, PARALLEL, (300, 500))
    assert things["camera"].data.ortho_scale == pytest.approx(240.0, rel=CLOSE)
    assert things["sun_0"].data.energy == pytest.approx(14.0, rel=CLOSE)
    assert things["sun_0"].data.angle == pytest.approx(0.25, rel=CLOSE)
    assert things["lamp_2"].data.spot_blend < 0.3
    assert [things[f"lamp_{i}"].data.energy for i in range(5)] == pytest.approx([100, 200, 300, 400, 500], rel=CLOSE)
    assert blender.context.scene.camera is None
    assert things["lamp_3"].data["spread_deg"] == pytest.approx(180.0)


def test_a_package_brings_its_picture(blender, tmp_path):
    imported(blender, tmp_path, PERSPECTIVE, (64, 48))
    command = os.environ.get("PUMICE", ROOT / "target" / "debug" / "pumice")
    subprocess.run([command, "export", tmp_path / "scene.json", "-o", tmp_path / "scene.usdz"], check=True, capture_output=True)
    (tmp_path / "sky.exr").unlink()
    blender.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    blender.context.scene.world = blender.data.worlds.new("sky")
    blender.ops.wm.usd_import(filepath=str(tmp_path / "scene.usdz"))
    (node,) = (node for node in blender.context.scene.world.node_tree.nodes if node.type == "TEX_ENVIRONMENT")
    assert tuple(node.image.size) == (64, 32) and blender.data.objects["surface"].type == "MESH"
