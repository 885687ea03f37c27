"""`pumice info` of files of others: what the header says, what the file leaves open, and the order of an array's axes.

The oracles are numpy, nibabel, pynrrd and tifffile, which write the files, and the peak memory that the system counts.
"""

import itertools
import json

import nibabel as nib
import nrrd
import numpy as np
import pytest
import tifffile

from command import run

# Sizes that all differ, and labels that all differ: any other order of axes, and any mirror, shows.
SHAPE = (5, 4, 3)
LABELS = np.arange(1, 61, dtype=np.uint8).reshape(SHAPE)


def info_of(pumice, path, *options):
    return json.loads(run(pumice, "info", path, "--json", *options).fine())


def compressed(pumice, source, folder, *options):
    """(array[x, y, z] of what the command reads, warnings)."""
    done = run(pumice, "compress", source, "-o", folder / "o.pumice", *options)
    assert "warning" not in done.fine()
    run(pumice, "decompress", folder / "o.pumice", "-o", folder / "o.npy").fine()
    return np.load(folder / "o.npy"), done.warnings


@pytest.mark.parametrize("order", ["C", "F"])
def test_a_napari_array_is_read_as_numpy_indexes_it(pumice, tmp_path, order):
    """`a[z, y, x]` with --axes zyx, in both orders of memory; without the option the command says what it takes."""
    path = tmp_path / "a.npy"
    np.save(path, np.asarray(LABELS, order=order))
    read, lines = compressed(pumice, path, tmp_path, "--axes", "zyx")
    assert np.array_equal(read, LABELS.transpose(2, 1, 0)) and not any("which axis is which" in line for line in lines)
    read, lines = compressed(pumice, path, tmp_path)
    assert np.array_equal(read, LABELS)
    (line,) = [line for line in lines if "which axis is which" in line]
    assert "(5, 4, 3) is taken as xyz" in line and "--axes" in line
    # Who says xyz needs no warning, and all others say the same words on standard error.
    assert not any("which axis is which" in line for line in compressed(pumice, path, tmp_path, "--axes", "xyz")[1])
    small = ["-o", tmp_path / "p.png", "--size", "8x8", "--spp", "1", "--backend", "cpu"]
    for command in (["info"], ["info", "--json"], ["info", "--labels"], ["table", "-o", tmp_path / "t.csv"], ["render", *small]):
        done = run(pumice, command[0], path, *command[1:])
        assert done.warnings == lines and "taken as xyz" not in done.out.replace(json.dumps(line), ""), command
    assert run(pumice, "verify", tmp_path / "o.pumice", path, "--axes", "zyx").code == 1


def test_info_says_what_compress_says_of_several_volumes(pumice, tmp_path):
    stack = np.stack([LABELS, LABELS[::-1]])
    tifffile.imwrite(tmp_path / "channels.tif", stack.transpose(1, 0, 2, 3), imagej=True, metadata={"axes": "ZCYX"})
    tifffile.imwrite(tmp_path / "times.tif", stack, imagej=True, metadata={"axes": "TZYX"})
    nib.save(nib.Nifti1Image(stack.transpose(3, 2, 1, 0), np.eye(4)), tmp_path / "times.nii")
    nrrd.write(str(tmp_path / "layers.nrrd"), stack, {"kinds": ["list", "domain", "domain", "domain"]})
    np.savez(tmp_path / "arrays.npz", first=LABELS, second=LABELS, spacing=np.ones(3))
    for name, keyword, values in [
        ("channels.tif", "channel", ["0", "1"]),
        ("times.tif", "time", ["0", "1"]),
        ("times.nii", "time", ["0", "1"]),
        ("layers.nrrd", "layer", ["0", "1"]),
        ("arrays.npz", "array", ["first", "second"]),
    ]:
        path = tmp_path / name
        said = run(pumice, "compress", path, "-o", tmp_path / "o.pumice").refused().split(f"{name}: ", 1)[1]
        line = next(line for line in run(pumice, "info", path).fine().splitlines() if line.startswith("open"))
        assert line.split(None, 1) == ["open", said], name
        choice = info_of(pumice, path)["choices"][0]
        assert (choice["keyword"], choice["count"], choice["assumed"]) == (keyword, 2, None), name
        assert [value["value"] for value in choice["values"]] == values, name
        # What is chosen is not open, and the volume that is described is the chosen one.
        told = info_of(pumice, path, choice["option"], values[1])
        assert keyword not in [c["keyword"] for c in told["choices"]] and sorted(told["dims"]) == [3, 4, 5], name
    # A control: one volume leaves nothing open.
    nib.save(nib.Nifti1Image(LABELS, np.eye(4)), tmp_path / "one.nii")
    assert info_of(pumice, tmp_path / "one.nii")["choices"] == []
    assert "open " not in run(pumice, "info", tmp_path / "one.nii").fine()


