"""Compares pumice-formats with nibabel, pynrrd, tifffile and numpy, which share no code with it: same voxels, same affine.

Voxels must be equal to the last bit, and affines too, except where a test says why not.
"""

import itertools

import nibabel as nib
import nrrd
import numpy as np
import pytest
import tifffile
import zarr

from format_dump import affine, build, pattern

INTEGERS = ["u1", "u2", "u4", "u8", "i1", "i2", "i4", "i8"]
ALL = INTEGERS + ["f4", "f8"]
NAMES = {"u": "u", "i": "i", "f": "f"}
SHAPE = (7, 5, 6)


def label_type(dtype):
    dtype = np.dtype(dtype)
    return f"{NAMES[dtype.kind]}{8 * dtype.itemsize}"


@pytest.fixture(scope="module")
def formats(rust_example):
    return build(rust_example)


def random_affine(seed):
    """A random affine as scanners write them: rotation with flips, unequal spacing, offset."""
    random = np.random.default_rng(seed)
    q, _ = np.linalg.qr(random.normal(size=(3, 3)))
    m = np.eye(4)
    m[:3, :3] = q * random.uniform(0.1, 9, 3)
    m[:3, 3] = random.uniform(-200, 200, 3)
    return m


def same_affine(ours, theirs):
    """Whether affines agree: axes to the last bit, the origin up to rounding, because it is moved to the voxel's corner and, for the
    comparison, back (sums of four numbers, each rounded once)."""
    theirs = np.asarray(theirs, dtype=np.float64)
    size = np.abs(theirs[:3, 3]) + np.abs(theirs[:3, :3]).sum(axis=1)
    moved = np.abs(ours[:3, 3] - theirs[:3, 3])
    return np.array_equal(ours[:3, :3], theirs[:3, :3]) and bool((moved <= 8 * np.finfo(float).eps / 2 * size).all())


# --- NRRD -------------------------------------------------------------------------------------------------------------------


def nrrd_header(matrix, **more):
    return {
        "space": "left-posterior-superior",
        "space directions": matrix[:3, :3].T,
        "space origin": matrix[:3, 3],
        "kinds": ["domain"] * 3,
        **more,
    }


@pytest.mark.parametrize("dtype", ALL)
@pytest.mark.parametrize("encoding", ["raw", "gzip", "ascii"])
@pytest.mark.parametrize("order", "<>")
def test_nrrd_matches_pynrrd(formats, tmp_path, dtype, encoding, order):
    # pynrrd writes text through doubles (%.17g), which loses 64-bit ids above 2⁵³ in the file.
    text64 = encoding == "ascii" and dtype in ("u8", "i8")
    labels = pattern(SHAPE, "f8" if text64 else dtype).astype(order + dtype)
    matrix = random_affine(ALL.index(dtype))
    path = tmp_path / "a.nrrd"
    nrrd.write(str(path), labels, nrrd_header(matrix, encoding=encoding))
    header = nrrd.read_header(str(path))
    found, ours = formats.read(path, tmp_path)
    assert np.array_equal(ours, labels.astype("u8"))
    assert np.array_equal(ours, nrrd.read(str(path))[0].astype("u8"))
    assert found["label_type"] == label_type(dtype)
    expected = np.eye(4)
    expected[:3, :3], expected[:3, 3] = np.array(header["space directions"]).T, header["space origin"]
    assert same_affine(affine(found), expected)
    assert found["frame"] == "LPS"


@pytest.mark.parametrize("encoding", ["raw", "gzip", "ascii"])
def test_detached_nrrd_matches_pynrrd(formats, tmp_path, encoding):
    labels = pattern(SHAPE, "u2")
    nrrd.write(str(tmp_path / "a.nhdr"), labels, {"encoding": encoding, "spacings": [1, 2, 3.5]}, detached_header=True)
    header, ours = formats.read(tmp_path / "a.nhdr", tmp_path)
    assert np.array_equal(ours, nrrd.read(str(tmp_path / "a.nhdr"))[0])
    assert header["spacing"] == [1, 2, 3.5]


