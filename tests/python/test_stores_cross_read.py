"""Compares the readers of stores with zarr, tensorstore and h5py, which write them and share no code with Pumice: same voxels, same place."""

import bz2
import gzip
import itertools
import json
import os
import shutil
import subprocess
import zlib

import compresso
import h5py
import numcodecs
import numpy as np
import pytest
import tensorstore as ts
import zarr
import zstandard
from zarr.codecs import BloscCodec, BytesCodec, GzipCodec, TransposeCodec, ZstdCodec

import npm_package
from format_dump import affine, build, pattern
from share import some_of_today

INTEGERS = ["u1", "u2", "u4", "u8", "i1", "i2", "i4", "i8"]
# No axis is a multiple of a chunk's.
SHAPE = (21, 18, 13)
CHUNK = (8, 7, 5)


@pytest.fixture(scope="module")
def formats(rust_example):
    return build(rust_example)


def zyx(labels):
    """An array[z, y, x] as Pumice has it, [x, y, z] of u64."""
    return np.asarray(labels).transpose().astype("u8")


def blobs(shape=SHAPE, dtype="u4", seed=0):
    """Labels with whole chunks of one value, of background too, beside mixed ones."""
    labels = pattern(shape, dtype, seed)
    labels[:9, :8] = 0
    labels[9:, :8] = 7
    return labels


# --- Zarr -------------------------------------------------------------------------------------------------------------------

V2_COMPRESSORS = [
    None,
    numcodecs.Zlib(3),
    numcodecs.GZip(3),
    numcodecs.BZ2(3),
    numcodecs.Zstd(3),
    *(numcodecs.Blosc(cname, 3, shuffle) for cname, shuffle in itertools.product(["lz4", "lz4hc", "blosclz", "zlib", "zstd"], [0, 1, 2])),
]


@pytest.mark.parametrize("compressor", V2_COMPRESSORS, ids=str)
def test_zarr_v2_compressors(formats, tmp_path, compressor):
    labels = blobs()
    zarr.create_array(tmp_path / "a.zarr", data=labels, chunks=CHUNK, zarr_format=2, compressors=compressor)
    header, ours = formats.read(tmp_path / "a.zarr", tmp_path)
    assert np.array_equal(ours, zyx(labels)) and header["label_type"] == "u32"
    assert "zyx" in " ".join(header["warnings"])


@pytest.mark.parametrize("order, separator", [("C", "/"), ("F", ".")])
@pytest.mark.parametrize("dtype", [o + t for o in "<>" for t in [*INTEGERS, "f4", "f8"]])
def test_zarr_v2_types_and_orders(formats, tmp_path, dtype, order, separator):
    labels = pattern(SHAPE, dtype[1:]).astype(dtype)
    keys = {"name": "v2", "separator": separator}
    array = zarr.create_array(
        tmp_path / "a.zarr", shape=SHAPE, dtype=dtype, chunks=CHUNK, zarr_format=2, order=order, compressors=None, chunk_key_encoding=keys
    )
    array[:] = labels
    _, ours = formats.read(tmp_path / "a.zarr", tmp_path, "--zyx")
    assert np.array_equal(ours, zyx(labels))


V3_CODECS = {
    "blosc": [BloscCodec(cname="zstd", clevel=3)],
    "gzip": [GzipCodec(level=3)],
    "zstd, checksum": [ZstdCodec(level=3, checksum=True)],
    "none": [],
}


@pytest.mark.parametrize("sharded", [False, True])
@pytest.mark.parametrize("codecs", V3_CODECS)
@pytest.mark.parametrize("endian", ["little", "big"])
def test_zarr_v3_codecs_and_shards(formats, tmp_path, codecs, sharded, endian):
    labels = blobs(dtype="u8")
    shape = {"chunks": (4, 7, 5), "shards": (8, 14, 10)} if sharded else {"chunks": CHUNK}
    zarr.create_array(
        tmp_path / "a.zarr", data=labels, compressors=V3_CODECS[codecs], serializer=BytesCodec(endian=endian), **shape
    )
    header, ours = formats.read(tmp_path / "a.zarr", tmp_path)
    assert np.array_equal(ours, zyx(labels)) and header["label_type"] == "u64"
    assert ("sharded" in header["encoding"]) == sharded


def test_zarr_v3_transposed(formats, tmp_path):
    labels = blobs(dtype="u2")
    zarr.create_array(tmp_path / "a.zarr", data=labels, chunks=CHUNK, filters=[TransposeCodec(order=(2, 0, 1))])
    assert np.array_equal(formats.read(tmp_path / "a.zarr", tmp_path)[1], zyx(labels))


@pytest.mark.parametrize("location", ["start", "end"])
def test_zarr_v3_shards_of_tensorstore(formats, tmp_path, location):
    labels = blobs(dtype="u4")
    inner = [{"name": "bytes", "configuration": {"endian": "little"}}, {"name": "zstd"}]
    sharding = {"chunk_shape": [4, 7, 5], "codecs": inner, "index_location": location}
    spec = {
        "driver": "zarr3",
        "kvstore": {"driver": "file", "path": str(tmp_path / "a.zarr")},
        "metadata": {
            "shape": SHAPE,
            "data_type": "uint32",
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [8, 14, 10]}},
            "codecs": [{"name": "sharding_indexed", "configuration": sharding}],
        },
    }
    ts.open(spec, create=True).result().write(labels).result()
    assert np.array_equal(formats.read(tmp_path / "a.zarr", tmp_path)[1], zyx(labels))


