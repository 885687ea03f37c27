# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that `pumice verify-render` agrees on instances of volumes that touch, notices what it should, and says where nothing can be judged."""

import json
import subprocess
import sys

import numpy as np
import pytest

DULL = {"base_color": [0.7, 0.5, 0.3], "specular": 0.0, "roughness": 1.0}
# Glass whose colour tells how many of its surfaces a path has passed.
TINTED = {"base_color": [0.9, 0.8, 0.5], "transmission": 1.0, "roughness": 0.0, "ior": 1.4}
VEIL = DULL | {"alpha": 0.5}


def instance(number, folder, labels, move, materials, scale=1.0, show="all"):
    """An instance of labels (x, y, z), whose voxels have this side."""
    labels = np.asarray(labels, dtype=np.uint8)
    name = f"{hash(labels.tobytes()) & 0xFFFFFF:06x}-{'x'.join(map(str, labels.shape))}.npy"
    np.save(folder / name, labels)
    style = {"show": show, "material": materials[0], "materials": {str(2 + i): m for i, m in enumerate(materials[1:])}}
    matrix = [*(scale * np.eye(3)).ravel().tolist(), *map(float, move)]
    return {"id": number, "source": name, "reading": {"axes": "xyz"}, "world_from_index": matrix, "style": style}


def scene(instances, cuts=()):
    """The instances from obliquely above, in even light; they stand about (0, 0, 0)."""
    back = np.array([0.5, -0.8, 0.45])
    back /= np.linalg.norm(back)
    right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    camera = np.concatenate([right, np.cross(back, right), back, 30.0 * back]).tolist()
    return {
        "version": 1,
        "instances": instances,
        "camera": {"world_from_camera": camera, "projection": {"perspective": {"fov_rad": 0.5}}},
        "film": {"width": 48, "height": 32, "filter": {"box": {"width": 1.0}}},
        "world": {"environment": {"constant": {"radiance": [0.5, 0.7, 1.0]}}},
        "settings": {"bounces": 16},
        "cuts": list(cuts),
    }


def block(*size):
    return np.ones(size, dtype=np.uint8)


def notched():
    """A block with some voxels missing, also where the other one touches it."""
    labels = block(4, 4, 4)
    labels[3, 1, 2:] = labels[0, 2:, 3] = labels[2, 0, 3] = 0
    return labels


def opaque(folder):
    return [
        instance(1, folder, notched(), (-4, -2, -2), [DULL]),
        instance(2, folder, notched(), (0, -2, -2), [DULL | {"base_color": [0.2, 0.4, 0.7]}]),
    ]


def split_glass(folder):
    """A slab in three parts side by side, before a dull block that it touches too."""
    return [
        *(instance(i, folder, block(2, 2, 4), (x, -2, -2), [TINTED]) for i, x in enumerate((1, -3, -1))),
        instance(9, folder, block(6, 2, 3), (-3, 0, -2), [DULL]),
    ]


def glass_and_opaque(folder):
    """Glass beside a dull label of another volume, whose voxels have half the side and lie a third of a voxel aside."""
    return [
        instance(1, folder, block(3, 4, 4), (-3, -2, -2), [TINTED]),
        instance(2, folder, block(6, 6, 6), (0, -1.67, -1.67), [DULL], 0.5),
    ]


def packed(folder):
    """Glass, dull and half transparent labels that fill a block, each in an instance of its own."""
    labels = np.random.default_rng(3).integers(1, 4, (3, 3, 3)).repeat(2, 0).repeat(2, 1).repeat(2, 2)
    return [
        instance(number, folder, labels, (-3, -3, -3), [TINTED, DULL, VEIL], show={"only": [number]}) for number in (1, 2, 3)
    ]


# Removes the nearer third, through voxels, so that each body ends in a cap that meets the cap of the other.
NEARER = {"shape": {"plane": {"point": [0.0, -0.6, 0.0], "normal": [0.25, -1.0, 0.15]}}}


