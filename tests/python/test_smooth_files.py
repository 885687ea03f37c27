"""Tests files with smoothed surfaces: numpy smooths the voxels by itself and compares places, faces and normals of every format with that.
The examples of pumice-export write the scenes; `part` is `blobs` within a region."""

import numpy as np
import pytest
import trimesh
from pxr import Usd, UsdGeom
from test_export_region import REGION
from test_gltf_scenes import File
from test_triangle_files import matrix_of
from test_usd_scenes import voxels

STEPS, SHARE, FARTHEST = 6, 0.5, 0.4
NAMES = ["noise", "part"]
# Places of six steps in single precision, in the world up to 10⁴ and from there in voxels of 4: 10⁴ · 2⁻²⁴ / 4, and as much again.
NEAR = 6e-4


@pytest.fixture
def folder(exported_scenes):
    return exported_scenes


def region_of(name, shape):
    return REGION if name == "part" else np.array([[0, 0, 0], shape])


def drawn_in(folder, name):
    """Dense index + 1 at the voxels of the region, and its lowest voxel."""
    drawn = voxels(folder, name)
    low, high = region_of(name, drawn.shape)
    return drawn[tuple(slice(a, b) for a, b in zip(low, high, strict=True))], low


def smoothed(drawn):
    """Where each corner of the voxels goes, relative to where it is, as [x, y, z, axis]."""
    padded = np.pad(drawn, 1, mode="edge")
    shape = np.array(drawn.shape) + 1
    directions, meeting = [], []
    for axis in range(3):
        for side in (0, 1):
            step = np.zeros(3)
            step[axis] = 2 * side - 1
            starts = np.zeros((4, 3), int)
            starts[:, (axis + 1) % 3], starts[:, (axis + 2) % 3], starts[:, axis] = [0, 1, 0, 1], [0, 0, 1, 1], side
            four = np.stack([padded[tuple(slice(s, s + n) for s, n in zip(start, shape, strict=True))] for start in starts])
            directions.append(step)
            meeting.append(1 + (np.diff(np.sort(four, axis=0), axis=0) != 0).sum(axis=0))
    meeting = np.stack(meeting)
    follows = np.where((meeting > 2).sum(axis=0) > 1, meeting > 2, meeting > 1)
    free = np.ones((*shape, 3))
    for axis in range(3):
        for end in (0, -1):
            place = [slice(None)] * 3
            place[axis] = end
            # No neighbours beyond the ends, and no way out of their planes.
            follows[(2 * axis - end, *place)] = False
            free[(*place, axis)] = 0
    count = follows.sum(axis=0)[..., None]
    moved = np.zeros((*shape, 3))
    for _ in range(STEPS):
        total = np.zeros_like(moved)
        for number, step in enumerate(directions):
            axis = number // 2
            total += follows[number][..., None] * (step + np.roll(moved, -int(step[axis]), axis))
        middle = np.where(count > 0, total / np.maximum(count, 1), moved)
        moved = free * np.clip(moved + SHARE * (middle - moved), -FARTHEST, FARTHEST)
    return moved


def key(shape, labels, axes, lowest):
    """A number for each face of voxels, by its label, its axis and its lowest corner."""
    return np.ravel_multi_index((labels, axes, *np.transpose(lowest)), (1000, 3, *np.add(shape, 1)))


def sides(drawn):
    """The keys of all faces of the voxels, rising, and what is beyond each: dense index + 1, -1 for the region's end."""
    padded = np.pad(drawn, 1)
    keys, beyond = [], []
    for axis in range(3):
        for side in (0, 1):
            other = np.roll(padded, 1 - 2 * side, axis)[1:-1, 1:-1, 1:-1]
            found = np.argwhere((drawn != 0) & (other != drawn))
            place = tuple(found.T)
            lowest = found + side * np.eye(3, dtype=int)[axis]
            is_end = np.isin(lowest[:, axis], [0, drawn.shape[axis]])
            keys.append(key(drawn.shape, drawn[place] - 1, axis, lowest))
            beyond.append(np.where(is_end, -1, other[place]))
    keys, beyond = np.concatenate(keys), np.concatenate(beyond)
    order = np.argsort(keys)
    return keys[order], beyond[order]


