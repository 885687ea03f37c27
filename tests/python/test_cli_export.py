"""Tests `pumice export`: real volumes as USD, opened by Pixar's own library; limits and bad input."""

import csv
import json

import numpy as np
import pytest
from command import run
from pxr import Usd, UsdGeom


@pytest.fixture(scope="module")
def info(pumice, data, tmp_path_factory):
    """What `info` says of the shipped volume, compressed."""
    path = tmp_path_factory.mktemp("volume") / "ct.pumice"
    run(pumice, "compress", data / "slicer_Segmentation.seg.nrrd", "-o", path).fine()
    return json.loads(run(pumice, "info", path, "--json").fine())


def exported(pumice, source, out, *more):
    report = out.with_suffix(".json")
    run(pumice, "export", source, "-o", out, "--json", report, *more).fine()
    report = json.loads(report.read_text())
    assert report["bytes"] == out.stat().st_size > 0 and report["cpu_seconds"] > 0 and report["peak_rss_bytes"] > 1e6
    return report


def surface(stage):
    """The only mesh of a stage, and its volume's prim."""
    (mesh,) = (prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    return UsdGeom.Mesh(mesh), mesh.GetParent()


@pytest.mark.parametrize("form", ["voxels", "cells4", "boxes"])
@pytest.mark.parametrize("ending", ["usda", "usdc", "usdz"])
def test_a_real_volume(pumice, data, info, tmp_path, form, ending):
    out = tmp_path / f"ct.{ending}"
    chosen = {"voxels": ["--lod", "1"], "cells4": ["--form", "cells4"], "boxes": ["--lod", "16"]}[form]
    report = exported(pumice, data / "slicer_Segmentation.seg.nrrd", out, *chosen)
    assert report["forms"] == [form] and report["left_out"] == []
    stage = Usd.Stage.Open(str(out))
    mesh, volume = surface(stage)
    labels = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("label").Get())
    assert len(labels) == report["faces"]
    notes = json.loads(volume.GetAttribute("userProperties:labels").Get())
    assert len(notes) == info["labels"] == 7 and all(name for _, name, _ in notes)
    assert set(labels.tolist()) <= set(range(7))
    # Points are corners of voxels; where they lie in the world, Blender's importer is asked (test_usd_import.py).
    points = np.array(mesh.GetPointsAttr().Get())
    assert (points == points.round()).all() and (points.max(axis=0) <= info["dims"]).all()


def test_the_exact_surface_is_merged_or_plain_and_of_chosen_labels(pumice, data, tmp_path):
    volume = data / "slicer_Segmentation.seg.nrrd"
    area, faces = {}, {}
    for name, flags in [("merged", []), ("plain", ["--plain"]), ("some", ["--labels", "2,3", "--plain"])]:
        out = tmp_path / f"{name}.usdc"
        faces[name] = exported(pumice, volume, out, *flags)["faces"]
        stage = Usd.Stage.Open(str(out))
        points = np.array(surface(stage)[0].GetPointsAttr().Get()).reshape(-1, 4, 3)
        cross = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 1])
        area[name] = np.abs(cross).sum()
    assert area["merged"] == area["plain"] == faces["plain"] and faces["merged"] < 0.7 * faces["plain"]
    assert area["some"] == faces["some"] and area["some"] != area["plain"]


def test_files_of_different_labels_fit_together(pumice, data, tmp_path):
    """Points of two files of one label each are those of a file of both, by names as by ids; STL says what it has not."""
    source = data / "slicer_Segmentation.seg.nrrd"

    def points(labels):
        out = tmp_path / f"{labels}.obj"
        run(pumice, "export", source, "-o", out, "--labels", labels, "--form", "cells4", "--plain").fine()
        return {line for line in out.read_text().splitlines() if line.startswith("v ")}

    one, two = points("5"), points("6")
    both = points("5,6")
    # Faces between the two are inside.
    assert both <= one | two and both & one and both & two and len(both) > 0.8 * len(one | two)
    listed = csv.DictReader(run(pumice, "info", source, "--labels", "--csv").fine().splitlines())
    (name,) = [row["name"] for row in listed if row["id"] == "5"]
    assert points(f'"{name}"') == one
    assert "nonsense" in run(pumice, "export", source, "-o", tmp_path / "o.stl", "--labels", "nonsense").refused()
    done = run(pumice, "export", source, "-o", tmp_path / "o.stl", "--form", "boxes")
    assert done.code == 0 and done.err == "pumice: left out: labels and materials\n", done


