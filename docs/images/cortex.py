"""Makes cortex.png and cut.png, both of the shipped mouse cortex: thirty-two of its neurites, and the whole block cut open.

    target/venv-bpy/bin/python docs/images/cortex.py [PUMICE]     four CPU minutes

Samples are those of the processor's renderer, so another machine gives the same pictures.
"""

import json
import subprocess
import tempfile
from pathlib import Path

import dendrites

HERE = Path(__file__).resolve().parent
SAMPLES = "128"
# In world units: a box cut out of the block, and a corner cut off by a plane.
CUTS = [
    {"shape": {"box": {"world_from_box": [2.2, 0, 0, 0, 1.2, 0, 0, 0, 1.2, 2.6, -1.0, 0.9]}}},
    {"shape": {"plane": {"point": [-2.6, -1.0, 0.9], "normal": [-1.0, -1.0, 1.2]}}},
]


def render(subject, picture, *flags):
    subprocess.run([dendrites.command(), "render", subject, "-o", picture, "--backend", "cpu", "--no-paths", *flags], check=True)
    print(f"{picture}: {picture.stat().st_size} bytes")


def main():
    with tempfile.TemporaryDirectory() as folder:
        volume, scene = HERE.parents[1] / "data" / "connectomics_32x32x40nm.nrrd", Path(folder) / "scene.json"
        render(volume, HERE / "cortex.png", "--pick", "32", "--spp", SAMPLES)
        render(volume, Path(folder) / "whole.png", "--view", "35,30", "--spp", "1", "--save-scene", scene)
        scene.write_text(json.dumps({**json.loads(scene.read_text()), "cuts": CUTS}))
        render(scene, HERE / "cut.png", "--spp", SAMPLES)


if __name__ == "__main__":
    main()
