"""Volumes in their compressed form, and the table of their labels."""

from __future__ import annotations

import json
import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native, blocks
from .errors import InputError

Path = str | os.PathLike[str]
Job = _native.Job


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

    def __len__(self) -> int:
        return len(self.ids)

    def index_of(self, label: int) -> int:
        """Row of a label; InputError where the volume has none with this id."""
        row = int(np.searchsorted(self.ids, np.uint64(label)))
        if row == len(self.ids) or int(self.ids[row]) != label:
            raise InputError(f"the volume has no label {label}")
        return row

    def auto_colors(self, visible: npt.ArrayLike | None = None) -> npt.NDArray[np.float32]:
        """Linear Rec. 709 colours, (n, 3), that labels which touch do not share: what `auto_color` gives in a scene."""
        shown = None if visible is None else np.asarray(visible, dtype=bool).tolist()
        return np.asarray(self._volume.auto_colors(shown))


class Volume:
    """A label volume in its compressed form. It never changes; threads may share it."""

    def __init__(self, native: _native.Volume) -> None:
        self._native = native
        self._facts: dict[str, Any] = json.loads(native.facts())
        self._labels: LabelTable | None = None
        self._contacts: npt.NDArray[np.uint32] | None = None

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
        """What the axes of the volume's world point at: RAS, LPS, LAS or unknown."""
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
        """The table of labels, background left out."""
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
        """Hash of labels and voxels, 32 hexadecimal digits; the same whatever file it came from."""
        return str(self._facts["content_hash"])

    @property
    def boxes(self) -> int:
        """Number of boxes."""
        return int(self._facts["boxes"])

    @property
    def resident_parts(self) -> dict[str, int]:
        """Bytes in memory by part."""
        return dict(self._facts["resident_parts"])

    @property
    def bytes_resident(self) -> int:
        """Bytes in memory."""
        return sum(self._facts["resident_parts"].values())

    def save(self, path: Path, *, level: str = "default", job: Job | None = None) -> None:
        """Writes a `.pumice` file, whole or not at all; level is fast, default or small."""
        self._native.save(os.fspath(path), level, job)

    def verify(self, source: Path | Any, *, job: Job | None = None, **reading: Any) -> None:
        """Compares every voxel and id with a file or an array; InputError says what is not the same."""
        difference = self._native.difference(_source(source), job=job, **reading)
        if difference is not None:
            raise InputError(difference)

    def decode(self, *, dtype: npt.DTypeLike | None = None, job: Job | None = None) -> npt.NDArray[Any]:
        """All labels as an array[x, y, z] in Fortran order; by default in the type they came from."""
        own = f"{self.label_type[0]}{int(self.label_type[1:]) // 8}"
        wanted = np.dtype(own if dtype is None else dtype)
        ids = self.labels.ids
        if wanted.kind in "ui" and len(ids) and int(ids[-1]) > np.iinfo(wanted).max:
            raise InputError(f"decode: label {int(ids[-1])} does not fit into {wanted}")
        out = np.empty(self.dims, dtype=wanted, order="F")
        x, y, depth = self.dims
        thickness = max(1, min(depth, blocks.MOST_LABELS // max(1, x * y)))
        for z in range(0, depth, thickness):
            n = min(thickness, depth - z)
            out[:, :, z : z + n] = np.asarray(self._native.decode_block((0, 0, z), (x, y, n), job)).T
        return out

    def label_at(self, x: int, y: int, z: int) -> int:
        """Id of the label at a voxel; 0 is background and everything outside."""
        if min(x, y, z) < 0 or any(i >= n for i, n in zip((x, y, z), self.dims, strict=True)):
            return 0
        return int(self._native.label_at(x, y, z))

    def box_arrays(self) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], npt.NDArray[np.uint32]]:
        """Origins (n, 3) and extents (n, 3) in voxels, and rows of the label table (n,), of all boxes."""
        origins, extents, labels = self._native.box_arrays()
        return np.asarray(origins), np.asarray(extents), np.asarray(labels)


def open(path: Path, *, job: Job | None = None, **reading: Any) -> Volume:
    """Opens a `.pumice` file, or any label volume of a known format, which is compressed in memory.

    Keywords: `layer`, `time`, `channel` (numbers from 0), `array` (name within an `.npz`), `spacing` (three lengths).
    """
    return Volume(_native.open(os.fspath(path), job=job, **reading))


