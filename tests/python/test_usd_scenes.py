"""Tests stages of scenes with Pixar's own library and numpy: the example `write_scenes` of pumice-export writes generated volumes in every
form, beside their voxels, from which this file finds by itself what each form must show."""

import json
import struct
import subprocess

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade
from stage_validators import of_stage

SCENES = ["blobs", "noise"]
FORMS = ["instances", "boxes", "cells4", "voxels", "smooth"]


@pytest.fixture(scope="module")
def folder(rust_example, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes")
    subprocess.run([rust_example("write_scenes"), folder], check=True)
    return folder


def opened(folder, name, form, ending="usdc"):
    """The stage with a form chosen, and the prim of its volume."""
    stage = Usd.Stage.Open(str(folder / f"{name}.{ending}"))
    # The choice of a form stays out of the file's own layer, which other tests open too.
    stage.SetEditTarget(stage.GetSessionLayer())
    volume = stage.GetPrimAtPath("/Scene/volume_7")
    assert volume.GetVariantSet("form").GetVariantNames() == sorted(FORMS)
    assert volume.GetVariantSet("form").SetVariantSelection(form)
    return stage, volume


def voxels(folder, name):
    """Dense index + 1 of the label that is shown at each voxel, as [x, y, z]; 0 for none."""
    data = (folder / f"{name}.labels").read_bytes()
    *dims, labels = struct.unpack_from("<4I", data)
    shown = np.frombuffer(data, "<u4", labels, 16)
    ids = np.frombuffer(data, "<u4", offset=16 + 4 * labels).reshape(dims, order="F")
    return np.where(np.concatenate([[0], shown])[ids] != 0, ids, 0).astype(np.int64)


def cells(drawn):
    """As `voxels`, where a cell of 4³ voxels has the lowest label that any of its voxels has."""
    none = drawn.max() + 1
    padded = np.pad(np.where(drawn == 0, none, drawn), [(0, -n % 4) for n in drawn.shape], constant_values=none)
    x, y, z = (n // 4 for n in padded.shape)
    least = padded.reshape(x, 4, y, 4, z, 4).min(axis=(1, 3, 5))
    whole = least.repeat(4, 0).repeat(4, 1).repeat(4, 2)[tuple(slice(n) for n in drawn.shape)]
    return np.where(whole == none, 0, whole)


def boxes(drawn, stage):
    """As `voxels`, where each voxel has the lowest label of the boxes that contain it."""
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/Scene/volume_7/boxes"))
    lows, sizes = (np.array(a.Get()).astype(int) for a in (instancer.GetPositionsAttr(), instancer.GetScalesAttr()))
    labels = np.array(UsdGeom.PrimvarsAPI(instancer).GetPrimvar("label").Get())
    assert (lows % 4 == 0).all() and (sizes >= 1).all() and (sizes <= 16).all()
    none = labels.max() + 2
    least = np.full(drawn.shape, none)
    for (x, y, z), (w, h, d), label in zip(lows, sizes, labels, strict=True):
        place = (slice(x, x + w), slice(y, y + h), slice(z, z + d))
        assert (np.array(least[place].shape) == (w, h, d)).all(), "a box ends within the volume"
        least[place] = np.minimum(least[place], label + 1)
        assert (drawn[place] == label + 1).any(), "a box has a voxel of its label"
    # Every voxel is within a box of its label: then the lowest label there is at most its own.
    assert (least[drawn != 0] <= drawn[drawn != 0]).all()
    return np.where(least == none, 0, least)


def faces(drawn):
    """{(voxel, axis, side): dense index} of the sides of drawn voxels that nothing drawn lies before."""
    padded = np.pad(drawn, 1)
    found = {}
    for axis in range(3):
        for side, step in [(0, -1), (1, 1)]:
            before = np.roll(padded, -step, axis)[1:-1, 1:-1, 1:-1]
            for voxel in np.argwhere((drawn != 0) & (before == 0)):
                found[(*voxel.tolist(), axis, side)] = int(drawn[tuple(voxel)]) - 1
    return found


def faces_of(mesh):
    """The same from a mesh of rectangles."""
    points = np.array(mesh.GetPointsAttr().Get()).reshape(-1, 4, 3)
    assert (np.array(mesh.GetFaceVertexIndicesAttr().Get()) == np.arange(4 * len(points))).all()
    assert (np.array(mesh.GetFaceVertexCountsAttr().Get()) == 4).all()
    assert np.array_equal(np.array(mesh.GetExtentAttr().Get()), [points.min(axis=(0, 1)), points.max(axis=(0, 1))])
    primvars = UsdGeom.PrimvarsAPI(mesh)
    labels = np.array(primvars.GetPrimvar("label").Get())
    normals = np.array(primvars.GetPrimvar("normals").ComputeFlattened())
    cross = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 1])
    assert np.array_equal(cross / np.abs(cross).sum(axis=1, keepdims=True), normals), "corners turn as the normals say"
    found = {}
    for corners, normal, label in zip(points.astype(int), normals.astype(int), labels.tolist(), strict=True):
        axis, side = int(np.flatnonzero(normal)[0]), int(normal.sum() > 0)
        low, high = corners.min(axis=0), corners.max(axis=0)
        low[axis] -= side
        high[axis] = low[axis] + 1
        for voxel in np.ndindex(*(high - low)):
            key = (*(low + voxel).tolist(), axis, side)
            assert key not in found, "no face is covered twice"
            found[key] = label
    return found