def verdict(command, folder, instances, control=None, cuts=(), control_cuts=None):
    """(verdict, exit code, what the command said) of Pumice's picture of these instances against that of Cycles."""
    wishes = []
    cuts_of_control = cuts if control_cuts is None else control_cuts
    for name, made, removed in (("scene", instances, cuts), ("control", control, cuts_of_control)):
        if made is not None:
            (folder / f"{name}.json").write_text(json.dumps(scene(made, removed)))
    if control is not None:
        wishes = ["--control", folder / "control.json"]
    report = folder / "report.json"
    wishes += ["--backend", "cpu", "--json", report, "--with-blender", sys.executable, "--time", "900"]
    done = subprocess.run([command, "verify-render", folder / "scene.json", *wishes], capture_output=True, text=True)
    assert report.exists(), done.stdout + done.stderr
    fields = json.loads(report.read_text())
    print(fields["sentence"], fields["agreement"]["mean"])
    return fields["agreement"]["verdict"], done.returncode, done.stdout + done.stderr


@pytest.mark.full
@pytest.mark.parametrize("made", [opaque, split_glass, glass_and_opaque, packed])
def test_instances_that_touch_agree(pumice_command, tmp_path, made):
    found = verdict(pumice_command, tmp_path, made(tmp_path))
    assert found[:2] == ("agrees", 0), found


def apart(instances):
    """The second body a 512th of a voxel aside, as Cycles gets faces that touch where no cut divides them."""
    instances[1]["world_from_index"][9] += 2.0**-9


@pytest.mark.full
def test_a_cut_through_opaque_bodies_that_touch_agrees(pumice_command, tmp_path):
    """Both bodies end in caps in one plane, side by side."""
    found = verdict(pumice_command, tmp_path, opaque(tmp_path), cuts=[NEARER])
    assert found[:2] == ("agrees", 0), found


@pytest.mark.full
def test_a_cut_through_glass_that_touches_agrees_where_no_faces_are_in_one_place(pumice_command, tmp_path):
    """Pumice draws the bodies that touch, Cycles the same with a gap that no eye sees, and so none of its faces are in one place."""
    gapped = json.loads(json.dumps(glass_and_opaque(tmp_path)))
    apart(gapped)
    found = verdict(pumice_command, tmp_path, glass_and_opaque(tmp_path), gapped, [NEARER])
    assert found[:2] == ("agrees", 0), found


@pytest.mark.full
def test_faces_that_a_cut_leaves_in_one_place_differ_and_are_not_judged(pumice_command, tmp_path):
    """The control of the test above: Cycles passes one of the two faces."""
    found = verdict(pumice_command, tmp_path, glass_and_opaque(tmp_path), cuts=[NEARER])
    assert found[:2] == ("cannot_tell", 2), found
    assert "planes in which faces of two volumes lie, where a cut passes" in found[2]
    assert "Otherwise it would be: Differs" in found[2]


@pytest.mark.full
def test_a_cut_through_one_of_two_bodies_differs_from_one_through_both(pumice_command, tmp_path):
    made = opaque(tmp_path)
    found = verdict(pumice_command, tmp_path, made, made, [NEARER], [NEARER | {"instances": [1]}])
    assert found[:2] == ("differs", 1), found


def swapped(instances):
    """The materials of two instances."""
    first, second, *_ = instances
    first["style"], second["style"] = second["style"], first["style"]


def own_bodies(instances):
    """Styles that differ in a material that no label has: parts of one body become bodies of their own."""
    for number, one in enumerate(instances):
        one["style"]["materials"][str(100 + number)] = DULL


@pytest.mark.full
@pytest.mark.parametrize(("made", "fault"), [(opaque, swapped), (split_glass, own_bodies), (glass_and_opaque, swapped)])
def test_a_wrong_order_differs(pumice_command, tmp_path, made, fault):
    wrong = json.loads(json.dumps(made(tmp_path)))
    fault(wrong)
    found = verdict(pumice_command, tmp_path, made(tmp_path), wrong)
    assert found[:2] == ("differs", 1), found


@pytest.mark.full
def test_what_has_no_order_is_not_judged(pumice_command, tmp_path):
    """Two blocks of glass that overlap in a layer, flush on four sides."""
    blocks = [
        instance(i, tmp_path, block(4, 4, 4), (x, -2, -2), [TINTED | {"base_color": color}])
        for i, (x, color) in enumerate([(-3, [0.9, 0.8, 0.5]), (0, [0.2, 0.4, 0.9])])
    ]
    found = verdict(pumice_command, tmp_path, blocks)
    assert found[:2] == ("cannot_tell", 2), found
    assert "Cannot be judged: faces of two volumes in one place that look the same way (16)" in found[2]
