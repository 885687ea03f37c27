# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that Blender's own importer reads what `pumice export` writes as glTF: surfaces, materials, labels, places, camera, lights, meshes."""

import ast
import json
import math
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
VOLUME = ROOT / "data" / "slicer_Segmentation.seg.nrrd"
COMMAND = os.environ.get("PUMICE", ROOT / "target" / "debug" / "pumice")

FLOOR = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 2 0
0 0 1
3 0 1 2
3 0 2 3
"""
# One label has every parameter that glTF has a word for.
GLOW = {
    "base_color": [0.2, 0.4, 0.6],
    "metallic": 0.25,
    "roughness": 0.3,
    "specular": 0.4,
    "specular_tint": [0.9, 0.8, 0.7],
    "ior": 1.4,
    "transmission": 0.6,
    "coat": 0.5,
    "coat_roughness": 0.1,
    "sheen": 0.5,
    "sheen_roughness": 0.7,
    "sheen_tint": [1.0, 0.5, 0.25],
    "alpha": 0.75,
    "emission": [6.0, 3.0, 1.5],
}
LAMPS = [
    {"shape": {"point": {"position": [1, -2, 3], "radius": 0.1}}, "power_w": 100, "color": [1, 0.5, 0.25]},
    {"shape": {"spot": {"position": [4, 5, 6], "direction": [0, 1, -1], "radius": 0.1, "angle_rad": 0.9, "blend": 0.3}}, "power_w": 40},
]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A scene of the volume, mirrored, with a sun, two lamps, a mesh that is mirrored, and a camera of 30 by 20 pixels; and its path."""
    folder = tmp_path_factory.mktemp("scene")
    path = folder / "scene.json"
    drawn = ["-o", folder / "p.png", "--size", "30x20", "--spp", "1", "--backend", "cpu", "--save-scene", path]
    subprocess.run([COMMAND, "render", VOLUME, *drawn], check=True, capture_output=True)
    scene = json.loads(path.read_text())
    (folder / "floor.ply").write_text(FLOOR)
    scene["suns"] = [{"direction": [0.0, 0.6, -0.8], "strength": 2.5, "color": [1.0, 1.0, 0.5], "angle_rad": 0.01}]
    scene["lights"] = LAMPS
    matrix = [-2.0, 0, 0, 0, 2.0, 0, 0, 0, 3.0, 10.0, 20.0, 30.0]
    scene["meshes"] = [{"id": 4, "source": "floor.ply", "world_from_mesh": matrix, "materials": [{"base_color": [0.1, 0.2, 0.3]}]}]
    scene["camera"] |= {"projection": {"perspective": {"fov_rad": 0.8}}, "fit": "horizontal", "clip": [0.25, 500.0]}
    scene["instances"][0]["world_from_index"][0] *= -1
    scene["instances"][0]["style"]["materials"]["3"] = GLOW
    path.write_text(json.dumps(scene))
    return scene, path


def imported(blender, source, out, *more):
    """The objects that the importer makes, by name, and the command's report."""
    report = out.with_suffix(".json")
    subprocess.run([COMMAND, "export", source, "-o", out, "--json", report, *more], check=True, capture_output=True)
    blender.ops.import_scene.gltf(filepath=str(out))
    return {o.name: o for o in blender.data.objects}, json.loads(report.read_text())


def world_points(thing):
    points = np.empty(3 * len(thing.data.vertices), np.float32)
    thing.data.vertices.foreach_get("co", points)
    matrix = np.array(thing.matrix_world)
    return points.reshape(-1, 3).astype(float) @ matrix[:3, :3].T + matrix[:3, 3]


def principled(material):
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")

    def value(name):
        value = shader.inputs[name].default_value
        return list(value)[:3] if hasattr(value, "__len__") else value

    return value


