"""Tests arrays as input and output, of every type, order and stride, with numpy as the oracle."""

import numpy as np
import pumice
import pytest

TYPES = ["u1", "u2", "u4", "u8", "i1", "i2", "i4", "i8", "f4", "f8", "?"]


def same(volume, array):
    np.testing.assert_array_equal(volume.decode(), array)
    volume.verify(array)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("order", ["C", "F"])
def test_every_type_and_order(labels, dtype, order):
    array = np.asarray(labels % 100 if dtype == "i1" else labels, dtype=dtype, order=order)
    volume = pumice.compress(array)
    decoded = volume.decode()
    assert decoded.dtype == (np.uint8 if dtype == "?" else array.dtype)
    same(volume, array)


@pytest.mark.parametrize("dtype", [">u2", ">i4", ">u8", ">f4"])
def test_the_other_byte_order(labels, dtype):
    same(pumice.compress(labels.astype(dtype)), labels)


def test_views_with_any_strides(labels):
    views = [
        labels[::-1, ::2, 1::3],
        labels.transpose(2, 0, 1),
        labels[5:6, :, ::-2],
        np.broadcast_to(labels[:, :1, :], (40, 9, 50)),
        np.lib.stride_tricks.as_strided(labels, (4, 4, 4), (50, 50, 1)),
    ]
    for view in views:
        same(pumice.compress(view), view)


def test_a_unit_has_its_usual_names(labels):
    for given, unit in {"": "unknown", "nm": "nm", "um": "um", "µm": "um", "μm": "um", "mm": "mm"}.items():
        assert pumice.compress(labels, unit=given).unit == unit
    with pytest.raises(pumice.InputError, match="unit: expected nm, um, mm, m or unknown, got \"inch\""):
        pumice.compress(labels, unit="inch")


def test_ids_keep_all_their_bits():
    big = np.array([0, 1, (1 << 32) + 1, (1 << 53) + 1, (1 << 64) - 1], dtype=np.uint64)
    array = big[np.random.default_rng(1).integers(0, 5, (9, 8, 7))]
    volume = pumice.compress(array)
    same(volume, array)
    assert volume.labels.ids.tolist() == sorted(set(array.ravel().tolist()) - {0})
    # Types that cannot represent an id are refused.
    for dtype in (np.uint32, np.int64, np.float16, np.float32, np.float64):
        with pytest.raises(pumice.InputError, match=f"does not fit into {np.dtype(dtype)}"):
            volume.decode(dtype=dtype)
    for dtype in (bool, "S3", complex, "no type"):
        with pytest.raises(pumice.InputError, match="^dtype: "):
            volume.decode(dtype=dtype)


def test_decoded_into_any_type_that_holds_the_ids(labels):
    volume = pumice.compress(labels)
    for dtype in ("u1", "i2", ">u4", "i8", "f2", "f4", "f8"):
        decoded = volume.decode(dtype=dtype)
        assert decoded.dtype == np.dtype(dtype)
        np.testing.assert_array_equal(decoded, labels)


def test_arrays_without_a_label_are_volumes_and_those_without_a_voxel_are_refused():
    nothing = pumice.compress(np.zeros((5, 6, 7), np.uint16))
    assert len(nothing.labels) == 0 and nothing.boxes == 0
    assert not nothing.decode().any()
    for shape in [(0, 3, 3), (3, 0, 3), (3, 3, 0)]:
        with pytest.raises(pumice.InputError, match="expected voxels along [xyz], got shape"):
            pumice.compress(np.zeros(shape, np.uint8))


def test_an_array_thicker_than_a_block():
    array = np.zeros((3, 5, 200), np.uint32)
    array[1, 2, 60:140] = 9
    array[:, :, -1] = 4
    same(pumice.compress(array), array)
    same(pumice.compress(np.ascontiguousarray(array.transpose(2, 1, 0))), array.transpose(2, 1, 0))


class Lazy:
    """An array that is read in pieces, like those of h5py and zarr. It records the size of each request."""

    def __init__(self, array):
        self.array, self.shape, self.dtype, self.largest = array, array.shape, array.dtype, 0

    def __getitem__(self, key):
        piece = self.array[key]
        self.largest = max(self.largest, piece.size)
        return piece


def test_nothing_asks_for_the_whole_array(labels):
    lazy = Lazy(np.tile(labels, (8, 8, 8)))
    volume = pumice.compress(lazy, threads=1)
    # Slabs of 64 of 320 planes.
    assert lazy.largest == lazy.array.size / 5
    same(volume, lazy.array)


