# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that Pumice and Cycles agree, by `pumice verify-render`, on what the ladder of scenes does not judge: smooth meshes of several materials,
meshes that emit, volumes within each other, sheared ones, and labels that let light through."""

import json
import subprocess
import sys

import numpy as np
import pytest

SIZE = "64x48"
DULL = {"base_color": [0.7, 0.5, 0.3], "specular": 0.0, "roughness": 1.0}


def ball(path, radius=1.0):
    """A ball of 320 triangles with the normals of the ball."""
    golden = (1 + 5**0.5) / 2
    ends = [(s, t * golden, 0) for s in (-1, 1) for t in (-1, 1)]
    ends = np.array([*ends, *((0, a, b) for a, b, _ in ends), *((b, 0, a) for a, b, _ in ends)], float)
    near = np.linalg.norm(ends[:, None] - ends[None], axis=2) < 2.1
    triangles = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]
    ]
    triangles = [ends[list(t)] for t in triangles]
    for _ in range(2):
        halves = [(t, [t[[0, 1]].mean(0), t[[1, 2]].mean(0), t[[2, 0]].mean(0)]) for t in triangles]
        triangles = [
            np.array(corners)
            for (a, b, c), (ab, bc, ca) in halves
            for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        ]
    triangles = np.array(triangles)
    triangles /= np.linalg.norm(triangles, axis=2, keepdims=True)
    turned = np.einsum("ij,ij->i", np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), triangles[:, 0]) < 0
    triangles[turned] = triangles[turned, ::-1]
    points = triangles.reshape(-1, 3)
    lines = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    lines += [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    lines += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(f"{v:.9g}" for v in [*(radius * p), *p]) for p in points]
    lines += [f"3 {3 * i} {3 * i + 1} {3 * i + 2}" for i in range(len(triangles))]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def scene(pumice_command, data, tmp_path):
    """Dull neurites under a wide sun and a grey sky, and where their middle is."""
    path = tmp_path / "scene.json"
    shown = ["--pick", "8", "--size", SIZE, "--spp", "1", "--bounces", "4", "--backend", "cpu", "--save-scene", path]
    volume = data / "connectomics_32x32x40nm.nrrd"
    subprocess.run([pumice_command, "render", volume, "-o", path.with_suffix(".png"), *shown], check=True)
    fields = json.loads(path.read_text())
    fields["instances"][0]["style"] |= {"auto_color": False, "material": DULL}
    fields["world"] = {"environment": {"constant": {"radiance": [0.5, 0.6, 0.8]}}}
    fields["suns"] = [{"direction": [0.5, 0.4, -1.0], "strength": 2.0, "angle_rad": 0.3}]
    return path, fields


def add_ball(fields, folder, material, share=0.25):
    """A ball before the middle of the volume, a share of its size."""
    matrix = np.reshape(fields["instances"][0]["world_from_index"], (4, 3))
    middle = matrix[3] + np.array([128, 128, 256]) @ matrix[:3]
    size = np.linalg.norm(np.array([256, 256, 512]) @ np.abs(matrix[:3]))
    eye = np.reshape(fields["camera"]["world_from_camera"], (4, 3))[3]
    place = middle + 0.35 * size * (eye - middle) / np.linalg.norm(eye - middle)
    radius = share * size / 2
    ball(folder / "ball.ply")
    placed = [*(radius * np.eye(3)).ravel().tolist(), *place.tolist()]
    fields["meshes"] = [{"id": 3, "source": "ball.ply", "world_from_mesh": placed, "materials": [material]}]


def coated(fields, folder):
    add_ball(fields, folder, {"base_color": [0.6, 0.2, 0.2], "roughness": 0.5, "coat": 1.0, "coat_roughness": 0.2})


def velvet(fields, folder):
    add_ball(fields, folder, {"base_color": [0.1, 0.1, 0.3], "roughness": 0.8, "sheen": 1.0, "sheen_roughness": 0.4})


def glass(fields, folder):
    add_ball(fields, folder, {"base_color": [1.0, 1.0, 1.0], "transmission": 1.0, "roughness": 0.0, "ior": 1.45})


def lit_by_a_mesh(fields, folder):
    add_ball(fields, folder, {"base_color": [0.5, 0.5, 0.5], "emission": [6.0, 5.0, 3.0]})
    fields["suns"] = []


def within_each_other(fields, folder):
    """The same volume twice, the other turned by a third of a turn about an oblique axis."""
    matrix = np.reshape(fields["instances"][0]["world_from_index"], (4, 3))
    middle = matrix[3] + np.array([128, 128, 256]) @ matrix[:3]
    turn = np.roll(np.eye(3), 1, axis=0)
    other = np.vstack([matrix[:3] @ turn, (matrix[3] - middle) @ turn + middle])
    again = json.loads(json.dumps(fields["instances"][0])) | {"id": 9, "world_from_index": other.ravel().tolist()}
    again["style"]["material"] = DULL | {"base_color": [0.3, 0.5, 0.7]}
    fields["instances"].append(again)


def veiled(fields, folder):
    """Labels that let light through, so that it reaches the faces where they touch."""
    fields["instances"][0]["style"]["material"] = DULL | {"alpha": 0.4}


def glazed(fields, folder):
    """Glass that touches glass."""
    fields["instances"][0]["style"]["material"] = {"base_color": [0.9, 0.9, 1.0], "transmission": 1.0, "roughness": 0.0, "ior": 1.45}


def sheared(fields, folder):
    """The x axis of the volume leans towards its z axis."""
    matrix = np.reshape(fields["instances"][0]["world_from_index"], (4, 3))
    middle = matrix[3] + np.array([128, 128, 256]) @ matrix[:3]
    matrix[0] += 0.5 * matrix[2]
    matrix[3] = middle - np.array([128, 128, 256]) @ matrix[:3]
    fields["instances"][0]["world_from_index"] = matrix.ravel().tolist()


@pytest.mark.full
@pytest.mark.parametrize("change", [coated, velvet, glass, lit_by_a_mesh, within_each_other, veiled, glazed, sheared])
def test_both_programs_agree(pumice_command, scene, change):
    path, fields = scene
    change(fields, path.parent)
    path.write_text(json.dumps(fields))
    report, page = path.with_name("report.json"), path.with_name("page.html")
    wishes = ["--backend", "cpu", "--json", report, "-o", page, "--with-blender", sys.executable, "--time", "600"]
    done = subprocess.run([pumice_command, "verify-render", path, *wishes], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(report.read_text())["agreement"]["verdict"] == "agrees"
