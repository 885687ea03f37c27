"""Tests PLY, OBJ and STL files with trimesh's readers and numpy: the example `write_mesh_scenes` of pumice-export writes generated volumes
beside their voxels and the scene, from which this file finds by itself which faces each file must have, and where."""

import json
import subprocess

import numpy as np
import pytest
import trimesh
from test_usd_scenes import faces, voxels

# One volume is mirrored, the other sheared and partly hidden.
SCENES = ["blobs", "noise"]


@pytest.fixture(scope="module")
def folder(rust_example, tmp_path_factory):
    folder = tmp_path_factory.mktemp("triangles")
    subprocess.run([rust_example("write_mesh_scenes"), folder], check=True)
    return folder


def matrix_of(folder, name):
    scene = json.loads((folder / f"{name}.json").read_text())
    return np.array(scene["instances"][0]["world_from_index"]).reshape(4, 3).T


def faces_in(rectangles, labels, matrix):
    """{(voxel, axis, side): label} of rectangles in the world, whose corners turn counter-clockwise as seen from outside."""
    rectangles = np.asarray(rectangles, float)
    in_voxels = np.linalg.solve(matrix[:, :3], (rectangles - matrix[:, 3]).reshape(-1, 3).T).T.reshape(-1, 4, 3)
    # Single precision of places up to 10⁴, in voxels of 4: 10⁴ · 2⁻²⁴ / 4.
    assert np.abs(in_voxels - in_voxels.round()).max() < 3e-4
    corners = in_voxels.round().astype(int)
    normals = np.cross(rectangles[:, 1] - rectangles[:, 0], rectangles[:, 2] - rectangles[:, 1])
    found = {}
    for rectangle, normal, label in zip(corners, normals, labels, strict=True):
        low, high = rectangle.min(axis=0), rectangle.max(axis=0)
        (axis,) = np.flatnonzero(low == high)
        # A step along the axis leaves the rectangle on the side where the normal is.
        side = int(normal @ matrix[:, axis] > 0)
        low[axis] -= side
        high[axis] = low[axis] + 1
        for voxel in np.ndindex(*(high - low)):
            key = (*(low + voxel).tolist(), int(axis), side)
            assert key not in found, "no face is covered twice"
            found[key] = label
    return found


def groups_of_obj(path):
    """Rectangles with the group and the material of each."""
    points, rectangles, names, materials, group, material = [], [], [], [], None, None
    for line in path.read_text().splitlines():
        word, *values = line.split()
        if word == "v":
            points.append([float(value) for value in values])
        elif word == "g":
            (group,) = values
        elif word == "usemtl":
            (material,) = values
        elif word == "f":
            rectangles.append([points[int(value) - 1] for value in values])
            names.append(group)
            materials.append(material)
    return np.array(rectangles), names, materials


@pytest.mark.parametrize("name", SCENES)
def test_ply_has_every_face_with_its_label_and_color(folder, name):
    read = trimesh.load(folder / f"{name}.voxels.ply", process=False)
    raw = {element: part["data"] for element, part in read.metadata["_ply_raw"].items()}
    points = np.stack([raw["vertex"][axis] for axis in "xyz"], axis=1)
    rectangles = points[raw["face"]["vertex_indices"]["f1"]]
    assert (raw["face"]["volume"] == 7).all() and (raw["face"]["vertex_indices"]["f0"] == 4).all()
    expected, matrix = faces(voxels(folder, name)), matrix_of(folder, name)
    labels = raw["face"]["label"].tolist()
    assert faces_in(rectangles, labels, matrix) == expected
    # Control: corners in reverse, and other labels, are other faces.
    assert faces_in(rectangles[:, ::-1], labels, matrix) != expected != faces_in(rectangles, labels[1:] + labels[:1], matrix)
    colors = read.visual.vertex_colors[raw["face"]["vertex_indices"]["f1"]][:, :, :3]
    assert (colors == colors[:, :1]).all()
    if name == "noise":
        # A linear 0.8 is 231 of a display, by the table of IEC 61966-2-1.
        assert (colors == 231).all()
    else:
        assert len({*zip(labels, map(tuple, colors[:, 0].tolist()), strict=True)}) == len(set(labels)), "a label has one colour"
        assert len(np.unique(colors[:, 0], axis=0)) > 5
    header = (folder / f"{name}.voxels.ply").read_bytes().split(b"end_header")[0].decode()
    comments = [line.split(maxsplit=4)[2:] for line in header.splitlines() if line.startswith("comment label ")]
    assert [(int(volume), int(label)) for volume, label, _ in comments] == [(7, label) for label in sorted(set(labels))]
    assert all(json.loads(note) == [int(label) + 1, None, None] for _, label, note in comments) or name == "blobs"