@pytest.mark.parametrize(
    ("array", "what"),
    [
        (np.full((4, 4, 4), -1), "at least 0 at voxel .0, 0, 0., got -1"),
        (np.full((4, 4, 4), np.nan), "a whole number .* got nan"),
        (np.full((4, 4, 4), np.inf), "a whole number .* got inf"),
        (np.full((4, 4, 4), 0.5, np.float32), "a whole number .* got 0.5"),
        (np.full((4, 4, 4), 2.0**60), "a whole number from 0 to 9007199254740992"),
        (np.zeros((4, 4, 4), complex), "that are whole, got complex128"),
        (np.zeros((4, 4, 4), "S3"), "labels are integers"),
        (np.zeros((4, 4)), r"three axes \(x, y, z\), got shape \(4, 4\)"),
        (np.zeros((4, 4, 4, 1)), "three axes"),
        ([[1, 2], [3, 4]], "expected a path or an array, got list"),
        (np.ma.masked_equal(np.ones((4, 4, 4), np.uint8), 1), r"masked.*filled\(0\)"),
        (np.broadcast_to(np.uint8(1), ((1 << 23) + 1, 1, 1)), "voxels along x"),
    ],
)
def test_what_is_no_label_array_is_refused(array, what):
    with pytest.raises(pumice.InputError, match=what) as caught:
        pumice.compress(array)
    assert "\n" not in str(caught.value)


def test_where_the_bad_voxel_is():
    array = np.zeros((70, 70, 70), np.int32)
    array[3, 66, 68] = -5
    with pytest.raises(pumice.InputError, match=r"voxel \(3, 66, 68\), got -5"):
        pumice.compress(array)


@pytest.mark.parametrize(
    ("keywords", "what"),
    [
        ({"spacing": (1, 2)}, "three lengths"),
        ({"spacing": (1, 2, 0)}, "above 0"),
        ({"spacing": (1, 2, float("nan"))}, "above 0"),
        ({"spacing": (1, 1, 1), "world_from_index": np.eye(4)}, "not both"),
        ({"world_from_index": np.eye(3)}, "4 × 4"),
        ({"world_from_index": np.full((4, 4), np.nan)}, "finite"),
        ({"unit": "furlong"}, "expected nm, um, mm, m"),
        ({"types": {3: 'a"b'}}, "quote"),
        ({"types": "/no/such/table.csv"}, "/no/such/table.csv"),
        ({"world_from_index": np.diag([1, 1, 0, 1])}, "in a plane"),
        ({"types": {3: " a"}}, "begins or ends with a space"),
        ({"types": {-3: "a"}}, "types: expected 0 to"),
        ({"names": {-3: "a"}}, "names: expected 0 to"),
        ({"threads": -1}, "threads: expected 0 to"),
        ({"threads": 1.5}, "threads: expected a whole number"),
        ({"memory_limit": -1}, "memory_limit: expected 0 to"),
        ({"memory_limit": 10}, "bytes of memory"),
        ({"layer": 1}, "an array is read as it is"),
    ],
)
def test_descriptions_that_make_no_sense(labels, keywords, what):
    with pytest.raises(pumice.InputError, match=what):
        pumice.compress(labels, **keywords)


def test_an_array_and_its_file_are_one_volume(tmp_path):
    # Floats up to 2⁵³ with whole values are accepted, from arrays and from files.
    for array in (np.full((3, 4, 5), 2.0**30, np.float32), np.full((3, 4, 5), 2.0**53)):
        np.save(tmp_path / "array.npy", array)
        with pytest.warns(pumice.PumiceWarning, match="no spacing"):
            volume = pumice.compress(tmp_path / "array.npy", axes="xyz")
        assert volume.content_hash == pumice.compress(array).content_hash
        same(volume, array)


def test_a_bool_is_true_whatever_its_byte():
    odd = np.full((4, 4, 4), 2, np.uint8).view(bool)
    assert pumice.compress(odd).labels.ids.tolist() == [1]


def test_an_error_of_the_array_itself_comes_through(labels):
    class Broken(Lazy):
        def __getitem__(self, key):
            raise OSError("the disk is gone")

    with pytest.raises(OSError, match="the disk is gone"):
        pumice.compress(Broken(labels))
