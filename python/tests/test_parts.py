"""Parts of arrays and files, merged to the bytes that the command makes of the whole volume."""

import subprocess

import numpy as np
import pumice
import pytest
import zarr

SHAPE = (2, 1030, 2060)


@pytest.fixture(scope="module")
def array():
    """An array[z, y, x] of 3 × 2 × 1 chunks."""
    z, y, x = np.ogrid[: SHAPE[0], : SHAPE[1], : SHAPE[2]]
    return ((x // 37 + y // 19 + z) % 9 * 1001).astype(np.uint32)


@pytest.fixture
def whole(command, array, tmp_path):
    np.save(tmp_path / "whole.npy", array)
    out = tmp_path / "whole.pumice"
    subprocess.run([command, "compress", tmp_path / "whole.npy", "--axes", "zyx", "-o", out], check=True)
    return out.read_bytes()


def test_parts_of_an_array_are_the_array(array, tmp_path):
    stored = zarr.create_array(tmp_path / "a.zarr", shape=SHAPE, dtype="u4", chunks=(1, 300, 500))
    stored[:] = array
    assert pumice.chunk_count(SHAPE[::-1]) == 6
    parts = [tmp_path / name for name in ("a", "b", "c")]
    pumice.compress_part(array, parts[0], 4, axes="zyx", fingerprint="v1")
    pumice.compress_part(stored, parts[1], "0,2-3", axes="zyx", fingerprint="v1")
    pumice.compress_part(np.asfortranarray(array), parts[2], [5, 1], axes="zyx", fingerprint="v1")
    out = tmp_path / "out.pumice"
    written = pumice.merge(parts, out)
    # A file lies elsewhere in the world than an array, so the oracle is the array, compressed at once.
    pumice.compress(array, axes="zyx").save(tmp_path / "at once.pumice")
    assert out.read_bytes() == (tmp_path / "at once.pumice").read_bytes()
    assert written["dims"] == SHAPE[::-1] and written["labels"] == 8 and written["bytes_disk"] == out.stat().st_size
    # Names and types come when parts are merged.
    pumice.merge(parts, out, types={1001: "soma"}, level="fast")
    assert pumice.open(out).labels.types[0] == "soma"


def test_parts_of_a_file(array, whole, tmp_path):
    for chunks in ("0-2", "3-5"):
        pumice.compress_part(tmp_path / "whole.npy", tmp_path / chunks, chunks, axes="zyx")
    pumice.merge([tmp_path / "3-5", tmp_path / "0-2"], tmp_path / "out.pumice")
    assert (tmp_path / "out.pumice").read_bytes() == whole


def test_what_is_wrong_is_one_line(array, tmp_path):
    part, out = tmp_path / "part", tmp_path / "out.pumice"
    for chunks, why in (
        (6, "numbers from 0 to 5"),
        ("x", "expected numbers of chunks"),
        (-1, "chunks"),
        ([1, 1], "comes twice"),
        ("", "expected numbers of chunks"),
        (1.5, "chunks"),
    ):
        with pytest.raises(pumice.InputError, match=why):
            pumice.compress_part(array, part, chunks, axes="zyx")
    assert not part.exists()
    pumice.compress_part(array, part, "0-4", axes="zyx", fingerprint="one")
    pumice.compress_part(array, tmp_path / "other", 5, axes="zyx", fingerprint="two")
    for parts, why in (
        ([part], "lack 1 of the volume's 6 chunks: 5"),
        ([part, part], "both have chunk 0"),
        ([part, tmp_path / "other"], "another source"),
        ([tmp_path / "none"], "No such file"),
        ([], "got none"),
        (part, "expected a list of paths"),
    ):
        with pytest.raises(pumice.InputError, match=why) as raised:
            pumice.merge(parts, out)
        assert "\n" not in str(raised.value)
    with pytest.raises(pumice.InputError, match="part of one"):
        pumice.open(part)
    with pytest.raises(pumice.InputError, match="fingerprint"):
        pumice.compress_part(tmp_path / "x.npy", part, 0, fingerprint="one")
    assert not out.exists()


def test_a_file_is_compressed_to_a_file(array, whole, tmp_path):
    out = tmp_path / "out.pumice"
    written = pumice.compress_file(tmp_path / "whole.npy", out, axes="zyx")
    assert out.read_bytes() == whole
    assert written == {"dims": SHAPE[::-1], "labels": 8, "boxes": written["boxes"], "bytes_disk": len(whole)} and written["boxes"] > 0
    pumice.compress_file(array, out, axes="zyx", unit="nm", types={1001: "soma"}, level="small")
    pumice.compress(array, axes="zyx", unit="nm", types={1001: "soma"}).save(tmp_path / "in memory.pumice", level="small")
    assert out.read_bytes() == (tmp_path / "in memory.pumice").read_bytes()
    with pytest.warns(pumice.PumiceWarning, match="1 of 1 rows|not in the volume"):
        pumice.compress_file(array, out, axes="zyx", table=pumice.AnnotationTable([5], names=["nobody"]))


def test_a_limit_need_not_hold_the_result(tmp_path):
    """Columns of 2 × 2 voxels with random ids: the result, 4.9 MB, is more than half of the limit, so in memory it is refused."""
    columns = np.random.default_rng(5).integers(0, 1 << 10, (64, 100, 100), np.uint32).repeat(2, 1).repeat(2, 2)
    limit = 8 << 20
    with pytest.raises(pumice.InputError, match="bytes of memory: 9[0-9]* is more than the limit of 8388608"):
        pumice.compress(columns, axes="zyx", memory_limit=limit, threads=1)
    written = pumice.compress_file(columns, tmp_path / "columns.pumice", axes="zyx", memory_limit=limit, threads=1)
    assert written["labels"] == (1 << 10) - 1
    assert np.array_equal(pumice.open(tmp_path / "columns.pumice").decode(), columns.transpose())


def test_a_fault_leaves_no_file(array, tmp_path):
    out = tmp_path / "out.pumice"
    np.save(tmp_path / "negative.npy", np.full((3, 4, 5), -1, np.int16))
    for source, why in ((tmp_path / "negative.npy", "voxel"), (tmp_path / "none.npy", "none.npy"), (array.astype(np.complex64), "complex")):
        with pytest.raises((pumice.InputError, OSError), match=why):
            pumice.compress_file(source, out, axes="zyx")
        assert not out.exists()
    with open(out, "wb") as file:
        np.save(file, array)
    with pytest.raises(pumice.InputError, match="one that is read"):
        pumice.compress_file(out, out, axes="zyx")
    assert np.array_equal(np.load(out), array)
    job = pumice.Job()
    job.cancel()
    with pytest.raises(pumice.Cancelled):
        pumice.compress_file(array, tmp_path / "b.pumice", axes="zyx", job=job)
    assert not (tmp_path / "b.pumice").exists()
