"""Measures another program that stores label volumes: bytes, CPU seconds, time to read one voxel. `pumice bench peers` runs it per program.

The request is a JSON file: {"peer": name, "setting": {keyword: value}, "labels": .npy, "voxels": [[x, y, z], …], "scratch": a folder's
name, "report": .json}, or {"check": [names], "report": .json}, which reports missing packages. The array is C-ordered (z, y, x), so x varies fastest, as most of
the programs expect.
"""

import gzip
import importlib
import importlib.metadata
import json
import pathlib
import resource
import sys
import time

# CPU seconds after which no further single voxel is read; at least one is.
VOXEL_SECONDS = 2.0


class Crackle:
    package = ("crackle-codec", "crackle")
    one_voxel = "decodes its z layer"

    def __init__(self, package):
        self.package = package

    def compress(self, labels, **setting):
        return self.package.compress(labels, **setting)

    def decompress(self, packed, like):
        return self.package.decompress(packed)

    def reader(self, packed, like):
        array = self.package.CrackleArray(packed)
        return lambda x, y, z: array[x, y, z]


class CrackleZstd(Crackle):
    """Crackle files compressed once more with zstd, as servers of such files store them."""

    one_voxel = "decodes all, then its z layer"

    def __init__(self, package):
        super().__init__(package)
        self.zstd = importlib.import_module("zstandard")

    def compress(self, labels, level=19, **setting):
        return self.zstd.ZstdCompressor(level=level).compress(super().compress(labels, **setting))

    def decompress(self, packed, like):
        return super().decompress(self.zstd.ZstdDecompressor().decompress(packed), like)

    def reader(self, packed, like):
        return lambda x, y, z: super(CrackleZstd, self).reader(self.zstd.ZstdDecompressor().decompress(packed), like)(x, y, z)


class Compresso:
    package = ("compresso", "compresso")
    one_voxel = "decodes its z layer"

    def __init__(self, package):
        self.package = package

    def compress(self, labels):
        return self.package.compress(labels)

    def decompress(self, packed, like):
        return self.package.decompress(packed)

    def reader(self, packed, like):
        return lambda x, y, z: self.package.decompress(packed, z=z)[x, y, 0]


class CompressoGzip(Compresso):
    one_voxel = "decodes all, then its z layer"

    def compress(self, labels, level=9):
        return gzip.compress(super().compress(labels), level, mtime=0)

    def decompress(self, packed, like):
        return super().decompress(gzip.decompress(packed), like)

    def reader(self, packed, like):
        return lambda x, y, z: super(CompressoGzip, self).reader(gzip.decompress(packed), like)(x, y, z)


class CompressedSegmentation:
    """Neuroglancer's format: blocks of 8 × 8 × 8 voxels, each with a table of its few labels."""

    package = ("compressed-segmentation", "compressed_segmentation")
    one_voxel = "from its block of 8³"

    def __init__(self, package):
        self.package = package

    def compress(self, labels):
        return self.package.compress(labels, order="F")

    def decompress(self, packed, like):
        return self.package.decompress(packed, like.shape, like.dtype, order="F").reshape(like.shape, order="F")

    def reader(self, packed, like):
        array = self.package.CompressedSegmentationArray(packed, shape=like.shape, dtype=like.dtype)
        return lambda x, y, z: array[x, y, z]


class CompressedSegmentationZstd(CompressedSegmentation):
    """Such blocks compressed once more with zstd, as servers of Neuroglancer's volumes store them."""

    one_voxel = "decodes all, then its block of 8³"

    def __init__(self, package):
        super().__init__(package)
        self.zstd = importlib.import_module("zstandard")

    def compress(self, labels, level=3):
        return self.zstd.ZstdCompressor(level=level).compress(super().compress(labels))

    def decompress(self, packed, like):
        return super().decompress(self.zstd.ZstdDecompressor().decompress(packed), like)

    def reader(self, packed, like):
        blocks = super().reader
        return lambda x, y, z: blocks(self.zstd.ZstdDecompressor().decompress(packed), like)(x, y, z)


class Zstd:
    package = ("zstandard", "zstandard")
    one_voxel = "decodes all"

    def __init__(self, package):
        self.package = package

    def compress(self, labels, level=3):
        return self.package.ZstdCompressor(level=level).compress(memoryview(labels.T).cast("B"))

    def decompress(self, packed, like):
        numpy = importlib.import_module("numpy")
        raw = self.package.ZstdDecompressor().decompress(packed)
        return numpy.frombuffer(raw, like.dtype).reshape(like.shape, order="F")

    def reader(self, packed, like):
        return lambda x, y, z: self.decompress(packed, like)[x, y, z]


