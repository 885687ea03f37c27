"""Tests what stands around volumes in a stage: camera, world, suns, lamps, meshes, and the package that holds their picture. The example
`write_scenes` of pumice-export writes three scenes in Pumice's own form and as stages. This file reads the stages with Pixar's library,
applies the formulas of UsdGeom's and UsdLux's schemas to what they say, and compares with what the documentation of Pumice's scenes says
of the same numbers."""

import json
import math
import struct
import subprocess
import zipfile

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade
from stage_validators import of_stage

SCENES = ["everything", "wide", "parallel"]


@pytest.fixture(scope="module")
def folder(rust_example, tmp_path_factory):
    folder = tmp_path_factory.mktemp("surrounded")
    subprocess.run([rust_example("write_scenes"), folder], check=True)
    return folder


def scene_of(folder, name):
    return json.loads((folder / f"{name}.json").read_text())


def stage_of(folder, name, ending="usdc"):
    return Usd.Stage.Open(str(folder / f"{name}.{ending}"))


def world_from(prim):
    """The matrix of a prim, to be multiplied with columns."""
    return np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default())).T


def is_perpendicular(rows):
    """Whether the rows of a matrix (3, 3) are at right angles to each other."""
    rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    return np.allclose(rows @ rows.T, np.eye(3), rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", SCENES)
def test_validators_find_nothing_and_all_forms_say_the_same(folder, name):
    for file in [f"{name}.usda", f"{name}.usdc", f"{name}.usdz", f"{name}_for_blender.usdc"]:
        assert of_stage(Usd.Stage.Open(str(folder / file))) == [], file
    text, crate, packed = (Sdf.Layer.FindOrOpen(str(folder / f"{name}.{e}")).ExportToString() for e in ("usda", "usdc", "usdz"))
    assert text == crate
    assert packed.replace("@./sky.exr@", r"@@@./a sky @home \@@@.exr@@@") == text
    assert "for Blender 4.2 to 5.0: suns have a quarter" in stage_of(folder, f"{name}_for_blender").GetMetadata("documentation")
    # Folders of whoever wrote the file stay unknown.
    assert "somewhere" not in text and str(folder) not in text and "generated.nrrd" in text


def window(scene):
    """Where the borders of the picture are: left, bottom, right, top, at distance 1 (perspective) or in world units."""
    camera, film = scene["camera"], scene["film"]
    width, height = film["width"] * film["pixel_aspect"], film["height"]
    fitted = {"auto": max(width, height), "horizontal": width, "vertical": height}[camera["fit"]]
    projection = camera["projection"]
    whole = 2 * math.tan(projection["perspective"]["fov_rad"] / 2) if "perspective" in projection else projection["orthographic"]["scale"]
    half = np.array([width, height]) / fitted / 2
    return whole * np.concatenate([camera["shift"] - half, camera["shift"] + half])


@pytest.mark.parametrize("name", SCENES)
def test_the_camera_shows_the_same_part_of_the_world(folder, name):
    scene, stage = scene_of(folder, name), stage_of(folder, name)
    prim = UsdGeom.Camera(stage.GetPrimAtPath("/Scene/camera"))
    camera = prim.GetCamera(Usd.TimeCode.Default())
    found = camera.frustum.GetWindow()
    found = np.array([*found.GetMin(), *found.GetMax()])
    # Apertures are single precision.
    assert np.allclose(found, window(scene), rtol=1e-6, atol=1e-7)
    # Control: a picture that is fitted otherwise, or whose pixels are square, has other borders.
    other = json.loads(json.dumps(scene))
    other["camera"]["fit"] = "horizontal" if name != "everything" else "vertical"
    assert not np.allclose(found, window(other), rtol=1e-2)
    pose = np.array(scene["camera"]["world_from_camera"]).reshape(4, 3)
    matrix = world_from(prim)
    assert np.allclose(matrix[:3, :3].T, pose[:3] / np.linalg.norm(pose[:3], axis=1, keepdims=True), rtol=0, atol=1e-12)
    assert np.array_equal(matrix[:3, 3], pose[3])
    # The opening: the diameter is the focal length over the f-stop, in units.
    opening = scene["camera"]["aperture"]
    if opening is None:
        assert camera.fStop == 0 and not prim.GetFStopAttr().HasAuthoredValue()
    else:
        assert camera.focalLength * Gf.Camera.FOCAL_LENGTH_UNIT / camera.fStop == pytest.approx(2 * opening["radius"], rel=1e-6)
        assert camera.focusDistance == opening["focus_distance"]
        notes = [prim.GetPrim().GetAttribute(f"userProperties:aperture_{key}").Get() for key in ("blades", "rotation_deg", "ratio")]
        assert notes == [opening["blades"], pytest.approx(math.degrees(opening["rotation_rad"])), opening["ratio"]]
    near, far = camera.clippingRange.min, camera.clippingRange.max
    if name == "wide":
        assert [near, far] == scene["camera"]["clip"]
    else:
        # No clip range: all that is in the scene lies within.
        cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
        boxes = [cache.ComputeWorldBound(p).ComputeAlignedRange() for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)]
        corners = np.array([box.GetCorner(i) for box in boxes for i in range(8)])
        depths = (corners - matrix[:3, 3]) @ -matrix[:3, 2]
        assert 0 < near < depths.min() and depths.max() < far < 10 * depths.max()


