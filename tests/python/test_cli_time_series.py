"""Tests time series: 4-D files and patterns of files become one `.pumice` file, whose every time step is the voxels that numpy has; what
is refused.

The voxels are written by other people's libraries, read back by them, and by the decoder that was written from the docs alone.
"""

import json

import decode_pumice
import nibabel
import nrrd
import numpy as np
import pytest
import tifffile
import zarr
from command import run
from PIL import Image

STEPS, SHAPE = 6, (20, 24, 40)


def volume(step):
    """Ids a[z, y, x] at a time step: slabs that stand still, a ball that moves, and a label that is there at two steps alone."""
    z, y, x = np.indices(SHAPE)
    ids = np.where(z < 8, 1 + x // 7 + 10 * (y // 5), 0)
    ids[(x - 6 - 5 * step) ** 2 + (y - 12) ** 2 + (z - 13) ** 2 < 25] = 60_000
    if step in (2, 3):
        ids[16:19, 3:9, 30:36] = 777
    return ids.astype(np.uint16)


SERIES = np.stack([volume(step) for step in range(STEPS)])


@pytest.fixture
def sources(tmp_path):
    """The series in each form that is read: arguments of `compress`."""
    tifffile.imwrite(tmp_path / "a.tif", SERIES[:, :, None], imagej=True, metadata={"axes": "TZCYX", "spacing": 2.0})
    nibabel.save(nibabel.Nifti1Image(SERIES.transpose(3, 2, 1, 0), np.eye(4)), tmp_path / "a.nii.gz")
    group = zarr.open_group(tmp_path / "a.zarr", mode="w", zarr_format=2)
    array = group.create_array("0", shape=SERIES.shape, chunks=(1, 16, 16, 16), dtype="u2")
    array[...] = SERIES
    axes = [{"name": "t", "type": "time"}] + [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    level = {"path": "0", "coordinateTransformations": [{"type": "scale", "scale": [1, 1, 1, 1]}]}
    group.attrs["multiscales"] = [{"version": "0.4", "axes": axes, "datasets": [level]}]
    for step in range(STEPS):
        # Numbers 8 to 13: their order is not that of letters.
        nrrd.write(str(tmp_path / f"frame_{step + 8}.nrrd"), SERIES[step].transpose(2, 1, 0))
    files = [str(tmp_path / f"frame_{step + 8}.nrrd") for step in range(STEPS)]
    return {
        "tiff": [str(tmp_path / "a.tif"), "--time-steps", "all"],
        "nifti": [str(tmp_path / "a.nii.gz"), "--time-steps", "all"],
        "zarr": [str(tmp_path / "a.zarr"), "--time-steps", "all"],
        "pattern": [str(tmp_path / "frame_{t}.nrrd")],
        "files": files[::-1],
    }


def test_what_was_compressed_is_verified_and_nothing_else(pumice, sources, tmp_path):
    """A part of the time steps, a pattern that one file fits, and several inputs of a file of one time step."""
    out, nifti = tmp_path / "part.pumice", sources["nifti"][0]

    def verify(*arguments):
        return run(pumice, "verify", out, *arguments)

    def differs(*arguments):
        done = verify(*arguments)
        assert done.code == 1, done
        return done.out

    run(pumice, "compress", nifti, "--time-steps", "1-3", "-o", out).fine()
    assert "exactly" in verify(nifti, "--time-steps", "1-3").fine()
    assert "exactly" in verify(tmp_path / "frame_{t}.nrrd", "--time-steps", "1-3").fine()
    for steps in ("0-2", "2-4"):
        assert "time step 0" in differs(nifti, "--time-steps", steps)
    assert "has 3 time steps, got 6" in verify(nifti).refused()
    assert "has 3 time steps, got 2" in verify(nifti, "--time-steps", "1-2").refused()
    assert "has 3 time steps, got 1" in verify(tmp_path / "frame_9.nrrd").refused()
    (tmp_path / "one").mkdir()
    (tmp_path / "frame_8.nrrd").rename(tmp_path / "one" / "frame_8.nrrd")
    pattern = tmp_path / "one" / "frame_{t}.nrrd"
    run(pumice, "compress", pattern, "-o", out).fine()
    assert "exactly" in verify(pattern).fine()
    for second in (tmp_path / "frame_9.nrrd", tmp_path / "absent.nrrd"):
        assert "has 1 time step, got 2" in verify(tmp_path / "one" / "frame_8.nrrd", second).refused()
    (tmp_path / "frame_9.nrrd").rename(tmp_path / "one" / "frame_8.nrrd")
    assert "expected label" in differs(pattern)


def compress(pumice, arguments, out, *more):
    run(pumice, "compress", *arguments, "-o", out, *more).fine()
    return out.read_bytes()


@pytest.mark.parametrize("kind", ["tiff", "nifti", "zarr", "pattern", "files"])
def test_every_time_step_is_what_was_written(pumice, sources, tmp_path, kind):
    data = compress(pumice, sources[kind], tmp_path / "a.pumice")
    for step in range(STEPS):
        ids, _ = decode_pumice.decode(data, step)
        assert (ids.transpose(2, 1, 0) == SERIES[step]).all(), step
    files = [name for name in sources[kind] if name not in ("--time-steps", "all")]
    assert "exactly" in run(pumice, "verify", tmp_path / "a.pumice", *files).fine()


@pytest.mark.parametrize("level", ["fast", "default", "small"])
def test_each_level_decodes_and_decompresses(pumice, sources, tmp_path, level):
    data = compress(pumice, sources["tiff"], tmp_path / "a.pumice", "--level", level)
    run(pumice, "decompress", tmp_path / "a.pumice", "-o", tmp_path / "back_{t}.npy").fine()
    for step in range(STEPS):
        ids, _ = decode_pumice.decode(data, step)
        assert (ids.transpose(2, 1, 0) == SERIES[step]).all()
        assert (np.load(tmp_path / f"back_{step:04}.npy").transpose(2, 1, 0) == SERIES[step]).all()
    run(pumice, "decompress", tmp_path / "a.pumice", "--time-step", "3", "-o", tmp_path / "one.npy").fine()
    assert (np.load(tmp_path / "one.npy").transpose(2, 1, 0) == SERIES[3]).all()


def test_a_range_and_what_info_says(pumice, sources, tmp_path):
    source = sources["tiff"][0]
    compress(pumice, [source, "--time-steps", "2-4"], tmp_path / "a.pumice")
    said = json.loads(run(pumice, "info", tmp_path / "a.pumice", "--json").fine())
    assert (said["kind"], said["time_steps"], said["dims"]) == ("series", 3, [40, 24, 20])
    assert said["labels"] == len(np.unique(SERIES[2:5])) - 1
    one = json.loads(run(pumice, "info", tmp_path / "a.pumice", "--time-step", "0", "--json").fine())
    assert (one["kind"], one["time_step"], one["time_steps"]) == ("pumice", 0, 3)
    # The table is that of all steps, with the voxels of the chosen one.
    for step in range(3):
        rows = run(pumice, "info", tmp_path / "a.pumice", "--time-step", str(step), "--labels", "--csv").fine().splitlines()
        place = rows[0].split(",").index("voxels")
        counts = {int(row.split(",")[0]): int(float(row.split(",")[place])) for row in rows[1:]}
        assert counts == {int(i): int((SERIES[2 + step] == i).sum()) for i in np.unique(SERIES[2:5]) if i}
    # One step is a file without time: the same bytes as of that step alone.
    tifffile.imwrite(tmp_path / "one.tif", SERIES[4][:, None], imagej=True, metadata={"axes": "ZCYX", "spacing": 2.0})
    one = compress(pumice, [source, "--time-steps", "4-4"], tmp_path / "b.pumice")
    assert one == compress(pumice, [tmp_path / "one.tif"], tmp_path / "c.pumice")
    assert one == compress(pumice, [source, "--time-step", "4"], tmp_path / "d.pumice")


def test_what_stands_still_is_stored_once(pumice, sources, tmp_path):
    together = len(compress(pumice, sources["tiff"], tmp_path / "a.pumice"))
    apart = sum(len(compress(pumice, [sources["tiff"][0], "--time-step", str(step)], tmp_path / "b.pumice")) for step in range(STEPS))
    assert together < 0.6 * apart


def test_pictures_of_time_steps_and_colours_that_stay(pumice, sources, tmp_path):
    compress(pumice, sources["tiff"], tmp_path / "a.pumice")
    options = ["--size", "48x32", "--spp", "2", "--seed", "3", "--backend", "cpu"]
    run(pumice, "render", tmp_path / "a.pumice", "--time-steps", "1-3", "-o", tmp_path / "m.exr", *options, "--save-scene", tmp_path / "s.json").fine()
    names = [tmp_path / f"m_{number:04}.exr" for number in (1, 2, 3)]
    assert all(name.exists() for name in names) and not (tmp_path / "m.exr").exists()
    scene = json.loads((tmp_path / "s.json").read_text())
    assert scene["instances"][0]["reading"] == {"time": 1}
    # A picture of the animation is that of its scene rendered alone, to the bit: nothing of an earlier step is left.
    scene["instances"][0]["reading"]["time"] = 3
    (tmp_path / "t.json").write_text(json.dumps(scene))
    run(pumice, "render", tmp_path / "t.json", "-o", tmp_path / "alone.exr", "--spp", "2", "--backend", "cpu").fine()
    assert run(pumice, "compare", tmp_path / "alone.exr", names[2], "--max-rel-mse", "1e-30").code == 0
    # A control: another step is another picture.
    assert run(pumice, "compare", names[0], names[2], "--max-rel-mse", "1e-30").code == 1
    # A scene is animated alike, and a picture is drawn again at its time step.
    run(pumice, "render", tmp_path / "s.json", "--time-steps", "3-3", "-o", tmp_path / "n.exr", "--spp", "2", "--backend", "cpu").fine()
    assert run(pumice, "compare", tmp_path / "n_0001.exr", names[2], "--max-rel-mse", "1e-30").code == 0
    run(pumice, "render", "--again", names[2], "-o", tmp_path / "again.exr", "--backend", "cpu").fine()
    assert run(pumice, "compare", tmp_path / "again.exr", names[2], "--max-rel-mse", "1e-30").code == 0


def test_steps_without_what_is_shown_are_drawn(pumice, tmp_path):
    """A cell that is born late: before, its picture is empty, and the whole volume is framed."""
    early, late = np.zeros((2, 10, 10, 10), np.uint8)
    early[2:4, 2:4, 2:4], late[5:8, 5:8, 5:8] = 1, 2
    for number, labels in enumerate((early, late, early * 0)):
        np.save(tmp_path / f"v{number}.npy", labels)
    a = tmp_path / "a.pumice"
    run(pumice, "compress", tmp_path / "v{t}.npy", "--axes", "zyx", "--spacing", "1,1,1", "-o", a).fine()
    options = ["--size", "48x32", "--spp", "2", "--backend", "cpu"]
    for more in ([], ["--distance", "25"], ["--floor"], ["--legend", "--dpi", "20"], ["--cut", "z=0.9"]):
        done = run(pumice, "render", a, "--time-steps", "all", "--labels", "2", *options, *more, "-o", tmp_path / "m.png")
        assert done.code == 0, done
        first, second, third = [np.asarray(Image.open(tmp_path / f"m_{number:04}.png")) for number in (1, 2, 3)]
        assert (first == third).all() and (first != second).any(), more
    done = run(pumice, "render", a, "--time-step", "2", *options, "-o", tmp_path / "e.png")
    assert done.code == 0 and "nothing is shown" in done.err, done
    done = run(pumice, "render", a, "--time-step", "1", *options, "-o", tmp_path / "f.png")
    assert done.code == 0 and "nothing is shown" not in done.err, done


def refused(pumice, *arguments):
    """The one line with which the command refuses."""
    return run(pumice, *arguments).refused()


def test_what_is_refused_says_what_there_is(pumice, sources, tmp_path):
    out = tmp_path / "a.pumice"
    compress(pumice, sources["pattern"], out)
    choose = "the file has 6 time steps, and each is a separate volume; choose one with --time-step (0 to 5)"
    for command in (["render", out, "-o", tmp_path / "a.png"], ["export", out, "-o", tmp_path / "a.glb"], ["info", out, "--labels"]):
        assert choose in refused(pumice, *command)
    assert choose in refused(pumice, "decompress", out, "-o", tmp_path / "a.nrrd")
    assert "--time-step 6 is out of range, counted from 0; the number of time steps is 6: 0 to 5" in refused(
        pumice, "export", out, "--time-step", "6", "-o", tmp_path / "a.glb"
    )
    assert "--time-steps 2-6 is out of range" in refused(pumice, "render", out, "--time-steps", "2-6", "-o", tmp_path / "a.png")
    assert "--spacing cannot be chosen" in refused(pumice, "info", out, "--spacing", "1,1,1")

    one = tmp_path / "frame_9.nrrd"
    made = tmp_path / "b.pumice"
    compress(pumice, [one], made)
    assert "--time-step cannot be chosen" in refused(pumice, "render", made, "--time-step", "0", "-o", tmp_path / "a.png")
    assert "several time steps" in refused(pumice, "render", made, "--time-steps", "all", "-o", tmp_path / "a.png")
    assert "--time-steps cannot be chosen: the file has one time step" in refused(pumice, "compress", one, "--time-steps", "all", "-o", made)

    # A gap, no match, and frames that differ.
    (tmp_path / "frame_10.nrrd").unlink()
    assert "time step 10 is missing between" in refused(pumice, "compress", tmp_path / "frame_{t}.nrrd", "-o", made)
    assert "no file has a number in place of {t}" in refused(pumice, "compress", tmp_path / "fame_{t}.nrrd", "-o", made)
    nrrd.write(str(tmp_path / "frame_10.nrrd"), SERIES[0][:, :, :30].transpose(2, 1, 0))
    assert "frame_10.nrrd: voxels: expected 40 × 24 × 20, got 30 × 24 × 20" in refused(pumice, "compress", tmp_path / "frame_{t}.nrrd", "-o", made)
    nrrd.write(str(tmp_path / "frame_10.nrrd"), SERIES[0].astype(np.uint32).transpose(2, 1, 0))
    assert "frame_10.nrrd: label type: expected u16, got u32" in refused(pumice, "compress", tmp_path / "frame_{t}.nrrd", "-o", made)

    # Voxels that differ from the source are found at their time step.
    nrrd.write(str(tmp_path / "frame_10.nrrd"), (SERIES[2] + (SERIES[2] == 777)).transpose(2, 1, 0))
    found = run(pumice, "verify", out, tmp_path / "frame_{t}.nrrd")
    assert found.code == 1 and "time step 2: at voxel (30, 3, 16) expected label 778, got 777" in found.out
