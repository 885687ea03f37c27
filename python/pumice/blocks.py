"""Cuts label arrays into blocks, so that no array is ever copied as a whole.

Anything with `shape`, `dtype` and slicing is accepted: a numpy array of any order and strides, a memory map, an HDF5 or Zarr array. Axes
are `array[x, y, z]`, and those of any other order once `Transposed` wraps it.

Blocks are slabs across the axis with the largest stride, which is the first one of an array without strides: 64 voxels thick, or as many whole
chunks of a chunked array, so that each chunk is read once. A slab of more than 2²⁴ voxels is cut along its other axes too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import dimension_names
from .errors import InputError

# The voxels of a chunk along x, y and z: the first, and the one after the last.
Region = Sequence[Sequence[int]]
Block = tuple[tuple[int, int, int], tuple[int, int, int], npt.NDArray[Any]]

THICKNESS = 64
# Most labels in one block: a slab of a wide volume is cut along its other axes too.
MOST_LABELS = 1 << 24


class Transposed:
    """An array of three axes as array[x, y, z]: a view, which reads what is sliced. `order` has the axes that are x, y and z."""

    def __init__(self, array: Any, order: tuple[int, int, int]) -> None:
        self._array, self._order = array, order
        self.dtype = array.dtype
        self.shape, self.strides, self.chunks = ([of[axis] for axis in order] for of in (array.shape, _strides(array), _chunks(array)))

    def __getitem__(self, cut: tuple[slice, slice, slice]) -> npt.NDArray[Any]:
        of_array = tuple(cut[self._order.index(axis)] for axis in range(3))
        piece: npt.NDArray[Any] = np.asanyarray(self._array[of_array])
        return piece.transpose(self._order)


class Frame:
    """A time step of an array of four axes, of which time is the first: an array of three axes, which reads what is sliced."""

    def __init__(self, array: Any, step: int) -> None:
        self._array, self._step = array, step
        self.dtype, self.shape = array.dtype, tuple(array.shape[1:])
        strides, chunks = getattr(array, "strides", None), getattr(array, "chunks", None)
        self.strides = None if strides is None else strides[1:]
        self.chunks = chunks[1:] if isinstance(chunks, (tuple, list)) else None
        # What says which axis is which (`dimension_names`).
        names = dimension_names.names_of(array)
        if names and names[0].strip().lower() not in ("t", "time", ""):
            raise InputError(f"source: expected time as the first axis, because the array names its axes {', '.join(names)}")
        self.dims = names[1:]
        if dimension_names.is_stored(array):
            self.attrs: dict[str, Any] = {}

    def __getitem__(self, cut: tuple[slice, slice, slice]) -> npt.NDArray[Any]:
        piece: npt.NDArray[Any] = np.asanyarray(self._array[(self._step, *cut)])
        return piece


def label_type(array: Any) -> str:
    """The name of the array's number type in volume descriptions; InputError where labels cannot be of that type."""
    _require_unmasked(array)
    dtype = np.dtype(array.dtype)
    if dtype.kind == "b":
        return "u8"
    if dtype.kind in "uif" and (dtype.kind, dtype.itemsize) not in {("f", 2), ("f", 16)}:
        return f"{dtype.kind}{8 * dtype.itemsize}"
    raise InputError(f"array: labels are integers, or floats of 32 or 64 bits that are whole, got {dtype}")


def shape_of(array: Any) -> tuple[int, int, int]:
    """Voxels along x, y, z."""
    shape = tuple(int(n) for n in array.shape)
    if len(shape) != 3:
        raise InputError(f"array: expected three axes (x, y, z), got shape {shape}")
    for axis, voxels in zip("xyz", shape, strict=True):
        if voxels == 0:
            raise InputError(f"array: expected voxels along {axis}, got shape {shape}")
        if voxels >= 1 << 32:
            raise InputError(f"array: {voxels} voxels along {axis} are too many")
    return shape[0], shape[1], shape[2]


