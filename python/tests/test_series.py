"""Time series of arrays and files in one file, beside the command and the arrays themselves."""

import subprocess

import numpy as np
import pumice
import pytest
import tifffile
import zarr

SHAPE = (4, 20, 30, 40)


@pytest.fixture(scope="module")
def frames():
    """An array[t, z, y, x] of balls that move, of which one leaves and one comes."""
    t, z, y, x = np.ogrid[tuple(slice(n) for n in SHAPE)]
    labels = np.zeros(SHAPE, np.uint16)
    for n in range(5):
        ball = (x - 6 * n - 5 - t) ** 2 + (y - 5 * n - 4) ** 2 + (z - 10) ** 2 < 16
        labels[ball & ~((t == 0) & (n == 3)) & ~((t == 3) & (n == 1))] = 10 * n + 7
    return labels


def times(path, frames):
    """Every voxel of every time step of the file at `path`, as array[z, y, x]."""
    for step, labels in enumerate(frames):
        volume = pumice.open(path, time=step)
        assert (volume.time_step, volume.time_steps) == (step, len(frames))
        yield volume, labels


def test_arrays_become_one_file_whose_time_steps_are_the_arrays(frames, tmp_path):
    stored = zarr.create_array(tmp_path / "a.zarr", shape=SHAPE, dtype="u2", chunks=(1, 7, 30, 11))
    stored[:] = frames
    files = []
    for i, source in enumerate([frames, list(frames), np.asfortranarray(frames), stored]):
        files.append(tmp_path / f"{i}.pumice")
        told = pumice.compress_series(source, files[-1], axes="zyx", spacing=(1, 1, 2), unit="um", names={17: "cell"})
        assert told["dims"] == SHAPE[:0:-1]
        assert (told["time_steps"], told["labels"]) == (4, 5)
    # The axes of an array[t, x, y, z] are in the order of spacing.
    files.append(tmp_path / "turned.pumice")
    pumice.compress_series(frames.transpose(0, 3, 2, 1), files[-1], spacing=(1, 1, 2), unit="um", names={17: "cell"})
    assert len({file.read_bytes() for file in files}) == 1
    for volume, labels in times(files[0], frames):
        assert volume.spacing == (1, 1, 2)
        assert volume.labels.names == ["", "cell", "", "", ""]
        np.testing.assert_array_equal(volume.decode(), labels.T)
        np.testing.assert_array_equal(volume.labels.voxels, [(labels == i).sum() for i in volume.labels.ids])
    with pytest.raises(pumice.InputError, match="4 time steps"):
        pumice.open(files[0])
    with pytest.raises(pumice.InputError, match="4"):
        pumice.open(files[0], time=4)


def test_files_give_what_the_command_gives(command, frames, tmp_path):
    tifffile.imwrite(tmp_path / "cells.tif", frames, imagej=True, metadata={"axes": "TZYX"})
    for step, labels in enumerate(frames):
        np.save(tmp_path / f"frame_{step}.npy", labels)
    by_command = tmp_path / "command.pumice"
    for inputs, source, flags, keywords in [
        (["cells.tif"], "cells.tif", ["--time-steps", "1-3"], {"time_steps": (1, 3)}),
        (["cells.tif"], "cells.tif", ["--time-steps", "all"], {"time_steps": "all"}),
        (["frame_{t}.npy"], "frame_{t}.npy", ["--axes", "zyx"], {"axes": "zyx"}),
        (["frame_2.npy", "frame_0.npy"], ["frame_2.npy", "frame_0.npy"], ["--axes", "zyx"], {"axes": "zyx"}),
    ]:
        subprocess.run([command, "compress", *inputs, *flags, "-o", by_command], check=True, cwd=tmp_path)
        paths = tmp_path / source if isinstance(source, str) else [tmp_path / path for path in source]
        pumice.compress_series(paths, tmp_path / "module.pumice", **keywords)
        assert (tmp_path / "module.pumice").read_bytes() == by_command.read_bytes()