@pytest.mark.parametrize("version, shards", [(2, None), (3, None), (3, (8, 14, 10))])
def test_missing_chunks_are_the_fill_value_and_counted(formats, tmp_path, version, shards):
    chunks = (4, 7, 5)
    array = zarr.create_array(tmp_path / "a.zarr", shape=SHAPE, dtype="u2", chunks=chunks, shards=shards, zarr_format=version, fill_value=9)
    array[4:8, 7:14, 5:10] = 3
    header, ours = formats.read(tmp_path / "a.zarr", tmp_path)
    assert np.array_equal(ours, zyx(array[:]))
    count = int(np.prod([-(-s // c) for s, c in zip(SHAPE, chunks)]))
    assert any(f"{count - 1} of {count} chunks are not there and are taken as 9" in line for line in header["warnings"]), header["warnings"]
    assert "chunk (0, 0, 0) is not there" in formats.refuse(tmp_path / "a.zarr", "--missing-chunks", "error")
    # Control: with all chunks nothing is said.
    array[:] = 3
    assert not any("not there" in line for line in formats.read(tmp_path / "a.zarr", tmp_path, "--missing-chunks", "error")[0]["warnings"])


@pytest.mark.parametrize("version, shards", [(2, None), (3, None), (3, (8, 14, 10))])
def test_regions(formats, tmp_path, version, shards):
    labels = blobs(dtype="u4", seed=3)
    zarr.create_array(tmp_path / "a.zarr", data=labels, chunks=(4, 7, 5), shards=shards, zarr_format=version)
    for z, y, x in [((0, 21), (0, 18), (0, 13)), ((3, 4), (6, 8), (12, 13)), ((5, 20), (1, 17), (4, 11)), ((8, 16), (7, 14), (5, 10))]:
        roi = ",".join(f"{low}:{high}" for low, high in (x, y, z))
        header, ours = formats.read(tmp_path / "a.zarr", tmp_path, "--roi", roi)
        assert np.array_equal(ours, zyx(labels[slice(*z), slice(*y), slice(*x)]))
        assert affine(header)[:3, 3].tolist() == [x[0], y[0], z[0]]
    assert "13 voxels" in formats.refuse(tmp_path / "a.zarr", "--roi", "0:14,:,:")


def test_thin_chunks_are_put_together(formats, tmp_path):
    """Planes and rows of one voxel come in blocks of 16 steps."""
    labels = blobs()
    for chunks in [(1, 18, 13), (1, 6, 13), (21, 1, 13), (3, 18, 2)]:
        folder = tmp_path / str(chunks)
        zarr.create_array(folder, data=labels, chunks=chunks)
        header, ours = formats.read(folder, tmp_path)
        assert np.array_equal(ours, zyx(labels))
        assert header["largest_block"] >= 13 * 16


# --- OME-Zarr ----------------------------------------------------------------------------------------------------------------


def ome(folder, version, images, colors=(), properties=(), axes="zyx", units=("micrometer",) * 3, scales=None, moved=None):
    """Writes an OME-Zarr image of several levels by hand, as the specification says."""
    group = zarr.open_group(folder, mode="w", zarr_format=2 if version == "0.4" else 3)
    scales = scales or [[2.0**n] * len(axes) for n in range(len(images))]
    datasets = []
    for n, labels in enumerate(images):
        group.create_array(str(n), data=labels, chunks=tuple(min(7, s) for s in labels.shape))
        steps = [{"type": "scale", "scale": scales[n]}]
        if moved:
            steps.append({"type": "translation", "translation": moved[n]})
        datasets.append({"path": str(n), "coordinateTransformations": steps})
    kinds = {"t": "time", "c": "channel"}
    space = iter(units)
    listed = [{"name": a, "type": kinds.get(a, "space")} | ({} if a in kinds else {"unit": next(space)}) for a in axes]
    said = {"multiscales": [{"axes": listed, "datasets": datasets, "version": version}]}
    if colors or properties:
        said["image-label"] = {"colors": list(colors), "properties": list(properties), "version": version}
    group.attrs.update(said if version == "0.4" else {"ome": said | {"version": version}})
    return group


@pytest.mark.parametrize("version", ["0.4", "0.5"])
def test_ome_levels_place_colours_and_names(formats, tmp_path, version):
    images = [blobs((20, 16, 12), "u2"), blobs((10, 8, 6), "u2", 1), blobs((10, 4, 3), "u2", 2)]
    scales = [[0.5, 0.1, 0.2], [1.0, 0.2, 0.4], [1.0, 0.4, 0.8]]
    moved = [[5, 6, 7], [5.25, 6.05, 7.1], [5.25, 6.15, 7.3]]
    colors = [{"label-value": 7, "rgba": [255, 0, 51, 255]}]
    properties = [{"label-value": 7, "name": "left"}, {"label-value": 65535, "name": "right", "area": 3}]
    ome(tmp_path / "a.zarr", version, images, colors, properties, scales=scales, moved=moved)
    for level, options in [(0, []), (1, ["--scale", "1"]), (2, ["--scale", "0.8,0.4,1"]), (1, ["--scale", "0.35,0.2,0.9"])]:
        header, ours = formats.read(tmp_path / "a.zarr", tmp_path, *options)
        assert np.array_equal(ours, zyx(images[level])), level
        assert header["spacing"] == scales[level][::-1] and header["unit"] == "um"
        # The place of the first voxel's middle, moved to its corner and back.
        assert np.allclose(affine(header)[:3, 3], moved[level][::-1], rtol=1e-15)
        assert header["notes"] == [
            {"id": 7, "name": "left", "color_srgb": [1.0, 0.0, pytest.approx(0.2)]},
            {"id": 65535, "name": "right", "color_srgb": None},
        ]
    assert any("finest of 3 levels" in line for line in formats.read(tmp_path / "a.zarr", tmp_path)[0]["warnings"])
    assert "there are 3 levels" in formats.refuse(tmp_path / "a.zarr", "--scale", "3")
    # The array of a level, by its own path, lies where its image says.
    header, ours = formats.read(tmp_path / "a.zarr" / "1", tmp_path)
    assert np.array_equal(ours, zyx(images[1])) and header["spacing"] == scales[1][::-1] and header["unit"] == "um"


@pytest.mark.parametrize("version", ["0.4", "0.5"])
def test_ome_label_images_time_and_channels(formats, tmp_path, version):
    picture = ome(tmp_path / "a.zarr", version, [pattern((2, 3, 4, 5, 6), "u2")], axes="tczyx")
    cells, nuclei = pattern((2, 1, 4, 5, 6), "u4", 1), pattern((2, 1, 4, 5, 6), "u4", 2)
    header = "several channels are asked for"
    # Without label images the picture itself is read.
    assert "2 time steps" in formats.refuse(tmp_path / "a.zarr"), header
    _, ours = formats.read(tmp_path / "a.zarr", tmp_path, "--time", "1", "--channel", "2")
    assert np.array_equal(ours, zyx(picture["0"][1, 2]))
    said = {"labels": ["cells", "nuclei"]}
    labels = zarr.open_group(tmp_path / "a.zarr" / "labels", mode="w", zarr_format=2 if version == "0.4" else 3)
    labels.attrs.update(said if version == "0.4" else {"ome": said})
    for name, image in [("cells", cells), ("nuclei", nuclei)]:
        ome(tmp_path / "a.zarr" / "labels" / name, version, [image], axes="tczyx")
    assert "2 label images" in formats.refuse(tmp_path / "a.zarr") and "--label" in formats.refuse(tmp_path / "a.zarr")
    for name, image in [("cells", cells), ("nuclei", nuclei)]:
        _, ours = formats.read(tmp_path / "a.zarr", tmp_path, "--label", name, "--time", "1")
        assert np.array_equal(ours, zyx(image[1, 0]))
        _, ours = formats.read(tmp_path / "a.zarr" / "labels" / name, tmp_path, "--time", "0")
        assert np.array_equal(ours, zyx(image[0, 0]))
    assert "cells, nuclei" in formats.refuse(tmp_path / "a.zarr", "--label", "other")
    # One alone is read, and a line says which.
    labels.attrs.update({"labels": ["nuclei"]} if version == "0.4" else {"ome": {"labels": ["nuclei"]}})
    header, ours = formats.read(tmp_path / "a.zarr", tmp_path, "--time", "0")
    assert np.array_equal(ours, zyx(nuclei[0, 0])) and any("label image nuclei is read" in line for line in header["warnings"])


def test_ome_units_that_differ_are_brought_together(formats, tmp_path):
    ome(tmp_path / "a.zarr", "0.4", [blobs()], units=("nanometer", "micrometer", "micrometer"), scales=[[40, 0.5, 0.25]])
    header, _ = formats.read(tmp_path / "a.zarr", tmp_path)
    assert header["unit"] == "um" and header["spacing"] == pytest.approx([0.25, 0.5, 0.04], rel=1e-15)


def test_data_sets_of_a_plain_group(formats, tmp_path):
    group = zarr.open_group(tmp_path / "a.zarr", mode="w")
    group.create_array("raw/image", data=np.full((4, 4, 4), 0.5, "f2"))
    one = group.create_array("volumes/labels/ids", data=blobs(), chunks=CHUNK)
    one.attrs.update({"resolution": [40, 8, 4], "offset": [80, 0, 16], "units": ["nm"] * 3})
    header, ours = formats.read(tmp_path / "a.zarr", tmp_path)
    assert np.array_equal(ours, zyx(blobs())) and "volumes/labels/ids" in " ".join(header["warnings"])
    assert header["spacing"] == [4, 8, 40] and header["unit"] == "nm"
    assert affine(header)[:3, 3].tolist() == [16 + 2, 4, 80 + 20]
    group.create_array("volumes/other", data=blobs(seed=5), dimension_names=["x", "y", "z"])
    line = formats.refuse(tmp_path / "a.zarr")
    assert "2 data sets" in line and "volumes/labels/ids, volumes/other" in line
    _, ours = formats.read(tmp_path / "a.zarr", tmp_path, "--dataset", "volumes/other")
    assert np.array_equal(ours, blobs(seed=5).astype("u8"))
    assert "there are: volumes/labels/ids" in formats.refuse(tmp_path / "a.zarr", "--dataset", "nothing")


# --- Neuroglancer precomputed ------------------------------------------------------------------------------------------------


def precomputed(folder, labels, scale, multiscale=None, **more):
    """Writes a scale with tensorstore; `labels` is [x, y, z]."""
    kind = {"data_type": str(labels.dtype), "num_channels": 1, "type": "segmentation"}
    spec = {"driver": "neuroglancer_precomputed", "kvstore": {"driver": "file", "path": str(folder)}, "multiscale_metadata": kind}
    spec |= {"scale_metadata": {"size": labels.shape, "resolution": [16, 16, 40], "chunk_size": [8, 7, 5]} | scale} | more
    ts.open(spec, create=True).result()[..., 0].write(labels).result()


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "uint32", "uint64"])
def test_precomputed_raw(formats, tmp_path, dtype):
    labels = blobs(dtype=dtype)
    precomputed(tmp_path / "a", labels, {"encoding": "raw"})
    header, ours = formats.read(tmp_path / "a", tmp_path)
    assert np.array_equal(ours, labels.astype("u8"))
    assert header["spacing"] == [16, 16, 40] and header["unit"] == "nm" and affine(header)[:3, 3].tolist() == [8, 8, 20]


@pytest.mark.parametrize("dtype", ["uint32", "uint64"])
@pytest.mark.parametrize("block", [[8, 8, 8], [3, 4, 2]])
def test_precomputed_compressed_segmentation(formats, tmp_path, dtype, block):
    labels = pattern(SHAPE, dtype) % 1000 + (np.uint64(1 << 40).astype(dtype) if dtype == "uint64" else 0)
    precomputed(tmp_path / "a", labels, {"encoding": "compressed_segmentation", "compressed_segmentation_block_size": block})
    assert np.array_equal(formats.read(tmp_path / "a", tmp_path)[1], labels.astype("u8"))


@pytest.mark.parametrize("hash", ["identity", "murmurhash3_x86_128"])
@pytest.mark.parametrize("encodings", [("raw", "raw"), ("gzip", "gzip")])
@pytest.mark.parametrize("bits", [(0, 0, 0), (1, 2, 3), (3, 0, 1), (0, 4, 0)])
def test_precomputed_shards(formats, tmp_path, hash, encodings, bits):
    labels = blobs(dtype="uint64")
    sharding = {
        "@type": "neuroglancer_uint64_sharded_v1",
        "hash": hash,
        "preshift_bits": bits[0],
        "minishard_bits": bits[1],
        "shard_bits": bits[2],
        "minishard_index_encoding": encodings[0],
        "data_encoding": encodings[1],
    }
    precomputed(tmp_path / "a", labels, {"encoding": "raw", "sharding": sharding})
    _, ours = formats.read(tmp_path / "a", tmp_path)
    assert np.array_equal(ours, labels)
    assert list((tmp_path / "a").rglob("*.shard"))


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "uint32", "uint64"])
@pytest.mark.parametrize("steps, indexed, connectivity", [((4, 4, 1), True, 4), ((8, 8, 1), True, 4), ((4, 4, 1), False, 4), ((4, 4, 1), False, 6)])
def test_precomputed_compresso(formats, tmp_path, dtype, steps, indexed, connectivity):
    """The package `compresso` encodes the chunks: smooth labels, noise, ids near the type's end, and a single label."""
    random = np.random.default_rng(2)
    labels = np.zeros((40, 30, 12), dtype)
    corners = random.integers(0, 40, (12, 3))
    where = np.stack(np.indices(labels.shape), -1)
    labels[:] = np.argmin([((where - c) ** 2).sum(-1) for c in corners], 0)
    labels += np.array(np.iinfo(dtype).max - 14, dtype)
    labels[20:, 15:] = random.integers(0, 9, (20, 15, 12))
    labels[:20, :15, :6] = 3
    folder = tmp_path / "a"
    (folder / "s").mkdir(parents=True)
    scale = {"key": "s", "size": labels.shape, "resolution": [4, 4, 40], "chunk_sizes": [[16, 13, 6]], "encoding": "compresso", "voxel_offset": [0, 0, 0]}
    (folder / "info").write_text(json.dumps({"type": "segmentation", "data_type": dtype, "num_channels": 1, "scales": [scale]}))
    for low in itertools.product(range(0, 40, 16), range(0, 30, 13), range(0, 12, 6)):
        part = labels[tuple(slice(a, a + n) for a, n in zip(low, (16, 13, 6)))]
        name = "_".join(f"{a}-{a + n}" for a, n in zip(low, part.shape))
        stream = compresso.compress(np.asfortranarray(part), steps=steps, connectivity=connectivity, random_access_z_index=indexed)
        # As servers hold them: compresso is made to be compressed again.
        (folder / "s" / f"{name}.gz").write_bytes(gzip.compress(stream))
    header, ours = formats.read(folder, tmp_path)
    assert np.array_equal(ours, labels.astype("u8")) and header["encoding"] == "compresso"
    # Each byte that is lost is noticed.
    for keep in [0, 3, 35, 36, 60, len(stream) - 1]:
        (folder / "s" / f"{name}.gz").write_bytes(gzip.compress(stream[:keep]))
        assert "chunk (1, 2, 2)" in formats.refuse(folder)