def is_as_expected(folder, name, labels, quads, normals):
    """Whether faces, with corners in voxels of the region, are those that numpy finds, and their normals."""
    drawn, low = drawn_in(folder, name)
    quads, labels = quads - low, np.array(labels)
    corners = quads.round().astype(int)
    moved, (keys, beyond) = smoothed(drawn), sides(drawn)
    apart = np.abs(quads - corners - moved[tuple(np.moveaxis(corners, -1, 0))]).max()
    lowest, size = corners.min(axis=1), np.ptp(corners, axis=1)
    axes = size.argmin(axis=1)
    # The four corners of a square, each once.
    assert (size.sum(axis=1) == 2).all() and size.max() == 1
    bits = np.sort((corners - lowest[:, None]) @ [1, 2, 4], axis=1)
    assert np.array_equal(bits, np.array([[0, 2, 4, 6], [0, 1, 4, 5], [0, 1, 2, 3]])[axes])
    got = key(drawn.shape, labels, axes, lowest)
    if apart > NEAR or not np.array_equal(np.sort(got), keys):
        return False
    # The diagonal that faces are divided by is the shorter one.
    across = [np.linalg.norm(quads[:, i] - quads[:, i + 2], axis=1) for i in (0, 1)]
    assert (across[0] < across[1] + 4 * NEAR).all()
    if normals is not None:
        assert np.abs(np.linalg.norm(normals, axis=-1) - 1).max() < 1e-5
        # The normals of the faces that are seen from outside: the sum of their areas at each corner, whatever their label.
        is_outside = beyond[np.searchsorted(keys, got)] == 0
        areas = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])[is_outside]
        places = tuple(np.moveaxis(corners[is_outside], -1, 0))
        sums = np.zeros((*np.add(drawn.shape, 1), 3))
        np.add.at(sums, places, areas[:, None])
        expected, lengths = sums[places], np.linalg.norm(sums[places], axis=-1, keepdims=True)
        # Places that are off by NEAR turn a face of half a voxel by 2 · NEAR; areas that cancel have no direction.
        off = np.abs(normals[is_outside] - expected / np.maximum(lengths, 1e-9)).max(axis=-1)[lengths[..., 0] > 0.5]
        assert off.size > 1000 and off.max() < 20 * NEAR
    return True


def of_usd(folder, name, ending="usdc"):
    stage = Usd.Stage.Open(str(folder / f"{name}.{ending}"))
    stage.SetEditTarget(stage.GetSessionLayer())
    stage.GetPrimAtPath("/Scene/volume_7").GetVariantSet("form").SetVariantSelection("smooth")
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Scene/volume_7/surface"))
    assert "smoothed" in mesh.GetPrim().GetAttribute("userProperties:not_exact").Get()
    points, places = np.array(mesh.GetPointsAttr().Get()), np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 4)
    assert (np.array(mesh.GetFaceVertexCountsAttr().Get()) == 4).all()
    assert np.array_equal(np.array(mesh.GetExtentAttr().Get()), [points.min(axis=0), points.max(axis=0)])
    primvars = UsdGeom.PrimvarsAPI(mesh)
    assert primvars.GetPrimvar("normals").GetInterpolation() == "faceVarying"
    normals = np.array(primvars.GetPrimvar("normals").ComputeFlattened()).reshape(-1, 4, 3)
    return places, points, np.array(primvars.GetPrimvar("label").Get()).tolist(), normals


def of_gltf(folder, name):
    file = File(folder / f"{name}.smooth.glb")
    node = next(n for n in file.below(file.named("volume_7")) if "mesh" in file.nodes[n])
    quads, labels, normals = [], [], []
    for primitive in file.json["meshes"][file.nodes[node]["mesh"]]["primitives"]:
        positions, of_vertices, numbers = (file.array(primitive["attributes"][a]) for a in ("POSITION", "NORMAL", "_LABEL"))
        triangles = file.array(primitive["indices"]).reshape(-1, 6)
        assert (triangles[:, [0, 2]] == triangles[:, [3, 4]]).all()
        corners = triangles[:, [0, 1, 2, 5]]
        quads.append(positions[corners])
        normals.append(of_vertices[corners])
        assert (numbers[corners] == numbers[corners[:, :1]]).all()
        labels += numbers[corners[:, 0], 0].astype(int).tolist()
    assert file.nodes[file.named("volume_7")]["extras"]["not_exact"].startswith("smoothed")
    assert "KHR_mesh_quantization" not in file.json.get("extensionsUsed", [])
    return np.concatenate(quads), labels, np.concatenate(normals)


