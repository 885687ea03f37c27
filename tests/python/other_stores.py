"""Reads and writes stores with cloud-volume and ome-zarr: `other_stores.py FUNCTION ARGUMENT…`, in an environment that has them
(requirements-stores.txt). Arrays are .npy files of [x, y, z]."""

import shutil
import sys

import numpy as np


def read_precomputed(folder, out):
    from cloudvolume import CloudVolume

    volume = CloudVolume(f"file://{folder}", progress=False, fill_missing=True)
    low, high = volume.bounds.minpt, volume.bounds.maxpt
    np.save(out, np.asarray(volume[low[0] : high[0], low[1] : high[1], low[2] : high[2]])[..., 0])
    print([int(n) for n in volume.resolution], [int(n) for n in volume.voxel_offset], volume.info["type"])


def write_precomputed(array, folder, encoding, compression):
    from cloudvolume import CloudVolume

    labels = np.load(array)
    first = [10, 20, 30]
    info = CloudVolume.create_new_info(1, "segmentation", str(labels.dtype), encoding, [8, 8, 40], first, labels.shape, [32, 32, 16])
    volume = CloudVolume(f"file://{folder}", info=info, compress=False if compression == "none" else compression, progress=False)
    volume.commit_info()
    volume[tuple(slice(a, a + n) for a, n in zip(first, labels.shape, strict=True))] = labels[..., None]


def read_ome(folder, out):
    from ome_zarr.io import parse_url
    from ome_zarr.reader import Reader

    [node] = Reader(parse_url(folder))()
    np.save(out, np.asarray(node.data[0]).squeeze().T)
    print([axis["name"] for axis in node.metadata["axes"]], node.metadata["color"])


def write_ome(array, folder, version):
    import zarr
    from ome_zarr import format as formats
    from ome_zarr.writer import write_image, write_label_metadata, write_labels

    labels = np.load(array).T
    kind = {"0.4": formats.FormatV04, "0.5": formats.FormatV05}[version]()
    shutil.rmtree(folder, ignore_errors=True)
    group = zarr.open_group(folder, mode="w", zarr_format=kind.zarr_format)
    write_image((labels % 5).astype(np.uint8), group, axes="zyx", fmt=kind, scaler=None)
    write_labels(labels, group, "cells", axes="zyx", fmt=kind, scaler=None)
    write_label_metadata(group, "/labels/cells", colors=[{"label-value": 7, "rgba": [255, 0, 51, 255]}], fmt=kind)


if __name__ == "__main__":
    globals()[sys.argv[1]](*sys.argv[2:])