# Compresses as brotli each file that is named, with another program's encoder.
BROTLI = """
const [fs, zlib] = [require("fs"), require("zlib")];
for (const file of process.argv.slice(1)) fs.writeFileSync(file + ".br", zlib.brotliCompressSync(fs.readFileSync(file)));
"""


@pytest.mark.parametrize("ending", [".gz", ".br", ".zstd"])
def test_precomputed_chunks_that_are_compressed_again(formats, tmp_path, ending):
    """As cloud-volume stores them: with the ending of what has compressed them."""
    labels = blobs()
    precomputed(tmp_path / "a", labels, {"encoding": "raw", "key": "s"})
    chunks = sorted((tmp_path / "a" / "s").iterdir())
    if ending == ".br":
        subprocess.run([npm_package.node(), "-e", BROTLI, *chunks], check=True)
    for chunk in chunks:
        compress = {".gz": gzip.compress, ".zstd": zstandard.ZstdCompressor().compress}.get(ending)
        if compress:
            chunk.with_name(chunk.name + ending).write_bytes(compress(chunk.read_bytes()))
        chunk.unlink()
    assert np.array_equal(formats.read(tmp_path / "a", tmp_path)[1], labels.astype("u8"))
    damaged = chunks[1].with_name(chunks[1].name + ending)
    content = damaged.read_bytes()
    for wrong in (content[: len(content) // 2], b"", b"no " + content):
        damaged.write_bytes(wrong)
        assert damaged.name in formats.refuse(tmp_path / "a")


def test_precomputed_scales_offset_gzip_and_names(formats, tmp_path):
    fine, coarse = blobs(), blobs((11, 9, 13), seed=1)
    precomputed(tmp_path / "a", fine, {"encoding": "raw", "voxel_offset": [100, -20, 7], "key": "fine"})
    precomputed(tmp_path / "a", coarse, {"encoding": "raw", "key": "coarse", "resolution": [32, 32, 40]})
    names = {"@type": "neuroglancer_segment_properties", "inline": {"ids": ["7"], "properties": [{"id": "n", "type": "label", "values": ["axon"]}]}}
    (tmp_path / "a" / "names").mkdir()
    (tmp_path / "a" / "names" / "info").write_text(json.dumps(names))
    info = json.loads((tmp_path / "a" / "info").read_text())
    (tmp_path / "a" / "info").write_text(json.dumps(info | {"segment_properties": "names"}))
    # Half of the chunks as `gzip` writes them, with its ending and without.
    for n, chunk in enumerate(sorted((tmp_path / "a" / "fine").iterdir())):
        if n % 2:
            subprocess.run(["gzip", chunk], check=True)
            if n % 4 == 3:
                os.rename(f"{chunk}.gz", chunk)
    header, ours = formats.read(tmp_path / "a", tmp_path)
    assert np.array_equal(ours, fine.astype("u8"))
    assert affine(header)[:3, 3].tolist() == [100 * 16 + 8, -20 * 16 + 8, 7 * 40 + 20]
    assert header["notes"] == [{"id": 7, "name": "axon", "color_srgb": None}]
    for scale in ["1", "32,32,40", "40,40,40"]:
        assert np.array_equal(formats.read(tmp_path / "a", tmp_path, "--scale", scale)[1], coarse.astype("u8"))
    os.remove(next((tmp_path / "a" / "coarse").iterdir()))
    # tensorstore leaves out chunks of zeroes.
    absent = 12 - len(list((tmp_path / "a" / "coarse").iterdir()))
    header, ours = formats.read(tmp_path / "a", tmp_path, "--scale", "1")
    assert any(f"{absent} of 12 chunks are not there" in line for line in header["warnings"])
    assert "is not there" in formats.refuse(tmp_path / "a", "--scale", "1", "--missing-chunks", "error")


# --- N5 ----------------------------------------------------------------------------------------------------------------------

N5_COMPRESSIONS = [
    *({"type": name} for name in ("raw", "gzip", "bzip2", "zstd")),
    {"type": "gzip", "useZlib": True},
    *({"type": "blosc", "cname": name, "clevel": 5, "shuffle": shuffle} for name, shuffle in itertools.product(["lz4", "blosclz", "zlib", "zstd"], [0, 1, 2])),
]


def n5(folder, labels, compression, **more):
    """Writes a data set with tensorstore; `labels` is [x, y, z]."""
    said = {"dimensions": labels.shape, "blockSize": [8, 7, 5], "dataType": str(labels.dtype), "compression": compression} | more
    ts.open({"driver": "n5", "kvstore": {"driver": "file", "path": str(folder)}, "metadata": said}, create=True).result().write(labels).result()


@pytest.mark.parametrize("compression", N5_COMPRESSIONS, ids=str)
def test_n5_compressions(formats, tmp_path, compression):
    labels = blobs(dtype="uint64")
    n5(tmp_path / "a.n5", labels, compression, resolution=[4, 8, 40], units=["nm", "nm", "nm"])
    header, ours = formats.read(tmp_path / "a.n5", tmp_path)
    assert np.array_equal(ours, labels)
    assert header["spacing"] == [4, 8, 40] and header["unit"] == "nm"


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "uint32", "int8", "int16", "int32", "int64", "float32", "float64"])
def test_n5_types(formats, tmp_path, dtype):
    labels = pattern(SHAPE, dtype)
    n5(tmp_path / "a.n5", labels, {"type": "gzip"})
    assert np.array_equal(formats.read(tmp_path / "a.n5", tmp_path)[1], labels.astype("u8"))


