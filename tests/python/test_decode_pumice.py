"""Tests .pumice files with the independent decoder, on volumes whose voxels are known.

The example `write_samples` of pumice-core makes the files. They are in the folder PUMICE_SAMPLES; if that is not set, they are made.
"""

import os
import pathlib
import struct
import subprocess

import numpy as np
import pytest

import decode_pumice


@pytest.fixture(scope="session")
def samples(rust_example, tmp_path_factory):
    given = os.environ.get("PUMICE_SAMPLES")
    folder = pathlib.Path(given) if given else tmp_path_factory.mktemp("samples")
    if not given:
        subprocess.run([rust_example("write_samples"), folder], check=True)
    files = sorted(folder.glob("*.pumice"))
    assert len(files) >= 20, f"{folder} has {len(files)} samples"
    return files


def expected_ids(file):
    """The voxels of NAME.LEVEL.pumice from NAME.ids: dimensions as 3 u32, then a u64 per voxel, x fastest."""
    data = file.with_name(file.name.split(".")[0] + ".ids").read_bytes()
    dims = struct.unpack_from("<3I", data)
    return np.frombuffer(data, "<u8", offset=12).reshape(dims, order="F")


def test_every_voxel_is_the_same(samples):
    for file in samples:
        ids, info = decode_pumice.decode(file.read_bytes())
        expected = expected_ids(file)
        assert info["volume"]["dims"] == list(expected.shape)
        assert (ids == expected).all(), f"{file.name}: first difference at {np.argwhere(ids != expected)[0]}"


def test_other_versions_are_refused(samples):
    data = bytearray(samples[0].read_bytes())
    for version in (0, 4, 5, 7):
        data[8:12] = struct.pack("<I", version)
        with pytest.raises(AssertionError, match=f"file version: expected 6, got {version}"):
            decode_pumice.decode(bytes(data))


def test_all_kinds_of_leaves_are_there(samples):
    files = [f for f in samples if ".small." not in f.name]
    sections = [chunk for f in files for chunk in decode_pumice.read_sections(f.read_bytes())[1]]
    assert any(len(s["RARE"]) for s in sections) and any(len(s["LEAF"]) for s in sections)
    assert any(len(s["SLIC"]) > 512 for s in sections) and any(0 < len(s["SLIC"]) <= 512 for s in sections)


def test_a_chunk_is_decoded_without_the_others(samples):
    """The sections of one chunk of a packed file give its boxes; those of the other chunks are not there."""
    faces = next(f for f in samples if f.name == "faces.default.pumice")
    head, of_chunk = decode_pumice.read_sections(faces.read_bytes())
    assert len(of_chunk) == 2 and len({chunk["LEAF"] for chunk in of_chunk}) == 2
    ids, expected = np.frombuffer(head["LIDS"], "<u8"), expected_ids(faces)
    fields, number = decode_pumice.packed_nodes(of_chunk[1])
    labels = np.frombuffer(of_chunk[1]["RUNS"], "<u4").reshape(-1, 2)
    starts = [int(first) for _, first in labels] + [len(number)]
    for (label, _), first, end in zip(labels, starts, starts[1:]):
        voxels = sum(int(decode_pumice.mask_bits(fields[n]).sum()) for n in number[first:end])
        assert voxels == np.count_nonzero(expected[1024:] == ids[label])


def test_contacts_are_the_same(samples):
    # Files of voxels (level small) store no contacts, since they follow from the voxels.
    for file in (f for f in samples if ".small." not in f.name):
        ids = expected_ids(file)
        pairs = set()
        for axis in range(3):
            a, b = np.moveaxis(ids, axis, 0)[:-1].ravel(), np.moveaxis(ids, axis, 0)[1:].ravel()
            touch = (a != b) & (a != 0) & (b != 0)
            found = np.stack([np.minimum(a, b)[touch], np.maximum(a, b)[touch]], axis=1)
            pairs |= set(map(tuple, np.unique(found, axis=0).tolist()))
        labels = np.unique(ids[ids != 0]).tolist()
        got = [(labels[a], labels[b]) for a, b in decode_pumice.contacts(file.read_bytes())]
        assert got == sorted(pairs), file.name


def test_a_wrong_voxel_would_be_noticed(samples):
    """Control: the comparison fails for a file of another volume of the same size."""
    by_shape = {}
    for file in samples:
        by_shape.setdefault(expected_ids(file).shape, []).append(file)
    pairs = [f for f in by_shape.values() if len({x.name.split(".")[0] for x in f}) > 1]
    assert pairs
    for files in pairs:
        names = sorted(files, key=lambda f: f.name)
        ids, _ = decode_pumice.decode(names[0].read_bytes())
        assert (ids != expected_ids(names[-1])).any()
