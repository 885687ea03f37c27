# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests `pumice verify-render` with this Blender: a scene agrees with itself, and each control is noticed: Cycles then draws a scene that
differs from ours in one thing. The page is read as a reader would, by its text and its pictures."""

import base64
import json
import math
import re
import subprocess
import sys

import pytest

# Sixteen pictures of 64 × 48 pixels take some ten seconds of both programs together.
SIZE = "64x48"


def turned(scene):
    """The sun 1° around the vertical axis."""
    x, y, _ = scene["suns"][0]["direction"]
    c, s = math.cos(math.radians(1)), math.sin(math.radians(1))
    scene["suns"][0]["direction"][:2] = [c * x - s * y, s * x + c * y]


def rougher(scene):
    scene["instances"][0]["style"]["material"]["roughness"] *= 1.05


def paler(scene):
    """The common base colour 2 % darker."""
    material = scene["instances"][0]["style"]["material"]
    material["base_color"] = [0.98 * c for c in material["base_color"]]


def fewer(scene):
    del scene["instances"][0]["style"]["show"]["only"][2]


@pytest.fixture(scope="module")
def scene(pumice_command, data, tmp_path_factory):
    """Some dull neurites of one colour under the sky alone: little noise, so that a verdict takes few pictures."""
    path = tmp_path_factory.mktemp("verified") / "scene.json"
    shown = ["--pick", "8", "--size", SIZE, "--spp", "1", "--bounces", "0", "--backend", "cpu", "--save-scene", path]
    volume = data / "connectomics_32x32x40nm.nrrd"
    subprocess.run([pumice_command, "render", volume, "-o", path.with_suffix(".png"), *shown], check=True)
    fields = json.loads(path.read_text())
    fields["instances"][0]["style"]["auto_color"] = False
    fields["instances"][0]["style"]["material"].update(base_color=[0.7, 0.5, 0.3], specular=0.0, roughness=1.0)
    fields["suns"] = []
    path.write_text(json.dumps(fields))
    return path


@pytest.fixture(scope="module")
def glossy(scene):
    """The same of metal under a small sun, where the roughness is seen. Noisier by an order of magnitude."""
    fields = json.loads(scene.read_text())
    fields["instances"][0]["style"]["material"].update(metallic=1.0, roughness=0.2)
    fields["suns"] = [{"direction": [0.5, 0.4, -1.0], "strength": 2.6, "angle_rad": 0.02}]
    path = scene.with_name("glossy.json")
    path.write_text(json.dumps(fields))
    return path


@pytest.fixture(scope="module")
def sunlit(scene):
    """The same under a small sun alone: 1° makes the faces that look along x darker by 1.4 %, and those along y brighter by 2.2 %."""
    fields = json.loads(scene.read_text())
    fields["world"] = {"environment": {"constant": {"radiance": [0.0, 0.0, 0.0]}}}
    fields["suns"] = [{"direction": [0.5, 0.4, -1.0], "strength": 2.6, "angle_rad": 0.02}]
    path = scene.with_name("sunlit.json")
    path.write_text(json.dumps(fields))
    return path


def compared(command, scene, *more):
    """(exit code, report, page) of a comparison with this Blender."""
    report, page = scene.with_name("report.json"), scene.with_name("page.html")
    wishes = ["--backend", "cpu", "--json", report, "-o", page, "--with-blender", sys.executable]
    done = subprocess.run([command, "verify-render", scene, *wishes, *more], capture_output=True, text=True)
    assert done.returncode in (0, 1) or "annot tell" in done.stderr, done
    return done, json.loads(report.read_text()), page.read_text()


@pytest.mark.turn(1, 2)
def test_a_scene_agrees_with_itself(pumice_command, scene):
    done, report, page = compared(pumice_command, scene, "--time", "600")
    assert done.returncode == 0 and report["agreement"]["verdict"] == "agrees", (done, report)
    assert report["surface"] == "voxels" and report["faces"] > 1e4 and report["agreement"]["masked"] == 0
    assert report["theirs"]["bytes"] > 1e8 and report["ours"]["cpu_seconds"] > 0
    # The page: the sentence of the report, six pictures that are PNG files, nothing from elsewhere, no script.
    assert report["sentence"] in page and report["sentence"] in done.stdout
    pictures = re.findall(r'src="data:image/png;base64,([^"]*)"', page)
    assert len(pictures) == 6 and all(base64.b64decode(p).startswith(b"\x89PNG\r\n") for p in pictures)
    assert page.count("<svg") == 2
    assert "<script" not in page and not re.search(r'(src|href)="(?!data:)', page)
    assert report["volume_hashes"][0] in page and "verify-render" in page


@pytest.fixture(scope="module")
def opened(scene):
    """All labels, cut open by an oblique plane through the middle, which halves voxels; seen from near, so that a voxel is a pixel."""
    fields = json.loads(scene.read_text())
    matrix = fields["instances"][0]["world_from_index"]
    middle = [sum(m * c for m, c in zip(matrix[a:9:3], (128, 128, 256))) + matrix[9 + a] for a in range(3)]
    fields["instances"][0]["style"]["show"] = "all"
    fields["instances"][0]["style"]["auto_color"] = True
    fields["cuts"] = [{"shape": {"plane": {"point": middle, "normal": [0.4, -0.3, 0.5]}}}]
    fields["camera"]["projection"]["perspective"]["fov_rad"] /= 16
    path = scene.with_name("opened.json")
    path.write_text(json.dumps(fields))
    return path


def moved(scene):
    """The cut by a quarter of a voxel."""
    voxel = min(abs(m) for m in scene["instances"][0]["world_from_index"][:9] if m)
    plane = scene["cuts"][0]["shape"]["plane"]
    length = math.hypot(*plane["normal"])
    plane["point"] = [p + 0.25 * voxel * n / length for p, n in zip(plane["point"], plane["normal"])]


def noticed(command, scene, control):
    """The report on a scene of which Cycles draws a changed one; never a clean "agrees"."""
    fields = json.loads(scene.read_text())
    control(fields)
    other = scene.with_name("other.json")
    other.write_text(json.dumps(fields))
    _, report, page = compared(command, scene, "--control", other, "--time", "900")
    assert "A control: Cycles draws another scene" in page
    agreement = report["agreement"]
    named = agreement["proven_in_tile"] or agreement["proven_in_mean"]
    assert agreement["verdict"] == "differs" or named, (control.__name__, report)
    return report


@pytest.mark.parametrize(
    "control", [pytest.param(fewer, marks=pytest.mark.turn(0, 4)), pytest.param(paler, marks=pytest.mark.turn(2, 4))]
)
def test_another_color_or_label_differs(pumice_command, scene, control):
    assert noticed(pumice_command, scene, control)["agreement"]["verdict"] == "differs"


@pytest.mark.full
def test_another_sun_differs(pumice_command, sunlit):
    assert noticed(pumice_command, sunlit, turned)["agreement"]["verdict"] == "differs"


@pytest.mark.full
def test_another_roughness_is_found_or_named(pumice_command, glossy):
    noticed(pumice_command, glossy, rougher)


@pytest.mark.full
def test_a_noisy_scene_agrees_with_itself(pumice_command, glossy):
    done, report, _ = compared(pumice_command, glossy, "--time", "1200")
    assert done.returncode == 0 and report["agreement"]["verdict"] == "agrees", (done, report)


@pytest.mark.full
def test_a_scene_that_is_cut_open_agrees_with_itself(pumice_command, opened):
    done, report, _ = compared(pumice_command, opened, "--time", "400")
    assert done.returncode == 0 and report["agreement"]["verdict"] == "agrees", (done, report)


@pytest.mark.full
def test_a_moved_cut_differs(pumice_command, opened):
    assert noticed(pumice_command, opened, moved)["agreement"]["verdict"] == "differs"