def radiance(prim):
    """Radiance of a light by the formulas of UsdLux (`LightAPI`: intensity, exposure, normalize, color)."""
    light, matrix = UsdLux.LightAPI(prim), world_from(prim)
    across = np.linalg.norm(np.cross(matrix[:3, 0], matrix[:3, 1]))

    def value(name):
        return prim.GetAttribute(f"inputs:{name}").Get()

    if prim.IsA(UsdLux.SphereLight):
        size = 4 * math.pi * value("radius") ** 2
    elif prim.IsA(UsdLux.RectLight):
        size = value("width") * value("height") * across
    elif prim.IsA(UsdLux.DiskLight):
        size = math.pi * value("radius") ** 2 * across
    else:
        widest = math.radians(value("angle")) / 2
        size = math.pi * math.sin(widest) ** 2 if widest > 0 else 1.0
    scalar = light.GetIntensityAttr().Get() * 2.0 ** light.GetExposureAttr().Get()
    scalar /= size if light.GetNormalizeAttr().Get() else 1.0
    return scalar * np.array(light.GetColorAttr().Get())


def shines_along(prim):
    return -world_from(prim)[:3, 2]


def unit(vector):
    return np.array(vector) / np.linalg.norm(vector)


# Intensity, colour, angles and sizes are single precision: four roundings of 6e-8 each.
CLOSE = {"rtol": 1e-6, "atol": 0.0}


@pytest.mark.parametrize("name", ["everything", "everything_for_blender"])
def test_suns_have_their_irradiance(folder, name):
    stage, suns = stage_of(folder, name), scene_of(folder, "everything")["suns"]
    assert len(suns) == 2
    for number, sun in enumerate(suns):
        prim = stage.GetPrimAtPath(f"/Scene/sun_{number}")
        angle = math.radians(prim.GetAttribute("inputs:angle").Get())
        irradiance = radiance(prim) * (math.pi * math.sin(angle / 2) ** 2 if angle > 0 else 1.0)
        assert np.allclose(shines_along(prim), unit(sun["direction"]), rtol=0, atol=1e-12)
        # For Blender, whose importer multiplies both, the file is wrong by what the documentation says: the control.
        strength, width = (4, 2) if name.endswith("blender") else (1, 1)
        assert np.allclose(strength * irradiance, sun["strength"] * np.array(sun["color"]), **CLOSE)
        assert width * angle == pytest.approx(sun["angle_rad"], rel=1e-6)


def test_lamps_have_their_power_and_size(folder):
    stage, lamps = stage_of(folder, "everything"), scene_of(folder, "everything")["lights"]
    seen = []
    for number, lamp in enumerate(lamps):
        prim = stage.GetPrimAtPath(f"/Scene/lamp_{number}")
        ((kind, shape),) = lamp["shape"].items()
        power = lamp["power_w"] * np.array(lamp["color"])
        seen.append(kind)
        if kind in ("point", "spot"):
            # A ball looks like a disk of its radius: its intensity, in W/sr, is that of power in all directions.
            radius = prim.GetAttribute("inputs:radius").Get()
            assert np.allclose(radiance(prim) * math.pi * radius**2, power / (4 * math.pi), **CLOSE)
            assert np.array_equal(world_from(prim)[:3, 3], shape["position"])
            is_point = prim.GetAttribute("treatAsPoint").Get()
            assert is_point == (shape["radius"] == 0) and (radius < 1e-3 if is_point else radius == np.float32(shape["radius"]))
            assert prim.GetAttribute("userProperties:soft_falloff").Get() == shape["soft_falloff"]
        else:
            # A flat lamp emits its power, evenly over its area and over the cosine.
            axes = np.array(shape["world_from_light"]).reshape(4, 3)
            width, height = (np.linalg.norm(axes[a]) * shape["size"][a] for a in (0, 1))
            area = width * height * (1 if shape["outline"] == "rectangle" else math.pi / 4)
            assert np.allclose(radiance(prim) * math.pi * area, power, **CLOSE)
            matrix = world_from(prim)
            if prim.IsA(UsdLux.RectLight):
                sides = [prim.GetAttribute(f"inputs:{side}").Get() for side in ("width", "height")]
            else:
                sides = [2 * prim.GetAttribute("inputs:radius").Get()] * 2
            ends = matrix[:3, :2] * sides
            assert np.allclose(ends.T, axes[:2] * np.array(shape["size"])[:, None], rtol=1e-6, atol=1e-12)
            assert np.allclose(shines_along(prim), unit(-axes[2]), rtol=0, atol=1e-12)
            assert prim.GetAttribute("userProperties:spread_deg").Get() == pytest.approx(math.degrees(shape["spread_rad"]))
        assert prim.GetAttribute("userProperties:visible_to_camera").Get() == lamp["visible_to_camera"]
    assert seen == ["point", "point", "spot", "spot", "area", "area"]