def test_nrrd_layers_match_pynrrd(formats, tmp_path):
    labels = pattern((3, *SHAPE), "u1")
    path = tmp_path / "a.seg.nrrd"
    directions = np.vstack([[np.nan] * 3, np.diag([1.0, 2, 3])])
    nrrd.write(str(path), labels, {"kinds": ["list"] + ["domain"] * 3, "space directions": directions, "space": "RAS"})
    for layer in range(3):
        _, ours = formats.read(path, tmp_path, "--layer", str(layer))
        assert np.array_equal(ours, labels[layer])
    assert "3 layers" in formats.refuse(path) and "--layer" in formats.refuse(path)
    assert "layers is 3" in formats.refuse(path, "--layer", "3")


# --- NIfTI ------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", ALL)
@pytest.mark.parametrize("image", [nib.Nifti1Image, nib.Nifti2Image])
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("ending", [".nii", ".nii.gz"])
def test_nifti_matches_nibabel(formats, tmp_path, dtype, image, order, ending):
    labels = pattern(SHAPE, dtype)
    header = image.header_class(endianness=order)
    header.set_data_dtype(np.dtype(dtype).newbyteorder(order))
    volume = image(labels.astype(order + dtype), random_affine(3), header)
    path = tmp_path / f"a{ending}"
    volume.to_filename(path)
    theirs = nib.load(path)
    found, ours = formats.read(path, tmp_path)
    assert np.array_equal(ours, np.asarray(theirs.dataobj.get_unscaled()).astype("u8"))
    assert same_affine(affine(found), theirs.affine)
    assert found["frame"] == "RAS" and found["label_type"] == label_type(dtype)


@pytest.mark.parametrize("signs", list(itertools.product([1, -1], repeat=3)))
@pytest.mark.parametrize("axes", list(itertools.permutations(range(3))))
def test_nifti_orientations_match_nibabel(formats, tmp_path, signs, axes):
    matrix = np.eye(4)
    matrix[:3, :3] = (np.diag(signs) * [0.5, 1, 2])[:, axes]
    nib.Nifti1Image(pattern(SHAPE, "u1"), matrix).to_filename(tmp_path / "a.nii")
    found, ours = formats.read(tmp_path / "a.nii", tmp_path)
    theirs = nib.load(tmp_path / "a.nii")
    assert np.array_equal(ours, theirs.dataobj) and same_affine(affine(found), theirs.affine)


@pytest.mark.parametrize("sform, qform", [(0, 0), (0, 1), (1, 0), (2, 1)])
def test_nifti_form_codes_match_nibabel(formats, tmp_path, sform, qform):
    image = nib.Nifti1Image(pattern(SHAPE, "u1"), None)
    image.header.set_zooms((1.5, 2, 3))
    image.set_sform(random_affine(5), sform)
    image.set_qform(random_affine(6), qform)
    image.to_filename(tmp_path / "a.nii")
    found, _ = formats.read(tmp_path / "a.nii", tmp_path)
    # Both compute the quaternion's matrix in doubles from float32 numbers, but in different order.
    assert np.allclose(affine(found), nib.load(tmp_path / "a.nii").affine, rtol=1e-12, atol=1e-10)


def test_nifti_pair_matches_nibabel(formats, tmp_path):
    labels = pattern(SHAPE, "i2")
    nib.Nifti1Pair(labels, random_affine(1)).to_filename(tmp_path / "a.hdr")
    for name in ["a.hdr", "a.img"]:
        found, ours = formats.read(tmp_path / name, tmp_path)
        assert np.array_equal(ours, labels)
        assert same_affine(affine(found), nib.load(tmp_path / "a.hdr").affine)


