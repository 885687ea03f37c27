"""Exported stages before three validators: Pixar's of today and of 2024, and NVIDIA's. Of all forms, in text, crate and package;
with cuts, a camera, lights, a world, meshes, and several materials."""

import json
import shutil
import zipfile

import numpy as np
import pytest
import stage_validators
from command import run

pytestmark = pytest.mark.full

VALIDATORS = [stage_validators.newest, stage_validators.of_2024, stage_validators.nvidia]
ALL = "instances,boxes,cells4,voxels,smooth"
SURFACES = {"boxes", "cells4", "voxels"}
# What NVIDIA's validator remarks of files that are as they are meant to be, by its rule: in which forms or kinds of file it may, and why.
REMARKS = {
    # Rectangles share no points: where they are merged, corners of one lie within the edges of others, so that shared points would not
    # close the surface. On a smoothed surface each label has its own points, for it to be closed without the others.
    "WeldChecker": SURFACES | {"smooth"},
    # The normals of a smoothed surface are indexed, one for each point and kind of face. Two that are equal (where it is flat) are there
    # twice (2 and 12 % in two real volumes): to find them takes a table as large as all normals.
    "IndexedPrimvarChecker": {"smooth"},
    # Voxels of one label that touch along an edge, or at a corner, have the points there in common; the volume is like that.
    "ManifoldChecker": {"smooth"},
    # Wrong: it looks for the ending "exr" in a list that has ".exr". The specification of packages allows OpenEXR.
    "TextureChecker": {"usdz"},
}


@pytest.fixture(scope="module")
def files(pumice, data, exported_scenes, tmp_path_factory):
    """Every stage of the examples; a volume with a glass label, a sun and a camera, whole and cut, in each form; a real volume."""
    folder = tmp_path_factory.mktemp("validated")
    at = np.stack(np.meshgrid(*map(np.arange, (20, 18, 16)), indexing="ij"), axis=-1)
    balls = sum((k + 1) * (np.linalg.norm(at - middle, axis=-1) < 6) for k, middle in enumerate([(6, 6, 7), (13, 11, 8)]))
    np.save(folder / "balls.npy", balls.astype("u1"))
    drawn = ["--spp", 1, "--size", "8x8", "--save-scene", folder / "whole.json"]
    run(pumice, "render", folder / "balls.npy", "-o", folder / "p.png", *drawn).fine()
    scene = json.loads((folder / "whole.json").read_text())
    scene["suns"] = [{"direction": [0.0, 0.6, -0.8], "strength": 2.5, "color": [1.0, 1.0, 0.5], "angle_rad": 0.01}]
    scene["instances"][0]["style"]["materials"] = {"2": {"transmission": 1.0, "roughness": 0.1}}
    (folder / "whole.json").write_text(json.dumps(scene))
    scene["cuts"] = [{"shape": {"plane": {"point": [10, 9, 8], "normal": [0.3, 0.5, 0.8]}}}]
    (folder / "cut.json").write_text(json.dumps(scene))
    # The smoothed surface is not cut.
    for name, forms in [("whole", ALL), ("cut", ALL.removesuffix(",smooth"))]:
        for ending in ("usda", "usdc", "usdz"):
            done = run(pumice, "export", folder / f"{name}.json", "-o", folder / f"{name}.{ending}", "--form", forms)
            # It names what the file lacks: the backdrop, and that boxes are not cut.
            assert done.code == 0, done
    run(pumice, "export", data / "slicer_Segmentation.seg.nrrd", "-o", folder / "ct.usdc", "--form", ALL).fine()
    found = sorted([*folder.glob("*.usd?"), *exported_scenes.glob("*.usd?")])
    assert len(found) >= 20 and {file.suffix for file in found} == {".usda", ".usdc", ".usdz"}
    return found


def test_pixars_find_nothing(files):
    for validator in VALIDATORS[:2]:
        assert dict(zip(files, validator(files), strict=True)) == {file: [] for file in files}


def test_nvidia_remarks_what_is_meant_to_be_so(files):
    seen = {rule: set() for rule in REMARKS}
    for file, found in zip(files, stage_validators.nvidia(files), strict=True):
        for form, said in found:
            # Files of one form have no variants that name it.
            rule, places = said.split(":")[0], {form or "voxels", file.suffix[1:]}
            assert rule in REMARKS and places & REMARKS[rule], f"{file.name}, form {form or 'none'}: {said}"
            seen[rule] |= places & REMARKS[rule]
    assert seen == REMARKS, "a remark that nothing gives reason for any more must go"


def edited(before, after):
    def broken(exported, name):
        text = (exported / "everything.usda").read_text()
        assert before in text
        path = exported / f"{name}.usda"
        path.write_text(text.replace(before, after))
        return path

    return broken


def misaligned(exported, name):
    """A package that any program for archives might write: its files begin anywhere."""
    path = exported / f"{name}.usdz"
    with zipfile.ZipFile(exported / "everything.usdz") as whole, zipfile.ZipFile(path, "w") as plain:
        for entry in whole.infolist():
            plain.writestr(entry.filename, whole.read(entry))
    return path


TRIANGLES = "faceVertexIndices = [0, 1, 2, 0, 2, 3]"
# A fault by its name: how it comes into a file, and what those validators say that can see it: today's, that of 2024, NVIDIA's.
FAULTS = {
    "no_default": (edited('defaultPrim = "Scene"', ""), ["StageMetadataChecker"] * 2 + ["DefaultPrimChecker"]),
    "no_up": (edited('upAxis = "Z"', ""), ["StageMetadataChecker"] * 3),
    "no_picture": (edited("a sky", "no sky"), ["MissingReferenceValidator", "MissingReferenceChecker", "MissingReferenceChecker"]),
    "no_schema": (
        edited('prepend apiSchemas = ["MaterialBindingAPI"]', ""),
        ["MaterialBindingApiAppliedValidator", "MaterialBindingAPIAppliedChecker", "UsdMaterialBindingApi"],
    ),
    "misaligned": (misaligned, ["UsdzPackageValidator", "ByteAlignmentChecker", "UsdzPackageValidator"]),
    # Geometry is NVIDIA's alone.
    "too_small": (edited("extent = [(0, 0, 0), (17, 9, 5)]", "extent = [(0, 0, 0), (1, 1, 1)]"), [None, None, "ExtentsChecker"]),
    "no_point": (edited(TRIANGLES, "faceVertexIndices = [0, 1, 2, 0, 2, 9]"), [None, None, "ValidateTopologyChecker"]),
    "turned": (edited(TRIANGLES, "faceVertexIndices = [0, 2, 1, 0, 3, 2]"), [None, None, "NormalsWindingsChecker"]),
}


@pytest.fixture(scope="module")
def broken(exported_scenes, tmp_path_factory):
    """The file with each fault, in a copy of the examples' folder."""
    folder = tmp_path_factory.mktemp("broken") / "stages"
    shutil.copytree(exported_scenes, folder)
    return {name: make(folder, name) for name, (make, _) in FAULTS.items()}


@pytest.mark.parametrize("number", range(len(VALIDATORS)))
def test_each_notices_what_is_broken(broken, number):
    """The control: a fault is named by each validator that looks for it, and without the fault none names it."""
    for name, found in zip(broken, VALIDATORS[number](broken.values()), strict=True):
        rule = FAULTS[name][1][number]
        assert rule is None or any(rule in said for _, said in found), (name, rule, found)
        assert rule not in REMARKS