def test_instances_cover_the_boxes(pumice, data, info, tmp_path):
    out = tmp_path / "boxes.usdc"
    report = exported(pumice, data / "slicer_Segmentation.seg.nrrd", out, "--form", "instances")
    stage = Usd.Stage.Open(str(out))
    (instancer,) = (prim for prim in stage.Traverse() if prim.IsA(UsdGeom.PointInstancer))
    positions = UsdGeom.PointInstancer(instancer).GetPositionsAttr().Get()
    assert len(positions) == report["boxes"] == info["boxes"]


def test_a_scene_says_what_it_leaves_out(pumice, data, tmp_path):
    scene = tmp_path / "scene.json"
    shown = ["--spp", 1, "--size", "8x8", "--save-scene", scene]
    run(pumice, "render", data / "slicer_Segmentation.seg.nrrd", "-o", tmp_path / "p.png", *shown).fine()
    done = run(pumice, "export", scene, "-o", tmp_path / "o.usdc")
    assert done.code == 0 and done.err == "pumice: left out: the backdrop\n", done
    stage = Usd.Stage.Open(str(tmp_path / "o.usdc"))
    types = {prim.GetTypeName() for prim in stage.Traverse()}
    assert {"Camera", "DomeLight", "DistantLight", "Mesh"} <= types
    lost = "the camera, the world, a sun"
    for ending, left_out in [("glb", "the world"), ("ply", lost), ("stl", f"{lost}, labels and materials")]:
        done = run(pumice, "export", scene, "-o", tmp_path / f"o.{ending}")
        assert done.code == 0 and done.err == f"pumice: left out: {left_out}\n", done
    # Light passes through one label, so that it reaches faces which no ray from outside meets.
    clear = json.loads(scene.read_text())
    clear["instances"][0]["style"]["groups"] = [{"material": {"alpha": 0.5}, "labels": [2]}]
    (tmp_path / "clear.json").write_text(json.dumps(clear))
    done = run(pumice, "export", tmp_path / "clear.json", "-o", tmp_path / "o.glb")
    between = "faces between labels that touch, which light reaches through glass and alpha"
    assert done.err == f"pumice: left out: the world, {between}\n", done
    # Of a single label there are none.
    clear["instances"][0]["style"]["show"] = {"only": [2]}
    (tmp_path / "clear.json").write_text(json.dumps(clear))
    done = run(pumice, "export", tmp_path / "clear.json", "-o", tmp_path / "o.glb")
    assert done.err == "pumice: left out: the world\n", done
    dim = json.loads(scene.read_text())
    dim["camera"] |= {"shift": [0.1, 0], "aperture": {"radius": 0.1, "focus_distance": 5}}
    area = {"world_from_light": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], "outline": "rectangle", "size": [1, 2]}
    dim["lights"] = [{"shape": {"area": area}, "power_w": 5}]
    (tmp_path / "rich.json").write_text(json.dumps(dim))
    done = run(pumice, "export", tmp_path / "rich.json", "-o", tmp_path / "o.glb")
    assert done.err == "pumice: left out: the camera's shift, the camera's depth of field, the world, an area light\n", done
    rich = json.loads(scene.read_text())
    rich["world"] = {"environment": {"image": {"path": "sky.hdr"}}, "backdrop": [[0, 0, 0], [1, 1, 1]]}
    rich["camera"]["aperture"] = {"radius": 1, "focus_distance": 9, "blades": 5}
    area = {"area": {"world_from_light": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 9], "outline": "ellipse", "size": [1, 1], "spread_rad": 1}}
    rich["lights"] = [{"shape": area, "power_w": 5}] * 2
    scene.write_text(json.dumps(rich))
    lacks = run(pumice, "export", scene, "-o", tmp_path / "rich.usdz").refused()
    assert "sky.hdr: No such file" in lacks
    (tmp_path / "sky.hdr").touch()
    for ending, first in [("usdz", "the world, whose picture sky.hdr a usdz package cannot hold (OpenEXR it can), "), ("usda", "")]:
        done = run(pumice, "export", scene, "-o", tmp_path / f"rich.{ending}", "--for", "blender")
        told, left = done.err.splitlines()
        assert done.code == 0 and told.startswith("pumice: for Blender 4.2 to 5.0: suns have a quarter of their strength")
        assert left == f"pumice: left out: {first}the backdrop, the shape of the camera's aperture, the spread of 2 area lamps"
    assert told.removeprefix("pumice: ") in (tmp_path / "rich.usda").read_text()