# --- TIFF -------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", ALL)
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("bigtiff", [False, True])
@pytest.mark.parametrize(
    "how",
    [{}, {"compression": "zlib"}, {"tile": (16, 16)}, {"tile": (16, 32), "compression": "zlib"}, {"rowsperstrip": 3}],
    ids=str,
)
def test_tiff_matches_tifffile(formats, tmp_path, dtype, order, bigtiff, how):
    stack = pattern((4, 21, 37), dtype)
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, stack, byteorder=order, bigtiff=bigtiff, photometric="minisblack", **how)
    found, ours = formats.read(path, tmp_path)
    assert np.array_equal(ours.T, tifffile.imread(path).astype("u8"))
    assert found["label_type"] == label_type(dtype)
    assert any("slices along z" in w for w in found["warnings"])


def test_white_is_zero_keeps_labels(formats, tmp_path):
    stack = pattern((3, 8, 9), "u1")
    tifffile.imwrite(tmp_path / "a.tif", stack, photometric="miniswhite")
    assert np.array_equal(formats.read(tmp_path / "a.tif", tmp_path)[1].T, stack)


@pytest.mark.parametrize("dtype", ["u1", "u2", "f4"])
@pytest.mark.parametrize("truncate", [False, True])
def test_imagej_matches_tifffile(formats, tmp_path, dtype, truncate):
    # ImageJ orders axes T, Z, C, Y, X. `truncate` writes one directory for all planes, as ImageJ does above 4 GiB.
    stack = pattern((2, 4, 3, 8, 9), dtype)
    path = tmp_path / "a.tif"
    more = {"truncate": True} if truncate else {}
    metadata = {"axes": "TZCYX", "spacing": 3.0, "unit": "um"}
    tifffile.imwrite(path, stack, imagej=True, resolution=(4, 2), metadata=metadata, **more)
    assert "--time" in formats.refuse(path) or "--channel" in formats.refuse(path)
    for t, c in itertools.product(range(2), range(3)):
        found, ours = formats.read(path, tmp_path, "--time", str(t), "--channel", str(c))
        assert np.array_equal(ours.T, stack[t, :, c].astype("u8"))
    assert found["spacing"] == [0.25, 0.5, 3] and found["unit"] == "um"


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4", "i1", "i2", "i4", "f4", "f8"])
def test_ome_matches_tifffile(formats, tmp_path, dtype):
    stack = pattern((2, 3, 4, 8, 9), dtype)
    path = tmp_path / "a.ome.tif"
    metadata = {
        "axes": "TCZYX",
        "PhysicalSizeX": 0.1,
        "PhysicalSizeXUnit": "µm",
        "PhysicalSizeY": 200.0,
        "PhysicalSizeYUnit": "nm",
        "PhysicalSizeZ": 0.002,
        "PhysicalSizeZUnit": "mm",
    }
    tifffile.imwrite(path, stack, ome=True, photometric="minisblack", metadata=metadata)
    for t, c in itertools.product(range(2), range(3)):
        found, ours = formats.read(path, tmp_path, "--time", str(t), "--channel", str(c))
        assert np.array_equal(ours.T, stack[t, c].astype("u8"))
    assert found["unit"] == "um"
    # Conversion of nm and mm to µm rounds in the last digit.
    assert np.allclose(found["spacing"], [0.1, 0.2, 2.0], rtol=1e-14)


def test_folder_of_slices(formats, tmp_path):
    stack = pattern((12, 8, 9), "u2")
    folder = tmp_path / "slices"
    folder.mkdir()
    for z, plane in enumerate(stack):
        tifffile.imwrite(folder / f"slice{z}.tif", plane)
    assert np.array_equal(formats.read(folder, tmp_path)[1].T, stack)
    tifffile.imwrite(folder / "slice7.tif", stack[7, :5])
    assert "slice7.tif" in formats.refuse(folder)


