"""Tests what `pumice export` writes of cut volumes: along many lines, the faces of each file enclose what a march through the voxels finds."""

import json

import numpy as np
import pytest
import trimesh
from command import run
from gltf_validator import issues
from pxr import Usd, UsdGeom
from stage_validators import of_stage
from test_gltf_scenes import File

ENDINGS = ["usdc", "glb", "ply", "obj", "stl"]
DIMS = (40, 36, 30)
# Steps of the march, in voxels.
STEP = 0.02
# Turned about z, mirrored, and stretched.
MATRIX = np.array([[1.6, 1.2, 0, -10], [1.2, -1.6, 0, 7], [0, 0, 5, 1]], float)
MIDDLE = MATRIX @ [20, 18, 15, 1]
OBLIQUE = {"plane": {"point": MIDDLE.tolist(), "normal": [0.3, 0.5, 0.8]}}
# The middle of a box that is turned by 0.7 about x and reaches through the volume along one of its axes.
HOLE = np.array([[9, 0, 0], [0, 12 * np.cos(0.7), -90 * np.sin(0.7)], [0, 12 * np.sin(0.7), 90 * np.cos(0.7)]])
HOLE = {"box": {"world_from_box": [*HOLE.T.ravel().tolist(), *MIDDLE.tolist()]}}
CUTS = [OBLIQUE, HOLE]


@pytest.fixture(scope="module")
def labels(tmp_path_factory):
    """Voxels as [x, y, z]: balls of four labels, which overlap and touch the volume's end."""
    random = np.random.default_rng(11)
    at = np.stack(np.meshgrid(*map(np.arange, DIMS), indexing="ij"), axis=-1)
    labels = np.zeros(DIMS, "u1")
    for ball in range(24):
        middle, radius = random.random(3) * DIMS, random.uniform(3, 9)
        labels[np.linalg.norm(at + 0.5 - middle, axis=-1) < radius] = ball % 4 + 1
    return labels


@pytest.fixture(scope="module")
def scene(pumice, labels, tmp_path_factory):
    """A function that writes the scene with other cuts, and returns its file."""
    folder = tmp_path_factory.mktemp("cuts")
    np.save(folder / "balls.npy", labels)
    shown = ["--spp", 1, "--size", "8x8", "--save-scene", folder / "whole.json"]
    run(pumice, "render", folder / "balls.npy", "-o", folder / "p.png", *shown).fine()
    whole = json.loads((folder / "whole.json").read_text())
    whole["instances"][0]["world_from_index"] = MATRIX.T.ravel().tolist()

    def write(name, shapes):
        path = folder / f"{name}.json"
        path.write_text(json.dumps(whole | {"cuts": [{"shape": shape} for shape in shapes]}))
        return path

    return write


def in_voxels(points):
    return np.linalg.solve(MATRIX[:, :3], (np.asarray(points, float) - MATRIX[:, 3]).reshape(-1, 3).T).T.reshape(np.shape(points))


def fans(points, counts, labels):
    """Triangles of convex polygons whose corners follow each other, and the label of each."""
    firsts = np.cumsum(counts) - counts
    places = [(f, f + i, f + i + 1) for f, count in zip(firsts, counts, strict=True) for i in range(1, count - 1)]
    return points[np.array(places)], np.repeat(labels, np.asarray(counts) - 2)


