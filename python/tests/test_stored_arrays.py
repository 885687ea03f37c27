"""Arrays of other packages that are read from files: which axis is which, and that they are read slab by slab.

zarr is the real one, in both formats. h5py, xarray and netCDF4 are stood in for by classes with the attributes that theirs have. numpy's
transposition is the oracle.
"""

from types import SimpleNamespace

import numpy as np
import pumice
import pytest
import zarr

ORDERS = ["xyz", "zyx", "yxz", "zxy"]


class Stored:
    """What all stored arrays have: shape, type, slicing. It records how often each voxel is read, and the largest piece."""

    def __init__(self, array, chunks=None):
        self.array, self.shape, self.dtype, self.attrs, self.chunks = array, array.shape, array.dtype, {}, chunks
        self.reads, self.largest = np.zeros(array.shape, np.uint8), 0

    def __getitem__(self, cut):
        self.reads[cut] += 1
        self.largest = max(self.largest, self.array[cut].size)
        return self.array[cut]


def h5py_dataset(array, names):
    made = type("Dataset", (Stored,), {"__module__": "h5py._hl.dataset"})(array)
    # An axis without a label has an empty one.
    made.dims = [SimpleNamespace(label=name) for name in names or [""] * 3]
    return made


def xarray_array(array, names):
    made = Stored(array)
    made.dims = tuple(names or ("dim_0", "dim_1", "dim_2"))
    return made


def netcdf_variable(array, names):
    made = Stored(array)
    made.dimensions = tuple(names or ("phony_dim_0", "phony_dim_1", "phony_dim_2"))
    return made


def zarr_array(array, names, zarr_format):
    store = zarr.storage.MemoryStore()
    named = {"dimension_names": names} if zarr_format == 3 and names else {}
    made = zarr.create_array(store=store, shape=array.shape, chunks=(16, 16, 16), dtype=array.dtype, zarr_format=zarr_format, **named)
    made[:] = array
    if zarr_format == 2 and names:
        made.attrs["_ARRAY_DIMENSIONS"] = list(names)
    return made


KINDS = {
    "h5py": h5py_dataset,
    "xarray": xarray_array,
    "netCDF4": netcdf_variable,
    "zarr 2": lambda array, names: zarr_array(array, names, 2),
    "zarr 3": lambda array, names: zarr_array(array, names, 3),
}


def stored_as(labels, order):
    """The array[x, y, z] with its axes in another order."""
    return np.ascontiguousarray(labels.transpose(["xyz".index(axis) for axis in order]))


@pytest.mark.parametrize("kind", KINDS)
def test_names_of_axes_decide(kind, labels):
    for order in ORDERS:
        array = stored_as(labels, order)
        for names in [list(order), *([[name.upper() for name in order]] if order == "zyx" else [])]:
            stored = KINDS[kind](array, names)
            volume = pumice.compress(stored, spacing=(1, 2, 3))
            np.testing.assert_array_equal(volume.decode(), labels)
            assert volume.spacing == (1, 2, 3)
            volume.verify(stored)
        if order in ("xyz", "zyx"):
            # What the array says may be said again, but not otherwise.
            assert pumice.compress(stored, axes=order).dims == labels.shape
        for wrong in {"xyz", "zyx"} - {order}:
            with pytest.raises(pumice.InputError, match=f"axes: expected no order, because the array names its axes .*; got '{wrong}'"):
                pumice.compress(stored, axes=wrong)
    # Control: names in another order are another volume.
    mirrored = pumice.compress(KINDS[kind](stored_as(labels, "zyx"), list("xyz")))
    assert mirrored.dims == labels.shape[::-1]


@pytest.mark.parametrize("kind", KINDS)
def test_a_stored_array_that_says_nothing_is_asked_for_axes(kind, labels):
    array = stored_as(labels, "zyx")
    for names in (None, ["a", "b", "c"], ["z", "y", "y"]):
        stored = KINDS[kind](array, names)
        for call in (pumice.compress, pumice.compress(labels).verify):
            with pytest.raises(pumice.InputError, match=r"^axes: expected 'zyx' or 'xyz', because this array \(.*\) .*name") as told:
                call(stored)
            assert "\n" not in str(told.value) and (names is None or ", ".join(names) in str(told.value))
        np.testing.assert_array_equal(pumice.compress(stored, axes="zyx").decode(), labels)
        assert pumice.compress(stored, axes="xyz").dims == array.shape
    if kind == "h5py":
        with pytest.raises(pumice.InputError, match=r"this array \(h5py Dataset\) does not name its axes"):
            pumice.compress(h5py_dataset(array, None))


def test_arrays_in_memory_are_x_y_z_as_before(labels, tmp_path):
    np.save(tmp_path / "a.npy", labels)
    for array in (labels, np.load(tmp_path / "a.npy", mmap_mode="r")):
        np.testing.assert_array_equal(pumice.compress(array).decode(), labels)


def test_four_axes_are_refused_whatever_their_names():
    stored = xarray_array(np.zeros((1, 2, 3, 4), np.uint8), ["t", "z", "y", "x"])
    for axes in (None, "zyx"):
        with pytest.raises(pumice.InputError, match=r"array: expected three axes \(x, y, z\), got shape \(1, 2, 3, 4\)"):
            pumice.compress(stored, axes=axes)


@pytest.mark.parametrize("order", ["xyz", "zyx", "yxz"])
@pytest.mark.parametrize("chunks", [None, (16, 16, 16), (100, 7, 7), (48, 48, 48)])
def test_each_chunk_is_read_once_and_the_array_never_whole(order, chunks):
    array = np.zeros((300, 20, 21), np.uint16)
    array[::7, 3, 4] = np.arange(43) + 1
    stored = Stored(array, chunks)
    stored.dims = tuple(order)
    volume = pumice.compress(stored)
    np.testing.assert_array_equal(volume.decode(), array.transpose([order.index(axis) for axis in "xyz"]))
    assert (stored.reads == 1).all() and stored.largest < array.size / 2
    # No slab ends within a chunk: where slabs end is where the voxels of a chunk are read by several calls.
    ends = []
    stored.__class__ = type("Watched", (Stored,), {"__getitem__": lambda self, cut: (ends.append(cut[0].stop), self.array[cut])[1]})
    pumice.compress(stored)
    assert chunks is None or all(end % chunks[0] == 0 or end == 300 for end in ends), ends
    assert len(ends) > 1


def test_a_type_that_names_the_byte_order_of_this_machine_is_read(labels):
    """zarr has such types; they equal the plain ones, and their buffers have another format."""
    for kind in ("u2", "u4", "u8", "i8", "f8"):
        named = labels.astype(np.dtype(kind).newbyteorder("<"))
        volume = pumice.compress(named)
        np.testing.assert_array_equal(volume.decode(), labels)


def test_masked_voxels_of_a_slab_are_refused(labels):
    """netCDF4 gives masked arrays where a voxel has the fill value."""
    masked = np.ma.masked_array(labels, mask=labels > 0)
    for names in (list("xyz"), list("zyx")):
        with pytest.raises(pumice.InputError, match="masked"):
            pumice.compress(netcdf_variable(masked, names))
    whole = netcdf_variable(np.ma.masked_array(labels, mask=False), list("xyz"))
    np.testing.assert_array_equal(pumice.compress(whole).decode(), labels)
