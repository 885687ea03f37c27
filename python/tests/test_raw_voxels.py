"""Tests that voxels without a header are read as the keywords say, and that a layout which is none is refused with one line."""

import numpy as np
import pumice
import pytest


@pytest.fixture
def array():
    return np.random.default_rng(5).integers(0, 40_000, (5, 4, 3))


@pytest.mark.parametrize(
    ("kind", "more"),
    [("<u2", {}), (">u4", {"raw_big_endian": True}), ("<i8", {"raw_offset": 7}), (">f4", {"raw_big_endian": True, "raw_offset": 3})],
)
def test_the_voxels_are_those_of_the_layout(array, tmp_path, kind, more):
    path = tmp_path / "voxels"
    path.write_bytes(bytes(more.get("raw_offset", 0)) + array.astype(kind).tobytes("F"))
    layout = {"raw_dims": array.shape, "raw_type": kind[1] + str(8 * int(kind[2])), **more}
    for volume in (pumice.open(path, spacing=(2, 3, 4), **layout), pumice.compress(path, spacing=(2, 3, 4), **layout)):
        assert np.array_equal(volume.decode(), array)
        assert volume.spacing == (2, 3, 4)
        volume.verify(path, **layout)
    found = pumice.probe(path, **layout)
    assert found["dims"] == list(array.shape)
    # A control: with x and z in each other's place the same bytes are other voxels.
    turned = pumice.open(path, spacing=(2, 3, 4), **(layout | {"raw_dims": array.shape[::-1]})).decode()
    assert not np.array_equal(turned, array.T) and np.array_equal(turned.ravel("F"), array.ravel("F"))


def test_a_figure_records_how_its_file_is_read(array, tmp_path):
    path = tmp_path / "voxels"
    path.write_bytes(array.astype("<u2").tobytes("F"))
    volume = pumice.open(path, raw_dims=array.shape, raw_type="u16", spacing=(1, 1, 1))
    fields = pumice.figure(volume).to_dict()["instances"][0]
    assert fields["reading"]["raw"] == {"dims": [5, 4, 3], "label_type": "u16", "big_endian": False, "offset": 0}


@pytest.mark.parametrize(
    ("layout", "line"),
    [
        ({"raw_dims": (5, 4, 3)}, "raw_type: expected it too"),
        ({"raw_type": "u16"}, "raw_dims: expected it too"),
        ({"raw_offset": 7}, "raw_dims: expected it too"),
        ({"raw_big_endian": True}, "raw_dims: expected it too"),
        ({"raw_dims": (5, 4), "raw_type": "u16"}, "raw_dims: expected three whole numbers x, y, z, got 2"),
        ({"raw_dims": 60, "raw_type": "u16"}, "raw_dims: expected three whole numbers x, y, z, got 60"),
        ({"raw_dims": (5, 4, -3), "raw_type": "u16"}, "raw_dims: expected 0 to"),
        ({"raw_dims": (5, 4, 3), "raw_type": "u17"}, "raw_type: expected one of u8 u16"),
        ({"raw_dims": (5, 4, 3), "raw_type": 16}, "raw_type: expected the name of a number type"),
        ({"raw_dims": (5, 4, 3), "raw_type": "u16", "raw_big_endian": 1}, "raw_big_endian: expected True or False, got 1"),
        ({"raw_dims": (5, 4, 3), "raw_type": "u16", "raw_offset": -1}, "raw_offset: expected 0 to"),
        ({"raw_dims": (5, 4, 4), "raw_type": "u16"}, "voxels"),
    ],
)
def test_what_is_no_layout_is_refused(array, tmp_path, layout, line):
    path = tmp_path / "voxels"
    path.write_bytes(array.astype("<u2").tobytes("F"))
    with pytest.raises(pumice.InputError) as refused:
        pumice.open(path, **layout)
    assert line in str(refused.value) and "\n" not in str(refused.value), refused.value


def test_an_array_has_no_layout(array):
    with pytest.raises(pumice.InputError, match="raw_dims: an array is read as it is$"):
        pumice.compress(array, raw_dims=array.shape, raw_type="u16")