@pytest.mark.parametrize("shape", [(8, 9, 3), (8, 9, 4)])
def test_colour_is_refused(formats, tmp_path, shape):
    tifffile.imwrite(tmp_path / "a.tif", np.zeros(shape, "u1"), photometric="rgb")
    assert "colour" in formats.refuse(tmp_path / "a.tif")


# --- NPY and NPZ ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [*ALL, "?"])
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("memory", "CF")
@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
def test_npy_matches_numpy(formats, tmp_path, dtype, order, memory, version):
    labels = (pattern(SHAPE, "u1") % 2).astype("?") if dtype == "?" else pattern(SHAPE, dtype).astype(order + dtype)
    path = tmp_path / "a.npy"
    with open(path, "wb") as file:
        np.lib.format.write_array(file, np.asarray(labels, order=memory), version)
    theirs = np.load(path).astype("u8")
    assert np.array_equal(formats.read(path, tmp_path)[1], theirs)
    assert np.array_equal(formats.read(path, tmp_path, "--zyx")[1], theirs.T)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_npz_matches_numpy(formats, tmp_path, save):
    labels = pattern(SHAPE, "u4")
    save(tmp_path / "a.npz", notes=np.zeros(3), labels=labels)
    assert np.array_equal(formats.read(tmp_path / "a.npz", tmp_path)[1], labels)
    save(tmp_path / "b.npz", a=labels, b=labels + 1)
    formats.refuse(tmp_path / "b.npz")
    assert np.array_equal(formats.read(tmp_path / "b.npz", tmp_path, "--array", "b")[1], labels + 1)


# --- Writers ----------------------------------------------------------------------------------------------------------------


@pytest.fixture
def source(tmp_path):
    """A function of a dtype that writes a volume with pynrrd; returns (path, labels, affine in LPS)."""

    def make(dtype, unit="mm"):
        labels, matrix = pattern((19, 17, 18), dtype), random_affine(8)
        path = tmp_path / "source.nrrd"
        nrrd.write(str(path), labels, nrrd_header(matrix, **{"space units": [unit] * 3}))
        return path, labels, matrix

    return make


@pytest.mark.parametrize("dtype", ALL)
def test_written_nrrd_is_read_by_pynrrd(formats, tmp_path, source, dtype):
    path, labels, matrix = source(dtype)
    formats.write(path, tmp_path / "out.nrrd")
    theirs, header = nrrd.read(str(tmp_path / "out.nrrd"))
    assert theirs.dtype == labels.dtype and np.array_equal(theirs, labels)
    assert np.array_equal(header["space directions"], matrix[:3, :3].T)
    assert np.array_equal(header["space origin"], matrix[:3, 3])
    assert header["space"] == "left-posterior-superior" and header["space units"] == ["mm"] * 3


@pytest.mark.parametrize("dtype", ALL)
@pytest.mark.parametrize("ending", [".nii", ".nii.gz"])
def test_written_nifti_is_read_by_nibabel(formats, tmp_path, source, dtype, ending):
    path, labels, matrix = source(dtype)
    formats.write(path, tmp_path / f"out{ending}")
    theirs = nib.load(tmp_path / f"out{ending}")
    assert theirs.get_data_dtype() == labels.dtype and np.array_equal(theirs.dataobj.get_unscaled(), labels)
    # NIfTI-1 stores the matrix in float32.
    expected = (np.diag([-1, -1, 1, 1]) @ matrix).astype("f4")
    assert np.array_equal(theirs.affine.astype("f4"), expected)
    assert theirs.header.get_xyzt_units()[0] == "mm"


def test_long_axis_becomes_nifti_2(formats, tmp_path):
    labels = pattern((40000, 2, 1), "u2")
    np.save(tmp_path / "a.npy", labels)
    formats.write(tmp_path / "a.npy", tmp_path / "out.nii.gz")
    theirs = nib.load(tmp_path / "out.nii.gz")
    assert isinstance(theirs, nib.Nifti2Image) and np.array_equal(theirs.dataobj, labels)