def smooth(t):
    t = np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)


def test_spots_fade_where_ours_do(folder):
    lamps = scene_of(folder, "everything")["lights"]
    for name in ["everything", "everything_for_blender"]:
        stage = stage_of(folder, name)
        for number in (2, 3):
            prim, shape = stage.GetPrimAtPath(f"/Scene/lamp_{number}"), lamps[number]["shape"]["spot"]
            assert np.allclose(shines_along(prim), unit(shape["direction"]), rtol=0, atol=1e-12)
            shaping = UsdLux.ShapingAPI(prim)
            cutoff = math.radians(shaping.GetShapingConeAngleAttr().Get())
            softness = shaping.GetShapingConeSoftnessAttr().Get()
            assert cutoff == pytest.approx(shape["angle_rad"] / 2, rel=1e-6)
            angles = np.linspace(0, cutoff, 1001)
            theirs = 1 - smooth((angles - (1 - softness) * cutoff) / (softness * cutoff))
            edge = math.cos(cutoff)
            ours = smooth((np.cos(angles) - edge) / ((1 - edge) * shape["blend"]))
            apart = np.abs(ours - theirs).max()
            if name == "everything":
                # What the curves differ by where both begin and end at the same angles: documented.
                assert apart < {0.15: 0.02, 0.5: 0.07}[round(shape["blend"], 5)]
            else:
                # Control: with Blender's blend as the softness they are far apart.
                assert apart > 0.3 and softness == np.float32(shape["blend"])


def test_the_world_is_the_same_in_every_direction(folder):
    # Stages live as long as their prims are used.
    stage = stage_of(folder, "everything")
    prim = stage.GetPrimAtPath("/Scene/world")
    world = scene_of(folder, "everything")["world"]["environment"]["image"]
    dome = UsdLux.DomeLight(prim)
    assert dome.GetIntensityAttr().Get() == world["strength"] and dome.GetTextureFormatAttr().Get() == "latlong"
    directions = np.random.default_rng(3).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)

    def place(matrix):
        """Where a latitude-longitude map of OpenEXR has these directions, as parts of its width and height."""
        x, y, z = (directions @ matrix[:3, :3]).T
        return (0.5 - np.arctan2(x, z) / (2 * np.pi)) % 1, np.arccos(y) / np.pi

    # Ours: the middle is seen along +x, the left quarter along +y, the first row along +z, turned about +z.
    azimuth = np.arctan2(directions[:, 1], directions[:, 0]) - world["rotation_rad"]
    expected = (0.5 - azimuth / (2 * np.pi)) % 1, np.arccos(directions[:, 2]) / np.pi
    assert np.allclose(place(world_from(prim)), expected, rtol=0, atol=1e-12)
    # Control: without the dome's matrix the pole is elsewhere.
    assert not np.allclose(place(np.eye(4)), expected, rtol=0, atol=0.1)
    for ending in ("usda", "usdc", "usdz"):
        stage = stage_of(folder, "everything", ending)
        assert stage.GetPrimAtPath("/Scene/world").GetAttribute("inputs:texture:file").Get().resolvedPath, ending

    stage = stage_of(folder, "wide")
    prim = stage.GetPrimAtPath("/Scene/world")
    light = UsdLux.LightAPI(prim)
    color = light.GetIntensityAttr().Get() * np.array(light.GetColorAttr().Get())
    assert np.allclose(color, scene_of(folder, "wide")["world"]["environment"]["constant"]["radiance"], **CLOSE)
    assert json.loads(prim.GetAttribute("userProperties:backdrop").Get()) == scene_of(folder, "wide")["world"]["backdrop"]
    stage = stage_of(folder, "parallel")
    dark = UsdLux.LightAPI(stage.GetPrimAtPath("/Scene/world"))
    assert dark.GetIntensityAttr().Get() == 0


