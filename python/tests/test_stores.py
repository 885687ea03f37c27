"""Levels, regions and joined ids by the keywords of `open`, `probe`, `compress` and `verify`."""

import json
import pathlib

import numpy as np
import pumice
import pytest

LABELS = np.arange(7 * 6 * 5, dtype=np.uint32).reshape(7, 6, 5) // 9


@pytest.fixture
def store(tmp_path):
    """A Neuroglancer volume of two levels, written by hand: the second has every other voxel."""
    scales = []
    for key, part, size in [("fine", LABELS, 4), ("coarse", LABELS[::2, ::2, ::2], 8)]:
        scales.append(
            {"key": key, "size": part.shape, "resolution": [size] * 3, "voxel_offset": [0] * 3, "chunk_sizes": [[4, 4, 4]], "encoding": "raw"}
        )
        (tmp_path / "cells" / key).mkdir(parents=True)
        for low in np.ndindex(*(-(-n // 4) for n in part.shape)):
            span = [(4 * i, min(4 * i + 4, n)) for i, n in zip(low, part.shape)]
            chunk = part[tuple(slice(*ends) for ends in span)]
            name = "_".join(f"{a}-{b}" for a, b in span)
            (tmp_path / "cells" / key / name).write_bytes(chunk.astype("<u4").tobytes(order="F"))
    (tmp_path / "cells" / "info").write_text(json.dumps({"type": "segmentation", "data_type": "uint32", "num_channels": 1, "scales": scales}))
    return tmp_path / "cells"


def test_levels_and_regions(store):
    with pytest.warns(pumice.PumiceWarning, match="finest of 2 levels"):
        assert np.array_equal(pumice.open(store).decode(), LABELS)
    coarse = LABELS[::2, ::2, ::2]
    for scale in (1, np.int64(1), [8, 8, 8], (8.0, 8, 8), "1"):
        assert np.array_equal(pumice.open(store, scale=scale).decode(), coarse)
    for roi in ([(1, 4), (0, None), (None, 2)], [slice(1, 4), slice(0, None), slice(None, 2)], "1:4,:,:2"):
        part = pumice.open(store, scale=0, roi=roi)
        assert np.array_equal(part.decode(), LABELS[1:4, :, :2])
        assert part.world_from_index[:3, 3].tolist() == [4, 0, 0]
    assert pumice.probe(store, scale=1)["dims"] == [4, 3, 3]
    asked = {c["keyword"]: c for c in pumice.probe(store)["choices"]}
    assert [v["value"] for v in asked["scale"]["values"]] == ["0", "1"] and asked["scale"]["assumed"] == "0"
    volume = pumice.compress(store, scale=1)
    assert volume.verify(store, scale=1) is None
    with pytest.raises(pumice.InputError, match="expected 7 × 6 × 5 voxels, got 4 × 3 × 3"):
        volume.verify(store, scale=0)


def test_joined_ids(store, tmp_path):
    pairs = np.array([[1, 10], [2, 10]], np.uint64)
    np.save(tmp_path / "pairs.npy", pairs)
    with pytest.warns(pumice.PumiceWarning, match="stay as they are"):
        joined = pumice.open(store, scale=0, relabel=tmp_path / "pairs.npy")
    assert np.array_equal(joined.decode(), np.where((LABELS == 1) | (LABELS == 2), 10, LABELS))


def test_absent_chunks(store):
    (store / "fine" / "0-4_0-4_0-4").unlink()
    with pytest.warns(pumice.PumiceWarning, match="1 of 8 chunks are not there"):
        assert pumice.open(store, scale=0).decode()[:4, :4, :4].max() == 0
    with pytest.raises(pumice.InputError, match="is not there"):
        pumice.open(store, scale=0, missing_chunks="error")


def test_a_scene_remembers_what_was_read(store):
    volume = pumice.open(store, scale=1, roi=[(0, 2), (None, None), (1, 3)])
    said = pumice.figure(volume, size=(16, 16)).to_dict()["instances"][0]["reading"]
    assert said == {"scale": 1, "roi": [[0, 2], [None, None], [1, 3]]}


@pytest.mark.parametrize(
    "keywords",
    [{"scale": 2}, {"scale": -1}, {"scale": [1, 2]}, {"scale": "x"}, {"scale": True}, {"roi": [(0, 1)] * 2}, {"roi": 3}, {"roi": [(3, 1)] * 3},
     {"roi": [(0, 99), (0, 1), (0, 1)]}, {"roi": [slice(0, 4, 2)] * 3}, {"label": "a"}, {"label": 3}, {"dataset": "a"}, {"missing_chunks": "skip"},
     {"relabel": "nothing.csv"}, {"axes": "zyx"}, {"layer": 0}],
)  # fmt: skip
def test_what_does_not_fit_is_refused(store, keywords):
    with pytest.raises((pumice.InputError, OSError)) as refused:
        pumice.open(pathlib.Path(store), **({"scale": 0} | keywords))
    assert len(str(refused.value).splitlines()) == 1