class NiftiGzip:
    package = ("nibabel", "nibabel")
    one_voxel = "decodes what is before it"

    def __init__(self, package):
        self.package = package

    def image(self, labels):
        numpy = importlib.import_module("numpy")
        return self.package.Nifti1Image(labels, numpy.eye(4), dtype=labels.dtype)

    def compress(self, labels, level=6):
        return gzip.compress(self.image(labels).to_bytes(), level, mtime=0)

    def decompress(self, packed, like):
        numpy = importlib.import_module("numpy")
        image = self.package.Nifti1Image.from_bytes(gzip.decompress(packed))
        return numpy.asarray(image.dataobj, order="F")

    def reader(self, packed, like):
        self.file.write_bytes(packed)
        image = self.package.load(self.file)
        return lambda x, y, z: image.dataobj[x, y, z]


class Zarr:
    package = ("zarr", "zarr")
    one_voxel = "decodes its chunk of 64³"

    def __init__(self, package):
        self.package = package

    def compress(self, labels, level=3):
        codecs = importlib.import_module("zarr.codecs")
        array = self.package.create_array(
            self.file,
            shape=labels.shape[::-1],
            chunks=(64, 64, 64),
            dtype=labels.dtype,
            compressors=codecs.ZstdCodec(level=level),
            overwrite=True,
        )
        array[:] = labels.T
        return self.file

    def decompress(self, packed, like):
        return self.package.open_array(packed, mode="r")[:].T

    def reader(self, packed, like):
        array = self.package.open_array(packed, mode="r")
        return lambda x, y, z: array[z, y, x]


PEERS = {
    "crackle": Crackle,
    "crackle + zstd": CrackleZstd,
    "compresso": Compresso,
    "compresso + gzip": CompressoGzip,
    "compressed_segmentation": CompressedSegmentation,
    "compressed_segmentation + zstd": CompressedSegmentationZstd,
    "zstd": Zstd,
    "NIfTI + gzip": NiftiGzip,
    "zarr": Zarr,
}


def bytes_of(packed):
    """Size of a program's output, which is a bytes object or a folder of files."""
    if isinstance(packed, pathlib.Path):
        return sum(path.stat().st_size for path in packed.rglob("*") if path.is_file())
    return len(packed)


def clocked(work):
    """Calls work(); returns its result, and its wall seconds and the CPU seconds of all threads."""

    def cpu():
        used = resource.getrusage(resource.RUSAGE_SELF)
        return used.ru_utime + used.ru_stime

    wall, before = time.monotonic(), cpu()
    result = work()
    return result, {"seconds": time.monotonic() - wall, "cpu_seconds": cpu() - before}


def missing(names):
    """A line of text for each package that cannot be imported."""
    lines = []
    for name in names:
        packages = [PEERS[name].package, ("numpy", "numpy")]
        if name.endswith(" + zstd"):
            packages.append(Zstd.package)
        for distribution, module in packages:
            try:
                importlib.import_module(module)
            except ImportError:
                lines.append(f"{name} needs the Python package {distribution}: pip install {distribution}")
    return list(dict.fromkeys(lines))


def measure(job):
    numpy = importlib.import_module("numpy")
    kind = PEERS[job["peer"]]
    distribution, module = kind.package
    peer = kind(importlib.import_module(module))
    peer.file = pathlib.Path(job["scratch"]).with_suffix(".nii.gz" if kind is NiftiGzip else "")
    labels = numpy.load(job["labels"]).T

    packed, compressing = clocked(lambda: peer.compress(labels, **job["setting"]))
    back, decompressing = clocked(lambda: peer.decompress(packed, labels))
    same = bool(back.shape == labels.shape and numpy.array_equal(back, labels))
    del back

    read, read_count, wrong = peer.reader(packed, labels), 0, 0
    seconds = 0.0
    for voxel in job["voxels"]:
        got, took = clocked(lambda: int(read(*voxel)))
        seconds += took["cpu_seconds"]
        read_count += 1
        wrong += int(got != int(labels[tuple(voxel)]))
        if seconds > VOXEL_SECONDS:
            break
    return {
        "version": importlib.metadata.version(distribution),
        "bytes": bytes_of(packed),
        "compress": compressing,
        "decompress": decompressing,
        "lossless": same and wrong == 0,
        "voxel_cpu_seconds": seconds / max(read_count, 1),
        "one_voxel": kind.one_voxel,
    }


def main():
    job = json.loads(pathlib.Path(sys.argv[1]).read_text())
    report = {"missing": missing(job["check"])} if "check" in job else measure(job)
    pathlib.Path(job["report"]).write_text(json.dumps(report))


main()