def test_meshes_stand_where_they_do_with_their_normals_and_materials(folder):
    stage = stage_of(folder, "everything")
    placed = {mesh["id"]: mesh for mesh in scene_of(folder, "everything")["meshes"]}
    assert not stage.GetPrimAtPath("/Scene/mesh_1"), "a mesh without triangles"

    # Its matrix shears, so a part of it is the Xform's.
    floor = UsdGeom.Mesh(stage.GetPrimAtPath("/Scene/mesh_3/mesh"))
    matrix = np.array(placed[3]["world_from_mesh"]).reshape(4, 3)
    corners = np.array(floor.GetPointsAttr().Get())
    assert np.array_equal(corners, [[0, 0, 0], [4, 0, 0], [4, 3, 1], [0, 3, 1]])
    homogeneous = np.column_stack([corners, np.ones(4)])
    assert np.allclose(homogeneous @ world_from(floor)[:3].T, homogeneous @ matrix, rtol=0, atol=1e-12)
    for prim in stage.Traverse():
        if UsdGeom.Xformable(prim):
            own = np.array(UsdGeom.Xformable(prim).GetLocalTransformation())[:3, :3]
            assert is_perpendicular(own), f"{prim.GetPath()}: location, rotation and scale say all of it"
    assert not is_perpendicular(matrix[:3]), "the control"
    assert np.array_equal(floor.GetFaceVertexIndicesAttr().Get(), [0, 1, 2, 0, 2, 3])
    flat = UsdGeom.PrimvarsAPI(floor).GetPrimvar("normals")
    assert flat.GetInterpolation() == "uniform" and floor.GetDoubleSidedAttr().Get()
    # Single precision.
    assert np.allclose(flat.ComputeFlattened(), [unit([0, -1, 3])] * 2, rtol=0, atol=1e-7)
    bound = {}
    for subset in UsdGeom.Subset.GetAllGeomSubsets(floor):
        material, _ = UsdShade.MaterialBindingAPI(subset.GetPrim()).ComputeBoundMaterial()
        shader = material.ComputeSurfaceSource()[0]
        for face in subset.GetIndicesAttr().Get():
            bound[face] = (tuple(shader.GetInput("diffuseColor").Get()), shader.GetInput("metallic").Get())
    # The second triangle's material index, 9, is past the end: it has the last material.
    first, last = placed[3]["materials"]
    expected = [(tuple(np.float32(m["base_color"]).tolist()), m["metallic"]) for m in (first, last)]
    assert [bound[0], bound[1]] == expected

    ball = UsdGeom.Mesh(stage.GetPrimAtPath("/Scene/mesh_8"))
    normals = UsdGeom.PrimvarsAPI(ball).GetPrimvar("normals")
    assert normals.GetInterpolation() == "faceVarying" and len(normals.Get()) == 7, "each once"
    found = np.array(normals.ComputeFlattened()).reshape(8, 3, 3)
    corners = np.array(ball.GetPointsAttr().Get())[np.array(ball.GetFaceVertexIndicesAttr().Get())].reshape(8, 3, 3)
    # All but the first triangle are smooth: normals of corners, whose directions the encoding keeps to 7e-5.
    assert np.allclose(found[1:], corners[1:], rtol=0, atol=7e-5)
    assert np.allclose(found[0], unit([1, 1, 1]), rtol=0, atol=1e-7)
    notes = [mesh.GetPrim().GetAttribute("userProperties:shadow_catcher").Get() for mesh in (floor, ball)]
    assert notes == [False, True]
    assert ball.GetPrim().GetAttribute("userProperties:source").Get() == "mesh 8.ply"


def test_packages_are_plain_and_aligned(folder):
    file = folder / "everything.usdz"
    data = file.read_bytes()
    with zipfile.ZipFile(file) as package:
        assert package.testzip() is None
        assert [entry.filename for entry in package.infolist()] == ["stage.usdc", "sky.exr"]
        for entry in package.infolist():
            assert entry.compress_type == zipfile.ZIP_STORED and entry.flag_bits & 1 == 0
            # The local header: 30 bytes, the name, what fills up to the alignment.
            assert data[entry.header_offset : entry.header_offset + 4] == b"PK\x03\x04"
            name, extra = struct.unpack_from("<2H", data, entry.header_offset + 26)
            start = entry.header_offset + 30 + name + extra
            assert start % 64 == 0
            assert data[start : start + entry.file_size] == package.read(entry)
        assert package.read("sky.exr") == (folder / "a sky @home @@@.exr").read_bytes()
    assert b"PK\x06\x06" not in data[-200:], "no ZIP64"
    with zipfile.ZipFile(folder / "wide.usdz") as package:
        assert [entry.filename for entry in package.infolist()] == ["stage.usdc"]
