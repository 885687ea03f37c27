"""`Volume.write`: the formats of the command, folders of chunks, and what is refused."""

import json
import warnings

import numpy as np
import pumice
import pytest
import zarr


@pytest.fixture
def volume():
    labels = (np.arange(20 * 18 * 9) % 7).astype("u2").reshape(20, 18, 9)
    table = pumice.AnnotationTable([3], names=["left"], colors=[(1, 0, 0.2)])
    return pumice.compress(labels, spacing=(1, 2, 3), unit="um", table=table), labels


def test_folders_and_files(volume, tmp_path):
    volume, labels = volume
    volume.write(tmp_path / "a.zarr", chunk=8, shards=True)
    volume.write(tmp_path / "old", format="ome-zarr", ome_version="0.4")
    for name in ("a.zarr", "old"):
        group = zarr.open_group(tmp_path / name, mode="r")
        assert np.array_equal(group["0"][:], labels.transpose())
    with pytest.warns(pumice.PumiceWarning, match="uint32"):
        volume.write(tmp_path / "p", format="precomputed", gzip=True)
    assert json.loads((tmp_path / "p" / "info").read_text())["scales"][0]["resolution"] == [1000, 2000, 3000]
    # Control: what holds everything says nothing.
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        volume.write(tmp_path / "a.npy")
    assert np.array_equal(np.load(tmp_path / "a.npy"), labels)
    for name in ("a.zarr", "old", "p"):
        assert np.array_equal(pumice.open(tmp_path / name).decode(dtype="u2"), labels)


@pytest.mark.parametrize(
    "name, keywords, words",
    [
        ("b.nrrd", {"shards": True}, "has no effect"),
        ("b.zarr", {"gzip": True}, "has no effect"),
        ("b.zarr", {"chunk": 7}, "the side of a chunk is 7"),
        ("b", {"format": "n5"}, "format: expected one of"),
        ("b.zarr", {"ome_version": "0.6"}, "ome_version: expected one of"),
        ("b", {"format": "precomputed", "encoding": "png"}, "encoding: expected one of"),
        ("there.zarr", {}, "new folder"),
        ("b.xyz", {}, "the ending names no format"),
    ],
)
def test_what_is_refused(volume, tmp_path, name, keywords, words):
    (tmp_path / "there.zarr").mkdir()
    with pytest.raises(pumice.InputError, match=words):
        volume[0].write(tmp_path / name, **keywords)
    assert [p.name for p in tmp_path.iterdir()] == ["there.zarr"]