def of_ply(folder, name):
    path = folder / f"{name}.smooth.ply"
    assert b"comment not exact: smoothed" in path.read_bytes()[:300]
    raw = {element: part["data"] for element, part in trimesh.load(path, process=False).metadata["_ply_raw"].items()}
    points, normals = (np.stack([raw["vertex"][p] for p in names], axis=1) for names in (("x", "y", "z"), ("nx", "ny", "nz")))
    corners = raw["face"]["vertex_indices"]["f1"]
    assert (raw["face"]["volume"] == 7).all()
    return points[corners].astype(float), raw["face"]["label"].tolist(), normals[corners].astype(float)


def of_obj(folder, name, ids):
    points, normals, quads, of_quads, labels, group = [], [], [], [], [], None
    for line in (folder / f"{name}.smooth.obj").read_text().splitlines():
        word, *values = line.split()
        if word in ("v", "vn"):
            (points if word == "v" else normals).append([float(value) for value in values])
        elif word == "g":
            group = ids.index(values[0])
        elif word == "f":
            pairs = [value.split("//") for value in values]
            quads.append([int(p) - 1 for p, _ in pairs])
            of_quads.append([int(n) - 1 for _, n in pairs])
            labels.append(group)
    return np.array(points)[quads], labels, np.array(normals)[of_quads]


def in_voxels(quads, normals, matrix):
    """Places and normals of the world in index space, and corners counter-clockwise as seen from outside there."""
    places = np.linalg.solve(matrix[:, :3], (quads - matrix[:, 3]).reshape(-1, 3).T).T.reshape(quads.shape)
    turned = normals @ matrix[:, :3]
    return places, turned / np.linalg.norm(turned, axis=-1, keepdims=True)


@pytest.mark.parametrize("name", NAMES)
def test_usd_and_gltf_have_the_smoothed_faces(folder, name):
    places, points, labels, normals = of_usd(folder, name)
    quads = points[places].astype(float)
    assert is_as_expected(folder, name, labels, quads, normals)
    # Control: other labels, and a point that is off.
    assert not is_as_expected(folder, name, labels[1:] + labels[:1], quads, None)
    quads[7, 1] += [0, 0, 3 * NEAR]
    assert not is_as_expected(folder, name, labels, quads, None)
    # Each label is closed: its edges are passed as often in both directions. A point is of one label.
    ends = np.stack([places, np.roll(places, -1, axis=1)], axis=-1).reshape(-1, 2)
    assert np.array_equal(*(np.sort(e @ [len(points), 1]) for e in (ends, ends[:, ::-1])))
    of_point = np.full(len(points), -1)
    of_point[places] = np.array(labels)[:, None]
    assert (of_point[places] == np.array(labels)[:, None]).all() and of_point.min() >= 0
    text = of_usd(folder, name, "usda")
    assert all(np.array_equal(a, b) for a, b in zip(text, (places, points, labels, normals), strict=True))

    quads, labels, normals = of_gltf(folder, name)
    assert is_as_expected(folder, name, labels, quads.astype(float), normals.astype(float))


@pytest.mark.parametrize("name", NAMES)
def test_faces_alone_have_the_smoothed_faces(folder, name):
    matrix = matrix_of(folder, name)
    file = File(folder / f"{name}.smooth.glb")
    ids = [id for id, _, _ in file.nodes[file.named("volume_7")]["extras"]["labels"]]
    is_mirrored = np.linalg.det(matrix[:, :3]) < 0
    for quads, labels, normals in [of_ply(folder, name), of_obj(folder, name, ids)]:
        # Corners turn counter-clockwise as seen from outside, in the world: the normal is on that side, but where voxels touch at a corner.
        area = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
        facing = np.einsum("ij,ikj->ik", area, normals)
        assert (facing > 0).mean() > 0.8
        places, turned = in_voxels(quads, normals, matrix)
        order = [0, 3, 2, 1] if is_mirrored else [0, 1, 2, 3]
        assert is_as_expected(folder, name, labels, places[:, order], turned[:, order])
    quads, _, _ = of_ply(folder, name)
    data = (folder / f"{name}.smooth.stl").read_bytes()
    assert b"not exact" in data[:80]
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    triangles = np.frombuffer(data, record, offset=84)
    assert np.array_equal(triangles["corners"].reshape(-1, 2, 3, 3), quads[:, [[0, 1, 2], [0, 2, 3]]])
