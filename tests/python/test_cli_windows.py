"""A region of a file is what numpy cuts out of all of its voxels, however these are stored: rows, strips, tiles and pages outside it are skipped.
Negative control: the region beside it differs."""

import gzip

import nrrd
import numpy as np
import pytest
import tifffile
from command import run
from share import some_of_today

# x, y, z; no two voxels have the same label.
SHAPE = (70, 50, 40)
LABELS = np.arange(1, 1 + np.prod(SHAPE), dtype=np.uint32).reshape(SHAPE)
ZYX = LABELS.transpose(2, 1, 0)


def npy_c(path):
    np.save(path.with_suffix(".npy"), LABELS)
    return [path.with_suffix(".npy"), "--axes", "xyz"]


def npy_f(path):
    np.save(path.with_suffix(".npy"), np.asfortranarray(LABELS))
    return [path.with_suffix(".npy"), "--axes", "xyz"]


def raw_big_endian(path):
    path.with_suffix(".raw").write_bytes(b"abc" + LABELS.astype(">u4").tobytes(order="F"))
    dims = ",".join(map(str, SHAPE))
    return [path.with_suffix(".raw"), "--raw-dims", dims, "--raw-type", "u32", "--raw-offset", "3", "--raw-big-endian"]


def raw_gzip(path):
    path.with_suffix(".raw.gz").write_bytes(gzip.compress(LABELS.tobytes(order="F"), 1))
    return [path.with_suffix(".raw.gz"), "--raw-dims", ",".join(map(str, SHAPE)), "--raw-type", "u32"]


def nrrd_layers(path):
    """The second of two layers, which lie voxel by voxel beside each other."""
    both = np.stack([LABELS[::-1], LABELS])
    header = {"kinds": ["list", "domain", "domain", "domain"], "space": "left-posterior-superior", "encoding": "raw"}
    header |= {"space directions": np.array([[np.nan] * 3, [1, 0, 0], [0, 1, 0], [0, 0, 1]])}
    nrrd.write(str(path.with_suffix(".seg.nrrd")), both, header)
    return [path.with_suffix(".seg.nrrd"), "--layer", "1"]


def tiff(**options):
    def write(path):
        tifffile.imwrite(path.with_suffix(".tif"), ZYX, photometric="minisblack", **options)
        return [path.with_suffix(".tif")]

    return write


def tiff_channels(path):
    """The second of three channels of each slice."""
    slices = np.stack([ZYX[::-1], ZYX, ZYX + 7], axis=1).astype(np.float32)
    tifffile.imwrite(path.with_suffix(".tif"), slices, imagej=True, metadata={"axes": "ZCYX"})
    return [path.with_suffix(".tif"), "--channel", "1"]


def tiff_slices(path):
    path.mkdir()
    for z, plane in enumerate(ZYX):
        tifffile.imwrite(path / f"s{z}.tif", plane, compression="zlib", rowsperstrip=4)
    return [path]


FILES = {
    "npy C": npy_c,
    "npy Fortran": npy_f,
    "raw big-endian": raw_big_endian,
    "raw gzip": raw_gzip,
    "NRRD layers": nrrd_layers,
    "TIFF": tiff(),
    "TIFF big-endian": tiff(byteorder=">"),
    "TIFF strips": tiff(rowsperstrip=3),
    "TIFF strips big-endian": tiff(rowsperstrip=3, byteorder=">"),
    "TIFF deflate": tiff(compression="zlib"),
    "TIFF deflate strips": tiff(compression="zlib", rowsperstrip=7, predictor=True),
    "TIFF tiles": tiff(tile=(16, 32)),
    "TIFF deflate tiles": tiff(tile=(16, 32), compression="zlib"),
    "TIFF channels": tiff_channels,
    "TIFF slices": tiff_slices,
}

REGIONS = [
    [(0, 70), (0, 50), (0, 40)],
    [(69, 70), (49, 50), (39, 40)],
    [(3, 41), (0, 50), (0, 40)],
    [(0, 70), (13, 14), (5, 33)],
    [(17, 18), (21, 46), (0, 17)],
    [(20, 64), (7, 49), (16, 40)],
]


@pytest.fixture(scope="module", params=FILES)
def source(request, tmp_path_factory):
    return FILES[request.param](tmp_path_factory.mktemp("file") / "a")


def read(pumice, source, roi, folder):
    run(pumice, "compress", *source, "--roi", roi, "--level", "fast", "-o", folder / "a.pumice").fine()
    run(pumice, "decompress", folder / "a.pumice", "-o", folder / "a.npy").fine()
    return np.load(folder / "a.npy")


@pytest.mark.parametrize("region", some_of_today(REGIONS, 4), ids=str)
def test_a_region_is_what_numpy_cuts_out(pumice, source, region, tmp_path):
    found = read(pumice, source, ",".join(f"{low}:{high}" for low, high in region), tmp_path)
    np.testing.assert_array_equal(found, LABELS[tuple(slice(*pair) for pair in region)])


def test_the_region_beside_it_differs(pumice, source, tmp_path):
    assert (read(pumice, source, "4:42,:,:", tmp_path) != LABELS[3:41]).all()