def delivery(array: Any, regions: Sequence[Region] | None = None) -> Callable[[], Block | None]:
    """A function that gives the next block each time, and None after the last; of `regions`, where they are given, alone."""
    shape = shape_of(array)
    blocks = _blocks(array, shape, [[(0, n) for n in shape]] if regions is None else regions)
    return lambda: next(blocks, None)


def _blocks(array: Any, shape: tuple[int, int, int], regions: Sequence[Region]) -> Iterator[Block]:
    steps = _steps(array, shape)
    for low, high in (zip(*region, strict=True) for region in regions):
        for z in range(low[2], high[2], steps[2]):
            for y in range(low[1], high[1], steps[1]):
                for x in range(low[0], high[0], steps[0]):
                    origin = (x, y, z)
                    end = tuple(min(o + s, n) for o, s, n in zip(origin, steps, high, strict=True))
                    dims = (end[0] - x, end[1] - y, end[2] - z)
                    cut = array[x : end[0], y : end[1], z : end[2]]
                    _require_unmasked(cut)
                    yield origin, dims, np.ravel(_unsigned(np.asarray(cut), origin), order="F")


def _steps(array: Any, shape: tuple[int, int, int]) -> list[int]:
    strides, chunks = _strides(array), _chunks(array)
    slow_to_fast = sorted(range(3), key=lambda axis: -abs(strides[axis]))
    steps = list(shape)
    for axis in slow_to_fast:
        steps[axis] = min(shape[axis], chunks[axis] * max(1, THICKNESS // chunks[axis]))
        if steps[0] * steps[1] * steps[2] <= MOST_LABELS:
            break
    return steps


def _strides(array: Any) -> Sequence[int]:
    """Strides of the axes. Arrays without strides lie in C order, as HDF5 and Zarr store them."""
    strides = getattr(array, "strides", None)
    return (3, 2, 1) if strides is None else strides


def _chunks(array: Any) -> Sequence[int]:
    """Voxels of a chunk along each axis; 1 for an array without chunks, and for chunks too large to be read whole."""
    chunks: Any = getattr(array, "chunks", None)
    if not isinstance(chunks, (tuple, list)) or len(chunks) != 3 or not all(isinstance(n, int) and n > 0 for n in chunks):
        return 1, 1, 1
    return chunks if math.prod(chunks) <= MOST_LABELS else (1, 1, 1)


def _require_unmasked(array: Any) -> None:
    if isinstance(array, np.ma.MaskedArray) and np.ma.is_masked(array):
        raise InputError("array: some voxels are masked; say what they are with array.filled(0)")


def _unsigned(labels: npt.NDArray[Any], origin: tuple[int, int, int]) -> npt.NDArray[Any]:
    """The labels in the narrowest unsigned type that holds them all, native byte order."""
    kind, bits = labels.dtype.kind, 8 * labels.dtype.itemsize
    if kind == "b":
        # Compared with 0 instead of viewed as bytes: a bool from foreign memory may hold any byte.
        truth: npt.NDArray[Any] = labels != 0
        return truth.view(np.uint8)
    if kind == "f":
        # The same limit as for files: above 2⁵³ float64 does not hold every integer.
        limit = float(1 << 53)
        with np.errstate(invalid="ignore"):
            good = (labels >= 0) & (labels <= limit) & (labels == np.floor(labels))
        _require(good, labels, origin, f"a whole number from 0 to {limit:.0f}")
        return labels.astype(np.uint64)
    if kind == "i":
        _require(labels >= 0, labels, origin, "a label of at least 0")
    # A type that names this machine's byte order, such as zarr's `<u8`, equals the plain one, but its buffer has another format.
    plain = np.dtype(f"=u{bits // 8}")
    return labels.astype(plain, copy=False).view(plain)


def _require(good: npt.NDArray[np.bool_], labels: npt.NDArray[Any], origin: tuple[int, int, int], what: str) -> None:
    if not good.all():
        at = tuple(int(i) for i in np.unravel_index(int(np.argmin(good)), good.shape))
        voxel = tuple(o + i for o, i in zip(origin, at, strict=True))
        raise InputError(f"array: expected {what} at voxel {voxel}, got {labels[at]}")