def test_arrays_are_listed_with_shape_and_type(pumice, tmp_path):
    np.savez(tmp_path / "a.npz", cells=np.ones((4, 5, 6), "<u4"), nuclei=np.ones((4, 5), "u1"))
    arrays, axes = info_of(pumice, tmp_path / "a.npz")["choices"]
    assert [(v["value"], v["text"]) for v in arrays["values"]] == [("cells", "(4, 5, 6) of <u4"), ("nuclei", "(4, 5) of |u1")]
    assert (axes["keyword"], axes["assumed"], [v["value"] for v in axes["values"]]) == ("axes", "xyz", ["xyz", "zyx"])
    assert "xyz is assumed" in run(pumice, "info", tmp_path / "a.npz", "--array", "cells").fine()


def test_files_that_say_their_axes_refuse_an_order(pumice, tmp_path):
    nrrd.write(str(tmp_path / "a.nrrd"), LABELS)
    nib.save(nib.Nifti1Image(LABELS, np.eye(4)), tmp_path / "a.nii.gz")
    run(pumice, "compress", tmp_path / "a.nrrd", "-o", tmp_path / "a.pumice").fine()
    for name in ["a.nrrd", "a.nii.gz", "a.pumice"]:
        for command in [["info"], ["render", "-o", tmp_path / "p.png", "--spp", "1"]]:
            line = run(pumice, command[0], tmp_path / name, *command[1:], "--axes", "zyx").refused()
            assert "zyx cannot be chosen" in line and "which axis is which" in line, name
    assert not (tmp_path / "p.png").exists()


def test_orientation_letters_are_those_of_nibabel(pumice, tmp_path):
    """All 48 directions, each oblique by up to 20° about a random axis, and sheared ones."""
    random = np.random.default_rng(5)
    for number, (order, signs) in enumerate(itertools.product(itertools.permutations(range(3)), itertools.product([1, -1], repeat=3))):
        turn = np.zeros((3, 3))
        turn[order, range(3)] = signs
        axis = random.normal(size=3)
        axis /= np.linalg.norm(axis)
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        angle = np.radians(random.uniform(0, 20))
        oblique = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        affine = np.eye(4)
        affine[:3, :3] = oblique @ turn * random.uniform(0.1, 9, 3)
        path = tmp_path / f"{number}.nii"
        nib.save(nib.Nifti1Image(LABELS, affine), path)
        letters = "".join(nib.aff2axcodes(nib.load(path).affine))
        assert info_of(pumice, path)["orientation"] == letters
    words = {"R": "right", "L": "left", "A": "anterior", "P": "posterior", "S": "superior", "I": "inferior"}
    line = next(line for line in run(pumice, "info", path).fine().splitlines() if line.startswith("axes"))
    assert line.split(None, 1)[1] == f"{letters}: x, y and z run to {', '.join(words[c] for c in letters)}"
    # A file without world axes has no letters.
    np.save(tmp_path / "a.npy", LABELS)
    assert info_of(pumice, tmp_path / "a.npy")["orientation"] is None
    assert "axes  " not in run(pumice, "info", tmp_path / "a.npy").fine()
    # The compressed form keeps the directions.
    run(pumice, "compress", path, "-o", tmp_path / "o.pumice").fine()
    assert info_of(pumice, tmp_path / "o.pumice")["orientation"] == letters


@pytest.mark.parametrize("name", ["connectomics_32x32x40nm.nrrd", "torchio_t1_seg_gif_PIR.nii.gz", "platynereis_nuclei.tif"])
def test_expected_memory_is_enough_and_not_absurd(pumice, data, tmp_path, name):
    found = info_of(pumice, data / name)
    voxels = int(np.prod(found["dims"]))
    width = int(found["label_type"][1:]) // 8
    assert (found["bytes_raw"], found["bytes_uncompressed"]) == (4 * voxels, width * voxels)
    report = run(pumice, "compress", data / name, "-o", tmp_path / "o.pumice", "--json", "-").fine()
    peak = json.loads(report)["peak_rss_bytes"]
    # Three times as much would frighten people away from volumes that fit.
    assert peak <= found["bytes_expected"] <= 3 * peak


def test_a_file_of_a_terabyte_is_described_in_little_memory(pumice, tmp_path):
    path = tmp_path / "a.npy"
    np.lib.format.open_memmap(path, mode="w+", dtype="u1", shape=(1 << 10, 1 << 10, 1 << 20))
    done = run(pumice, "info", path, "--json")
    assert json.loads(done.fine())["bytes_uncompressed"] == 1 << 40
    # A thousandth of the file; what is counted includes this process, which starts the command.
    assert done.peak_rss_bytes < 1 << 30
