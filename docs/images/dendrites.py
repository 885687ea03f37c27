"""The scene of forms.png and final_shot.png: two dendrites with spines, side by side in a part of the shipped mouse cortex."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO

ROOT = Path(__file__).resolve().parents[2]
LABELS = "59242172,32068811"
# In voxels: the lowest corner, and the highest.
REGION = [100, 130, 0, 230, 230, 121]
# The camera stands this way from the middle of the region, and sees as much as its diagonal, shifted by parts of the picture's width.
TOWARDS_CAMERA = np.array([0.5, -0.75, 0.45])
SHIFT = [0.04, 0.025]


def command():
    """The command `pumice`: the first argument, or the dev build."""
    return Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "target" / "debug" / "pumice"


def scene(folder, width, height):
    """The file of the scene, for pictures of this size: the command's own materials and sun, and a grey sky."""
    path = folder / "scene.json"
    drawn = ["--labels", LABELS, "--size", f"{width}x{height}", "--spp", "1", "--backend", "cpu"]
    volume = ROOT / "data" / "connectomics_32x32x40nm.nrrd"
    subprocess.run([command(), "render", volume, *drawn, "-o", folder / "p.png", "--save-scene", path], check=True)
    scene = json.loads(path.read_text())
    world_from_index = np.array(scene["instances"][0]["world_from_index"]).reshape(4, 3)
    low, high = np.array(REGION[:3]), np.array(REGION[3:])
    middle = (low + high) / 2 @ world_from_index[:3] + world_from_index[3]
    diagonal = np.linalg.norm((high - low) @ world_from_index[:3])
    z = TOWARDS_CAMERA / np.linalg.norm(TOWARDS_CAMERA)
    x = np.cross([0, 0, 1], z)
    x /= np.linalg.norm(x)
    pose = np.concatenate([x, np.cross(z, x), z, middle + 4 * diagonal * z])
    projection = {"perspective": {"fov_rad": 2 * np.arctan(1 / 8)}}
    scene["camera"] |= {"world_from_camera": pose.tolist(), "projection": projection, "shift": SHIFT}
    scene["world"] = {"environment": {"constant": {"radiance": [0.55] * 3}}}
    path.write_text(json.dumps(scene))
    return path


def write_png(path, tiles):
    """Writes pictures of one height, sRGB from 0 to 1, beside each other."""
    pixels = (np.concatenate(tiles, axis=1).clip(0, 1) * 255 + 0.5).astype("u1")
    spec = OpenImageIO.ImageSpec(pixels.shape[1], pixels.shape[0], 3, OpenImageIO.UINT8)
    spec.attribute("png:compressionLevel", 9)
    out = OpenImageIO.ImageOutput.create(str(path))
    assert out.open(str(path), spec) and out.write_image(pixels) and out.close(), OpenImageIO.geterror()
    print(f"{path}: {path.stat().st_size} bytes")