def test_bad_input(pumice, data, tmp_path):
    volume = data / "slicer_Segmentation.seg.nrrd"
    (tmp_path / "folder.usdc").mkdir()
    for arguments, what in [
        (["-o", tmp_path / "o.usd"], "o.usd: expected a name that ends in .usda, .usdc, .usdz"),
        (["-o", tmp_path / "o"], "expected a name that ends in"),
        (["-o", tmp_path / "nowhere" / "o.usdc"], "nowhere: No such file or directory"),
        (["-o", tmp_path / "folder.usdc"], "folder.usdc: expected an ordinary file, got a folder"),
        (["-o", tmp_path / "o.usdc", "--labels", "987654"], "no label 987654"),
        (["-o", tmp_path / "o.usdc", "--form", "spheres"], "possible values: instances, boxes, cells4, voxels, smooth"),
        (["-o", tmp_path / "o.usdc", "--limit", "1K"], "is more than the limit of 1024"),
        (["-o", tmp_path / "o.usdc", "--form", "instances", "--limit", "5K"], "is more than the limit of 5120"),
        (["-o", tmp_path / "o.usdc", "--lod", "2"], "expected 16, 4 or 1"),
        (["-o", tmp_path / "o.glb", "--form", "boxes,voxels"], "form: a .glb file holds one, got boxes, voxels; write a file for each"),
        (["-o", tmp_path / "o.ply", "--form", "instances"], "form: a .ply file has no instances; expected voxels, cells4, boxes or smooth"),
        (["-o", tmp_path / "o.gltf", "--limit", "1K"], "is more than the limit of 1024"),
        (["-o", tmp_path / "o.stl", "--limit", "1K"], "is more than the limit of 1024"),
        # Estimated while faces are found, 9001 rectangles take 576 KB; with the corners of their triangles they take 782 KB.
        (["-o", tmp_path / "o.glb", "--limit", "600000"], "bytes of the binary part of the file: 782272 is more than the limit of 600000"),
        (["-o", tmp_path / "o.usdc", "--lod", "4", "--form", "boxes"], "cannot be used with"),
        (["-o", tmp_path / "o.obj", "--form", "smooth", "--limit", "1K"], "is more than the limit of 1024"),
        (["-o", tmp_path / "o.usdc", "--region", "1,2,3"], "expected six whole numbers X0,Y0,Z0,X1,Y1,Z1"),
        (["-o", tmp_path / "o.usdc", "--region", "0,0,0,-4,4,4"], "expected six whole numbers"),
        (["-o", tmp_path / "o.usdc", "--region", "0,7,0,4,7,4"], "Z0 below Z1, got 0,7,0,4,7,4"),
        (["-o", tmp_path / "o.usdc", "--region", "9,0,0,4,4,4"], "region: expected X0,Y0,Z0,X1,Y1,Z1 with X0 below X1"),
        (["-o", tmp_path / "o.glb", "--region", "0,0,0,4,99999,4"], "region: expected X1,Y1,Z1 of at most "),
        (["-o", tmp_path / "o.stl", "--region", "0,0,0,1,1,1"], "no label is shown within the region, or cuts remove them all"),
    ]:
        assert what in run(pumice, "export", volume, *arguments).refused(), arguments
    # A full disk, imitated by a limit on the size of files: nothing is left, and the former file stays.
    (tmp_path / "o.usdc").write_text("former")
    line = run(pumice, "export", volume, "-o", tmp_path / "o.usdc", file_size_limit=50_000).refused()
    assert "o.usdc: File too large" in line, line
    assert (tmp_path / "o.usdc").read_text() == "former"
    assert "p.usdz: File too large" in run(pumice, "export", volume, "-o", tmp_path / "p.usdz", file_size_limit=50_000).refused()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder.usdc", "o.usdc"]
    # Of two files that belong together neither is written where one cannot be, and former ones stay.
    for ending, beside in [("gltf", "bin"), ("obj", "mtl")]:
        for former in (tmp_path / f"o.{ending}", tmp_path / f"o.{beside}"):
            former.write_text("former")
        there = sorted(p.name for p in tmp_path.iterdir())
        line = run(pumice, "export", volume, "-o", tmp_path / f"o.{ending}", file_size_limit=50_000).refused()
        assert f"o.{ending}: File too large" in line, line
        assert all((tmp_path / f"o.{e}").read_text() == "former" for e in (ending, beside))
        assert sorted(p.name for p in tmp_path.iterdir()) == there
    assert "nowhere.nrrd" in run(pumice, "export", tmp_path / "nowhere.nrrd", "-o", tmp_path / "n.usdc").refused()
