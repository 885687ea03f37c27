"""Folders that `pumice decompress` writes, opened by other people's readers and by Pumice's own: same voxels, ids, place, names and colours."""

import json
import shutil
import signal
import subprocess
import time

import nrrd
import numpy as np
import pytest
import tensorstore as ts
import zarr
from command import run

# No axis is a multiple of a chunk's, and one has a single chunk.
DIMS = (75, 41, 20)
LARGE = 2**64 - 1
TABLE = "id,name,type,color,depth\n7,left,axon,#ff0033,1.5\n9,,glia,,\n" + str(LARGE) + ",right,,#0000ff,-3\n"
# Of a NRRD: lengths 0.5, 0.25 and 2 µm; the lowest corner of the first voxel is (10, 20, 3) voxels from the origin.
HEADER = {
    "space": "right-anterior-superior",
    "space directions": np.diag([0.5, 0.25, 2.0]),
    "space origin": [10.5 * 0.5, 20.5 * 0.25, 3.5 * 2],
    "space units": ["um"] * 3,
    "kinds": ["domain"] * 3,
}


def labels(dtype="u8"):
    """array[x, y, z] with ids up to the largest, whole chunks of background, and noise."""
    random = np.random.default_rng(0)
    some = np.array([0, 7, 9, np.iinfo(dtype).max], dtype)
    array = np.zeros(DIMS, dtype)
    array[40:] = some[random.integers(0, 4, (35, *DIMS[1:]))]
    array[33:40] = 7
    return array


@pytest.fixture(scope="module")
def source(pumice, tmp_path_factory):
    """A compressed volume of u64 with a place, names, types, colours and a column of numbers."""
    folder = tmp_path_factory.mktemp("source")
    nrrd.write(str(folder / "a.nrrd"), labels(), HEADER)
    (folder / "a.csv").write_text(TABLE)
    run(pumice, "compress", folder / "a.nrrd", "-o", folder / "a.pumice", "--table", folder / "a.csv").fine()
    return folder / "a.pumice"


def write(pumice, source, out, *options):
    return run(pumice, "decompress", source, "-o", out, *options).fine()


def check_own(pumice, source, out):
    """Our reader finds every voxel, the same matrix, and the names."""
    assert run(pumice, "verify", source, out).code == 0
    ours = [json.loads(run(pumice, "info", path, "--json").fine()) for path in (out, source)]
    # One rounding a product.
    of_unit = {"um": 1.0, "nm": 1000.0}[ours[0]["unit"]]
    assert np.allclose(ours[0]["world_from_centre"], of_unit * np.array(ours[1]["world_from_centre"]), rtol=1e-15)
    back = source.parent / "back.pumice"
    run(pumice, "compress", out, "-o", back).fine()
    rows = run(pumice, "info", back, "--labels", "--csv").fine().splitlines()
    assert any(row.startswith(f"{LARGE},right") for row in rows) and any(row.startswith("7,left") for row in rows)


OME = {
    "0.5": [],
    "0.5 in shards": ["--shards", "--chunk", "8"],
    "0.5 in one shard": ["--shards"],
    "0.4": ["--ome-version", "0.4", "--chunk", "17"],
}


