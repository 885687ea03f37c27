"""Parts of a time series through the command: merged, they are the bytes of one run; what is interrupted goes on. Negative controls: parts of
other series, of other time steps and of other numbers of them; sources that changed."""

import json
import os
import random
import signal
import time

import decode_pumice
import nibabel
import numpy as np
import pytest
import zarr
from command import run
from test_cli_parts import goes_on

# Chunks 3 × 1 × 1.
STEPS, SHAPE = 4, (2060, 8, 3)


def volume(step):
    """Ids a[x, y, z]: a pattern that stands still, a block that moves across a face between chunks; nothing at step 2."""
    x, y, z = np.ogrid[: SHAPE[0], : SHAPE[1], : SHAPE[2]]
    ids = ((x // 41 + y // 3 + z) % 7).astype(np.uint16)
    ids[1000 + 10 * step : 1030 + 10 * step, 2:6] = 60_000 + step
    return ids if step != 2 else np.zeros_like(ids)


SERIES = np.stack([volume(step) for step in range(STEPS)])


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """The series in a store, in one file, and in files of which two are there for a mix of ways to read them."""
    folder = tmp_path_factory.mktemp("series")
    group = zarr.open_group(folder / "a.zarr", mode="w", zarr_format=2)
    group.create_array("0", shape=(STEPS, *SHAPE[::-1]), chunks=(1, 3, 8, 500), dtype="u2")[...] = SERIES.transpose(0, 3, 2, 1)
    axes = [{"name": "t", "type": "time"}] + [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    level = {"path": "0", "coordinateTransformations": [{"type": "scale", "scale": [1, 1, 1, 1]}]}
    group.attrs["multiscales"] = [{"version": "0.4", "axes": axes, "datasets": [level]}]
    for step in range(STEPS):
        np.save(folder / f"frame_{step + 8}.npy", SERIES[step])
    nibabel.save(nibabel.Nifti1Image(SERIES.transpose(1, 2, 3, 0), np.eye(4)), folder / "a.nii")
    return {
        "store": [folder / "a.zarr", "--time-steps", "all"],
        "file": [folder / "a.nii", "--time-steps", "1-3"],
        "pattern": [folder / "frame_{t}.npy", "--axes", "xyz"],
    }


@pytest.fixture(scope="module")
def whole(pumice, sources, tmp_path_factory):
    """The bytes of the file that one run makes; the decoder that was written from the docs finds every voxel in it."""
    folder = tmp_path_factory.mktemp("whole")

    def of(kind, level="default"):
        out = folder / f"{kind}-{level}.pumice"
        if not out.exists():
            run(pumice, "compress", *sources[kind], "--level", level, "-o", out).fine()
            if level == "default":
                for step, expected in enumerate(SERIES[1:] if kind == "file" else SERIES):
                    assert (decode_pumice.decode(out.read_bytes(), step)[0] == expected).all()
        return out.read_bytes()

    return of


@pytest.mark.parametrize("kind", ["store", "file", "pattern"])
def test_merged_parts_are_the_whole_series(pumice, sources, whole, tmp_path, kind):
    parts = []
    for chunks in ("0,2", "1"):
        parts.append(tmp_path / f"{chunks}.part")
        said = run(pumice, "compress", *sources[kind], "--chunks", chunks, "-o", parts[-1]).fine()
        assert f"{3 if kind == 'file' else 4} time steps, chunks {chunks} of 3" in said
    for level in ("default", "fast", "small") if kind == "store" else ("default",):
        out = tmp_path / f"{level}.pumice"
        report = json.loads(run(pumice, "merge", *parts[::-1], "--level", level, "-o", out, "--json", "-").fine())
        assert out.read_bytes() == whole(kind, level)
        assert report["time_steps"] == (3 if kind == "file" else 4)
    assert "pumice merge" in run(pumice, "info", parts[0]).refused()


def test_parts_of_other_series_are_refused_by_name(pumice, sources, tmp_path):
    folder = sources["store"][0].parent
    one, out = tmp_path / "one", tmp_path / "out.pumice"
    run(pumice, "compress", *sources["store"], "--chunks", "0", "-o", one).fine()

    def refused(name, *args):
        run(pumice, "compress", *args, "--chunks", "1-2", "-o", tmp_path / name).fine()
        line = run(pumice, "merge", one, tmp_path / name, "-o", out).refused()
        assert f"{name}: expected a part of the volume that" in line and not out.exists()
        return line

    assert "expected 4 time steps, got 3" in refused("fewer", folder / "a.zarr", "--time-steps", "0-2")
    assert "expected 4 time steps, got 1" in refused("single", folder / "a.zarr", "--time-step", "1")
    assert "expected `--time-steps 0-3`" in refused("files", *sources["pattern"])
    run(pumice, "compress", *sources["file"], "--chunks", "0", "-o", one).fine()
    assert "read with `--time-steps 0-2`, expected `--time-steps 1-3`" in refused("earlier", folder / "a.nii", "--time-steps", "0-2")
    # Other voxels at the last time step alone.
    other = tmp_path / "other"
    other.mkdir()
    for step in range(STEPS):
        np.save(other / f"frame_{step}.npy", SERIES[step] + (step == 3) * (SERIES[step] > 0).astype(np.uint16))
    run(pumice, "compress", *sources["pattern"], "--chunks", "0", "-o", one).fine()
    assert "made from another source" in refused("changed", other / "frame_{t}.npy", "--axes", "xyz")
    assert "chunks: expected numbers from 0 to 2" in run(pumice, "compress", *sources["store"], "--chunks", "3", "-o", tmp_path / "x").refused()


@pytest.mark.parametrize("kind", ["store", "pattern"])
def test_what_is_killed_goes_on(pumice, sources, whole, tmp_path, kind):
    out = tmp_path / "out.pumice"
    args = ["compress", *sources[kind], "--threads", "1", "-o", out]
    start = time.monotonic()
    run(pumice, *args, "--resume").fine()
    took = time.monotonic() - start
    assert out.read_bytes() == whole(kind) and not os.path.exists(f"{out}.parts")
    goes_on(pumice, args, out, whole(kind), [0.7 * took], signal.SIGKILL)


@pytest.mark.full
def test_what_is_killed_at_any_moment_goes_on(pumice, sources, whole, tmp_path):
    out = tmp_path / "out.pumice"
    args = ["compress", *sources["store"], "--threads", "1", "-o", out]
    start = time.monotonic()
    run(pumice, *args, "--resume").fine()
    took = time.monotonic() - start
    rng = random.Random(13)
    goes_on(pumice, args, out, whole("store"), [took * rng.uniform(0, 1.1) for _ in range(50)], signal.SIGKILL)


def test_finished_chunks_are_kept_and_another_series_is_refused(pumice, sources, whole, tmp_path):
    source, out = tmp_path / "frames", tmp_path / "out.pumice"
    source.mkdir()
    for step in range(STEPS):
        np.save(source / f"{step}.npy", SERIES[step])
    args = ["compress", source / "{t}.npy", "--axes", "xyz", "-o", out]
    parts = tmp_path / "out.pumice.parts"
    # The part of the first chunk alone, as a killed process leaves it: its file keeps its time.
    kept = tmp_path / "kept"
    run(pumice, *args[:-1], kept, "--chunks", "0").fine()
    done = run(pumice, *args, "--threads", "1", "--resume", file_size_limit=kept.stat().st_size - 1)
    assert "0 of 3 parts are kept in" in done.refused() and not out.exists()
    kept.rename(parts / "000000.part")
    stamp = (parts / "000000.part").stat().st_mtime_ns
    assert "--resume goes on" in run(pumice, *args).refused()
    assert "the parts were made with other options" in run(pumice, *args, "--time-steps", "0-2", "--roi", ":,:,1:", "--resume").refused()
    assert "another source" in run(pumice, *args, "--time-steps", "0-2", "--resume").refused()
    done = run(pumice, *args, "--threads", "1", "--resume", file_size_limit=1000)
    assert "1 of 3 parts are kept in" in done.refused() and (parts / "000000.part").stat().st_mtime_ns == stamp
    times = (source / "3.npy").stat().st_mtime_ns
    os.utime(source / "3.npy", ns=(times, times + 10**9))
    assert "has changed since" in run(pumice, *args, "--resume").refused()
    run(pumice, *args, "--restart").fine()
    assert out.read_bytes() == whole("pattern") and not parts.exists()


def test_the_steps_of_a_stream_go_on(pumice, tmp_path):
    source, out, whole = tmp_path / "a.nii.gz", tmp_path / "out.pumice", tmp_path / "whole.pumice"
    nibabel.save(nibabel.Nifti1Image(SERIES.transpose(1, 2, 3, 0), np.eye(4)), source)
    args = ["compress", source, "--time-steps", "all", "-o"]
    run(pumice, *args, whole).fine()
    assert "0 of 3 parts are kept in" in run(pumice, *args, out, "--resume", file_size_limit=1000).refused()
    run(pumice, *args, out, "--resume").fine()
    assert out.read_bytes() == whole.read_bytes()