@pytest.mark.parametrize("name", SCENES)
def test_validators_find_nothing_in_any_form(folder, name):
    for ending in ["usda", "usdc"]:
        for form in FORMS:
            stage, _ = opened(folder, name, form, ending)
            assert of_stage(stage) == [], (ending, form)
    text, crate = (Sdf.Layer.FindOrOpen(str(folder / f"{name}.{e}")).ExportToString() for e in ("usda", "usdc"))
    assert text == crate


@pytest.mark.parametrize("name", SCENES)
def test_each_form_shows_what_is_drawn_at_its_level(folder, name):
    drawn = voxels(folder, name)
    counts = {}
    # The stage lives as long as its prims are used.
    instanced, _ = opened(folder, name, "instances")
    expected = {"boxes": boxes(drawn, instanced), "cells4": cells(drawn), "voxels": drawn}
    for form, field in expected.items():
        stage, _ = opened(folder, name, form)
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Scene/volume_7/surface"))
        counts[form] = len(mesh.GetFaceVertexCountsAttr().Get())
        assert faces_of(mesh) == faces(field), form
        # Control: another level's surface is another.
        assert all(faces(field) != faces(other) for key, other in expected.items() if key != form)
    if name == "blobs":
        assert counts["boxes"] < counts["cells4"] < counts["voxels"] < 0.7 * len(faces(drawn)), counts


@pytest.mark.parametrize("form", FORMS)
def test_materials_and_colors(folder, form):
    stage, volume = opened(folder, "noise", form)
    # Of the labels 1 to 6, 2 is hidden, 1 and 5 are glass, 3 glows.
    opacity = {0: 0.0, 2: 0.25, 3: 1.0, 4: 0.0, 5: 1.0}
    seen = {}

    def bound(prim):
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        shader = material.ComputeSurfaceSource()[0]
        return shader.GetInput("opacity").Get(), tuple(shader.GetInput("emissiveColor").Get())

    if form == "instances":
        instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/Scene/volume_7/boxes"))
        prototypes = [stage.GetPrimAtPath(path) for path in instancer.GetPrototypesRel().GetTargets()]
        labels = UsdGeom.PrimvarsAPI(instancer).GetPrimvar("label").Get()
        for label, prototype in zip(labels, instancer.GetProtoIndicesAttr().Get(), strict=True):
            seen.setdefault(label, set()).add(bound(prototypes[prototype]))
    else:
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Scene/volume_7/surface"))
        labels = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("label").Get())
        subsets = UsdGeom.Subset.GetAllGeomSubsets(mesh)
        indices = [np.array(subset.GetIndicesAttr().Get()) for subset in subsets]
        assert np.array_equal(np.sort(np.concatenate(indices)), np.arange(len(labels))), "each face has one material"
        for subset, faces in zip(subsets, indices, strict=True):
            for label in set(labels[faces].tolist()):
                seen.setdefault(label, set()).add(bound(subset.GetPrim()))
    assert all({o for o, _ in found} == {opacity[label]} for label, found in seen.items())
    # Where boxes or cells coincide, labels with a higher index may have no face.
    assert len(seen) == len(opacity) if form in ("instances", "voxels", "smooth") else len(seen) >= 1
    assert all((emission == (5, 4, 3)) == (label == 2) for label, found in seen.items() for _, emission in found)
    notes = json.loads(volume.GetAttribute("userProperties:labels").Get())
    assert notes == [[i, None, None] for i in range(1, 7)]
    assert len(volume.GetAttribute("userProperties:data_hash").Get()) == 32


def test_colors_are_the_materials_and_the_place_is_the_instances(folder):
    stage, volume = opened(folder, "blobs", "voxels")
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Scene/volume_7/surface"))
    colors = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("displayColor").ComputeFlattened())
    for subset in UsdGeom.Subset.GetAllGeomSubsets(mesh):
        material, _ = UsdShade.MaterialBindingAPI(subset.GetPrim()).ComputeBoundMaterial()
        diffuse = material.ComputeSurfaceSource()[0].GetInput("diffuseColor").Get()
        assert (colors[np.array(subset.GetIndicesAttr().Get())] == np.array(diffuse)).all()
    assert len(np.unique(colors, axis=0)) > 5
    # The volume is turned by half a radian about z, mirrored in y, stretched in z, and moved.
    world = UsdGeom.Xformable(volume).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
    point = np.array(world.Transform((1.0, 2.0, 3.0)))
    x, y = 4.0, -8.0
    expected = [np.cos(0.5) * x - np.sin(0.5) * y + 1e4, np.sin(0.5) * x + np.cos(0.5) * y - 0.1, 123.0]
    assert np.allclose(point, expected, rtol=0, atol=1e-9)
