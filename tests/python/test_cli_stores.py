"""Stores of large volumes in the command: what is said and chosen, bounded memory, and what is refused."""

import json
import os

import numpy as np
import pytest
import zarr
from command import run


def volume(folder, shape, chunks, shards=None, write=None):
    """A Zarr array of u32 with these chunks, of which `write` fills some."""
    array = zarr.create_array(folder, shape=shape, dtype="u4", chunks=chunks, shards=shards, dimension_names=["z", "y", "x"])
    if write:
        write(array)
    return folder


def test_info_says_levels_and_data_sets(pumice, tmp_path):
    group = zarr.open_group(tmp_path / "a.zarr", mode="w")
    for name in ("cells", "nuclei"):
        group.create_array(name, data=np.ones((4, 5, 6), "u2"))
    done = run(pumice, "info", tmp_path / "a.zarr")
    assert "the group has 2 data sets that may be the labels; choose one with --dataset (cells, nuclei)" in done.fine()
    said = json.loads(run(pumice, "info", tmp_path / "a.zarr", "--json").fine())
    assert [(c["keyword"], [v["value"] for v in c["values"]]) for c in said["choices"]][0] == ("dataset", ["cells", "nuclei"])
    assert "choose one with --dataset" in run(pumice, "compress", tmp_path / "a.zarr", "-o", tmp_path / "a.pumice").refused()
    done = run(pumice, "compress", tmp_path / "a.zarr", "--dataset", "cells", "-o", tmp_path / "a.pumice")
    done.fine()
    assert run(pumice, "verify", tmp_path / "a.pumice", tmp_path / "a.zarr", "--dataset", "cells").code == 0


def test_the_file_that_describes_a_store_stands_for_its_folder(pumice, tmp_path):
    volume(tmp_path / "a.zarr", (4, 5, 6), (2, 2, 2), write=lambda a: a.__setitem__(slice(None), 3))
    whole = json.loads(run(pumice, "info", tmp_path / "a.zarr", "--json").fine())
    assert json.loads(run(pumice, "info", tmp_path / "a.zarr" / "zarr.json", "--json").fine()) == whole | {"warnings": whole["warnings"]}


@pytest.mark.parametrize("shards", [None, (64, 64, 64)])
def test_memory_does_not_grow_with_the_volume(pumice, tmp_path, shards):
    """256 times as many voxels, most of them absent: the command takes no more than some MB more. The whole array would be 17 GB."""
    some = lambda array: array.__setitem__((slice(0, 64),) * 3, np.arange(64**3, dtype="u4").reshape((64,) * 3) // 512)  # noqa: E731
    small = volume(tmp_path / "small.zarr", (64, 64, 64), (32, 32, 32), shards, some)
    large = volume(tmp_path / "large.zarr", (1024, 2048, 2048), (32, 32, 32) if shards else (64, 64, 64), shards, some)
    peaks = []
    for source in (small, large):
        done = run(pumice, "compress", source, "-o", source.with_suffix(".pumice"), "--threads", "1", exact_peak=True)
        done.fine()
        peaks.append(done.peak_rss_bytes)
    assert peaks[1] - peaks[0] < 24 << 20, peaks
    assert any("chunks are not there and are taken as 0" in line for line in done.warnings)
    info = [json.loads(run(pumice, "info", s.with_suffix(".pumice"), "--json").fine()) for s in (small, large)]
    assert info[0]["labels"] == info[1]["labels"] == 511 and info[1]["dims"] == [2048, 2048, 1024]


@pytest.mark.full
def test_a_million_chunk_files_take_little_memory(pumice, tmp_path):
    """10⁶ files of one voxel each, as links to one."""
    volume(tmp_path / "a.zarr", (100, 100, 100), (1, 1, 1), write=lambda a: a.__setitem__((0, 0, 0), 5))
    one = tmp_path / "a.zarr" / "c" / "0" / "0" / "0"
    for z in range(100):
        for y in range(100):
            folder = tmp_path / "a.zarr" / "c" / str(z) / str(y)
            folder.mkdir(parents=True, exist_ok=True)
            for x in range(100):
                if (z, y, x) != (0, 0, 0):
                    # A file has at most 65,000 links on some systems.
                    if (z * 10_000 + y * 100 + x) % 30_000 == 0:
                        (folder / str(x)).write_bytes(one.read_bytes())
                        one = folder / str(x)
                    else:
                        os.link(one, folder / str(x))
    done = run(pumice, "compress", tmp_path / "a.zarr", "-o", tmp_path / "a.pumice", exact_peak=True)
    done.fine()
    assert done.peak_rss_bytes < 300 << 20
    assert json.loads(run(pumice, "info", tmp_path / "a.pumice", "--json").fine())["labels"] == 1


def test_no_permission_is_one_line(pumice, tmp_path):
    volume(tmp_path / "a.zarr", (4, 4, 4), (4, 4, 4), write=lambda a: a.__setitem__(slice(None), 3))
    chunk = tmp_path / "a.zarr" / "c" / "0" / "0" / "0"
    chunk.chmod(0)
    if os.access(chunk, os.R_OK):
        # Nothing keeps the system's administrator from reading.
        chunk.unlink()
        chunk.mkdir()
    line = run(pumice, "compress", tmp_path / "a.zarr", "-o", tmp_path / "a.pumice").refused()
    assert "chunk (0, 0, 0) cannot be read" in line and not (tmp_path / "a.pumice").exists()


def test_options_that_have_no_effect_are_refused(pumice, tmp_path):
    volume(tmp_path / "a.zarr", (4, 4, 4), (4, 4, 4), write=lambda a: a.__setitem__(slice(None), 3))
    np.save(tmp_path / "a.npy", np.ones((3, 3, 3), "u1"))
    for name, options in [
        ("a.zarr", ["--scale", "0"]),
        ("a.zarr", ["--label", "x"]),
        ("a.zarr", ["--dataset", "x"]),
        ("a.zarr", ["--axes", "xyz"]),
        ("a.npy", ["--scale", "0"]),
        ("a.npy", ["--label", "x"]),
        ("a.npy", ["--dataset", "x"]),
        ("a.npy", ["--missing-chunks", "fill"]),
    ]:
        assert f"{options[0]}" in run(pumice, "info", tmp_path / name, *options).refused()
    run(pumice, "compress", tmp_path / "a.zarr", "-o", tmp_path / "a.pumice").fine()
    for options in [["--scale", "0"], ["--roi", ":,:,:"], ["--relabel", tmp_path / "a.npy"]]:
        assert options[0] in run(pumice, "info", tmp_path / "a.pumice", *options).refused()
    for options in [["--scale", "a"], ["--roi", "1:2"], ["--roi", "2:1,:,:"], ["--missing-chunks", "skip"]]:
        assert run(pumice, "info", tmp_path / "a.zarr", *options).code == 2
