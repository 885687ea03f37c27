"""Parts of arrays and files, merged to the bytes that the command makes of the whole volume."""

import subprocess

import numpy as np
import pumice
import pytest
import zarr

SHAPE = (5, 1030, 2060)


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
    stored = zarr.create_array(tmp_path / "a.zarr", shape=SHAPE, dtype="u4", chunks=(2, 300, 500))
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
