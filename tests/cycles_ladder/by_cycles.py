"""Renders a rung of the ladder with Cycles: a job for `scene_in_cycles.py`, run by a Python that has Blender (`bpy`)."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np

from rung import laid_over_white

SCRIPT = Path(__file__).resolve().parents[2] / "session/src/cycles/scene_in_cycles.py"


def seed_of(number):
    """Seeds that are far apart, because Cycles' pictures of neighbouring seeds are not independent."""
    return number * 2_654_435_761 % 2_147_483_647


def pictures(python, rung, first, seeds, *, spp=None, scene=None, **options):
    """(pictures, report): pictures (seeds, height, width, 3) with the seeds number `first` and following."""
    folder = rung.folder
    job_file, out, report = (folder / f"{rung.name}-{n}" for n in ("job.json", "cycles.npy", "report.json"))
    renders = [{"seed": seed_of(1 + first + i), "spp": spp or rung.spp} for i in range(seeds)]
    # Not Sobol-Burley, a developer option: with a sun and a sky it converges to another picture than the sum of the two.
    job = rung.job(out, report, renders, scene, **{"pattern": "TABULATED_SOBOL", **options})
    job_file.write_text(json.dumps(job))
    done = subprocess.run([python, SCRIPT, job_file], capture_output=True, text=True, env=surroundings(python))
    if done.returncode != 0 or not report.exists():
        raise RuntimeError(f"{SCRIPT.name} failed with {done.returncode}:\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}")
    drawn, told = np.load(out).astype(np.float64), json.loads(report.read_text())
    report.unlink()
    if drawn.shape[-1] > 3:
        drawn = laid_over_white(drawn[..., :3], drawn[..., 3], drawn[..., 4:] if drawn.shape[-1] > 4 else None)
    return drawn, told


def surroundings(python):
    """Environment variables of the interpreter, with the system libraries that `cargo xtask test` unpacked on its library path."""
    libraries = Path(python).absolute().parents[2] / "libraries/lib"
    paths = [str(libraries), *filter(None, [os.environ.get("LD_LIBRARY_PATH")])]
    return {**os.environ, "LD_LIBRARY_PATH": ":".join(paths)} if libraries.is_dir() else dict(os.environ)