def test_n5_levels_and_data_sets(formats, tmp_path):
    fine, coarse = blobs(), blobs((11, 9, 13), seed=1)
    n5(tmp_path / "a.n5" / "labels" / "s0", fine, {"type": "gzip"})
    n5(tmp_path / "a.n5" / "labels" / "s1", coarse, {"type": "gzip"}, downsamplingFactors=[2, 2, 1])
    (tmp_path / "a.n5" / "attributes.json").write_text('{"n5": "2.5.0"}')
    (tmp_path / "a.n5" / "labels" / "attributes.json").write_text('{"pixelResolution": {"dimensions": [0.5, 0.5, 4], "unit": "um"}}')
    header, ours = formats.read(tmp_path / "a.n5", tmp_path)
    assert np.array_equal(ours, fine.astype("u8")) and header["spacing"] == [0.5, 0.5, 4] and header["unit"] == "um"
    for scale in ["1", "1,1,4"]:
        header, ours = formats.read(tmp_path / "a.n5", tmp_path, "--scale", scale)
        assert np.array_equal(ours, coarse.astype("u8")) and header["spacing"] == [1, 1, 4]
        # Averages of two voxels lie between them.
        assert affine(header)[:3, 3].tolist() == [0.25, 0.25, 0]
    n5(tmp_path / "a.n5" / "other", blobs(seed=4), {"type": "raw"})
    assert "labels, other" in formats.refuse(tmp_path / "a.n5")
    assert np.array_equal(formats.read(tmp_path / "a.n5", tmp_path, "--dataset", "other")[1], blobs(seed=4).astype("u8"))


