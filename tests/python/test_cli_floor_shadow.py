"""Tests that what darkens the corners of a figure on a floor is the shadow of what is shown, against a box in closed form; and that a figure
fades it, so that the border has the background's colour.

A point of the floor gets the light of the sky and of the sun that the box leaves: both are integrals over directions, done here by sampling
directions and by comparing slabs. Light that the box itself reflects to the floor is left out, by `--mode one-bounce`.
"""

import json

import numpy as np
import pytest
from command import run
from exr_planes import planes
from PIL import Image

WIDTH, HEIGHT = 96, 72
DIRECTIONS = 200_000


def basis(axis):
    across = np.cross(axis, [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across)
    return across, np.cross(axis, across)


def directions(axis, cosines, angles):
    x, y = basis(axis)
    sines = np.sqrt(1 - cosines**2)
    return cosines[:, None] * axis + (sines * np.cos(angles))[:, None] * x + (sines * np.sin(angles))[:, None] * y


def part_that_hits(box, origin, rays):
    low, high = ((corner - origin) / rays for corner in box)
    enters, leaves = np.minimum(low, high).max(axis=1), np.maximum(low, high).min(axis=1)
    return ((enters < leaves) & (leaves > 0)).mean()


def expected_shadow(scene, box, point):
    """The part of the light that a box keeps from a point of the floor, the mean of three channels."""
    u, angles = np.random.default_rng(1).random((2, DIRECTIONS)) * [[1], [2 * np.pi]]
    up, sun = np.array([0.0, 0.0, 1.0]), scene["suns"][0]
    toward_sun = -np.array(sun["direction"]) / np.linalg.norm(sun["direction"])
    of_sky = part_that_hits(box, point, directions(up, np.sqrt(1 - u), angles))
    of_sun = part_that_hits(box, point, directions(toward_sun, 1 - u * (1 - np.cos(sun["angle_rad"] / 2)), angles))
    sky = np.pi * np.array(scene["world"]["environment"]["constant"]["radiance"])
    direct = sun["strength"] * np.array(sun["color"]) * toward_sun[2]
    return ((of_sky * sky + of_sun * direct) / (sky + direct)).mean()


@pytest.mark.full
def test_the_corners_of_a_tight_frame_are_as_dark_as_the_shadow_there(pumice, tmp_path):
    np.save(tmp_path / "box.npy", np.ones((12, 12, 12), np.uint8))
    flags = ["--floor", "--background", "white", "--view", "30,25", "--mode", "one-bounce", "--size", f"{WIDTH}x{HEIGHT}", "--spp", 400]
    source = [tmp_path / "box.npy", "--axes", "xyz", "--spacing", "1,1,1", "--backend", "cpu"]
    run(pumice, "render", *source, *flags, "-o", tmp_path / "a.exr", "--save-scene", tmp_path / "a.json").fine()
    scene = json.loads((tmp_path / "a.json").read_text())
    # As it is caught, without the fading of figures.
    scene["film"]["shadow_fade"] = 0
    (tmp_path / "a.json").write_text(json.dumps(scene))
    run(pumice, "render", tmp_path / "a.json", "--mode", "one-bounce", "--spp", 400, "--backend", "cpu", "-o", tmp_path / "b.exr").fine()
    shadow = planes(tmp_path / "b.exr")["A"]
    matrix = np.array(scene["instances"][0]["world_from_index"]).reshape(4, 3)
    corners = np.array([[12.0 * (i >> a & 1) for a in range(3)] for i in range(8)]) @ matrix[:3] + matrix[3]
    box = corners.min(axis=0), corners.max(axis=0)
    x, y, back, position = np.array(scene["camera"]["world_from_camera"]).reshape(4, 3)
    half = np.tan(scene["camera"]["projection"]["perspective"]["fov_rad"] / 2)
    floor = scene["meshes"][0]["world_from_mesh"][11]
    expected, got = [], []
    for column in (2, WIDTH - 3):
        for row in (2, HEIGHT - 3):
            ray = (2 * column + 1 - WIDTH) / WIDTH * half * x + (HEIGHT - 2 * row - 1) / WIDTH * half * y - back
            expected.append(expected_shadow(scene, box, position + (floor - position[2]) / ray[2] * ray))
            got.append(shadow[row - 2 : row + 3, column - 2 : column + 3].mean())
    # 25 pixels of 400 samples: of a shadow of 0.09, sampled as whether a direction hits, the standard error is 0.003. Six of them, and what the
    # shadow changes over five pixels.
    assert np.abs(np.subtract(got, expected)).max() < 0.02, (got, expected)
    # Near the box it is more than a display shows as white, and far from it less.
    assert max(expected) > 0.05 and min(expected) < 0.002


@pytest.mark.parametrize("transform", ["standard", "agx", "filmic"])
def test_the_border_of_a_figure_is_white(pumice, tmp_path, transform):
    """In a frame so tight that the soft shadow reaches every corner: without fading they are darker."""
    np.save(tmp_path / "box.npy", np.ones((12, 12, 12), np.uint8))
    source = [tmp_path / "box.npy", "--axes", "xyz", "--spacing", "1,1,1", "--backend", "cpu", "--view-transform", transform]
    flags = ["--floor", "--background", "white", "--view", "30,25", "--size", f"{WIDTH}x{HEIGHT}", "--spp", 16]
    scene = tmp_path / "a.json"
    run(pumice, "render", *source, *flags, "-o", tmp_path / "a.png", "--save-scene", scene).fine()
    faded = np.asarray(Image.open(tmp_path / "a.png"))
    fields = json.loads(scene.read_text())
    assert fields["film"]["shadow_fade"] > 0
    fields["film"]["shadow_fade"] = 0
    scene.write_text(json.dumps(fields))
    run(pumice, "render", scene, "--spp", 16, "--backend", "cpu", "--view-transform", transform, "-o", tmp_path / "b.png").fine()
    caught = np.asarray(Image.open(tmp_path / "b.png"))
    border = lambda picture: np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])  # noqa: E731
    assert faded.shape == caught.shape == (HEIGHT, WIDTH, 3)
    assert border(faded).min() == 255 and border(caught).min() < 250
    # A tenth of the shorter side is 7.2 pixels: what is 8 pixels or more from the border is the same.
    assert np.array_equal(faded[8:-8, 8:-8], caught[8:-8, 8:-8]) and faded[8:-8, 8:-8].min() < 200
