"""Tests that only ordinary files are read where a file is meant, and that what is wrong with a folder or a limit is said with its number."""

import re

import pytest
import tifffile
from broken_files import labels
from command import run
from one_of_each import NO_FILES, arguments, left_in, one_of_each

# What reads a device to its end needs more.
ADDRESS_BYTES = 2 << 30

# By what is read: which file of the made is a pipe, and the command.
READERS = {
    "compress": ("raw.nrrd", "compress raw.nrrd -o rest.pumice"),
    "voxels without a header": ("raw.nrrd", "compress raw.nrrd -o rest.pumice --raw-dims 2,2,2 --raw-type u8"),
    "info": ("raw.nrrd", "info raw.nrrd"),
    "info of a .pumice file": ("v.pumice", "info v.pumice"),
    "labels": ("v.pumice", "info v.pumice --labels"),
    "verify": ("v.pumice", "verify v.pumice raw.nrrd"),
    "the other side of verify": ("raw.nrrd", "verify v.pumice raw.nrrd"),
    "decompress": ("v.pumice", "decompress v.pumice -o rest.npy"),
    "render": ("v.pumice", "render v.pumice -o rest.png QUICK"),
    "export": ("v.pumice", "export v.pumice -o rest.ply"),
    "table": ("v.pumice", "table v.pumice -o rest.csv"),
    "a scene": ("scene.json", "render scene.json -o rest.png QUICK"),
    "the volume of a scene": ("v.pumice", "render scene.json -o rest.png QUICK"),
    "the mesh of a scene": ("mesh.ply", "render scene.json -o rest.png QUICK"),
    "the sky of a scene": ("a.exr", "render scene.json -o rest.png QUICK"),
    "the sky of an export": ("a.exr", "export scene.json -o rest.usdz"),
    "a picture drawn again": ("b.exr", "render --again b.exr -o rest.png"),
    "a picture compared": ("a.exr", "compare a.exr b.exr"),
    "the other picture": ("b.exr", "compare a.exr b.exr"),
    "types": ("types.csv", "compress raw.nrrd -o rest.pumice --types types.csv"),
    "a table": ("table.csv", "compress raw.nrrd -o rest.pumice --table table.csv"),
    "the voxels of a MetaImage": ("apart.raw", "compress apart.mhd -o rest.pumice"),
    "the voxels of an NRRD": ("detached.raw", "compress detached.nhdr -o rest.pumice"),
    "the voxels of a pair": ("pair.img", "compress pair.hdr -o rest.pumice"),
    "a slice": ("slices/s03.tif", "compress slices -o rest.pumice"),
}


@pytest.fixture(scope="module")
def made(pumice, tmp_path_factory):
    return one_of_each(pumice, tmp_path_factory.mktemp("made"))


@pytest.mark.parametrize("what", READERS)
def test_pipes_sockets_and_devices_are_not_waited_for(pumice, made, what, tmp_path):
    name, line = READERS[what]
    kept = made / f"{name}.kept"
    (made / name).rename(kept)

    # An endless device, of which more than memory holds can be read; where readers differ in nothing, one meets a socket.
    kinds = {**NO_FILES, "a device": lambda path: path.symlink_to("/dev/zero")}
    try:
        for kind in ["a pipe", "a device", "a socket"][: 3 if what == "compress" else 2]:
            kinds[kind](made / name)
            try:
                done = run(pumice, *arguments(line, made, tmp_path / "out"), limit_seconds=20, address_limit=ADDRESS_BYTES)
            finally:
                (made / name).unlink()
            said = done.refused()
            assert f"expected an ordinary file, got {kind}" in said and (made / name).name in said, said
            assert left_in(tmp_path) == []
    finally:
        kept.rename(made / name)


@pytest.mark.parametrize("what", ["compress", "a scene", "types", "a slice", "the voxels of a pair", "the sky of a scene"])
def test_ordinary_files_are_read_also_through_links(pumice, made, what, tmp_path):
    """Control of the test above."""
    name, line = READERS[what]
    kept = made / f"{name}.kept"
    (made / name).rename(kept)
    try:
        (made / name).symlink_to(kept)
        done = run(pumice, *arguments(line, made, tmp_path / "out"))
        (made / name).unlink()
    finally:
        kept.rename(made / name)
    assert done.code == 0, done


def test_a_missing_slice_is_named(pumice, tmp_path):
    folder = tmp_path / "slices"
    folder.mkdir()
    for z, plane in enumerate(labels().transpose(2, 1, 0)):
        tifffile.imwrite(folder / f"s{z:02}.tif", plane)
    out = tmp_path / "o.pumice"
    # Control: nothing is missing, nor where every second slice was saved.
    run(pumice, "compress", folder, "-o", out).fine()
    (folder / "s07.tif").unlink()
    for command in [("compress", folder, "-o", tmp_path / "n.pumice"), ("info", folder)]:
        said = run(pumice, *command).refused()
        assert f"{folder}: slice number 7 is missing between s06.tif and s08.tif: " in said, said
    (folder / "s11.tif").unlink()
    assert "slice number 7 is missing between s06.tif and s08.tif (the first of 2)" in run(pumice, "info", folder).refused()
    for z in range(1, 16, 2):
        (folder / f"s{z:02}.tif").unlink(missing_ok=True)
    assert "dims       24 × 20 × 8 voxels" in run(pumice, "info", folder).fine()
    assert left_in(tmp_path) == ["o.pumice", "slices"]


@pytest.mark.parametrize("threads", ["1", "2"])
def test_a_memory_limit_below_the_table_of_labels_names_one_that_suffices(pumice, data, threads, tmp_path):
    out = tmp_path / "o.pumice"
    compress = ["compress", data / "platynereis_nuclei.tif", "--spacing", "1,1,1", "-o", out, "--threads", threads, "--memory-limit"]
    limits, limit = [], 1
    while (done := run(pumice, *compress, limit)).code == 2:
        needed = int(re.search(rf"--memory-limit {limit} is too small: (\d+) bytes", done.refused())[1])
        assert not out.exists() and needed > limit
        limits, limit = [*limits, limit], needed
    done.fine()
    # Control: it is no number that always suffices, and far below the size of the result, which need not be in memory.
    assert 1 <= len(limits) <= 9 and limit < out.stat().st_size
    out.unlink()
    run(pumice, *compress, limit // 2).refused()
    assert left_in(tmp_path) == []
