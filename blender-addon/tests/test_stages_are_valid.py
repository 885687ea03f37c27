# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole scene of Blender's as a USD stage, before the three validators of tests/python/stage_validators.py.

Blender's own exporter writes meshes, lights and world, and Pumice the volumes, the camera and what joins them.
"""

import json
import subprocess
from pathlib import Path

import pytest

import staged_scene
from test_round_trip import with_usd  # noqa: F401

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = "import json, sys, stage_validators as v; print(json.dumps([validate(sys.argv[1:]) for validate in (v.newest, v.of_2024, v.nvidia)]))"
# What NVIDIA's validator remarks of stages that are as they are meant to be, by its rule: in which files, and why.
REMARKS = {
    # Rectangles of volumes share no points; see tests/python/test_stage_validators.py.
    "WeldChecker": {"usda", "usdc", "usdz"},
    # Texture coordinates as Blender's exporter writes them.
    "IndexedPrimvarChecker": {"usda", "usdc", "usdz"},
    # Text is what was asked for.
    "UsdAsciiPerformanceChecker": {"usda"},
    # Wrong: it looks for the ending "exr" in a list that has ".exr". The specification of packages allows OpenEXR.
    "TextureChecker": {"usdz"},
}
pytestmark = pytest.mark.full


@pytest.fixture(scope="module")
def validated():
    """Validates files: what Pixar's validators of today and of 2024, and NVIDIA's, find in each, as {(file, validator): texts}."""

    def validate(files):
        python = ROOT / "target/venv/bin/python"
        done = subprocess.run([python, "-c", SCRIPT, *map(str, files)], cwd=ROOT / "tests/python", capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        found = dict(zip(("newest", "2024", "nvidia"), json.loads(done.stdout.splitlines()[-1]), strict=True))
        return {(file, name): [text for _, text in said] for name, lists in found.items() for file, said in zip(files, lists, strict=True)}

    return validate


def test_a_scene_as_a_stage_is_valid(with_usd, validated, tmp_path):  # noqa: F811
    staged_scene.build(with_usd, tmp_path)
    files = []
    for ending in ("usda", "usdc", "usdz"):
        (tmp_path / ending).mkdir()
        files.append(tmp_path / ending / f"scene.{ending}")
        assert with_usd.ops.pumice.export_scene(filepath=str(files[-1])) == {"FINISHED"}
    # A control: the stage without a kind at its root, as it was once written.
    broken = tmp_path / "usda" / "broken.usda"
    text = files[0].read_text()
    assert text.count('kind = "group"') == 1
    broken.write_text(text.replace('kind = "group"', ""))
    found = validated([*files, broken])
    assert any(said.startswith("KindChecker") for said in found[broken, "nvidia"])
    seen = {rule: set() for rule in REMARKS}
    for file in files:
        assert found[file, "newest"] == found[file, "2024"] == []
        for said in found[file, "nvidia"]:
            rule, ending = said.split(":")[0], file.suffix[1:]
            assert ending in REMARKS.get(rule, ()), f"{file.name}: {said}"
            seen[rule].add(ending)
    assert seen == REMARKS, "a remark that nothing gives reason for any more must go"
