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