@pytest.mark.parametrize("kind", OME)
def test_ome_zarr(pumice, source, tmp_path, kind):
    out = tmp_path / "a.ome.zarr"
    write(pumice, source, out, *OME[kind])
    group = zarr.open_group(out, mode="r")
    array = group["0"]
    assert np.array_equal(array[:], labels().transpose()) and array.dtype == "u8"
    version = kind[:3]
    assert group.metadata.zarr_format == {"0.4": 2, "0.5": 3}[version]
    driver = {"0.4": "zarr", "0.5": "zarr3"}[version]
    other = ts.open({"driver": driver, "kvstore": {"driver": "file", "path": str(out / "0")}}).result()
    assert np.array_equal(other.read().result(), labels().transpose())
    about = dict(group.attrs) if version == "0.4" else group.attrs["ome"]
    image = about["multiscales"][0]
    assert [axis["name"] for axis in image["axes"]] == ["z", "y", "x"] and all(axis["unit"] == "micrometer" for axis in image["axes"])
    scale, moved = image["datasets"][0]["coordinateTransformations"]
    assert scale["scale"] == [2, 0.25, 0.5] and moved["translation"] == [7, 5.125, 5.25]
    assert about["image-label"]["colors"] == [{"label-value": 7, "rgba": [255, 0, 51, 255]}, {"label-value": LARGE, "rgba": [0, 0, 255, 255]}]
    assert about["image-label"]["properties"] == [
        {"label-value": 7, "name": "left", "type": "axon", "depth": 1.5},
        {"label-value": 9, "type": "glia"},
        {"label-value": LARGE, "name": "right", "depth": -3},
    ]
    check_own(pumice, source, out)
    # Control: chunks of background alone are absent, and those with labels are not.
    if "--chunk" in OME[kind]:
        assert 0 < len([p for p in out.rglob("*") if p.is_file()]) < 5 + np.prod([-(-d // int(OME[kind][-1])) for d in DIMS])


PRECOMPUTED = {
    "compressed": [],
    "raw": ["--encoding", "raw", "--chunk", "16"],
    "compressed, gzip": ["--gzip", "--chunk", "24"],
    "raw, gzip": ["--gzip", "--encoding", "raw"],
}


@pytest.mark.parametrize("kind", PRECOMPUTED)
def test_precomputed(pumice, source, tmp_path, kind):
    out = tmp_path / "a"
    told = write(pumice, source, out, "--format", "precomputed", *PRECOMPUTED[kind])
    about = json.loads((out / "info").read_text())
    scale = about["scales"][0]
    assert (about["data_type"], about["type"], scale["resolution"], scale["voxel_offset"]) == ("uint64", "segmentation", [500, 250, 2000], [10, 20, 3])
    assert "colours" in told
    if "gzip" not in kind:
        other = ts.open({"driver": "neuroglancer_precomputed", "kvstore": {"driver": "file", "path": str(out)}}).result()
        assert np.array_equal(other.read().result()[..., 0], labels())
    else:
        assert all(p.suffix == ".gz" for p in (out / scale["key"]).iterdir())
    names = json.loads((out / about["segment_properties"] / "info").read_text())["inline"]
    assert names["ids"] == ["7", "9", str(LARGE)] and names["properties"][0]["values"] == ["left", "", "right"]
    check_own(pumice, source, out)


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4", "i4", "i8", "f4"])
@pytest.mark.parametrize("out", ["a.zarr", "raw", "compressed_segmentation"])
def test_types(pumice, tmp_path, dtype, out):
    """Zarr keeps the type; precomputed has unsigned integers, of 32 and 64 bits alone where it compresses."""
    array = (labels("u2") % 100).astype(dtype)
    np.save(tmp_path / "a.npy", array)
    run(pumice, "compress", tmp_path / "a.npy", "-o", tmp_path / "a.pumice", "--axes", "xyz").fine()
    options = [] if out == "a.zarr" else ["--format", "precomputed", "--encoding", out]
    told = write(pumice, tmp_path / "a.pumice", tmp_path / out, *options)
    assert run(pumice, "verify", tmp_path / "a.pumice", tmp_path / out).code == 0
    if out == "a.zarr":
        assert zarr.open_array(tmp_path / out / "0", mode="r").dtype == dtype
    else:
        wanted = {"raw": {"u1": 1, "u2": 2, "u4": 4, "i4": 4}, "compressed_segmentation": {"u1": 4, "u2": 4, "u4": 4, "i4": 4}}[out].get(dtype, 8)
        name = f"uint{8 * wanted}"
        assert json.loads((tmp_path / out / "info").read_text())["data_type"] == name
        assert (f"labels are written as {name}" in told) == (dtype != f"u{wanted}")
        assert "no unit" in told


def test_directions_are_left_out_and_said(pumice, tmp_path):
    directions = np.array([[0, 2.0, 0], [-1.0, 0, 0], [0, 0, 3.0]])
    nrrd.write(str(tmp_path / "a.nrrd"), labels("u2"), HEADER | {"space directions": directions})
    run(pumice, "compress", tmp_path / "a.nrrd", "-o", tmp_path / "a.pumice").fine()
    for options in (["--format", "ome-zarr"], ["--format", "precomputed"]):
        out = tmp_path / options[1]
        assert "directions of the axes" in write(pumice, tmp_path / "a.pumice", out, *options)
        assert json.loads(run(pumice, "info", out, "--json").fine())["spacing"] in ([2, 1, 3], [2000, 1000, 3000])
    # Control: a straight volume loses none, and one between whole voxels is rounded in precomputed alone.
    nrrd.write(str(tmp_path / "b.nrrd"), labels("u2"), HEADER | {"space origin": [0.1, 0.2, 0.3]})
    run(pumice, "compress", tmp_path / "b.nrrd", "-o", tmp_path / "b.pumice").fine()
    assert write(pumice, tmp_path / "b.pumice", tmp_path / "b.zarr") == ""
    assert "rounded to (0, 0, 0) voxels" in write(pumice, tmp_path / "b.pumice", tmp_path / "b.precomputed")


def test_what_exists_is_not_replaced_and_nothing_half_stays(pumice, source, tmp_path):
    (tmp_path / "a.zarr").mkdir()
    (tmp_path / "b.precomputed").write_text("before")
    (tmp_path / "c.zarr").symlink_to("nowhere")
    for name in ("a.zarr", "b.precomputed", "c.zarr"):
        assert "expected the name of a new folder" in run(pumice, "decompress", source, "-o", tmp_path / name).refused()
    assert (tmp_path / "b.precomputed").read_text() == "before" and not any((tmp_path / "a.zarr").iterdir())
    assert "No such file" in run(pumice, "decompress", source, "-o", tmp_path / "none" / "d.zarr").refused()
    # A label that does not fit, on a disk where nothing else is wrong.
    assert "the side of a chunk is 7" in run(pumice, "decompress", source, "-o", tmp_path / "e.zarr", "--chunk", "7").refused()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.zarr", "b.precomputed", "c.zarr"]


def test_interrupted_writing_leaves_nothing(pumice, tmp_path):
    np.save(tmp_path / "n.npy", np.indices((160, 160, 160), "u4").sum(0) // 40)
    run(pumice, "compress", tmp_path / "n.npy", "-o", tmp_path / "n.pumice", "--axes", "xyz").fine()
    child = subprocess.Popen([pumice, "decompress", tmp_path / "n.pumice", "-o", tmp_path / "n.precomputed", "--chunk", "8"], stderr=subprocess.PIPE)
    until = time.monotonic() + 60
    while not any(tmp_path.glob(".pumice-*/*/*")) and child.poll() is None and time.monotonic() < until:
        time.sleep(0.01)
    child.send_signal(signal.SIGINT)
    child.communicate(timeout=60)
    assert child.returncode != 0 and sorted(p.name for p in tmp_path.iterdir()) == ["n.npy", "n.pumice"]
    # Control: undisturbed it appears.
    write(pumice, tmp_path / "n.pumice", tmp_path / "n.precomputed")
    assert run(pumice, "verify", tmp_path / "n.pumice", tmp_path / "n.precomputed").code == 0


def test_a_full_disk_is_one_line(pumice, source, tmp_path):
    said = run(pumice, "decompress", source, "-o", tmp_path / "a.precomputed", "--encoding", "raw", file_size_limit=16 << 10).refused()
    assert "a.precomputed" in said and not any(tmp_path.iterdir())


def test_memory_does_not_grow_with_the_volume(pumice, tmp_path):
    """27 times as many voxels, most of them background."""
    peaks = []
    for n in (128, 384):
        array = zarr.create_array(tmp_path / f"{n}.zarr", shape=(n, n, n), dtype="u4", chunks=(64,) * 3, dimension_names=["z", "y", "x"])
        array[:64, :64, :64] = np.arange(64**3).reshape((64,) * 3) // 512
        run(pumice, "compress", tmp_path / f"{n}.zarr", "-o", tmp_path / "v.pumice", "--threads", "1").fine()
        done = run(pumice, "decompress", tmp_path / "v.pumice", "-o", tmp_path / f"{n}.ome.zarr", exact_peak=True)
        done.fine()
        peaks.append(done.peak_rss_bytes)
        shutil.rmtree(tmp_path / f"{n}.ome.zarr")
    assert peaks[1] - peaks[0] < 16 << 20, peaks
