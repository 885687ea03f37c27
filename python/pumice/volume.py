"""Volumes in their compressed form, and the table of their labels."""

from __future__ import annotations

import dataclasses
import json
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, Unpack

import numpy as np
import numpy.typing as npt

from . import _native, arguments, blocks, dimension_names
from .arguments import Axes, Choice, Encoding, Level, OmeVersion, Path, Reading, Store
from .checked import checked
from .compressing import labels_given, limits_of
from .errors import InputError, PumiceWarning
from .label_table import AnnotationTable
from .page_memory import PageMemory

Job = _native.Job

# Most faces of a coarse surface that may be asked for: more than its cells can have.
MOST_FACES = 1 << 30


class LabelTable:
    """The labels of a volume as numpy columns, ids rising: row i is the label with dense index i. Columns cannot be changed."""

    def __init__(self, volume: _native.Volume, type_names: Sequence[str]) -> None:
        self._volume = volume
        self.ids: npt.NDArray[np.uint64] = np.asarray(volume.ids())
        self.voxels: npt.NDArray[np.uint64] = np.asarray(volume.voxels())
        low, high, boxes = volume.bounds()
        self.low: npt.NDArray[np.uint32] = np.asarray(low)
        self.high: npt.NDArray[np.uint32] = np.asarray(high)
        self.boxes: npt.NDArray[np.uint32] = np.asarray(boxes)
        names, colors = volume.notes()
        self.names: list[str] = names
        self.colors: npt.NDArray[np.float32] = np.asarray(colors)
        types = np.asarray(volume.types())
        self.types: list[str] = [type_names[t] if t >= 0 else "" for t in types.tolist()]
        self.columns: dict[str, npt.NDArray[np.float64]] = {name: np.asarray(values) for name, values in volume.columns()}

    def __len__(self) -> int:
        return len(self.ids)

    @checked
    def index_of(self, label: int) -> int:
        """Row of the label with the id `label`; InputError where the volume has none."""
        wanted = arguments.whole("label", label, 0, arguments.MOST_64)
        row = int(np.searchsorted(self.ids, np.uint64(wanted)))
        if row == len(self.ids) or int(self.ids[row]) != wanted:
            raise InputError(f"the volume has no label {wanted}")
        return row

    @checked
    def rows_of(self, labels: Iterable[int] | npt.ArrayLike) -> npt.NDArray[np.intp]:
        """Rows of labels by id, (n,), in the order of `labels`; InputError names the first id that the volume does not have.

        Ids are compared exactly, where `np.searchsorted(ids, [2**53 + 1])` compares floats."""
        wanted = arguments.whole_numbers("labels", labels, arguments.MOST_64)
        rows = np.searchsorted(self.ids, wanted)
        found = rows < len(self.ids)
        found[found] = self.ids[rows[found]] == wanted[found]
        if not found.all():
            raise InputError(f"the volume has no label {int(wanted[found.argmin()])}")
        return rows

    @checked
    def isin(self, labels: Iterable[int] | npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether the id of each row is one of `labels`, (rows,); ids that the volume does not have change nothing. Exact, as `rows_of`."""
        return np.isin(self.ids, arguments.whole_numbers("labels", labels, arguments.MOST_64))

    @checked
    def query(self, line: str) -> npt.NDArray[np.bool_]:
        """Whether a query `line` such as `glia voxels>1000` holds, by row, (n,); see `query_labels`. It may compare `voxels`, `boxes`, `low_x` to
        `high_z`, `centre_x` to `centre_z` (the middle of the bounds in the volume's world) and the names of `columns`."""
        return np.asarray(self._volume.query(line))

    @checked
    def auto_colors(
        self, visible: npt.ArrayLike | None = None, *, known: npt.ArrayLike | None = None
    ) -> npt.NDArray[np.float32]:
        """Linear Rec. 709 colours, (n, 3), that labels which touch do not share: what `auto_color` gives in a scene.

        `known`: colours (n, 3) that labels keep, NaN where a label is new. A new label gets the colour that is farthest from those of its
        neighbours, from a palette of 36, for normal and colour-blind eyes; `visible` then has no effect.
        """
        shown = None if visible is None else np.asarray(visible, dtype=bool).tolist()
        kept: Any = None  # the types of Python 3.11 do not know that arrays are buffers
        if known is not None:
            kept = np.ascontiguousarray(known, dtype=np.float32)
            if kept.shape != (len(self), 3):
                raise InputError(f"known: expected an array ({len(self)}, 3), got {kept.shape}")
            kept = kept.ravel()
        return np.asarray(self._volume.auto_colors(shown, kept))


class Volume:
    """An immutable label volume in its compressed form, which threads may share."""

    def __init__(
        self,
        native: _native.Volume,
        source: tuple[Path, arguments.ReadAs | None] | None = None,
        memory: PageMemory | None = None,
    ) -> None:
        self._native = native
        self._memory = memory
        # The file that has these voxels, and how it is read; None for an array that was not saved.
        self._source = source
        self._facts: dict[str, Any] = json.loads(native.facts())
        self._labels: LabelTable | None = None
        self._contacts: npt.NDArray[np.uint32] | None = None
        self._content_hash: str | None = None

    def __repr__(self) -> str:
        x, y, z = self.dims
        return f"<pumice.Volume {x}×{y}×{z}, {self._facts['labels']} labels, {self.bytes_resident} bytes>"

    @property
    def dims(self) -> tuple[int, int, int]:
        """Voxels along x, y, z."""
        x, y, z = self._facts["dims"]
        return x, y, z

    @property
    def spacing(self) -> tuple[float, float, float]:
        """Lengths of a voxel along x, y, z in `unit`."""
        x, y, z = self._facts["spacing"]
        return x, y, z

    @property
    def unit(self) -> str:
        """Length unit of the volume's world: nm, um, mm, m or unknown."""
        return str(self._facts["unit"])

    @property
    def frame(self) -> str:
        """Anatomical directions of the axes of the volume's world: RAS, LPS, LAS or unknown."""
        return str(self._facts["frame"])

    @property
    def label_type(self) -> str:
        """Number type of the labels in the file or array they came from: u8 to u64, i8 to i64, f32, f64."""
        return str(self._facts["label_type"])

    @property
    def world_from_index(self) -> npt.NDArray[np.float64]:
        """4 × 4 matrix that maps voxel corners to the volume's world; voxel (i, j, k) is the cube from there to (i+1, j+1, k+1)."""
        matrix = np.eye(4)
        matrix[:3] = np.array(self._facts["world_from_index"]).reshape(4, 3).T
        return matrix

    @property
    def labels(self) -> LabelTable:
        """The table of labels, without the background."""
        if self._labels is None:
            self._labels = LabelTable(self._native, self._facts["type_names"])
        return self._labels

    @property
    def contacts(self) -> npt.NDArray[np.uint32]:
        """Pairs of labels that touch, (n, 2), by row of the table."""
        if self._contacts is None:
            self._contacts = np.asarray(self._native.contacts())
        return self._contacts

    @property
    def content_hash(self) -> str:
        """Hash of labels and voxels, 32 hexadecimal digits; the same whatever file the volume came from. The first call walks over all
        boxes."""
        if self._content_hash is None:
            self._content_hash = self._native.content_hash()
        return self._content_hash

    @property
    def is_whole(self) -> bool:
        """Whether all labels of the table were read."""
        return bool(self._facts["is_whole"])

    @property
    def time_step(self) -> int | None:
        """The time step that the volume is, counted from 0; None where its file has one volume. Its table has the labels of all time steps; those
        that are not there have 0 voxels and empty bounds. It cannot be saved."""
        step = self._facts["time_step"]
        return None if step is None else int(step)

    @property
    def time_steps(self) -> int | None:
        """Number of time steps of the file; None where it has one volume."""
        steps = self._facts["time_steps"]
        return None if steps is None else int(steps)

    @property
    def memory(self) -> PageMemory | None:
        """The memory that the volume was opened with, to be drawn from disk; None where it is in memory."""
        return self._memory

    @property
    def boxes(self) -> int:
        """Number of boxes."""
        return int(self._facts["boxes"])

    @property
    def resident_parts(self) -> dict[str, int]:
        """Current bytes in memory by part; `index` is present once `label_at`, `decode` or `verify` has built it."""
        return self._native.resident_parts()

    @property
    def bytes_resident(self) -> int:
        """Bytes in memory: the sum of `resident_parts`."""
        return sum(self.resident_parts.values())

    @property
    def bytes_mapped(self) -> int:
        """How many of `bytes_resident` are pages of the file and not memory of this process: see `open`."""
        return self._native.mapped_bytes()

    @checked
    def save(self, path: Path, *, level: Level = "default", job: Job | None = None) -> None:
        """Writes a `.pumice` file, which appears complete or not at all; `level` is `fast` (the largest file), `default` or `small` (the slowest)."""
        to = arguments.path("path", path)
        self._native.save(to, level, job)
        self._source = (os.path.abspath(to), arguments.ReadAs())

    @checked
    def with_labels(self, labels: Iterable[int], *, job: Job | None = None) -> Volume:
        """This volume with further `labels` (ids) of its file: only their boxes and nodes are read, and nodes that are there already are shared.

        For a volume that holds some of its file's labels (`open(..., labels=...)`): a picture of one type of cells, and then of two. `is_whole`
        tells whether any are missing; labels that are held already cost nothing. InputError where the file has changed since.
        """
        chosen = arguments.ids("labels", labels)
        if self.is_whole:
            self.labels.rows_of(chosen)
            return self
        path, read_as = self._source or (None, None)
        if path is None or read_as is None:
            raise InputError("with_labels: the volume comes from no file that its labels could be read from")
        return Volume(self._native.with_labels(path, chosen, job=job, read_as=read_as), self._source)

    @checked
    def write(
        self,
        path: Path,
        *,
        format: Store | None = None,
        ome_version: OmeVersion | None = None,
        shards: bool = False,
        encoding: Encoding | None = None,
        gzip: bool = False,
        chunk: int | None = None,
        job: Job | None = None,
    ) -> None:
        """Writes the labels for other programs, whole or not at all: `.nrrd`, `.npy`, `.nii`, `.nii.gz` or `.tif`, or a new folder.

        A name that ends with `.zarr` or `.precomputed`, or `format`, makes a folder of OME-Zarr (`ome_version` 0.5, or 0.4 on Zarr 2; `shards`
        puts 8 × 8 × 8 chunks into a file) or Neuroglancer precomputed (`encoding` compressed_segmentation or raw; `gzip`). `chunk` is the side
        of a chunk in voxels, 8 to 128, by default 64. Names, types, colours and numbers of labels go with the volume. A `PumiceWarning` tells
        what a folder does not hold. A folder that exists is not replaced.
        """
        to = arguments.path("path", path)
        write_as = (format, ome_version, bool(shards), encoding, bool(gzip), chunk)
        for note in self._native.write(to, write_as=write_as, job=job):
            warnings.warn(note, PumiceWarning, stacklevel=3)

    @checked
    def verify(self, source: Path | Any, *, job: Job | None = None, **choice: Unpack[Choice]) -> None:
        """Compares every voxel and id with `source`, a file or an array; InputError names the first difference. Keywords are as for `open`."""
        read_as = choice_of(source, choice)
        difference = self._native.difference(_source(source, axes=read_as.axes), job=job, read_as=read_as)
        if difference is not None:
            raise InputError(difference)

    @checked
    def decode(self, *, dtype: npt.DTypeLike | None = None, job: Job | None = None) -> npt.NDArray[Any]:
        """All labels as an array[x, y, z] in Fortran order; by default in the type they came from.

        `dtype` is an integer or floating-point type that holds every id exactly; InputError names an id that it does not hold.
        """
        own = f"{self.label_type[0]}{int(self.label_type[1:]) // 8}"
        wanted = _number_type(own if dtype is None else dtype)
        ids = np.asarray(self._native.ids())
        with np.errstate(over="ignore", invalid="ignore"):
            # Convert there and back to find ids that are lost. Values that the way back would saturate or wrap count as lost too: 2⁶⁴, to
            # which a float rounds 2⁶⁴ − 1, and negative numbers.
            kept = ids.astype(wanted)
            lost = kept.astype(np.uint64) != ids
            lost |= kept.astype(np.float64) >= 2.0**64 if wanted.kind == "f" else kept < 0
        if lost.any():
            raise InputError(f"decode: label {int(ids[lost.argmax()])} does not fit into {wanted}")
        out = np.empty(self.dims, dtype=wanted, order="F")
        x, y, depth = self.dims
        thickness = max(1, min(depth, blocks.MOST_LABELS // max(1, x * y)))
        for z in range(0, depth, thickness):
            n = min(thickness, depth - z)
            out[:, :, z : z + n] = np.asarray(self._native.decode_block((0, 0, z), (x, y, n), job)).T
        return out

    @checked
    def label_at(self, x: int, y: int, z: int) -> int:
        """Id of the label at the voxel `x`, `y`, `z`, counted from 0; 0 is background and everything outside."""
        if min(x, y, z) < 0 or any(i >= n for i, n in zip((x, y, z), self.dims, strict=True)):
            return 0
        return self._native.label_at(x, y, z)

    def box_arrays(self) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], npt.NDArray[np.uint32]]:
        """Origins (n, 3) and extents (n, 3) in voxels, and rows of the label table (n,), of all boxes."""
        origins, extents, labels = self._native.box_arrays()
        return np.asarray(origins), np.asarray(extents), np.asarray(labels)

    @checked
    def faces(
        self,
        labels: Iterable[int] | None = None,
        *,
        interfaces: Literal["outside", "all"] = "outside",
        shared_corners: bool = False,
        job: Job | None = None,
    ) -> Faces:
        """The exact surface of the `labels` with these ids (all labels if omitted): one quad per voxel face, normals outward.

        `interfaces`: `outside` gives the faces towards voxels that are not shown, which are all that is visible from outside; `all` also gives those
        between two shown labels, once for each. `shared_corners` gives one vertex per position instead of four per quad. Costs 68 bytes
        per quad; with shared corners 36, and some 30 more during the search for them.
        """
        if interfaces not in ("outside", "all"):
            raise InputError(f"interfaces: expected outside or all, got {interfaces!r}")
        vertices, quads, rows = self._native.faces(
            visible_rows(self, labels), all_interfaces=interfaces == "all", shared_corners=shared_corners, job=job
        )
        return Faces(np.asarray(vertices), np.asarray(quads), np.asarray(rows))

    @checked
    def coarse_surface(
        self, visible: npt.ArrayLike | None = None, *, most_faces: int = 50_000, job: Job | None = None
    ) -> CoarseSurface:
        """A surface with at most `most_faces` quads, at least 6, of the labels whose rows are `visible` (all labels if omitted): for programs
        or views that draw only meshes. Its cells are as fine as the faces allow; parts thinner than a cell are drawn up to about a cell
        thick. Not exact. Costs up to 100 MB while it is made."""
        shown = [True] * len(self.labels) if visible is None else np.asarray(visible, dtype=bool).tolist()
        vertices, quads, rows, cell = self._native.coarse_surface(
            shown, most_faces=arguments.whole("most_faces", most_faces, 6, MOST_FACES), job=job
        )
        x, y, z = cell
        return CoarseSurface(np.asarray(vertices), np.asarray(quads), np.asarray(rows), (x, y, z))


@dataclasses.dataclass(frozen=True)
class CoarseSurface:
    """A coarse surface in index space, closed; the arrays are read-only.

    `vertices` (n, 3), `quads` (m, 4) vertex indices, counter-clockwise seen from outside (clockwise after a mirroring matrix), `labels` (m,)
    rows of the label table, `cell` voxels of a cell along x, y, z (0 where nothing is shown).
    """

    vertices: npt.NDArray[np.float32]
    quads: npt.NDArray[np.uint32]
    labels: npt.NDArray[np.uint32]
    cell: tuple[int, int, int]


@checked
def distinct_colors(count: int, *, color_blind_safe: bool = False) -> npt.NDArray[np.float32]:
    """Linear Rec. 709 colours, (`count`, 3), each as far as possible from black, white and those before it; at most 256.

    With `color_blind_safe` also for eyes without red or green cones: 12 colours stay apart by a ΔE of 20 then, 256 by one of 2.
    """
    return np.asarray(_native.distinct_colors(arguments.whole("count", count, 0, arguments.MOST_64), color_blind_safe))


@dataclasses.dataclass(frozen=True)
class Faces:
    """Faces of voxels in index space, which `Volume.world_from_index` maps to the world; the arrays are read-only.

    `vertices` (n, 3) are integers, `quads` (m, 4) are vertex indices, counter-clockwise seen from outside (clockwise after a mirroring
    matrix), `labels` (m,) are rows of the label table.
    """

    vertices: npt.NDArray[np.int32]
    quads: npt.NDArray[np.uint32]
    labels: npt.NDArray[np.uint32]


@checked
def open(
    path: Path,
    *,
    labels: Iterable[int] | None = None,
    mapped: bool = False,
    memory: PageMemory | None = None,
    job: Job | None = None,
    **reading: Unpack[Reading],
) -> Volume:
    """Opens a `.pumice` file, or any label volume of a known format, which is compressed in memory. `path` may be the URL of a store
    (`https://`, `gs://`, `s3://`).

    `labels`: only these ids are read from a `.pumice` file. The table still has all labels; voxels of the others are background (0),
    they have no boxes and empty bounds, and the volume cannot be saved.

    `mapped`: boxes and nodes of a `.pumice` file of the level `fast` stay in the file and take no memory of this process. As long as the
    volume exists, no other program may change that file in place, or this process ends; saving over it with Pumice is safe. Files of
    other levels, and chosen labels, are read into memory.

    `memory`: boxes and nodes of a `.pumice` file go into temporary files, and come into this `PageMemory` where rays meet them, page by page. The
    volume is drawn with the same picture, and has its table; a graphics processor holds pages within the same limit itself; what needs all boxes (`save`, `decode`, `faces`, …) is an InputError.

    Keywords: `layer`, `time`, `channel` (numbers from 0), `array` (name within an `.npz`), `spacing` (three lengths), `axes` (the order of
    the axes of an array whose file does not say it: "xyz" or "zyx"; without it, "xyz" of `.npy` and `.npz`, "zyx" of HDF5 and Zarr, with a
    warning). Unusual things in the file that are not errors cause a `PumiceWarning`. A keyword that leaves nothing to choose in this file is
    an InputError.

    Large volumes: `scale` (the number of a level, 0 the finest, or three voxel lengths to which the level is nearest), `roi` (three pairs of
    the first voxel and the one after the last, None for the volume's end; the voxels keep their place in the world), `label` (label image of
    an OME-Zarr picture), `dataset` (path within an HDF5 file, a Zarr or an N5 folder), `missing_chunks` ("fill", the default, takes absent
    chunks as the fill value, with a warning that counts them; "error" refuses them), `relabel` (a table of pairs supervoxel, segment, CSV,
    TSV or `.npy`, that joins ids while reading).

    A file without a header needs `raw_dims` (voxels along x, y, z; x is fastest) and `raw_type` (u8 u16 u32 u64 i8 i16 i32 i64 f32 f64), with
    `raw_big_endian` (False) and `raw_offset` (0, the bytes before the first voxel) where they apply.
    """
    chosen = None if labels is None else arguments.ids("labels", labels)
    if memory is not None and (chosen is not None or mapped):
        raise InputError(f"memory: {'mapped' if mapped else 'labels'} has no effect beside it; pages are made of the labels that are drawn")
    read_as = arguments.reading(reading)
    native, odd = _native.open(
        arguments.path("path", path),
        labels=chosen,
        mapped=mapped,
        memory=None if memory is None else memory._native,
        job=job,
        read_as=read_as,
    )
    warn(odd)
    return Volume(native, source_of(path, read_as), memory)


@checked
def probe(path: Path, *, query: str | None = None, job: Job | None = None, **reading: Unpack[Reading]) -> dict[str, Any]:
    """A summary of a file, from its header: the same fields as `pumice info --json`, including warnings. Keywords are as for `open`.

    Of a file that is not a `.pumice` file no voxel is read. `choices` lists what the file leaves open and no keyword says, each as a dict:
    `keyword` (`layer`, `time`, `channel`, `array`, `axes`, `scale`, `label` or `dataset`), `what` (a sentence), `values` (dicts of `value` and `text`), `assumed` (the
    answer that is taken without the keyword; None where `open` refuses the file). The first volume is described. `bytes_expected` is the
    memory that compressing is expected to take.

    `query`, for `.pumice` files, adds under "shown" the bytes in memory of a process that reads and traces only the labels that match
    (`query_labels`).
    """
    read_as = arguments.reading(reading)
    return dict(json.loads(_native.probe(arguments.path("path", path), query=query, job=job, read_as=read_as)))


@checked
def compress(
    source: Path | Any,
    *,
    spacing: Sequence[float] | None = None,
    unit: str = "",
    world_from_index: npt.ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
    types: Mapping[int, str] | Path | None = None,
    table: AnnotationTable | Path | None = None,
    memory_limit: int | None = None,
    threads: int = 0,
    job: Job | None = None,
    **choice: Unpack[Choice],
) -> Volume:
    """Compresses `source`: a file, with keywords as for `open`, or an array[x, y, z] of labels of any integer type and order; floats must be whole
    numbers ≥ 0. Of a `.pumice` file it takes `table` alone, and `save` writes it anew.

    `axes="zyx"` reads an array[z, y, x], as tifffile, scikit-image and napari use it, in memory or in an `.npy` or `.npz` file. The volume's
    axes are x, y, z all the same, in `spacing` and in `decode` too. An array of h5py, zarr, xarray or netCDF4 that names its axes x, y and z is
    read as they say; one that does not needs `axes`. Arrays are read in slabs and never whole.

    For arrays: `spacing` (three lengths) or `world_from_index` (4 × 4, voxel corners to world), `unit` (nm, um or µm, mm, m), `names` by id.
    `types`: type by id, or the path of a CSV table id,type. `table`: names, types, colours and numbers by id, as an `AnnotationTable` or a
    file that `read_label_table` reads; what it says replaces what the source has, and a `PumiceWarning` tells what does not fit.
    `memory_limit` is in bytes and includes the result: one below twice its size is refused with a number that suffices. `threads` of 0 uses all
    cores.
    """
    given, told = labels_given(types, table)
    limits = limits_of(memory_limit, threads)
    read_as = choice_of(source, choice)
    described, read_as = described_source(source, spacing, unit, world_from_index, names, read_as)
    native, odd = _native.compress(
        described,
        given=given,
        **limits,
        read_as=read_as,
        job=job,
    )
    warn([*told, *odd])
    # What a table says of the labels is not in the file.
    is_file = isinstance(described, str) and types is None and table is None
    return Volume(native, source_of(str(described), read_as) if is_file else None)


@checked
def is_on_server(path: Path) -> bool:
    """Whether `path` is the URL of a place on a server (`https://`, `http://`, `gs://`, `s3://`, also behind `precomputed://`, `zarr://` or `n5://`),
    and not a file or folder of this machine. Nothing is asked of the server."""
    return _native.is_on_server(arguments.path("path", path))


def source_of(path: Path, read_as: arguments.ReadAs) -> tuple[Path, arguments.ReadAs | None] | None:
    """The file that a volume comes from, for scenes that name it; None for a store on a server, which a picture cannot be made again from."""
    text = os.fspath(path)
    return None if _native.is_on_server(text) else (os.path.abspath(text), read_as)


def described_source(
    source: Path | Any,
    spacing: Sequence[float] | None,
    unit: str,
    world_from_index: npt.ArrayLike | None,
    names: Mapping[int, str] | None,
    read_as: arguments.ReadAs,
    chunks: str | None = None,
) -> tuple[str | _Blocks, arguments.ReadAs]:
    """A source as the compiled part takes it, and how it is read."""
    if not isinstance(source, (str, os.PathLike)):
        return _source(source, spacing, unit, world_from_index, names, read_as.axes, chunks), read_as
    for name, given in (("unit", unit or None), ("world_from_index", world_from_index), ("names", names)):
        if given is not None:
            raise InputError(f"{name}: a file says that itself; only arrays take it")
    lengths = None if spacing is None else arguments.three_lengths(spacing)
    return arguments.path("source", source), read_as._replace(spacing=lengths)


def visible_rows(volume: Volume, labels: Iterable[int] | None) -> list[bool]:
    """Which rows of the label table are shown: those of the labels with these ids, or all."""
    visible = np.full(len(volume.labels), labels is None)
    if labels is not None:
        visible[volume.labels.rows_of(labels)] = True
    listed: list[bool] = visible.tolist()
    return listed


class _Blocks:
    """An array as the compiled part takes it: its description, and a function that delivers its blocks."""

    def __init__(self, info: str, array: Any, chunks: str | None) -> None:
        self.info = info
        regions = None if chunks is None else _native.chunk_regions(blocks.shape_of(array), chunks)
        self.next = blocks.delivery(array, regions)


def _source(
    source: Path | Any,
    spacing: Sequence[float] | None = None,
    unit: str = "",
    world_from_index: npt.ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
    axes: Axes | None = None,
    chunks: str | None = None,
) -> str | _Blocks:
    """A path as it is, or an array's description and blocks: those of some `chunks` alone, where they are given."""
    if isinstance(source, (str, os.PathLike)):
        return arguments.path("source", source)
    if not hasattr(source, "dtype") or not hasattr(source, "shape"):
        raise InputError(f"source: expected a path or an array, got {type(source).__name__}")
    kind = blocks.label_type(source)
    order = dimension_names.order_of(source, axes)
    if order != (0, 1, 2) and len(source.shape) == 3:
        source = blocks.Transposed(source, order)
    matrix = np.eye(4)
    if world_from_index is not None:
        if spacing is not None:
            raise InputError("give spacing or world_from_index, not both")
        matrix = np.asarray(world_from_index, dtype=np.float64)
        if matrix.shape != (4, 4) or not np.array_equal(matrix[3], (0, 0, 0, 1)) or not np.isfinite(matrix).all():
            raise InputError("world_from_index: expected a finite 4 × 4 matrix with the last row 0, 0, 0, 1")
        # The same limit as in scenes: below it f64 has lost the digits of the third direction.
        if not abs(np.linalg.det(matrix[:3, :3])) > 1e-12 * np.prod(np.linalg.norm(matrix[:3, :3], axis=0)):
            raise InputError("world_from_index: expected a matrix that can be inverted; its axes lie in a plane")
        if not all(map(arguments.is_length, np.linalg.norm(matrix[:3, :3], axis=0))):
            raise InputError(f"world_from_index: expected columns as long as a voxel can be, got {matrix[:3, :3].tolist()}")
    elif spacing is not None:
        matrix[(0, 1, 2), (0, 1, 2)] = arguments.three_lengths(spacing)
    columns = matrix[:3].T.ravel().tolist()
    listed = list(zip(arguments.ids("names", names or {}), map(str, (names or {}).values()), strict=True))
    info = _native.volume_info(blocks.shape_of(source), kind, columns, unit, listed)
    return _Blocks(info, source, chunks)


def choice_of(source: Path | Any, choice: Choice) -> arguments.ReadAs:
    if "spacing" in choice:
        raise TypeError("unexpected keyword argument 'spacing'")
    if not isinstance(source, (str, os.PathLike)):
        for name, given in choice.items():
            if given is not None and name != "axes":
                raise InputError(f"{name}: an array is read as it is" + ("" if name.startswith("raw_") else "; choose by slicing it"))
    return arguments.reading(choice)


def warn(odd: list[str]) -> None:
    for line in odd:
        # The warning points to the line that called `open` or `compress`.
        warnings.warn(line, PumiceWarning, stacklevel=4)


def _number_type(dtype: npt.DTypeLike) -> np.dtype[Any]:
    try:
        wanted = np.dtype(dtype)
    except TypeError as error:
        raise InputError(f"dtype: {error}") from None
    if wanted.kind not in "uif":
        raise InputError(f"dtype: expected a type of integers or floats, got {wanted}")
    return wanted
