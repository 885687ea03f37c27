# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures the peak memory of Blender that imports a volume and renders it by F12, without a Memory Limit and within one. It is no test and is collected
only by name:

    PUMICE_COPIES=4,4,2 PUMICE_LIMITS=0,256,64 python -m pytest -s blender-addon/tests/measure_memory.py

with the environment of the tests (conftest.py). The volume is so many copies of the cortex in data/, mirrored so that bodies go on, each with labels of
its own. Each render has a process of its own:

    enable the extension ─► peak of Blender alone ─► set the limit ─► import ─► F12 ─► peak of all, hash of the pixels
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
SIZE = (480, 270)
SPP = 8


class Copies:
    """An array of mirrored copies of another, made where it is read; `pumice.compress_file` reads it slab by slab."""

    def __init__(self, array, counts):
        self.array, self.counts = array, counts
        self.shape = tuple(n * count for n, count in zip(array.shape, counts))
        self.dtype = np.dtype(np.uint32)
        self.ndim = 3

    def __getitem__(self, chosen):
        chosen = chosen if isinstance(chosen, tuple) else (chosen,)
        chosen = [*chosen, *[slice(None)] * (3 - len(chosen))]
        at = [np.arange(n)[one] for n, one in zip(self.shape, chosen)]
        copy = [a // n for a, n in zip(at, self.array.shape)]
        within = [np.where(c % 2, n - 1 - a % n, a % n) for a, c, n in zip(at, copy, self.array.shape)]
        labels = self.array[np.ix_(*within)].astype(np.uint32)
        number = (copy[0][:, None, None] * self.counts[1] + copy[1][:, None]) * self.counts[2] + copy[2]
        step = int(self.array.max()) + 1
        return np.where(labels > 0, labels + np.uint32(step) * number.astype(np.uint32), 0).astype(np.uint32)


def made(path, counts, region=None):
    """Compresses copies of the cortex, or of a part of it with so many voxels along each axis, in a process of its own."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import numpy as np, pumice, measure_memory as m;"
        "whole = pumice.open(sys.argv[2]).decode();"
        "region = eval(sys.argv[5]); whole = whole[tuple(map(slice, region))] if region else whole;"
        "pumice.compress_file(m.Copies(whole, eval(sys.argv[4])), sys.argv[3], level='fast')"
    )
    cortex = ROOT / "data" / "connectomics_32x32x40nm.nrrd"
    # The extension brings the module `pumice`, and its folder is on this process's path.
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", code, Path(__file__).parent, cortex, path, str(counts), str(region)]
    subprocess.run(command, check=True, env=paths)
    return path


def measured(path, limit_mib, threads=None):
    """Bytes at the peak of Blender alone and of all, and what was drawn, of a render in a process of its own."""
    command = [sys.executable, __file__, str(path), str(limit_mib)]
    some = {} if threads is None else {"RAYON_NUM_THREADS": str(threads)}
    done = subprocess.run(command, check=True, capture_output=True, text=True, env={**os.environ, **some})
    return json.loads(done.stdout.splitlines()[-1])


def _peak():
    # (The maximum of `getrusage` counts what the process was before it became this program.)
    with open("/proc/self/status") as file:
        return next(1024 * int(line.split()[1]) for line in file if line.startswith("VmHWM"))


def _render(path, limit_mib):
    """What the process of `measured` does; the extension is installed where BLENDER_USER_RESOURCES says."""
    import hashlib
    import time

    import addon_utils
    import bpy

    name = "bl_ext.user_default.pumice"
    addon_utils.enable(name, default_set=True, persistent=True)
    registry = sys.modules[f"{name}.registry"]
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    alone, start = _peak(), time.monotonic()
    bpy.context.preferences.addons[name].preferences.memory_limit = limit_mib
    assert bpy.ops.pumice.import_volume(filepath=path) == {"FINISHED"}
    opened, scene = time.monotonic(), bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100
    scene.pumice.samples, scene.pumice.seed, scene.pumice.backend = SPP, 7, "CPU"
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(Path(bpy.app.tempdir) / "picture.exr")
    bpy.ops.render.render(write_still=True)
    import OpenImageIO

    pixels = OpenImageIO.ImageInput.open(scene.render.filepath).read_image("float")
    [entry] = registry._entries.values()
    pages = None if entry.volume.memory is None else vars(entry.volume.memory.figures)
    print(
        json.dumps(
            {
                "alone": alone,
                "peak": _peak(),
                "import_seconds": round(opened - start, 2),
                "render_seconds": round(time.monotonic() - opened, 2),
                "pixels": hashlib.blake2b(np.ascontiguousarray(pixels).tobytes(), digest_size=16).hexdigest(),
                "voxels": list(entry.volume.dims),
                "pages": pages,
            }
        ),
        flush=True,
    )
    os._exit(0)


def test_measure(extension, tmp_path):
    copies = tuple(int(n) for n in os.environ.get("PUMICE_COPIES", "2,2,1").split(","))
    kept = os.environ.get("PUMICE_MEASURED_VOLUME")
    path = Path(kept) if kept and Path(kept).exists() else made(Path(kept) if kept else tmp_path / "copies.pumice", copies)
    print(f"{path.stat().st_size} bytes on disk")
    for limit in os.environ.get("PUMICE_LIMITS", "0,64").split(","):
        print(limit, json.dumps(measured(path, int(limit))))


if __name__ == "__main__":
    for brought in Path(__import__("bpy").utils.resource_path("LOCAL")).glob("python/lib/python3*/site-packages"):
        sys.path.append(str(brought))
    _render(sys.argv[1], int(sys.argv[2]))