@pytest.mark.parametrize("form", ["voxels", "cells4", "boxes"])
@pytest.mark.parametrize("ending", ["gltf", "glb"])
def test_a_surface_arrives_whole(blender, scene, tmp_path, form, ending):
    import pumice

    things, report = imported(blender, scene[1], tmp_path / f"ct.{ending}", "--form", form)
    assert sorted(name for name, o in things.items() if o.type == "MESH") == ["mesh_4", "volume_1"]
    thing = things["volume_1"]
    mesh = thing.data
    assert len(mesh.polygons) == 2 * report["faces"] and len(mesh.vertices) == 4 * report["faces"]
    # The label of each vertex is a whole number, and each label has one material, which no other has.
    labels = np.empty(len(mesh.vertices), np.int32)
    attribute = mesh.attributes["_LABEL"]
    assert (attribute.data_type, attribute.domain) == ("INT", "POINT")
    attribute.data.foreach_get("value", labels)
    corners = np.empty(3 * len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("vertices", corners)
    of_face = labels[corners.reshape(-1, 3)]
    assert (of_face == of_face[:, :1]).all()
    materials = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("material_index", materials)
    pairs = {*zip(of_face[:, 0].tolist(), materials.tolist(), strict=True)}
    assert len(pairs) == len({label for label, _ in pairs}) == len({material for _, material in pairs})
    volume = pumice.open(VOLUME)
    # Blender makes a text of a list of lists.
    notes = ast.literal_eval(thing["labels"])
    assert [int(id) for id, _, _ in notes] == volume.labels.ids.tolist() and all(name for _, name, _ in notes)
    if form == "voxels":
        assert {label for label, _ in pairs} == set(range(len(notes)))
    # Where it stands: corners are whole numbers of voxels, placed by the matrix of the instance.
    expected = np.array(scene[0]["instances"][0]["world_from_index"]).reshape(4, 3).T
    points = world_points(thing)
    in_voxels = np.linalg.solve(expected[:, :3], (points - expected[:, 3]).T).T
    assert np.abs(in_voxels - in_voxels.round()).max() < 2e-4, "single precision of places up to 256 voxels away"
    assert in_voxels.round().min() >= 0 and (in_voxels.round().max(axis=0) <= volume.dims).all()
    bounds = [expected[:, :3] @ corner + expected[:, 3] for corner in (in_voxels.round().min(axis=0), in_voxels.round().max(axis=0))]
    assert np.allclose([points.min(axis=0), points.max(axis=0)], np.sort(bounds, axis=0), rtol=1e-6, atol=1e-6)
    # The normals point outward, and faces are flat. A closed surface whose faces point outward has a volume above 0.
    normals = np.empty(3 * len(mesh.loops), np.float32)
    mesh.corner_normals.foreach_get("vector", normals)
    flat = np.empty(3 * len(mesh.polygons), np.float32)
    mesh.polygons.foreach_get("normal", flat)
    # Blender keeps custom normals as two numbers of 16 bits.
    assert np.abs(normals.reshape(-1, 3, 3) - flat.reshape(-1, 1, 3)).max() < 1e-3
    a, b, c = (points[corners.reshape(-1, 3)[:, i]] - points.mean(axis=0) for i in range(3))
    sign = np.sign(np.linalg.det(np.array(thing.matrix_world)[:3, :3]))
    assert sign * np.einsum("ij,ij->i", a, np.cross(b, c)).sum() > 0
    # Although the matrix mirrors, the world's normals point at whoever looks from outside.
    assert sign == -1
    graph = blender.context.evaluated_depsgraph_get()
    middle = points.mean(axis=0)
    for direction in np.vstack([np.eye(3), -np.eye(3)]):
        hit, place, normal, _, met, _ = blender.context.scene.ray_cast(graph, middle - 20 * direction, direction)
        assert hit and met.name == "volume_1" and np.dot(normal, direction) < -0.99, (direction, place)


def test_materials_arrive(blender, scene, tmp_path):
    things, _ = imported(blender, scene[1], tmp_path / "ct.glb")
    style = scene[0]["instances"][0]["style"]
    found = [principled(material) for material in things["volume_1"].data.materials]
    assert len(found) == 7

    def close(got, expected):
        return np.allclose(got, expected, rtol=1e-6, atol=1e-6)

    for given in style["materials"].values():
        assert any(close(value("Base Color"), given["base_color"]) for value in found)
    glow = next(value for value in found if close(value("Base Color"), GLOW["base_color"]))
    for name, key in [
        ("Metallic", "metallic"),
        ("Roughness", "roughness"),
        ("Specular IOR Level", "specular"),
        ("Specular Tint", "specular_tint"),
        ("IOR", "ior"),
        ("Transmission Weight", "transmission"),
        ("Coat Weight", "coat"),
        ("Coat Roughness", "coat_roughness"),
        ("Sheen Roughness", "sheen_roughness"),
        ("Alpha", "alpha"),
    ]:
        assert close(glow(name), GLOW[key]), (name, glow(name))
    assert close(np.multiply(glow("Emission Color"), glow("Emission Strength")), GLOW["emission"])
    assert close(np.multiply(glow("Sheen Tint"), glow("Sheen Weight")), np.multiply(GLOW["sheen_tint"], GLOW["sheen"]))
    (floor,) = things["mesh_4"].data.materials
    assert close(principled(floor)("Base Color"), [0.1, 0.2, 0.3])
    # Control: the other materials do not glow, and are not glass.
    assert sum(value("Emission Strength") > 0 for value in found) == sum(value("Transmission Weight") > 0 for value in found) == 1


def test_camera_lights_and_meshes_arrive(blender, scene, tmp_path):
    things, report = imported(blender, scene[1], tmp_path / "ct.glb")
    # The scene has a label of glass.
    assert report["left_out"] == ["the world", "faces between labels that touch, which light reaches through glass and alpha"]
    blender.context.view_layer.update()

    def matrix(name):
        return np.array(things[name].matrix_world)

    def close(got, expected):
        return np.allclose(got, expected, rtol=1e-6, atol=2e-6)

    camera = things["camera"].data
    expected = np.array(scene[0]["camera"]["world_from_camera"]).reshape(4, 3).T
    assert close(matrix("camera")[:3], expected)
    # 0.8 radians span the width; Blender keeps a vertical angle, as a focal length.
    assert camera.type == "PERSP" and math.isclose(math.tan(camera.angle_y / 2), math.tan(0.4) * 20 / 30, rel_tol=1e-5)
    assert close([camera.clip_start, camera.clip_end], [0.25, 500])
    sun, point, spot = (things[name].data for name in ("sun_0", "lamp_0", "lamp_1"))
    assert (sun.type, point.type, spot.type) == ("SUN", "POINT", "SPOT")
    assert close([sun.energy, point.energy, spot.energy], [2.5, 100, 40])
    assert close(sun.color, [1, 1, 0.5]) and close(point.color, [1, 0.5, 0.25])
    assert close([spot.spot_size, spot.spot_blend], [0.9, 0.3])
    assert close(-matrix("sun_0")[:3, 2], [0, 0.6, -0.8]) and close(-matrix("lamp_1")[:3, 2], np.array([0, 1, -1]) / math.sqrt(2))
    assert close(matrix("lamp_0")[:3, 3], [1, -2, 3]) and close(matrix("lamp_1")[:3, 3], [4, 5, 6])
    # A mirrored mesh stands where it stood: corners (1, 0, 0), (0, 2, 0) and (0, 0, 1) of it.
    corners = {tuple(p) for p in world_points(things["mesh_4"]).round(4).tolist()}
    assert corners == {(10, 20, 30), (8, 20, 30), (10, 24, 30), (10, 20, 33)}
    assert np.linalg.det(matrix("mesh_4")[:3, :3]) < 0 and all(not p.use_smooth for p in things["mesh_4"].data.polygons)