@pytest.mark.parametrize("dtype", ALL)
def test_written_npy_is_read_by_numpy(formats, tmp_path, source, dtype):
    path, labels, _ = source(dtype)
    formats.write(path, tmp_path / "out.npy")
    theirs = np.load(tmp_path / "out.npy")
    assert theirs.dtype == labels.dtype and np.array_equal(theirs, labels)


@pytest.mark.parametrize("dtype", ALL)
def test_written_tiff_is_read_by_tifffile(formats, tmp_path, source, dtype):
    path, labels, matrix = source(dtype, "nm")
    formats.write(path, tmp_path / "out.tif")
    theirs = tifffile.imread(tmp_path / "out.tif")
    assert theirs.dtype == labels.dtype and np.array_equal(theirs.T, labels)
    found, ours = formats.read(tmp_path / "out.tif", tmp_path)
    assert np.array_equal(ours, labels.astype("u8"))
    if dtype not in ("u8", "i8"):
        with tifffile.TiffFile(tmp_path / "out.tif") as file:
            assert file.is_ome and file.series[0].axes == "ZYX"
            pixels = tifffile.xml2dict(file.ome_metadata)["OME"]["Image"]["Pixels"]
        # The spacing is the length of the source's axis vectors, up to the rounding of a square root.
        spacing = np.linalg.norm(matrix[:3, :3], axis=0)
        assert np.allclose([pixels[f"PhysicalSize{a}"] for a in "XYZ"], spacing, rtol=1e-14)
        assert found["unit"] == "nm" and np.allclose(found["spacing"], spacing, rtol=1e-14)


def test_large_strip_count_round_trip(formats, tmp_path):
    """Pages with several strips, of which the last is shorter."""
    labels = pattern((600, 500, 3), "u4")
    np.save(tmp_path / "a.npy", labels)
    formats.write(tmp_path / "a.npy", tmp_path / "out.tif")
    assert np.array_equal(tifffile.imread(tmp_path / "out.tif").T, labels)


# --- MetaImage: no package here writes it, so the header is written by hand from its documentation ----------------------------


@pytest.mark.parametrize("dtype, name", [("u1", "MET_UCHAR"), ("u2", "MET_USHORT"), ("u4", "MET_UINT"), ("i2", "MET_SHORT")])
@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("big_endian", [False, True])
def test_metaimage_voxels(formats, tmp_path, dtype, name, compressed, big_endian):
    import zlib

    labels = pattern(SHAPE, dtype)
    data = labels.astype((">" if big_endian else "<") + dtype).tobytes(order="F")
    data = zlib.compress(data) if compressed else data
    text = f"""ObjectType = Image
NDims = 3
BinaryData = True
BinaryDataByteOrderMSB = {big_endian}
CompressedData = {compressed}
CompressedDataSize = {len(data)}
TransformMatrix = 0 1 0 -1 0 0 0 0 1
Offset = 10 20 30
ElementSpacing = 0.5 2 3
DimSize = 7 5 6
ElementType = {name}
ElementDataFile = LOCAL
"""
    (tmp_path / "a.mha").write_bytes(text.encode() + data)
    found, ours = formats.read(tmp_path / "a.mha", tmp_path)
    assert np.array_equal(ours, labels)
    # The rows of TransformMatrix are the directions of the axes (MetaIO documentation).
    expected = [[0, -2, 0, 10], [0.5, 0, 0, 20], [0, 0, 3, 30], [0, 0, 0, 1]]
    assert same_affine(affine(found), expected) and found["frame"] == "LPS"


# --- Negative control -------------------------------------------------------------------------------------------------------