def probe(path: Path, *, job: Job | None = None, **reading: Any) -> dict[str, Any]:
    """What a file holds, from its header: the same fields as `pumice info --json`."""
    return dict(json.loads(_native.probe(os.fspath(path), job=job, **reading)))


def compress(
    source: Path | Any,
    *,
    spacing: Sequence[float] | None = None,
    unit: str = "",
    world_from_index: npt.ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
    types: Mapping[int, str] | Path | None = None,
    memory_limit: int | None = None,
    threads: int = 0,
    job: Job | None = None,
    **reading: Any,
) -> Volume:
    """Compresses a file, or an array[x, y, z] of labels of any integer type and order; floats must be whole numbers ≥ 0.

    For arrays: `spacing` (three lengths) or `world_from_index` (4 × 4, voxel corners to world), `unit` (nm, um, mm, m), `names` by id.
    `types`: type by id, or the path of a CSV table id,type. `memory_limit` in bytes; 0 `threads` are all.
    """
    table = _type_table(types)
    if isinstance(source, (str, os.PathLike)):
        for name, given in (("unit", unit or None), ("world_from_index", world_from_index), ("names", names)):
            if given is not None:
                raise InputError(f"{name}: a file says that itself; only arrays take it")
        described: str | _Blocks = os.fspath(source)
        lengths = None if spacing is None else _three(spacing)
    else:
        if reading:
            raise InputError(f"{next(iter(reading))}: an array is read as it is; choose by slicing it")
        described, lengths = _source(source, spacing, unit, world_from_index, names), None
    native = _native.compress(
        described, types=table, memory_limit=memory_limit, threads=threads, spacing=lengths, job=job, **reading
    )
    return Volume(native)


class _Blocks:
    """What the compiled part takes for blocks."""

    def __init__(self, info: str, array: Any) -> None:
        self.info = info
        self.next = blocks.delivery(array)


def _source(
    source: Path | Any,
    spacing: Sequence[float] | None = None,
    unit: str = "",
    world_from_index: npt.ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
) -> str | _Blocks:
    if isinstance(source, (str, os.PathLike)):
        return os.fspath(source)
    if not hasattr(source, "dtype") or not hasattr(source, "shape"):
        raise InputError(f"source: expected a path or an array, got {type(source).__name__}")
    matrix = np.eye(4)
    if world_from_index is not None:
        if spacing is not None:
            raise InputError("give spacing or world_from_index, not both")
        matrix = np.asarray(world_from_index, dtype=np.float64)
        if matrix.shape != (4, 4) or not np.array_equal(matrix[3], (0, 0, 0, 1)) or not np.isfinite(matrix).all():
            raise InputError("world_from_index: expected a finite 4 × 4 matrix with the last row 0, 0, 0, 1")
    elif spacing is not None:
        matrix[(0, 1, 2), (0, 1, 2)] = _three(spacing)
    columns = matrix[:3].T.ravel().tolist()
    listed = [(int(label), str(name)) for label, name in (names or {}).items()]
    info = _native.volume_info(blocks.shape_of(source), blocks.label_type(source), columns, unit, listed)
    return _Blocks(info, source)


def _three(spacing: Sequence[float]) -> tuple[float, float, float]:
    lengths = [float(s) for s in spacing]
    if len(lengths) != 3 or not all(0.0 < s < float("inf") for s in lengths):
        raise InputError(f"spacing: expected three lengths above 0, got {lengths}")
    return lengths[0], lengths[1], lengths[2]


def _type_table(types: Mapping[int, str] | Path | None) -> str | None:
    if types is None:
        return None
    if isinstance(types, (str, os.PathLike)):
        try:
            with pathlib.Path(types).open(encoding="utf-8") as file:
                return file.read()
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"{os.fspath(types)}: {error}") from error
    for label, name in types.items():
        if any(c in name for c in ',"\r\n'):
            raise InputError(f"types: the name {name!r} of label {label} has a comma, a quote or a line break")
    return "".join(f"{int(label)},{name}\n" for label, name in types.items())
