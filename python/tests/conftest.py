"""Fixtures with volumes. The tests import the installed module."""

import os
import sys
from pathlib import Path

import numpy as np
import pumice
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/python"))
from share import pytest_collection_modifyitems, pytest_configure  # noqa: E402, F401


@pytest.fixture
def command():
    """Path of the command `pumice` of the same build."""
    path = Path(os.environ.get("PUMICE", ROOT / "target/debug/pumice"))
    assert path.exists(), f"{path}: build it first (cargo build -p pumice)"
    return path


@pytest.fixture(scope="session")
def labels():
    """An array of blobs: 40 × 30 × 50 voxels, 17 labels with large ids, separated by gaps."""
    rng = np.random.default_rng(7)
    shape = (40, 30, 50)
    centres = rng.uniform(0, 1, (17, 3)) * shape
    ids = np.sort(rng.choice(np.arange(1, 250), 17, replace=False)).astype(np.uint8)
    grid = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in shape), indexing="ij"), axis=-1)
    distances = np.linalg.norm(grid[..., None, :] - centres, axis=-1)
    nearest = distances.argmin(axis=-1)
    return np.where(distances.min(axis=-1) < 9, ids[nearest], 0).astype(np.uint8)


@pytest.fixture(scope="session")
def volume(labels):
    return pumice.compress(labels, spacing=(1, 1, 2.5), unit="um")


@pytest.fixture(scope="session")
def cortex():
    """Path of a shipped volume that takes a second to compress."""
    return ROOT / "data/connectomics_32x32x40nm.nrrd"


@pytest.fixture(scope="session")
def ct():
    """A small shipped volume."""
    return pumice.open(ROOT / "data/slicer_Segmentation.seg.nrrd")
