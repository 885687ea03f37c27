"""Tests glTF files of scenes with the Khronos validator and numpy: the example `write_mesh_scenes` of pumice-export writes generated volumes
in every form, beside their voxels and the scene, from which this file finds by itself what each file must show."""

import json
import struct
import subprocess

import numpy as np
import pytest
from gltf_validator import issues
from test_usd_scenes import cells, faces, voxels

FORMS = ["instances", "boxes", "cells4", "voxels", "smooth"]
FILES = [("blobs", form) for form in FORMS[:4]] + [(name, form) for name in ("part", "noise") for form in FORMS]
FILES += [("long", "cells4"), ("many", "voxels")]
ENDINGS = ["gltf", "glb"]
TYPES = {5120: "<i1", 5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
ELEMENTS = {"SCALAR": 1, "VEC3": 3}
LUMENS = 683


@pytest.fixture(scope="module")
def folder(rust_example, tmp_path_factory):
    folder = tmp_path_factory.mktemp("gltf")
    subprocess.run([rust_example("write_mesh_scenes"), folder], check=True)
    return folder


class File:
    """A glTF file, read with nothing but json and numpy."""

    def __init__(self, path):
        if path.suffix == ".glb":
            data = path.read_bytes()
            magic, version, length, json_length, kind = struct.unpack_from("<4s3I4s", data)
            assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON") and json_length % 4 == 0
            self.json = json.loads(data[20 : 20 + json_length])
            binary_length, kind = struct.unpack_from("<I4s", data, 20 + json_length)
            assert kind == b"BIN\0" and binary_length % 4 == 0
            self.binary = data[28 + json_length :]
            assert len(self.binary) == binary_length
        else:
            self.json = json.loads(path.read_text())
            (beside,) = path.parent.glob(f"{path.stem}.*.bin")
            self.binary = beside.read_bytes()
            assert self.json["buffers"][0]["uri"] == beside.name
        assert self.json["buffers"][0]["byteLength"] == len(self.binary)
        self.nodes = self.json["nodes"]

    def array(self, accessor):
        """The elements of an accessor, as rows."""
        accessor = self.json["accessors"][accessor]
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind, elements = np.dtype(TYPES[accessor["componentType"]]), ELEMENTS[accessor["type"]]
        stride = view.get("byteStride", kind.itemsize * elements)
        start = view["byteOffset"] + accessor.get("byteOffset", 0)
        assert start + stride * (accessor["count"] - 1) + kind.itemsize * elements <= view["byteOffset"] + view["byteLength"]
        return np.ndarray((accessor["count"], elements), kind, self.binary, start, (stride, kind.itemsize))

    def named(self, name):
        (number,) = (n for n, node in enumerate(self.nodes) if node.get("name") == name)
        return number

    def world(self, number):
        """The matrix of a node in the scene's own frame, in which z is up."""
        matrix = self.local(number)
        (parent,) = (n for n, node in enumerate(self.nodes) if number in node.get("children", []))
        return matrix if self.nodes[parent].get("name") == "scene" else self.world(parent) @ matrix

    def local(self, number):
        node = self.nodes[number]
        if "matrix" in node:
            return np.array(node["matrix"]).reshape(4, 4).T
        matrix = np.eye(4)
        matrix[:3, 3] = node.get("translation", [0, 0, 0])
        x, y, z, w = node.get("rotation", [0, 0, 0, 1])
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        return matrix

    def below(self, number):
        """A node and those below it."""
        return [number] + [n for child in self.nodes[number].get("children", []) for n in self.below(child)]


def faces_of(file):
    """{(voxel, axis, side): dense index} of the faces of the volume's rectangles, and the labels of each material."""
    found, materials = {}, {}
    volume = file.named("volume_7")
    for number in (n for n in file.below(volume) if "mesh" in file.nodes[n]):
        node = file.nodes[number]
        # The place of a part of a large volume, in voxels.
        low_of_part = np.array(node.get("translation", [0, 0, 0])).astype(int)
        for primitive in file.json["meshes"][node["mesh"]]["primitives"]:
            positions, normals, labels = (file.array(primitive["attributes"][a]) for a in ("POSITION", "NORMAL", "_LABEL"))
            accessor = file.json["accessors"][primitive["attributes"]["POSITION"]]
            assert accessor["min"] == positions.min(axis=0).tolist() and accessor["max"] == positions.max(axis=0).tolist()
            indices = file.array(primitive["indices"]).reshape(-1, 6)
            assert np.array_equal(indices, 4 * np.arange(len(positions) // 4)[:, None] + [0, 1, 2, 0, 2, 3])
            corners = positions.astype(int).reshape(-1, 4, 3) + low_of_part
            for name, of_corners in [("normals", normals), ("labels", labels)]:
                assert (of_corners.reshape(len(corners), 4, -1) == of_corners[::4, None]).all(), f"{name} are of rectangles"
            normals, labels = normals[::4].astype(int), labels[::4, 0]
            cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1])
            assert np.array_equal(127 * cross // np.abs(cross).sum(axis=1, keepdims=True), normals), "corners turn outward"
            # Four corners are a rectangle: its diagonals have one middle.
            assert np.array_equal(corners[:, 0] + corners[:, 2], corners[:, 1] + corners[:, 3])
            assert (labels == labels.astype(int)).all()
            materials.setdefault(primitive["material"], set()).update(labels.astype(int).tolist())
            for rectangle, normal, label in zip(corners, normals, labels.astype(int).tolist(), strict=True):
                axis, side = int(np.flatnonzero(normal)[0]), int(normal.sum() > 0)
                low, high = rectangle.min(axis=0), rectangle.max(axis=0)
                low[axis] -= side
                high[axis] = low[axis] + 1
                for voxel in np.ndindex(*(high - low)):
                    key = (*(low + voxel).tolist(), axis, side)
                    assert key not in found, "no face is covered twice"
                    found[key] = label
    return found, materials


def boxes_of(file):
    """Lowest corner, size and label of each instance of a cube."""
    rows = []
    for number in file.below(file.named("volume_7")):
        instancing = file.nodes[number].get("extensions", {}).get("EXT_mesh_gpu_instancing")
        if instancing:
            rows.append(np.hstack([file.array(instancing["attributes"][a]) for a in ("TRANSLATION", "SCALE", "_LABEL")]))
            (primitive,) = file.json["meshes"][file.nodes[number]["mesh"]]["primitives"]
            cube = file.array(primitive["attributes"]["POSITION"])
            assert cube.min() == 0 and cube.max() == 1 and len(np.unique(cube, axis=0)) == 8
    rows = np.vstack(rows)
    assert (rows == rows.astype(int)).all()
    return rows[:, :3].astype(int), rows[:, 3:6].astype(int), rows[:, 6].astype(int)


def boxes(drawn, file):
    """As `voxels`, where each voxel has the lowest label of the boxes that contain it."""
    none = drawn.max() + 1
    least = np.full(drawn.shape, none)
    for low, size, label in zip(*boxes_of(file), strict=True):
        place = tuple(slice(a, a + n) for a, n in zip(low, size, strict=True))
        assert (np.array(least[place].shape) == size).all() and (drawn[place] == label + 1).any()
        least[place] = np.minimum(least[place], label + 1)
    assert (least[drawn != 0] <= drawn[drawn != 0]).all(), "every voxel is within a box of its label"
    return np.where(least == none, 0, least)


def test_the_validator_finds_nothing(folder):
    files = [folder / f"{name}.{form}.{ending}" for name, form in FILES for ending in ENDINGS]
    for file, found in zip(files, issues(files), strict=True):
        if ".instances." in file.name:
            # It does not know this extension, and takes what only the extension refers to for unused.
            extension = File(file).json["extensionsUsed"].index("EXT_mesh_gpu_instancing")
            assert [2, "UNSUPPORTED_EXTENSION", f"/extensionsUsed/{extension}"] in found
            found = [(c, p) for _, c, p in found if c != "UNSUPPORTED_EXTENSION" and not (c == "UNUSED_OBJECT" and p.startswith("/accessors/"))]
        assert found == [], file.name


def test_the_validator_convicts_broken_files(folder, tmp_path):
    """Control: each fault is found."""
    whole = (folder / "noise.voxels.gltf").read_text()
    good = File(folder / "noise.voxels.gltf")
    binary = good.binary
    indices = good.json["accessors"][good.json["meshes"][0]["primitives"][0]["indices"]]
    index = good.json["bufferViews"][indices["bufferView"]]["byteOffset"]

    def broken(name, change=lambda _: None, data=binary):
        described = json.loads(whole)
        change(described)
        described["buffers"][0]["uri"] = f"{name}.bin"
        (tmp_path / f"{name}.gltf").write_text(json.dumps(described))
        (tmp_path / f"{name}.bin").write_bytes(data)
        return tmp_path / f"{name}.gltf"

    def set_in(*path, to):
        def change(described):
            for key in path[:-1]:
                described = described[key]
            described[path[-1]] = to

        return change

    far = binary[:index] + b"\xff\xff\0\0" + binary[index + 4 :]
    expected = {
        broken("bounds", set_in("accessors", 1, "max", to=[1, 1, 1])): "ACCESSOR_MAX_MISMATCH",
        broken("index", data=far): "ACCESSOR_INDEX_OOB",
        broken("quantization", set_in("extensionsUsed", to=["KHR_lights_punctual"])): "UNDECLARED_EXTENSION",
        broken("shear", set_in("nodes", 1, "matrix", 4, to=7.0)): "NODE_MATRIX_NON_TRS",
        broken("color", set_in("materials", 0, "pbrMetallicRoughness", "baseColorFactor", to=[2, 0, 0, 1])): "VALUE_NOT_IN_RANGE",
        broken("short", data=binary[:-4]): "BUFFER_BYTE_LENGTH_MISMATCH",
    }
    for (file, code), found in zip(expected.items(), issues(expected), strict=True):
        assert any(c == code for severity, c, _ in found if severity < 2), (file.name, found[:3])


@pytest.mark.parametrize("name", ["blobs", "noise", "long", "many"])
def test_each_form_shows_what_is_drawn_at_its_level(folder, name, ending="glb"):
    drawn = voxels(folder, name)
    expected = {"cells4": cells(drawn)} if name == "long" else {"voxels": drawn}
    if name in ("blobs", "noise"):
        expected |= {"cells4": cells(drawn), "boxes": boxes(drawn, File(folder / f"{name}.instances.{ending}"))}
    fields = {form: faces(field) for form, field in expected.items()}
    for form, field in fields.items():
        file = File(folder / f"{name}.{form}.{ending}")
        found, _ = faces_of(file)
        assert found == field, form
        assert set(file.json["extensionsRequired"]) == {"KHR_mesh_quantization"}
        # Control: another level's surface is another.
        assert all(found != other for key, other in fields.items() if key != form)
    if name == "long":
        assert drawn.shape[0] > 65_535 and len(file.nodes[file.named("volume_7")]["children"]) == 2, "in three meshes"
    labels = file.nodes[file.named("volume_7")]["extras"]["labels"]
    assert labels == [[str(i), None, None] for i in range(1, len(labels) + 1)] and len(labels) >= drawn.max()


def test_both_endings_say_the_same(folder):
    for name, form in FILES:
        text, binary = (File(folder / f"{name}.{form}.{ending}") for ending in ENDINGS)
        del text.json["buffers"][0]["uri"]
        assert text.json == binary.json and text.binary == binary.binary


@pytest.mark.parametrize("name", ["blobs", "noise"])
def test_places_are_those_of_the_scene(folder, name):
    file, scene = File(folder / f"{name}.voxels.glb"), json.loads((folder / f"{name}.json").read_text())
    (root,) = file.json["scenes"][file.json["scene"]]["nodes"]
    # z up becomes y up.
    assert np.allclose(file.local(root)[:3, :3], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], rtol=0, atol=1e-7)
    assert sorted(file.nodes[root]["children"]) == [n for n in range(len(file.nodes)) if "name" in file.nodes[n] and n != root]

    def is_placed(node, matrix, what):
        below = next(n for n in reversed(file.below(file.named(node))) if what in file.nodes[n])
        expected = np.array(matrix).reshape(4, 3).T
        # Single precision: half of 2⁻²³ for each of a few numbers that are multiplied.
        assert np.allclose(file.world(below)[:3], expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max()), node

    is_placed("volume_7", scene["instances"][0]["world_from_index"], "mesh")
    is_placed("camera", scene["camera"]["world_from_camera"], "camera")
    for mesh in scene["meshes"]:
        if not mesh.get("shadow_catcher"):
            is_placed(f"mesh_{mesh['id']}", mesh["world_from_mesh"], "mesh")
    assert sum("mesh" in node for node in file.nodes) == 1 + sum(not m.get("shadow_catcher") for m in scene["meshes"])


def test_cameras(folder):
    (camera,) = File(folder / "blobs.voxels.glb").json["cameras"]
    # 0.7 radians span the longer side, the width, of 64 × 48 pixels.
    perspective = camera["perspective"]
    assert np.isclose(np.tan(perspective["yfov"] / 2), np.tan(0.35) * 48 / 64, rtol=1e-6) and "zfar" not in perspective
    assert np.isclose(perspective["aspectRatio"], 64 / 48, rtol=1e-6) and 0 < perspective["znear"] < 100
    (camera,) = File(folder / "noise.voxels.glb").json["cameras"]
    assert camera["orthographic"] == {"xmag": 20, "ymag": 15, "znear": 0.5, "zfar": 500}


def test_lights(folder):
    file = File(folder / "noise.voxels.glb")
    lights = file.json["extensions"]["KHR_lights_punctual"]["lights"]
    assert [light["type"] for light in lights] == ["directional", "point", "spot", "spot"], "the area light has no word"
    watts = [3, 100 / (4 * np.pi), 2 * 50 / (4 * np.pi), 20 / (4 * np.pi)]
    assert np.allclose([light["intensity"] for light in lights], np.multiply(watts, LUMENS), rtol=1e-6)
    assert np.allclose(lights[2]["color"], [1, 0.5, 0.25]) and np.allclose(lights[0]["color"], [1, 0.9, 0.5])
    assert np.allclose([lights[2]["spot"][f"{c}ConeAngle"] for c in ("inner", "outer")], [0.3, 0.4], rtol=1e-6)
    assert np.allclose(lights[3]["spot"]["outerConeAngle"], np.pi / 2, rtol=1e-6)
    for node, direction, position in [("sun_0", [1, 2, -2], None), ("lamp_1", [0, 1, -3], [3, -2, 50])]:
        matrix = file.world(file.named(node))
        assert np.allclose(-matrix[:3, 2], np.array(direction) / np.linalg.norm(direction), atol=1e-6)
        assert position is None or np.allclose(matrix[:3, 3], position, rtol=1e-6)


def test_materials(folder):
    file = File(folder / "noise.voxels.glb")
    _, materials = faces_of(file)
    by_label = {label: file.json["materials"][material] for material, labels in materials.items() for label in labels}
    # Of the labels 1 to 6, 2 is hidden, 1 and 5 are glass, 3 glows, 4 is a metal, 6 has the common material.
    assert sorted(by_label) == [0, 2, 3, 4, 5] and by_label[0] is by_label[4]
    glass, glow, metal, common = by_label[0], by_label[2], by_label[3], by_label[5]

    def close(got, expected):
        return np.allclose(got, expected, rtol=1e-6)

    assert glass["alphaMode"] == metal["alphaMode"] == "OPAQUE" and glow["alphaMode"] == "BLEND"
    assert close(glow["pbrMetallicRoughness"]["baseColorFactor"], [0.8, 0.8, 0.8, 0.25])
    assert close(glass["pbrMetallicRoughness"]["roughnessFactor"], 0.1) and metal["pbrMetallicRoughness"]["metallicFactor"] == 1
    extensions = glass["extensions"]
    assert extensions["KHR_materials_transmission"] == {"transmissionFactor": 1} and close(extensions["KHR_materials_ior"]["ior"], 1.33)
    # Blender's specular level 0.8 is 1.6 times that of the index of refraction.
    specular = extensions["KHR_materials_specular"]
    assert specular["specularFactor"] == 1 and close(specular["specularColorFactor"], 1.6)
    extensions = glow["extensions"]
    strength = extensions["KHR_materials_emissive_strength"]["emissiveStrength"]
    assert close(np.multiply(glow["emissiveFactor"], strength), [5, 4, 3]) and max(glow["emissiveFactor"]) == 1
    assert close([*extensions["KHR_materials_clearcoat"].values()], [0.5, 0.2])
    sheen = extensions["KHR_materials_sheen"]
    assert close(sheen["sheenColorFactor"], [0.75, 0.375, 0.15]) and close(sheen["sheenRoughnessFactor"], 0.4)
    specular = metal["extensions"]["KHR_materials_specular"]
    assert specular["specularFactor"] == 0.5 and close(specular["specularColorFactor"], [0.2, 0.4, 0.6])
    # Blender's default material needs no extension.
    assert "extensions" not in common
    used = {name for material in file.json["materials"] for name in material.get("extensions", {})}
    assert set(file.json["extensionsUsed"]) == used | {"KHR_lights_punctual", "KHR_mesh_quantization"}


def test_meshes_of_the_scene(folder):
    file = File(folder / "noise.voxels.glb")
    corners = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1.5]])
    # The triangle that names a corner twice is not written; a material past the end is the last.
    expected = {0: [[0, 1, 4], [2, 3, 4], [0, 3, 2]], 1: [[1, 2, 4], [3, 0, 4], [0, 2, 1]]}
    for name, is_smooth in [("mesh_1", False), ("mesh_2", True)]:
        node = next(n for n in file.below(file.named(name)) if "mesh" in file.nodes[n])
        primitives = file.json["meshes"][file.nodes[node]["mesh"]]["primitives"]
        for material, primitive in enumerate(primitives):
            positions = file.array(primitive["attributes"]["POSITION"])[file.array(primitive["indices"]).reshape(-1, 3)]
            assert np.array_equal(positions, corners[expected[material]])
            assert ("NORMAL" in primitive["attributes"]) == is_smooth
            if is_smooth:
                normals = file.array(primitive["attributes"]["NORMAL"])[file.array(primitive["indices"]).reshape(-1, 3)]
                given = np.array([[1, 0, 0.3], [0, 1, 0.3], [-1, 0, 0.3], [0, -1, 0.3], [0, 0, 1]])[expected[material]]
                given /= np.linalg.norm(given, axis=2, keepdims=True)
                # Normals are kept in 32 bits, to 7·10⁻⁵ rad.
                assert np.abs(normals - given).max() < 1e-4
        red = file.json["materials"][primitives[1]["material"]]["pbrMetallicRoughness"]["baseColorFactor"]
        assert np.allclose(red, [0.9, 0.1, 0.05, 1], rtol=1e-6)
