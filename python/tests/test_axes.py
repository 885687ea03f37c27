"""Tests arrays whose axes are z, y, x, in memory and in files, and what `probe` says a file leaves open. numpy's indices are the oracle."""

import warnings

import numpy as np
import pumice
import pytest


class Sliced:
    """An array as HDF5 and Zarr have it: shape, type and slicing by non-negative slices alone; counts the voxels that are read."""

    def __init__(self, array):
        self._array, self.shape, self.dtype, self.voxels = array, array.shape, array.dtype, 0

    def __getitem__(self, cut):
        assert len(cut) == 3 and all(type(part) is slice and part.step is None for part in cut)
        self.voxels += self._array[cut].size
        return self._array[cut]


@pytest.fixture
def napari(labels):
    """The labels as `a[z, y, x]`: sizes 50, 30, 40."""
    return np.ascontiguousarray(labels.transpose(2, 1, 0))


def told_by(call, *args, **more):
    """(result, texts of warnings) of a call."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        result = call(*args, **more)
    return result, [str(w.message) for w in told]


@pytest.mark.parametrize("form", ["C", "F", "strided", "sliced", "masked"])
def test_an_array_of_z_y_x_is_the_same_volume(labels, volume, napari, form):
    forms = {
        "C": lambda: napari,
        "F": lambda: np.asfortranarray(napari),
        "strided": lambda: np.repeat(napari, 2, axis=1)[:, ::2],
        "sliced": lambda: Sliced(napari),
        "masked": lambda: np.ma.masked_array(napari, mask=False),
    }
    array = forms[form]()
    read, told = told_by(pumice.compress, array, axes="zyx", spacing=(1, 1, 2.5), unit="um")
    np.testing.assert_array_equal(read.decode(), labels)
    assert read.dims == labels.shape and read.spacing == (1.0, 1.0, 2.5) and told == []
    assert read.content_hash == volume.content_hash
    read.verify(array, axes="zyx")
    if form == "sliced":
        assert array.voxels == 2 * labels.size, "each voxel is read once a pass"
    # A control: the same array as x, y, z is another volume.
    assert pumice.compress(array).content_hash != volume.content_hash
    with pytest.raises(pumice.InputError):
        read.verify(array)


def test_masked_voxels_are_refused_in_either_order(napari):
    masked = np.ma.masked_array(napari, mask=napari > 0)
    for axes in ("xyz", "zyx"):
        with pytest.raises(pumice.InputError, match="masked"):
            pumice.compress(masked, axes=axes)


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("ending", ["npy", "npz"])
def test_files_of_arrays_in_either_order(labels, napari, tmp_path, order, ending):
    path = tmp_path / f"a.{ending}"
    stored = np.asarray(napari, order=order)
    np.save(path, stored) if ending == "npy" else np.savez(path, labels=stored)
    for call in (pumice.open, pumice.compress):
        read, told = told_by(call, path, axes="zyx")
        np.testing.assert_array_equal(read.decode(), labels)
        assert not any("which axis" in line for line in told)
        read, told = told_by(call, path)
        np.testing.assert_array_equal(read.decode(), napari)
        assert any("(50, 30, 40) is taken as xyz" in line for line in told)
        assert not any("which axis" in line for line in told_by(call, path, axes="xyz")[1])
    pumice.compress(labels).verify(path, axes="zyx")


def test_an_order_is_refused_where_the_file_says_it(cortex, volume, napari, tmp_path):
    volume.save(tmp_path / "a.pumice")
    for path in (cortex, tmp_path / "a.pumice"):
        for call in (pumice.open, pumice.probe):
            with pytest.raises(pumice.InputError, match="zyx cannot be chosen: .*which axis is which"):
                call(path, axes="zyx")
    np.save(tmp_path / "a.npy", napari)
    for axes in ("yxz", "ZYX", "", 3):
        for call, source in ((pumice.open, tmp_path / "a.npy"), (pumice.compress, napari), (pumice.probe, tmp_path / "a.npy")):
            with pytest.raises(pumice.InputError, match="axes: expected one of xyz, zyx, "):
                call(source, axes=axes)


def test_probe_lists_what_a_file_leaves_open(napari, cortex, tmp_path):
    np.savez(tmp_path / "a.npz", cells=napari, nuclei=napari[0], factor=np.ones(3))
    found = pumice.probe(tmp_path / "a.npz")
    arrays, axes = found["choices"]
    assert arrays["keyword"] == "array" and arrays["assumed"] is None
    assert [v["value"] for v in arrays["values"]] == ["cells", "nuclei"] and arrays["values"][0]["text"].startswith("(50, 30, 40)")
    assert axes["keyword"] == "axes" and axes["assumed"] == "xyz"
    # Each answer goes back as a keyword.
    for value, dims in (("xyz", [50, 30, 40]), ("zyx", [40, 30, 50])):
        found = pumice.probe(tmp_path / "a.npz", **{"array": "cells", axes["keyword"]: value})
        assert found["dims"] == dims and found["choices"] == []
    layers = pumice.probe(cortex.with_name("slicer_SegmentationOverlapping.seg.nrrd"))
    (choice,) = layers["choices"]
    assert choice["keyword"] == "layer" and "overlapping sphere" in choice["values"][1]["text"] and layers["orientation"] == "RAS", "its x and y run against LPS"
    found = pumice.probe(cortex)
    assert found["choices"] == [] and found["bytes_uncompressed"] == 256 * 256 * 512 * int(found["label_type"][1:]) // 8
    assert found["bytes_expected"] > 256 * 256 * 512
