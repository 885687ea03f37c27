"""Reads and writes volumes with pumice-formats, for comparison with other people's packages."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np


class Formats:
    """Runs the two example programs of pumice-formats."""

    def __init__(self, dump, convert):
        self.dump, self.convert = str(dump), str(convert)

    def read(self, path, folder, *options):
        """(header, voxels as u64 indexed [x, y, z]) of a file."""
        out = Path(folder) / "voxels.bin"
        done = subprocess.run([self.dump, str(path), str(out), *options], capture_output=True, text=True)
        assert done.returncode == 0, f"{path}: {done.stderr}"
        header = json.loads(done.stdout)
        voxels = np.fromfile(out, "<u8").reshape(header["dims"], order="F")
        assert header["voxels"] == voxels.size
        return header, voxels

    def refuse(self, path, *options):
        """Asserts that the file is refused; returns the one line of the error."""
        done = subprocess.run([self.dump, str(path), "-", *options], capture_output=True, text=True)
        assert done.returncode == 2 and "panicked" not in done.stderr, done
        assert len(done.stderr.splitlines()) == 1, done.stderr
        return done.stderr

    def write(self, source, target):
        done = subprocess.run([self.convert, str(source), str(target)], capture_output=True, text=True)
        assert done.returncode == 0, f"{target}: {done.stderr}"


def build(rust_example):
    """The programs named by PUMICE_DUMP and PUMICE_CONVERT; builds those that are not set."""
    return Formats(
        os.environ.get("PUMICE_DUMP") or rust_example("dump_volume"),
        os.environ.get("PUMICE_CONVERT") or rust_example("convert_volume"),
    )


def affine(header):
    """The 4 × 4 matrix from voxel indices, at the centres of voxels, to the file's world."""
    return np.vstack([header["world_from_centre"], [0, 0, 0, 1]])


def pattern(shape, dtype, seed=0):
    """Random labels up to the largest that the type can hold exactly (2⁵³ for doubles, 2²⁴ for floats)."""
    random = np.random.default_rng(seed)
    dtype = np.dtype(dtype)
    top = {"f4": 2**24, "f8": 2**53}.get(dtype.str[1:]) or int(np.iinfo(dtype).max)
    labels = random.integers(0, top, shape, dtype=np.uint64, endpoint=True)
    labels[random.random(shape) < 0.3] = 0
    labels.flat[0] = top
    return labels.astype(dtype)
