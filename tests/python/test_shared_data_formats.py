"""Tests real volumes that may not be shipped: dimensions, spacing, orientation and voxels must be those of nibabel, pynrrd and tifffile."""

import gzip

import nibabel as nib
import nrrd
import numpy as np
import pytest
import tifffile

from format_dump import affine, build


@pytest.fixture(scope="module")
def formats(rust_example):
    return build(rust_example)


@pytest.mark.parametrize(
    "name, dims, spacing, unit",
    [
        ("connectomics_16x16x40nm.nrrd", [512, 512, 512], [16, 16, 40], "nm"),
        ("connectomics_32x32x40nm.nrrd", [256, 256, 512], [32, 32, 40], "nm"),
        ("slicer_Segmentation.seg.nrrd", [128, 128, 34], [3.04687595367432, 3.04687595367432, 10], "unknown"),
    ],
)
def test_nrrd(formats, shared_data, tmp_path, name, dims, spacing, unit):
    header, ours = formats.read(shared_data / name, tmp_path)
    theirs, their_header = nrrd.read(str(shared_data / name))
    assert np.array_equal(ours, theirs)
    assert header["dims"] == dims and header["unit"] == unit
    assert np.allclose(header["spacing"], spacing, rtol=1e-12)  # 9.9999999999999964 in the file
    assert np.array_equal(affine(header)[:3, :3].T, their_header["space directions"])


def test_slicer_names(formats, shared_data, tmp_path):
    header, _ = formats.read(shared_data / "slicer_Segmentation.seg.nrrd", tmp_path)
    assert [n["name"] for n in header["notes"]][:2] == ["ribs", "cervical vertebral column"]
    assert len(header["notes"]) == 7 and header["frame"] == "LPS"


def test_overlapping_layers(formats, shared_data, tmp_path):
    path = shared_data / "slicer_SegmentationOverlapping.seg.nrrd"
    theirs, _ = nrrd.read(str(path))
    for layer in range(2):
        header, ours = formats.read(path, tmp_path, "--layer", str(layer))
        assert np.array_equal(ours, theirs[layer])
    assert [n["name"] for n in header["notes"]] == ["overlapping sphere"]
    assert "overlapping sphere" in formats.refuse(path)


@pytest.mark.parametrize(
    "name, dims", [("torchio_t1_seg_gif_PIR.nii.gz", [256, 256, 176]), ("gubra_mouse_brain_atlas.nii.gz", [461, 621, 323])]
)
def test_nifti(formats, shared_data, tmp_path, name, dims):
    header, ours = formats.read(shared_data / name, tmp_path)
    theirs = nib.load(shared_data / name)
    assert np.array_equal(ours, theirs.dataobj)
    # Both compute the quaternion's matrix in doubles, but in different order.
    assert np.allclose(affine(header), theirs.affine, rtol=1e-12, atol=1e-10)
    assert header["dims"] == dims and header["spacing"] == [1, 1, 1] and header["unit"] == "mm"


def test_tiff(formats, shared_data, tmp_path):
    header, ours = formats.read(shared_data / "platynereis_nuclei.tif", tmp_path)
    assert np.array_equal(ours.T, tifffile.imread(shared_data / "platynereis_nuclei.tif"))
    assert header["dims"] == [256, 256, 103] and any("spacing" in w for w in header["warnings"])


def test_raw(formats, shared_data, tmp_path):
    path = shared_data / "neuroglancer_64cube_u64.raw.gz"
    _, ours = formats.read(path, tmp_path, "--raw", "64,64,64,u64")
    theirs = np.frombuffer(gzip.open(path).read(), "<u8").reshape((64, 64, 64), order="F")
    assert np.array_equal(ours, theirs)
