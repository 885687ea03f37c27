"""Small label volumes in every readable format, for tests that break them. They are written by other people's packages, or by hand from
the format's definition where there is no package."""

import gzip
import io
import struct

import nibabel
import nrrd
import numpy as np
import tifffile

DIMS = (24, 20, 16)


def labels(dtype=np.uint16):
    """A volume of smooth cells, indexed [x, y, z]."""
    x, y, z = np.mgrid[0 : DIMS[0], 0 : DIMS[1], 0 : DIMS[2]]
    return ((x // 5) + 7 * (y // 6) + 50 * (z // 7)).astype(dtype)


def volumes(folder):
    """Writes one good file of each format; returns {name: path to open}."""
    v = labels()
    affine = np.diag([2.0, 3.0, 4.0, 1.0])
    made = {}

    def put(name, data):
        (folder / name).write_bytes(data)
        made[name] = folder / name

    for name, encoding in [("raw.nrrd", "raw"), ("gzip.nrrd", "gzip"), ("ascii.nrrd", "ascii")]:
        nrrd.write(str(folder / name), v, header={"spacings": [2.0, 3.0, 4.0], "encoding": encoding})
        made[name] = folder / name
    nrrd.write(str(folder / "detached.nhdr"), v, header={"encoding": "raw"}, detached_header=True)
    made["detached.nhdr"] = folder / "detached.nhdr"

    for name, image in [
        ("one.nii", nibabel.Nifti1Image),
        ("one.nii.gz", nibabel.Nifti1Image),
        ("two.nii", nibabel.Nifti2Image),
        ("pair.hdr", nibabel.Nifti1Pair),
    ]:
        nibabel.save(image(v, affine), folder / name)
        made[name] = folder / name

    zyx = v.transpose(2, 1, 0)
    tifffile.imwrite(folder / "stack.tif", zyx)
    tifffile.imwrite(folder / "deflate.tif", zyx, compression="zlib")
    tifffile.imwrite(folder / "big.tif", zyx, bigtiff=True)
    tifffile.imwrite(folder / "imagej.tif", zyx, imagej=True, metadata={"axes": "ZYX"})
    for name in ["stack.tif", "deflate.tif", "big.tif", "imagej.tif"]:
        made[name] = folder / name

    np.save(folder / "c.npy", v)
    np.save(folder / "fortran.npy", np.asfortranarray(v))
    np.savez_compressed(folder / "one.npz", labels=v)
    for name in ["c.npy", "fortran.npy", "one.npz"]:
        made[name] = folder / name

    data = np.asfortranarray(v).tobytes(order="F")
    head = "ObjectType = Image\nNDims = 3\nDimSize = 24 20 16\nElementType = MET_USHORT\nElementSpacing = 2 3 4\n"
    put("local.mha", (head + "ElementDataFile = LOCAL\n").encode() + data)
    (folder / "apart.raw").write_bytes(data)
    put("apart.mhd", (head + "ElementDataFile = apart.raw\n").encode())
    return made


def nifti(values):
    return nibabel.Nifti1Image(values, np.diag([2.0, 3.0, 4.0, 1.0])).to_bytes()


def huge_headers():
    """{name: bytes} of files whose header states sizes with a product above 2⁶⁴, followed by hardly any data."""
    nifti2 = nibabel.Nifti2Header()
    nifti2.set_data_dtype(np.uint16)
    nifti2["dim"] = [3, 2**40, 2**40, 2**40, 1, 1, 1, 1]
    nifti2["magic"] = b"n+2"
    nifti2["vox_offset"] = 544
    npy = io.BytesIO()
    np.lib.format.write_array_header_2_0(npy, {"descr": "<u2", "fortran_order": False, "shape": (2**40, 2**40, 2**40)})

    # A classic TIFF with one page: width, length, 16 bits, uncompressed, one strip at byte 8.
    tags = [(256, 4, 0xFFFFFFFF), (257, 4, 0xFFFFFFFF), (258, 3, 16), (259, 3, 1), (262, 3, 1), (273, 4, 8), (277, 3, 1)]
    tags += [(278, 4, 0xFFFFFFFF), (279, 4, 0xFFFFFFFF)]
    tiff = b"II*\0" + struct.pack("<IH", 8, len(tags))
    tiff += b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags) + bytes(4)

    nrrd_head = "NRRD0004\ntype: uint16\ndimension: 3\nsizes: {0} {0} {0}\nencoding: {1}\nendian: little\n\n"
    meta_head = "NDims = 3\nDimSize = {0} {0} {0}\nElementType = MET_USHORT\nElementDataFile = LOCAL\n"
    return {
        "raw.nrrd": nrrd_head.format(2**32 - 1, "raw").encode() + bytes(100),
        "past-u64.nrrd": nrrd_head.format(2**70, "raw").encode() + bytes(100),
        "gzip.nrrd": nrrd_head.format(2**32 - 1, "gzip").encode() + gzip.compress(bytes(100)),
        "within-u32.nrrd": nrrd_head.format(2**31 - 1, "gzip").encode() + gzip.compress(bytes(100)),
        "two.nii": nifti2.binaryblock + bytes(104),
        "huge.npy": npy.getvalue() + bytes(100),
        "huge.mha": meta_head.format(2**32 - 1).encode() + bytes(100),
        "huge.tif": tiff,
    }


def wrong_values():
    """{name: bytes} of well-formed files that contain values that are no labels, or invalid spacings or matrices."""
    v = labels(np.float32)

    def with_one(value, dtype):
        a = v.astype(dtype)
        a[5, 6, 7] = value
        return a

    def npy(a):
        out = io.BytesIO()
        np.save(out, a)
        return out.getvalue()

    nan_affine = bytearray(nifti(labels(np.uint8)))
    nan_affine[280:284] = struct.pack("<f", np.nan)  # srow_x[0], nifti1.h
    meta = "NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementSpacing = {}\nElementDataFile = LOCAL\n"
    return {
        "half.npy": npy(with_one(1.5, np.float64)),
        "negative.npy": npy(with_one(-1, np.float32)),
        "nan.npy": npy(with_one(np.nan, np.float32)),
        "infinite.npy": npy(with_one(np.inf, np.float64)),
        "too-large.npy": npy(with_one(2.0**65, np.float64)),
        "negative-integer.npy": npy(with_one(-3, np.int16)),
        "complex.npy": npy(np.zeros((4, 4, 4), np.complex64)),
        "half.nii": nifti(with_one(2.5, np.float32)),
        "nan.nii": nifti(with_one(np.nan, np.float64)),
        "nan-affine.nii": bytes(nan_affine),
        "nan-spacing.mha": meta.format("nan 1 1").encode() + bytes(8),
        "zero-spacing.mha": meta.format("0 1 1").encode() + bytes(8),
        "infinite-spacing.mha": meta.format("inf 1 1").encode() + bytes(8),
    }