# --- HDF5 --------------------------------------------------------------------------------------------------------------------

H5_STORAGE = {
    "contiguous": {},
    "chunks": {"chunks": CHUNK},
    "gzip, shuffle": {"chunks": CHUNK, "compression": "gzip", "shuffle": True},
    "lzf": {"chunks": CHUNK, "compression": "lzf"},
    "fletcher32": {"chunks": CHUNK, "fletcher32": True},
    "scale-offset": {"chunks": CHUNK, "scaleoffset": 0},
}


@pytest.mark.parametrize("libver", ["earliest", "latest"])
@pytest.mark.parametrize("storage", H5_STORAGE)
def test_hdf5_storage(formats, tmp_path, storage, libver):
    labels = blobs(dtype="u4")
    with h5py.File(tmp_path / "a.h5", "w", libver=libver) as file:
        made = file.create_dataset("volumes/labels", data=labels, **H5_STORAGE[storage])
        made.attrs["resolution"] = [40.0, 4.0, 8.0]
        made.attrs["offset"] = [80.0, 0.0, 16.0]
    header, ours = formats.read(tmp_path / "a.h5", tmp_path)
    assert np.array_equal(ours, zyx(labels)) and header["label_type"] == "u32"
    assert header["spacing"] == [8, 4, 40] and affine(header)[:3, 3].tolist() == [20, 2, 100]
    assert any("volumes/labels is read" in line for line in header["warnings"])


