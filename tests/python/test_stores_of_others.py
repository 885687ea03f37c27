"""Stores that cloud-volume and ome-zarr write are read, and those that Pumice writes are read by them. They have an environment of their own, because
they take 600 MB."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command import run

HERE = Path(__file__).resolve().parent
NEEDED = HERE / "requirements-stores.txt"

pytestmark = pytest.mark.full


@pytest.fixture(scope="module")
def others():
    """A function that runs one of other_stores.py in the environment, and returns what it says."""
    place = HERE.parents[1] / "target/venv-stores"
    python, made = place / "bin/python", place / "made-of.txt"
    if not made.exists() or made.read_text() != NEEDED.read_text():
        subprocess.run([sys.executable, "-m", "venv", "--clear", place], check=True)
        subprocess.run([python, "-m", "pip", "install", "-q", "--no-deps", "-r", NEEDED], check=True)
        made.write_text(NEEDED.read_text())

    def call(function, *arguments):
        said = subprocess.run([python, HERE / "other_stores.py", function, *map(str, arguments)], capture_output=True, text=True, check=False)
        assert said.returncode == 0, said.stderr
        return said.stdout.strip()

    return call


@pytest.fixture(scope="module")
def volume(pumice, tmp_path_factory):
    """The path of a .pumice file with labels, and the labels, as a .npy file too."""
    folder = tmp_path_factory.mktemp("volume")
    random = np.random.default_rng(0)
    labels = np.kron(random.integers(0, 9, (12, 9, 7)), np.ones((6, 5, 4), int)).astype(np.uint64)
    labels[labels == 8] = 2**63 + 5
    labels[40:, :, :] = 0
    np.save(folder / "a.npy", labels)
    run(pumice, "compress", folder / "a.npy", "--axes", "xyz", "--spacing", "16,16,40", "-o", folder / "a.pumice").fine()
    return folder / "a.pumice", labels


def same(path, labels):
    """Whether an array has these labels, and not those of another place."""
    found = np.load(path)
    assert found.shape == labels.shape and not np.array_equal(found, np.roll(labels, 1, 0))
    return np.array_equal(found, labels)


@pytest.mark.parametrize("options", [[], ["--encoding", "raw", "--chunk", "16"], ["--gzip", "--chunk", "24"], ["--gzip", "--encoding", "raw"]], ids=str)
def test_cloud_volume_reads_what_is_written(pumice, others, volume, tmp_path, options):
    source, labels = volume
    run(pumice, "decompress", source, "-o", tmp_path / "a", "--format", "precomputed", *options).fine()
    assert others("read_precomputed", tmp_path / "a", tmp_path / "b.npy") == "[16, 16, 40] [0, 0, 0] segmentation"
    assert same(tmp_path / "b.npy", labels)


@pytest.mark.parametrize("compression", ["none", "gzip", "br", "zstd"])
@pytest.mark.parametrize("encoding", ["raw", "compressed_segmentation", "compresso"])
def test_what_cloud_volume_writes_is_read(pumice, others, volume, tmp_path, encoding, compression):
    source, _ = volume
    others("write_precomputed", source.with_suffix(".npy"), tmp_path / "a", encoding, compression)
    run(pumice, "verify", source, tmp_path / "a").fine()
    header = json.loads(run(pumice, "info", tmp_path / "a", "--json").fine())
    assert [row[3] for row in header["world_from_centre"][:3]] == [10 * 8 + 4, 20 * 8 + 4, 30 * 40 + 20] and header["unit"] == "nm"
    # Control: another volume is told apart.
    changed = np.load(source.with_suffix(".npy"))
    changed[3, 4, 5] += 1
    np.save(tmp_path / "b.npy", changed)
    others("write_precomputed", tmp_path / "b.npy", tmp_path / "b", encoding, compression)
    assert run(pumice, "verify", source, tmp_path / "b").code == 1


@pytest.mark.parametrize("version", ["0.4", "0.5"])
def test_ome_zarr_reads_what_is_written(pumice, others, volume, tmp_path, version):
    source, labels = volume
    run(pumice, "decompress", source, "-o", tmp_path / "a.ome.zarr", "--ome-version", version).fine()
    assert others("read_ome", tmp_path / "a.ome.zarr", tmp_path / "b.npy").startswith("['z', 'y', 'x']")
    assert same(tmp_path / "b.npy", labels)


@pytest.mark.parametrize("version", ["0.4", "0.5"])
def test_what_ome_zarr_writes_is_read(pumice, others, volume, tmp_path, version):
    source, _ = volume
    others("write_ome", source.with_suffix(".npy"), tmp_path / "a.zarr", version)
    for path in (tmp_path / "a.zarr", tmp_path / "a.zarr" / "labels" / "cells"):
        run(pumice, "verify", source, path).fine()
    run(pumice, "compress", tmp_path / "a.zarr", "-o", tmp_path / "a.pumice").fine()
    rows = run(pumice, "info", tmp_path / "a.pumice", "--labels", "--csv").fine().splitlines()
    assert [row.split(",")[0] for row in rows if "#ff0033" in row] == ["7"]