@pytest.mark.parametrize("name", SCENES)
def test_obj_has_a_group_for_each_label(folder, name):
    rectangles, groups, materials = groups_of_obj(folder / f"{name}.voxels.obj")
    drawn = voxels(folder, name)
    expected = faces(drawn)
    glb = (folder / f"{name}.voxels.gltf").read_text()
    ids = [id for id, _, _ in next(n for n in json.loads(glb)["nodes"] if n.get("name") == "volume_7")["extras"]["labels"]]
    labels = [ids.index(group) for group in groups]
    assert faces_in(rectangles, labels, matrix_of(folder, name)) == expected
    runs = 1 + sum(a != b for a, b in zip(groups, groups[1:], strict=False))
    assert runs == len(set(groups)), "a group is written in one piece"
    (beside,) = folder.glob(f"{name}.voxels.*.mtl")
    assert (folder / f"{name}.voxels.obj").read_text().splitlines()[1] == f"mtllib {beside.name}"
    written = beside.read_text().split("newmtl ")[1:]
    written = {text.split("\n")[0]: dict(line.split(maxsplit=1) for line in text.splitlines()[1:] if line) for text in written}
    assert set(materials) == set(written)
    if name == "noise":
        glow = written[materials[labels.index(2)]]
        assert [float(glow[key]) for key in ("d", "Pc", "Pcr", "Ps", "Pr")] == [0.25, 0.5, 0.2, 0.75, 0.5] and glow["Ke"] == "5 4 3"
        metal, glass = (written[materials[labels.index(label)]] for label in (3, 0))
        assert metal["Pm"] == "1" and glass["Ni"] == "1.33" and metal["Kd"] == "0.8 0.8 0.8"
        assert glass["Tf"] == "1 1 1" and "Tf" not in metal
    # Another reader finds as many triangles, and the materials.
    read = trimesh.load(folder / f"{name}.voxels.obj", process=False)
    parts = [read] if isinstance(read, trimesh.Trimesh) else list(read.geometry.values())
    assert sum(len(part.faces) for part in parts) == 2 * len(rectangles)
    assert {part.visual.material.name for part in parts} == set(written)


@pytest.mark.parametrize("name", SCENES)
def test_stl_has_every_face(folder, name):
    path = folder / f"{name}.voxels.stl"
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    data = np.frombuffer(path.read_bytes(), record, offset=84)
    pairs = data["corners"].reshape(-1, 2, 3, 3)
    assert (pairs[:, 0, 0] == pairs[:, 1, 0]).all() and (pairs[:, 0, 2] == pairs[:, 1, 1]).all()
    rectangles = np.concatenate([pairs[:, 0], pairs[:, 1, 2:]], axis=1)
    assert faces_in(rectangles, [0] * len(rectangles), matrix_of(folder, name)).keys() == faces(voxels(folder, name)).keys()
    # Another reader takes it for a binary file, and finds the same triangles and normals.
    read = trimesh.load(path, process=False)
    assert np.array_equal(read.triangles, data["corners"])
    cross = np.cross(read.triangles[:, 1] - read.triangles[:, 0], read.triangles[:, 2] - read.triangles[:, 0])
    cross /= np.linalg.norm(cross, axis=1, keepdims=True)
    # The sides of a voxel of 4 are known to 10⁴ · 2⁻²³.
    assert np.abs(cross - data["normal"]).max() < 2e-3 and np.abs(np.linalg.norm(data["normal"], axis=1) - 1).max() < 1e-6


def test_another_reader_finds_gltf_in_the_same_place(folder):
    read = trimesh.load(folder / "blobs.voxels.glb")
    placed = [(*read.graph[node], node) for node in read.graph.nodes_geometry]
    corners = np.concatenate([trimesh.transform_points(read.geometry[mesh].vertices, matrix) for matrix, mesh, _ in placed])
    x, y, z = corners.T
    whole = trimesh.load(folder / "blobs.voxels.stl").bounds
    # y is up there, z here.
    turned = np.stack([x, -z, y], axis=1)
    assert np.allclose([turned.min(axis=0), turned.max(axis=0)], whole, rtol=1e-6, atol=1e-3)
    # Control: unturned, it is elsewhere.
    assert not np.allclose([corners.min(axis=0), corners.max(axis=0)], whole, rtol=1e-6, atol=1e-3)