def read_usdc(path):
    stage = Usd.Stage.Open(str(path))
    assert of_stage(stage) == []
    (mesh,) = (UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    points, counts = np.array(mesh.GetPointsAttr().Get(), float), np.array(mesh.GetFaceVertexCountsAttr().Get())
    assert np.array_equal(mesh.GetFaceVertexIndicesAttr().Get(), np.arange(len(points))) and counts.sum() == len(points)
    assert np.allclose(mesh.GetExtentAttr().Get(), [points.min(axis=0), points.max(axis=0)], rtol=0, atol=0)
    primvars = UsdGeom.PrimvarsAPI(mesh)
    labels = np.array(primvars.GetPrimvar("label").Get())
    triangles, of_triangles = fans(points, counts, labels)
    normals = np.repeat(np.array(primvars.GetPrimvar("normals").ComputeFlattened()), counts - 2, axis=0)
    check_normals(triangles, normals)
    subsets = [np.array(subset.GetIndicesAttr().Get()) for subset in UsdGeom.Subset.GetAllGeomSubsets(mesh)]
    assert np.array_equal(np.sort(np.concatenate(subsets)), np.arange(len(counts))), "each face has one material"
    assert all(len(set(labels[faces])) == 1 for faces in subsets), "each label has its own"
    return triangles, of_triangles


def read_glb(path):
    assert issues([path]) == [[]]
    file = File(path)
    (volume,) = (node for node in file.nodes if node.get("name", "").startswith("volume_"))
    triangles, labels = [], []
    for primitive in file.json["meshes"][volume["mesh"]]["primitives"]:
        positions, normals, of_vertex = (file.array(primitive["attributes"][a]) for a in ("POSITION", "NORMAL", "_LABEL"))
        accessor = file.json["accessors"][primitive["attributes"]["POSITION"]]
        assert accessor["min"] == positions.min(axis=0).tolist() and accessor["max"] == positions.max(axis=0).tolist()
        corners = file.array(primitive["indices"]).reshape(-1, 3)
        assert np.array_equal(np.unique(corners), np.arange(len(positions)))
        check_normals(positions[corners].astype(float), normals[corners[:, 0]] / (127 if normals.dtype == "i1" else 1))
        assert (of_vertex[corners] == of_vertex[corners[:, :1]]).all() and len(np.unique(of_vertex)) == 1
        triangles.append(positions[corners].astype(float))
        labels.append(of_vertex[corners[:, 0], 0].astype(int))
    return np.concatenate(triangles), np.concatenate(labels)


def read_ply(path):
    header, body = path.read_bytes().split(b"end_header\n", 1)
    vertices, faces = (int(header.split(b"element %b " % name)[1].split()[0]) for name in (b"vertex", b"face"))
    record = np.dtype([("position", "<f4", 3), ("color", "u1", 3)])
    points = np.frombuffer(body, record, vertices)["position"]
    place, first, counts, labels = vertices * record.itemsize, 0, [], []
    for _ in range(faces):
        count = body[place]
        *corners, label, _ = np.frombuffer(body, "<u4", count + 2, place + 1).tolist()
        assert corners == list(range(first, first + count))
        first += count
        counts.append(count)
        labels.append(label)
        place += 1 + 4 * (count + 2)
    assert place == len(body) and first == vertices
    triangles, labels = fans(in_voxels(points), counts, np.array(labels))
    # The volume is mirrored, and faces turn right in the world.
    return triangles[:, ::-1], labels


def read_obj(path):
    points, counts, labels, group, first = [], [], [], None, 1
    for line in path.read_text().splitlines():
        word, *values = line.split()
        if word == "v":
            points.append([float(value) for value in values])
        elif word == "g":
            group = int(values[0]) - 1
        elif word == "f":
            assert [int(value) for value in values] == list(range(first, len(points) + 1))
            first = len(points) + 1
            counts.append(len(values))
            labels.append(group)
    triangles, labels = fans(in_voxels(np.array(points)), counts, np.array(labels))
    return triangles[:, ::-1], labels


def read_stl(path):
    read = trimesh.load(path, process=False)
    return in_voxels(read.triangles)[:, ::-1], None


READ = {"usdc": read_usdc, "glb": read_glb, "ply": read_ply, "obj": read_obj, "stl": read_stl}


def check_normals(triangles, normals):
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(cross, axis=1)
    # Slivers have no direction in single precision.
    sound = size > 1e-3
    assert sound.mean() > 0.9
    # Single precision of corners up to 40, by sides of a hundredth.
    assert np.abs(cross[sound] / size[sound, None] - normals[sound]).max() < 2e-3


def is_removed(points, shapes):
    world = points @ MATRIX[:, :3].T + MATRIX[:, 3]
    removed = np.zeros(len(points), bool)
    for shape in shapes:
        if plane := shape.get("plane"):
            removed |= (world - plane["point"]) @ plane["normal"] > 0
        else:
            box = np.reshape(shape["box"]["world_from_box"], (4, 3)).T
            removed |= (np.abs(np.linalg.solve(box[:, :3], (world - box[:, 3]).T)) < 1).all(axis=0)
    return removed


def paired(crossings, least):
    """Crossings without pairs that are closer than `least`, which a march may miss."""
    kept = []
    for crossing in crossings:
        if kept and crossing[0] - kept[-1][0] < least:
            kept.pop()
        else:
            kept.append(crossing)
    return kept


def differences(triangles, of_triangles, labels, shapes, lines=150):
    """Number of lines on which the faces are not where the march finds them, and of places that were compared."""
    random = np.random.default_rng(5)
    wrong = compared = 0
    a, b, c = np.moveaxis(triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    for x, y in random.random((lines, 2)) * DIMS[:2]:
        z = (np.arange(int(DIMS[2] / STEP)) + 0.5) * STEP
        points = np.stack([np.full_like(z, x), np.full_like(z, y), z], axis=1)
        there = labels[int(x), int(y), z.astype(int)].astype(int)
        there[is_removed(points, shapes)] = 0
        padded = np.concatenate([[0], there, [0]])
        steps = np.flatnonzero((padded[1:] == 0) != (padded[:-1] == 0))
        expected = [(step * STEP, padded[step + 1] != 0, max(padded[step], padded[step + 1])) for step in steps]
        sides = [(q[:, 0] - p[:, 0]) * (y - p[:, 1]) - (q[:, 1] - p[:, 1]) * (x - p[:, 0]) for p, q in ((a, b), (b, c), (c, a))]
        hit = np.flatnonzero((np.min(sides, axis=0) > 0) | (np.max(sides, axis=0) < 0))
        at = a[hit, 2] - (normal[hit, 0] * (x - a[hit, 0]) + normal[hit, 1] * (y - a[hit, 1])) / normal[hit, 2]
        found = sorted((z, normal[face, 2] < 0, face) for z, face in zip(at.tolist(), hit.tolist(), strict=True))
        found, expected = paired(found, 3 * STEP), paired(expected, 3 * STEP)
        compared += len(expected)
        is_same = len(found) == len(expected) and all(
            abs(f[0] - e[0]) < 2 * STEP and f[1] == e[1] for f, e in zip(found, expected, strict=True)
        )
        if is_same and of_triangles is not None:
            # At an edge between two labels the march may take either.
            near = [{labels[int(x), int(y), int(np.clip(z + d, 0, DIMS[2] - 1))] for d in (-3 * STEP, 3 * STEP)} for z, _, _ in found]
            is_same = all(of_triangles[f[2]] + 1 in ids for f, ids in zip(found, near, strict=True))
        wrong += not is_same
    return wrong, compared


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_file_encloses_what_cuts_leave(pumice, scene, labels, tmp_path, ending):
    out = tmp_path / f"cut.{ending}"
    assert run(pumice, "export", scene("cut", CUTS), "-o", out).code == 0
    triangles, of_triangles = READ[ending](out)
    wrong, compared = differences(triangles, of_triangles, labels, CUTS)
    assert wrong == 0 and compared > 150
    # Controls: without the cuts, and with a plane moved by a quarter of a voxel along z, other faces are found.
    moved = {"plane": OBLIQUE["plane"] | {"point": (MIDDLE + [0, 0, 5 / 4]).tolist()}}
    for others in ([], [moved, HOLE]):
        assert differences(triangles, of_triangles, labels, others)[0] >= 5


def test_a_slab_without_a_whole_face_and_a_volume_cut_away(pumice, scene, labels, tmp_path):
    plane = OBLIQUE["plane"]
    behind = {"plane": {"point": (MIDDLE - 0.05 * np.array(plane["normal"])).tolist(), "normal": [-n for n in plane["normal"]]}}
    for ending in ("usdc", "glb"):
        out = tmp_path / f"slab.{ending}"
        assert run(pumice, "export", scene("slab", [OBLIQUE, behind]), "-o", out).code == 0
        triangles, _ = READ[ending](out)
        distance = (triangles.reshape(-1, 3) @ MATRIX[:, :3].T + MATRIX[:, 3] - MIDDLE) @ plane["normal"]
        # Single precision of 40 voxels of 5.
        assert len(triangles) > 100 and -0.05 * (0.98 + 1e-3) < distance.min() and distance.max() < 1e-4
    all_gone = {"plane": {"point": [0, 0, -1e4], "normal": [0, 0, 1]}}
    for ending in ENDINGS:
        line = run(pumice, "export", scene("gone", [all_gone]), "-o", tmp_path / f"gone.{ending}").refused()
        assert "nothing of the scene's volumes is left: no label is shown, or cuts remove them all" in line
        assert not (tmp_path / f"gone.{ending}").exists()


def test_instances_lose_the_boxes_that_are_gone(pumice, scene, tmp_path):
    boxes = {}
    for name, shapes in [("whole", []), ("half", [OBLIQUE])]:
        out = tmp_path / f"{name}.usdc"
        done = run(pumice, "export", scene(name, shapes), "-o", out, "--form", "instances")
        assert ("what cuts take off the boxes of instances" in done.err) == bool(shapes)
        stage = Usd.Stage.Open(str(out))
        (instancer,) = (UsdGeom.PointInstancer(p) for p in stage.Traverse() if p.IsA(UsdGeom.PointInstancer))
        low, size = np.array(instancer.GetPositionsAttr().Get()), np.array(instancer.GetScalesAttr().Get())
        boxes[name] = {(*a, *b) for a, b in zip(low.tolist(), size.tolist(), strict=True)}
    corners = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(-1, 3)
    gone = {box for box in boxes["whole"] if is_removed(box[:3] + corners * box[3:], [OBLIQUE]).all()}
    assert gone and boxes["half"] == boxes["whole"] - gone