def test_bad_series_are_refused(frames, tmp_path):
    out = tmp_path / "out.pumice"
    named = zarr.create_array(tmp_path / "a.zarr", shape=SHAPE, dtype="u2", chunks=SHAPE, dimension_names=["z", "t", "y", "x"])
    np.save(tmp_path / "one.npy", frames[0])
    for source, keywords, what in [
        (frames[0], {}, "four axes"),
        ([], {}, "at least one"),
        ([frames[0], str(tmp_path / "one.npy")], {}, "paths alone, or arrays alone"),
        ([frames[0], frames[1][1:]], {}, "time step 1: voxels: expected 20 × 30 × 40, got 19 × 30 × 40, as time step 0 has"),
        ([frames[0], frames[1].astype(np.uint8)], {}, "label type"),
        (list(frames.astype(np.int16) - 1), {}, "a label of at least 0"),
        (named, {}, "expected time as the first axis"),
        (frames, {"time_steps": "all"}, "choose by slicing"),
        (tmp_path / "one.npy", {"time_steps": "all"}, "one time step"),
        (tmp_path / "one.npy", {}, "got one volume"),
        (tmp_path / "{t}.npy", {}, "{t}.npy"),
        (tmp_path / "one.npy", {"time_steps": (2, 1)}, "time_steps"),
        (tmp_path / "one.npy", {"time_steps": 3}, "time_steps"),
        (7, {}, "expected paths or arrays"),
    ]:
        with pytest.raises(pumice.InputError, match=what):
            pumice.compress_series(source, out, **keywords)
    assert not out.exists()


def test_parts_of_a_series_are_the_series(tmp_path):
    """Three chunks along x. The oracle is one run, which other tests compare with the arrays."""
    t, z, y, x = np.ogrid[:3, :2, :9, :2060]
    frames = ((x // 37 + y // 4 + z + t * (x > 1500)) % 5 * 1001).astype(np.uint32)
    pumice.compress_series(frames, tmp_path / "whole.pumice", axes="zyx")
    stored = zarr.create_array(tmp_path / "a.zarr", shape=frames.shape, dtype="u4", chunks=(1, 2, 9, 700))
    stored[:] = frames
    parts = [tmp_path / name for name in "abc"]
    for part, source, chunks in zip(parts, (frames, list(frames), stored), (2, 0, [1]), strict=True):
        pumice.compress_part(source, part, chunks, axes="zyx", fingerprint="v1")
    told = pumice.merge(parts, tmp_path / "out.pumice")
    assert (told["time_steps"], told["dims"]) == (3, (2060, 9, 2))
    assert (tmp_path / "out.pumice").read_bytes() == (tmp_path / "whole.pumice").read_bytes()
    pumice.compress_part(frames[:2], parts[0], 2, axes="zyx", fingerprint="v1")
    with pytest.raises(pumice.InputError, match="expected 2 time steps, got 3"):
        pumice.merge(parts, tmp_path / "other.pumice")
    with pytest.raises(pumice.InputError, match="time_steps: an array"):
        pumice.compress_part(frames, parts[0], 2, time_steps="all")


def test_parts_of_files_and_what_goes_on(tmp_path):
    x = np.arange(2060)[:, None, None] // 41 + np.arange(3)[None, :, None] + np.zeros((1, 1, 2), int)
    for step in range(3):
        np.save(tmp_path / f"f{step}.npy", (x * (step + 1) % 6).astype(np.uint16))
    source, out = tmp_path / "f{t}.npy", tmp_path / "out.pumice"
    told = pumice.compress_series(source, out, axes="xyz")
    whole = out.read_bytes()
    for chunks in ("0,2", "1"):
        pumice.compress_part(source, tmp_path / chunks, chunks, time_steps=(0, 2), axes="xyz")
    pumice.merge([tmp_path / "1", tmp_path / "0,2"], out)
    assert out.read_bytes() == whole
    job = pumice.Job()
    job.cancel()
    with pytest.raises((pumice.Cancelled, pumice.InputError)):
        pumice.compress_series(source, out, axes="xyz", resume=True, job=job)
    kept = tmp_path / "out.pumice.parts"
    assert (kept / "manifest.json").exists()
    # What is there is taken as it is: what is no part is refused when all are merged.
    (kept / "000001.part").write_bytes(b"no part")
    with pytest.raises(pumice.InputError, match=r"000001\.part.*3 of 3 parts are kept"):
        pumice.compress_series(source, out, axes="xyz", resume=True)
    assert pumice.compress_series(source, out, axes="xyz", restart=True) == told
    assert out.read_bytes() == whole and not kept.exists()
    pumice.compress_series(source, out, axes="xyz", resume=True, types={1: "soma"})
    assert pumice.open(out, time=0).labels.types[0] == "soma"
    with pytest.raises(pumice.InputError, match="only files take them"):
        pumice.compress_series([np.ones((2, 2, 2), np.uint8)], out, resume=True)
    with pytest.raises(pumice.InputError, match="give one of them"):
        pumice.compress_series(source, out, resume=True, restart=True)