@pytest.mark.parametrize("dtype", [o + t for o in "<>" for t in [*INTEGERS, "f4", "f8"]])
def test_hdf5_types(formats, tmp_path, dtype):
    labels = pattern(SHAPE, dtype[1:]).astype(dtype)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("labels", data=labels, chunks=CHUNK)
    assert np.array_equal(formats.read(tmp_path / "a.h5", tmp_path)[1], zyx(labels))


def test_hdf5_data_sets_user_block_and_parts(formats, tmp_path):
    labels = blobs(dtype="u2")
    with h5py.File(tmp_path / "a.h5", "w", userblock_size=1024) as file:
        file["raw"] = np.zeros(SHAPE, "f4")
        file["table"] = np.arange(20)
        file["deep/labels"] = labels
        file["deep"].attrs["x"] = 1
        file["loop/again"] = h5py.SoftLink("/loop")
        file["same"] = file["deep/labels"]
        partly = file.create_dataset("partly", SHAPE, "u2", chunks=CHUNK, fillvalue=5)
        partly[3:9, 2:5, 1:4] = 8
    line = formats.refuse(tmp_path / "a.h5")
    assert "2 data sets" in line and "--dataset" in line and "partly" in line and "raw" not in line
    assert np.array_equal(formats.read(tmp_path / "a.h5", tmp_path, "--dataset", "deep/labels")[1], zyx(labels))
    with h5py.File(tmp_path / "a.h5") as file:
        expected = file["partly"][:]
    assert np.array_equal(formats.read(tmp_path / "a.h5", tmp_path, "--dataset", "partly")[1], zyx(expected))
    assert "it has:" in formats.refuse(tmp_path / "a.h5", "--dataset", "nothing")
    _, ours = formats.read(tmp_path / "a.h5", tmp_path, "--dataset", "deep/labels", "--roi", "2:9,1:17,5:6")
    assert np.array_equal(ours, zyx(labels)[2:9, 1:17, 5:6])


# --- Joined ids and regions, for every format ----------------------------------------------------------------------------------


def test_ids_are_joined_while_reading(formats, tmp_path):
    labels = (blobs() % 50).astype("u4")
    ids = np.unique(labels)[1:]
    segments = np.random.default_rng(1).integers(1, 9, len(ids)).astype("u8") + (1 << 40)
    segments[0] = 0
    expected = zyx(labels)
    for id, segment in zip(ids[:-2], segments):
        expected[zyx(labels) == id] = segment
    pairs = np.stack([ids[:-2].astype("u8"), segments[:-2]], axis=1)
    np.save(tmp_path / "pairs.npy", pairs)
    np.save(tmp_path / "fortran.npy", np.asfortranarray(pairs.astype("i8")))
    np.savetxt(tmp_path / "pairs.csv", pairs, "%d", ",", header="supervoxel,segment", comments="")
    np.savetxt(tmp_path / "pairs.tsv", pairs, "%d", "\t")
    zarr.create_array(tmp_path / "a.zarr", data=labels, chunks=CHUNK)
    np.save(tmp_path / "a.npy", labels)
    for source, table in itertools.product(["a.zarr", "a.npy"], ["pairs.npy", "fortran.npy", "pairs.csv", "pairs.tsv"]):
        header, ours = formats.read(tmp_path / source, tmp_path, "--zyx", "--relabel", str(tmp_path / table))
        assert np.array_equal(ours, expected), (source, table)
        assert header["label_type"] == "u64" and any("these ids stay as they are" in line for line in header["warnings"])
    for text, words in [("1,2\n1,3\n", "two segments"), ("1,2\nx,3\n", "line 2"), ("", "no pairs"), ("1,2,3\n", "line 1"), ("0,4\n", "background")]:
        (tmp_path / "bad.csv").write_text(text)
        assert words in formats.refuse(tmp_path / "a.zarr", "--zyx", "--relabel", str(tmp_path / "bad.csv"))


def test_regions_of_streamed_files(formats, tmp_path):
    labels = blobs()
    np.save(tmp_path / "a.npy", labels)
    header, ours = formats.read(tmp_path / "a.npy", tmp_path, "--zyx", "--roi", "2:9,1:17,5:6")
    assert np.array_equal(ours, zyx(labels)[2:9, 1:17, 5:6]) and affine(header)[:3, 3].tolist() == [2, 1, 5]
    assert "cannot be chosen" in formats.refuse(tmp_path / "a.npy", "--zyx", "--scale", "1")
    assert "cannot be chosen" in formats.refuse(tmp_path / "a.npy", "--zyx", "--dataset", "a")


# --- Bad stores ----------------------------------------------------------------------------------------------------------------


