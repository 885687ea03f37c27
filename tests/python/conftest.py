"""Fixtures of the Python tests: paths of programs and volumes.

`cargo xtask test` sets the environment variables; by hand: `cargo build -p pumice && pytest tests/python`.
"""

import os
import subprocess
from pathlib import Path

import pytest

from share import pytest_collection_modifyitems, pytest_configure  # noqa: F401

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def pumice():
    """Path of the command: the environment variable PUMICE, or else the dev build."""
    path = Path(os.environ.get("PUMICE", ROOT / "target" / "debug" / "pumice"))
    assert path.is_file(), f"{path} is missing: cargo build -p pumice, or set PUMICE"
    return path


@pytest.fixture(scope="session")
def data():
    """Folder of the volumes that the project ships."""
    return ROOT / "data"


@pytest.fixture(scope="session")
def shared_data():
    """Folder of volumes that may not be shipped. `cargo xtask test` runs tests that use it only if the folder exists."""
    path = Path(os.environ.get("PUMICE_SHARED_DATA", ROOT.parent / "shared" / "data"))
    assert path.is_dir(), f"{path} is missing: set PUMICE_SHARED_DATA to the folder of shared volumes"
    return path


@pytest.fixture(scope="session")
def rust_example():
    """A function that builds an example binary and returns its path: rust_example("compare_raw")."""

    def build(name):
        subprocess.run(["cargo", "build", "--quiet", "--workspace", "--example", name], cwd=ROOT, check=True)
        target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
        return target / "debug" / "examples" / name

    return build


@pytest.fixture(scope="session")
def exported_scenes(rust_example, tmp_path_factory):
    """A folder with what the examples `write_scenes` and `write_mesh_scenes` write."""
    folder = tmp_path_factory.mktemp("exported")
    for name in ("write_scenes", "write_mesh_scenes"):
        subprocess.run([rust_example(name), folder], check=True)
    return folder
