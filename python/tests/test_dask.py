"""Compression on the workers of a Dask cluster: the bytes of the command, also where a worker is killed, and nothing is made twice."""

import os
import shutil
import signal
import subprocess
import time

import dask.array
import numpy as np
import pumice
import pumice.dask
import pytest
import zarr
from share import one_of_today

SHAPE = (2060, 1030, 2)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A store of 3 × 2 × 1 chunks."""
    x, y, z = np.ogrid[: SHAPE[0], : SHAPE[1], : SHAPE[2]]
    path = tmp_path_factory.mktemp("store") / "a.zarr"
    array = zarr.create_array(path, shape=SHAPE, dtype="u4", chunks=(500, 300, 2))
    array[:] = ((x // 37 + y // 19 + z) % 9 * 1001).astype(np.uint32)
    return path


@pytest.fixture(scope="module")
def whole(stored):
    command = os.environ.get("PUMICE", os.path.join(os.path.dirname(__file__), "../../target/debug/pumice"))
    out = stored.parent / "whole.pumice"
    subprocess.run([command, "compress", stored, "--axes", "xyz", "-o", out], check=True)
    return out.read_bytes()


def test_a_store_and_an_array_give_the_bytes_of_the_command(stored, whole, tmp_path):
    out = tmp_path / "file.pumice"
    assert pumice.dask.compress(stored, out, axes="xyz") == str(out)
    assert out.read_bytes() == whole
    array = dask.array.from_zarr(str(stored))
    # A file lies elsewhere in the world than an array, so the oracle is the array, compressed at once.
    pumice.compress(np.asarray(zarr.open_array(stored)[:])).save(stored.parent / "array.pumice")
    expected = (stored.parent / "array.pumice").read_bytes()
    for axes, turned in (("xyz", array), ("zyx", array.T)):
        out = tmp_path / f"{axes}.pumice"
        delayed = pumice.dask.compress(turned, out, axes=axes, compute=False)
        assert not out.exists()
        delayed.compute(scheduler="synchronous")
        assert out.read_bytes() == expected
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file.pumice", "xyz.pumice", "zyx.pumice"]


def test_parts_that_are_there_are_not_made_again(stored, whole, tmp_path):
    out, parts = tmp_path / "out.pumice", tmp_path / "out.pumice.parts"
    parts.mkdir()
    pumice.compress_part(stored, parts / "chunk-000003.part", 3, axes="xyz")
    # The negative control: what is no part at all is taken for one, and the merge refuses it by name.
    (parts / "chunk-000002.part").write_bytes(b"no part")
    with pytest.raises(pumice.InputError, match=r"chunk-000002\.part"):
        pumice.dask.compress(stored, out, axes="xyz")
    (parts / "chunk-000002.part").unlink()
    kept = {path.name: path.stat().st_mtime_ns for path in parts.iterdir()}
    assert len(kept) == 5
    assert not out.exists()
    pumice.dask.compress(stored, out, axes="xyz")
    assert out.read_bytes() == whole and not parts.exists()


def test_merging_is_a_tree(stored, whole, tmp_path):
    """Six chunks, two by two: 0–3 and 4–5, of which 0–1 and 2–3. What is there already is not made again, at each height."""
    out, parts = tmp_path / "out.pumice", tmp_path / "out.pumice.parts"
    tree = pumice.dask.compress(stored, out, axes="xyz", fan_in=2, compute=False)
    names = sorted(key.rsplit("-", 1)[0] for key in tree.dask)
    assert names.count("pumice-part") == 6 and names.count("pumice-join") == 4 and names.count("pumice-merge") == 1
    flat = pumice.dask.compress(stored, out, axes="xyz", compute=False)
    assert sum(key.startswith("pumice-join") for key in flat.dask) == 0
    tree.compute(scheduler="synchronous")
    assert out.read_bytes() == whole and not parts.exists()
    out.unlink()

    # Interrupted when one of the joined parts was there, and one that it replaces was not removed yet.
    parts.mkdir()
    for number in (2, 3):
        pumice.compress_part(stored, parts / f"chunk-{number:06}.part", number, axes="xyz")
    pumice.merge_into_part([parts / "chunk-000003.part", parts / "chunk-000002.part"], parts / "chunks-000002-000003.part")
    (parts / "chunk-000002.part").unlink()
    rest = pumice.dask.compress(stored, out, axes="xyz", fan_in=2, compute=False)
    names = sorted(key.rsplit("-", 1)[0] for key in rest.dask)
    assert names.count("pumice-part") == 4 and names.count("pumice-join") == 3
    rest.compute(scheduler="synchronous")
    assert out.read_bytes() == whole and not parts.exists()
    for wrong in (1, 0, -3, "many"):
        with pytest.raises(pumice.InputError, match="fan_in"):
            pumice.dask.compress(stored, out, axes="xyz", fan_in=wrong)


def test_a_part_that_was_joined_is_not_made_again(stored, whole, tmp_path):
    """A worker that dies takes with it what its tasks returned: they run again, when their parts are gone but the joined one is there."""
    source, out, parts = tmp_path / "a.zarr", tmp_path / "out.pumice", tmp_path / "out.pumice.parts"
    shutil.copytree(stored, source)
    tree = pumice.dask.compress(source, out, axes="xyz", fan_in=2, compute=False)
    pumice.compress_part(source, parts / "chunks-000000-000003.part", "0-3", axes="xyz")
    pumice.compress_part(source, parts / "chunks-000004-000005.part", "4-5", axes="xyz")
    # The negative control: what is not there is made, for which the source is needed.
    other = pumice.dask.compress(source, tmp_path / "other.pumice", axes="xyz", fan_in=2, compute=False)
    shutil.rmtree(source)
    with pytest.raises(pumice.PumiceError, match=r"a\.zarr"):
        other.compute(scheduler="synchronous")
    tree.compute(scheduler="synchronous")
    assert out.read_bytes() == whole


@pytest.mark.parametrize("fan_in", one_of_today([2, 16]))
def test_a_worker_is_killed(stored, whole, tmp_path, fan_in):
    import distributed

    out = tmp_path / "out.pumice"
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        merged = client.compute(pumice.dask.compress(stored, out, axes="xyz", fan_in=fan_in, compute=False))
        until = time.monotonic() + 60
        while not list((tmp_path / "out.pumice.parts").glob("*.part")) and time.monotonic() < until:
            time.sleep(0.01)
        (pid, *_) = client.run(os.getpid).values()
        os.kill(pid, signal.SIGKILL)
        assert merged.result(timeout=120) == str(out)
    assert out.read_bytes() == whole