@pytest.fixture
def good(tmp_path):
    """A folder for each kind of store, with small chunks, and a function that copies it afresh."""
    labels = blobs(dtype="u4")
    zarr.create_array(tmp_path / "v2.zarr", data=labels, chunks=CHUNK, zarr_format=2)
    zarr.create_array(tmp_path / "v3.zarr", data=labels, chunks=(4, 7, 5), shards=(8, 14, 10))
    precomputed(tmp_path / "raw.precomputed", labels, {"encoding": "raw"})
    precomputed(tmp_path / "cseg.precomputed", labels, {"encoding": "compressed_segmentation", "compressed_segmentation_block_size": [8, 8, 8]})
    sharding = {"@type": "neuroglancer_uint64_sharded_v1", "hash": "identity", "preshift_bits": 0, "minishard_bits": 1, "shard_bits": 1}
    precomputed(tmp_path / "shard.precomputed", labels, {"encoding": "raw", "sharding": sharding})
    n5(tmp_path / "a.n5", labels, {"type": "gzip"})
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("labels", data=labels, chunks=CHUNK, compression="gzip")

    def copy(name):
        target = tmp_path / f"bad-{name}"
        if target.is_dir():
            shutil.rmtree(target)
        (shutil.copytree if (tmp_path / name).is_dir() else shutil.copy)(tmp_path / name, target)
        return target

    return copy


STORES = ["v2.zarr", "v3.zarr", "raw.precomputed", "cseg.precomputed", "shard.precomputed", "a.n5"]
DESCRIBES = {"zarr.json", ".zarray", ".zattrs", "info", "attributes.json"}


def chunk_files(store):
    return sorted(p for p in store.rglob("*") if p.is_file() and p.name not in DESCRIBES)


@pytest.mark.parametrize("name", STORES)
def test_truncated_and_damaged_chunks_are_named(formats, good, name):
    for keep in [0, 1, 10, -1]:
        store = good(name)
        chunk = max(chunk_files(store), key=lambda p: p.stat().st_size)
        chunk.write_bytes(chunk.read_bytes()[:keep])
        assert "bad-" in formats.refuse(store)
    store = good(name)
    chunk_files(store)[0].write_bytes(os.urandom(2000))
    assert "bad-" in formats.refuse(store)


def bomb(compress):
    """A compressed chunk that holds 2²⁹ zeros, or half of them."""
    return compress(bytes(1 << 20), 512)


def gzipped(piece, times):
    packer = zlib.compressobj(9, wbits=31)
    return b"".join(packer.compress(piece) for _ in range(times)) + packer.flush()


def zlibbed(piece, times):
    packer = zlib.compressobj(9)
    return b"".join(packer.compress(piece) for _ in range(times)) + packer.flush()


def zstandarded(piece, times):
    packer = zstandard.ZstdCompressor().compressobj()
    return b"".join(packer.compress(piece) for _ in range(times)) + packer.flush()


def bzipped(piece, times):
    packer = bz2.BZ2Compressor()
    return b"".join(packer.compress(piece) for _ in range(times)) + packer.flush()


