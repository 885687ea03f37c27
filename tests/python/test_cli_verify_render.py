"""Tests bad input of `pumice verify-render`; comparisons themselves need Blender (blender-addon/tests/test_verify_render.py)."""

import json
import sys

from command import run


def test_bad_input(pumice, data, tmp_path):
    volume = data / "slicer_Segmentation.seg.nrrd"
    without_bpy = ["--with-blender", sys.executable]
    quick = ["--size", "8x8", "--backend", "cpu"]
    for arguments, what in [
        ([], "--with-blender"),
        (["--with-blender", tmp_path / "nowhere"], "nowhere: No such file"),
        (without_bpy, "No module named 'bpy'"),
        ([*without_bpy, "--spp", "255"], "255"),
        ([*without_bpy, "-o", tmp_path / "page.pdf"], "page.pdf: expected a name that ends in .html"),
        ([*without_bpy, "-o", tmp_path / "missing" / "page.html"], "missing: No such file"),
        ([*without_bpy, "--memory-limit", "1M"], "bytes of memory for Cycles"),
        ([*without_bpy, "--lod", "2"], "[possible values: 1, 4, 16]"),
        ([*without_bpy, "--control", tmp_path / "none.json"], "none.json: No such file"),
        ([*without_bpy, "--labels", "987654"], "no label 987654"),
    ]:
        line = run(pumice, "verify-render", volume, *quick, *arguments).refused()
        assert what in line, (arguments, line)
    assert list(tmp_path.iterdir()) == []


def test_what_cycles_has_not_is_refused(pumice, data, tmp_path):
    path = tmp_path / "scene.json"
    shown = ["--size", "8x8", "--spp", "1", "--backend", "cpu", "--save-scene", path]
    run(pumice, "render", data / "slicer_Segmentation.seg.nrrd", "-o", tmp_path / "p.png", *shown).fine()
    scene = json.loads(path.read_text())
    wide = {"film": {**scene["film"], "filter": {"box": {"width": 2.0}}}}
    ambient = {"settings": {**scene["settings"], "mode": "ambient_occlusion"}}
    for change, what in [(wide, "film.filter: Cycles has a box of 1 pixel"), (ambient, "settings.mode")]:
        path.write_text(json.dumps({**scene, **change}))
        line = run(pumice, "verify-render", path, "--with-blender", sys.executable, "--backend", "cpu").refused()
        assert what in line, line
