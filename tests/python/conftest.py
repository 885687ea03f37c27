"""What the Python tests share: where the programs and the volumes are.

`cargo xtask test` sets the environment; by hand: `cargo build -p pumice && pytest tests/python`.
"""

import os
import subprocess
from pathlib import Path

import pytest

from share import pytest_collection_modifyitems, pytest_configure  # noqa: F401

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def pumice():
    """Path of the command: environment variable PUMICE, else the dev build."""
    path = Path(os.environ.get("PUMICE", ROOT / "target" / "debug" / "pumice"))
    assert path.is_file(), f"{path} is missing: cargo build -p pumice, or set PUMICE"
    return path


@pytest.fixture(scope="session")
def data():
    """The volumes that the project ships."""
    return ROOT / "data"


@pytest.fixture(scope="session")
def shared_data():
    """Volumes that may not be shipped. The runner starts tests that ask for it only where the folder exists."""
    path = Path(os.environ.get("PUMICE_SHARED_DATA", ROOT.parent / "shared" / "data"))
    assert path.is_dir(), f"{path} is missing: set PUMICE_SHARED_DATA to the folder of shared volumes"
    return path


@pytest.fixture(scope="session")
def rust_example():
    """Builds an example binary and gives its path: rust_example("pumice-picture", "compare_raw")."""

    def build(package, name):
        subprocess.run(["cargo", "build", "--quiet", "--package", package, "--example", name], cwd=ROOT, check=True)
        target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
        return target / "debug" / "examples" / name

    return build