def blosced(piece, times):
    return numcodecs.Blosc("zstd", 9, 0).encode(piece * (times // 2))


BOMBS = {
    "zarr 2, gzip": ("v2.zarr", ".zarray", {"compressor": {"id": "gzip", "level": 1}}, gzipped),
    "zarr 2, zlib": ("v2.zarr", ".zarray", {"compressor": {"id": "zlib", "level": 1}}, zlibbed),
    "zarr 2, bz2": ("v2.zarr", ".zarray", {"compressor": {"id": "bz2", "level": 1}}, bzipped),
    "zarr 2, zstd": ("v2.zarr", ".zarray", {"compressor": {"id": "zstd", "level": 1}}, zstandarded),
    "zarr 2, blosc": ("v2.zarr", ".zarray", {"compressor": {"id": "blosc", "cname": "zstd", "clevel": 5, "shuffle": 1, "blocksize": 0}}, blosced),
    "N5, gzip": ("a.n5", "attributes.json", {"compression": {"type": "gzip"}}, gzipped),
    "N5, zstd": ("a.n5", "attributes.json", {"compression": {"type": "zstd"}}, zstandarded),
    "N5, bzip2": ("a.n5", "attributes.json", {"compression": {"type": "bzip2"}}, bzipped),
    "N5, blosc": ("a.n5", "attributes.json", {"compression": {"type": "blosc"}}, blosced),
    "precomputed": ("raw.precomputed", "info", {}, gzipped),
    "precomputed, tables": ("cseg.precomputed", "info", {}, gzipped),
}


@pytest.mark.parametrize("kind", some_of_today(BOMBS, 8))
def test_a_chunk_that_inflates_without_end_is_refused_with_little_memory(formats, good, kind):
    name, about, change, compress = BOMBS[kind]
    store = good(name)
    (store / about).write_text(json.dumps(json.loads((store / about).read_text()) | change))
    # Without the other chunks, which are compressed in another way.
    chunk, *others = chunk_files(store)
    for other in others:
        other.unlink()
    header = chunk.read_bytes()[:16] if name == "a.n5" else b""
    chunk.write_bytes(header + bomb(compress))
    # 512 MiB would be needed, or 256 for blosc; there are 200.
    done = subprocess.run(["sh", "-c", 'ulimit -v 204800; exec "$0" "$1" -', formats.dump, str(store)], capture_output=True, text=True)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1, done
    assert "more than the" in done.stderr and "bytes of a chunk" in done.stderr and "panicked" not in done.stderr, done.stderr


@pytest.mark.parametrize("nested", [False, True])
def test_bombs_in_shards_are_refused(formats, tmp_path, nested):
    """Shards that are read chunk by chunk, and whole, as one in which a shard lies."""
    packed = zstandarded(bytes(1 << 20), 512)
    plain, zstd = {"name": "bytes", "configuration": {"endian": "little"}}, {"name": "zstd", "configuration": {"level": 1, "checksum": False}}
    sharded = lambda inner, side: {  # noqa: E731
        "name": "sharding_indexed",
        "configuration": {"chunk_shape": [side] * 3, "codecs": inner, "index_codecs": [plain], "index_location": "start"},
    }
    codecs = [sharded([plain, zstd], 4)]
    content = np.array([16, len(packed)], "<u8").tobytes() + packed
    if nested:
        content = np.array([16, len(content)], "<u8").tobytes() + content
        codecs = [sharded(codecs, 4)]
    grid = {"name": "regular", "configuration": {"chunk_shape": [4] * 3}}
    keys = {"name": "default", "configuration": {"separator": "/"}}
    about = {"zarr_format": 3, "node_type": "array", "shape": [4] * 3, "data_type": "uint16", "fill_value": 0, "chunk_grid": grid}
    about |= {"chunk_key_encoding": keys, "codecs": codecs, "attributes": {}}
    (tmp_path / "a.zarr" / "c" / "0" / "0").mkdir(parents=True)
    (tmp_path / "a.zarr" / "zarr.json").write_text(json.dumps(about))
    (tmp_path / "a.zarr" / "c" / "0" / "0" / "0").write_bytes(content)
    assert "more than the 128 bytes of a chunk" in formats.refuse(tmp_path / "a.zarr")


def test_chunks_that_vanish_are_counted_and_cut_ones_refused(formats, good):
    """A store that somebody changes after its description was written."""
    store = good("v2.zarr")
    chunks = chunk_files(store)
    chunks[0].unlink()
    # zarr leaves out chunks of the fill value.
    absent = 27 - len(chunks) + 1
    assert any(f"{absent} of 27 chunks are not there" in line for line in formats.read(store, store.parent)[0]["warnings"])
    chunks[1].write_bytes(chunks[1].read_bytes()[:-7])
    assert "chunk" in formats.refuse(store)


@pytest.mark.parametrize("name", STORES)
def test_links_folders_and_permissions(formats, good, name):
    store = good(name)
    chunk = chunk_files(store)[0]
    chunk.unlink()
    chunk.symlink_to(chunk.name)
    assert "links" in formats.refuse(store)
    chunk.unlink()
    chunk.mkdir()
    assert "folder" in formats.refuse(store)
    chunk.rmdir()
    os.mkfifo(chunk)
    assert "pipe" in formats.refuse(store)


@pytest.mark.parametrize("name", ["v2.zarr", "v3.zarr", "raw.precomputed", "a.n5"])
def test_descriptions_that_lie(formats, good, name):
    store = good(name)
    about = next(store / name for name in ("zarr.json", ".zarray", "info", "attributes.json") if (store / name).is_file())
    text = about.read_text()

    def changed(change):
        value = json.loads(text)
        change(value)
        about.write_text(json.dumps(value))
        return formats.refuse(store)

    about.write_text(text[: len(text) // 2])
    assert "JSON" in formats.refuse(store)
    about.write_text("[]")
    assert "JSON" in formats.refuse(store)

    def shape(size):
        def change(value):
            if "scales" in value:
                value["scales"][0]["size"][0] = size
            else:
                value["shape" if "shape" in value else "dimensions"][0] = size

        return change

    assert "0" in changed(shape(0))
    assert "8388608" in changed(shape(1 << 40))

    def other_type(value):
        value["data_type" if "data_type" in value else "dtype" if "dtype" in value else "dataType"] = "complex64" if name != "v2.zarr" else "<c8"

    assert "type" in changed(other_type)

    def chunk(size):
        def change(value):
            if "scales" in value:
                value["scales"][0]["chunk_sizes"][0] = size
            elif "blockSize" in value:
                value["blockSize"] = size
            elif "chunks" in value:
                value["chunks"] = size
            else:
                value["chunk_grid"]["configuration"]["chunk_shape"] = size

        return change

    for size in [[0, 0, 0], [-1, 2, 3], [1], [1 << 40] * 3, [9, 9, 9]]:
        # Chunks of Neuroglancer have their size in their names: with another size none is there, which is counted.
        if "precomputed" not in name or size != [9, 9, 9]:
            changed(chunk(size))


def test_a_codec_that_is_not_there(formats, good):
    store = good("v2.zarr")
    about = json.loads((store / ".zarray").read_text())
    (store / ".zarray").write_text(json.dumps(about | {"compressor": {"id": "jpegls"}}))
    assert "jpegls" in formats.refuse(store)
    store = good("a.n5")
    about = json.loads((store / "attributes.json").read_text())
    (store / "attributes.json").write_text(json.dumps(about | {"compression": {"type": "xz"}}))
    assert "xz" in formats.refuse(store)
    (store / "attributes.json").write_text(json.dumps(about | {"isLabelMultiset": True}))
    assert "multiset" in formats.refuse(store)
    store = good("raw.precomputed")
    about = json.loads((store / "info").read_text())
    about["scales"][0]["encoding"] = "jpeg"
    (store / "info").write_text(json.dumps(about))
    assert "jpeg" in formats.refuse(store)


def test_labels_that_are_no_whole_numbers(formats, tmp_path):
    labels = blobs(dtype="f4")
    labels[12, 10, 11] = 2.5
    zarr.create_array(tmp_path / "a.zarr", data=labels, chunks=CHUNK)
    assert "voxel (11, 10, 12) is 2.5" in formats.refuse(tmp_path / "a.zarr")
    labels[12, 10, 11] = np.nan
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("labels", data=labels, chunks=CHUNK)
    assert "voxel (11, 10, 12) is NaN" in formats.refuse(tmp_path / "a.h5")


def test_damaged_hdf5_is_refused(formats, good, tmp_path):
    file = good("a.h5")
    whole = file.read_bytes()
    rng = np.random.default_rng(0)
    for cut in [8, 9, 96, 500, len(whole) // 2, len(whole) - 1]:
        file.write_bytes(whole[:cut])
        formats.refuse(file)
    for _ in range(40):
        bad = bytearray(whole)
        for at in rng.integers(0, len(whole), 8):
            bad[at] ^= 1 << rng.integers(8)
        file.write_bytes(bad)
        done = subprocess.run([formats.dump, str(file), "-"], capture_output=True, text=True)
        assert done.returncode in (0, 2) and "panicked" not in done.stderr, done.stderr