def test_comparison_notices_one_changed_voxel(formats, tmp_path):
    labels = pattern(SHAPE, "u2")
    nrrd.write(str(tmp_path / "a.nrrd"), labels, {"encoding": "raw"})
    bytes_ = bytearray((tmp_path / "a.nrrd").read_bytes())
    bytes_[-1] ^= 1
    (tmp_path / "a.nrrd").write_bytes(bytes_)
    assert not np.array_equal(formats.read(tmp_path / "a.nrrd", tmp_path)[1], labels)


def test_tiff_pages_are_what_the_caller_says(formats, tmp_path):
    """tifffile writes a series of stacks; `--axes` names its axes anew. Pages are t = 3 times z = 4, with the time step slowest."""
    pages = (np.arange(3 * 4 * 5 * 6) % 251).astype("u2").reshape(3, 4, 5, 6)
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, pages, imagej=True, metadata={"axes": "TZYX"})
    by_time = lambda planes: planes.transpose(2, 1, 0).astype("u8")  # noqa: E731
    for axes, option, expected in [
        ("tzyx", ["--time", "2"], pages[2]),
        ("ztyx", ["--time", "1"], pages[:, 1]),
        ("czyx", ["--channel", "2"], pages[2]),
        ("zcyx", ["--channel", "3"], pages[:, 3]),
        ("zyx", [], pages.reshape(12, 5, 6)),
        ("tyx", ["--time", "7"], pages.reshape(12, 5, 6)[7:8]),
    ]:
        assert np.array_equal(formats.read(path, tmp_path, "--axes", axes, *option)[1], by_time(expected)), axes
    assert np.array_equal(formats.read(path, tmp_path, "--time", "1")[1], by_time(pages[1]))
    assert "names 3 axes of pages, and the file has 3 × 4 pages" in formats.refuse(path, "--axes", "tczyx")
    assert "expected an order such as zyx" in formats.refuse(path, "--axes", "xyz")
    assert "--time-step 0 cannot be chosen" in formats.refuse(path, "--axes", "zyx", "--time", "0")
    # Slices that were saved as time steps, in OME's description; and pages of which nothing is said.
    tifffile.imwrite(tmp_path / "t.ome.tif", pages.reshape(12, 5, 6), metadata={"axes": "TYX"})
    tifffile.imwrite(tmp_path / "p.tif", pages.reshape(12, 5, 6), photometric="minisblack", metadata=None)
    assert "--axes zyx" in formats.refuse(tmp_path / "t.ome.tif")
    for name in ("t.ome.tif", "p.tif"):
        header, ours = formats.read(tmp_path / name, tmp_path, "--axes", "zyx")
        assert np.array_equal(ours, by_time(pages.reshape(12, 5, 6))) and not any("slices along z" in line for line in header["warnings"])
        assert np.array_equal(formats.read(tmp_path / name, tmp_path, "--axes", "tyx", "--time", "11")[1], by_time(pages[2, 3:4]))
        assert "names 2 axes of pages, and the file has 12 pages" in formats.refuse(tmp_path / name, "--axes", "tzyx")


def test_arrays_of_four_axes_take_an_order(formats, tmp_path):
    labels = (np.arange(3 * 4 * 5 * 6) % 251).astype("u2").reshape(3, 4, 5, 6)
    zarr.create_array(tmp_path / "a.zarr", data=labels)
    assert "--axes tzyx" in formats.refuse(tmp_path / "a.zarr")
    ours = formats.read(tmp_path / "a.zarr", tmp_path, "--axes", "tzyx", "--time", "2")[1]
    assert np.array_equal(ours, labels[2].transpose(2, 1, 0))
    ours = formats.read(tmp_path / "a.zarr", tmp_path, "--axes", "zcyx", "--channel", "1")[1]
    assert np.array_equal(ours, labels[:, 1].transpose(2, 1, 0))
    assert "time" in formats.refuse(tmp_path / "a.zarr", "--axes", "tzyx")
    assert "expected xyz or zyx" in formats.refuse(tmp_path / "a.zarr", "--axes", "tczyx")
