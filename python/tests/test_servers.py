"""Stores on a server, on loopback, are what they are in a folder."""

import numpy as np
import pumice
import pumice.dask
import pytest
import zarr
from store_server import serving


@pytest.fixture
def url(tmp_path):
    """A folder `served` on a server, where `a.zarr` is an array of 3 × 2 × 2 chunks."""
    served = tmp_path / "served"
    labels = (np.arange(30 * 20 * 25, dtype="u8") // 500 << 40).reshape(30, 20, 25)
    zarr.create_array(served / "a.zarr", data=labels, chunks=(10, 10, 13), dimension_names=["z", "y", "x"])
    with serving(served) as server:
        yield f"{server.url}/a.zarr"


def test_a_store_on_a_server_is_the_store(url, tmp_path):
    folder = tmp_path / "served" / "a.zarr"
    with pytest.warns(pumice.PumiceWarning, match="no spacing"):
        expected, volume = pumice.compress(folder), pumice.open(url)
        assert np.array_equal(volume.decode(), expected.decode()) and volume.dims == (25, 20, 30)
        assert tuple(pumice.probe(url)["dims"]) == (25, 20, 30)
        expected.save(tmp_path / "a.pumice")
        pumice.compress_file(url, tmp_path / "b.pumice")
        pumice.dask.compress(url, tmp_path / "c.pumice")
    assert (tmp_path / "a.pumice").read_bytes() == (tmp_path / "b.pumice").read_bytes() == (tmp_path / "c.pumice").read_bytes()


def test_a_picture_of_it_cannot_be_made_again(url, tmp_path):
    """Unless the volume is saved: pictures name files."""
    with pytest.warns(pumice.PumiceWarning, match="no spacing"):
        volume = pumice.open(url)
    with pytest.warns(pumice.PumiceWarning, match="cannot be drawn again"):
        pumice.figure(volume, size=(8, 8)).save(tmp_path / "a.json")
    volume.save(tmp_path / "a.pumice")
    pumice.figure(volume, size=(8, 8)).save(tmp_path / "a.json")


def test_what_is_not_there_is_said(url):
    with pytest.raises(pumice.InputError, match="gives none of the files that describe a store"):
        pumice.open(url.replace("a.zarr", "b.zarr"))
