"""Cuts label arrays into blocks, so that no array is ever copied as a whole.

Anything with `shape`, `dtype` and slicing is accepted: a numpy array of any order and strides, a memory map, an HDF5 or Zarr array. Axes
are `array[x, y, z]`, and those of an `array[z, y, x]` once `Reversed` wraps it. Blocks are 64 voxels thick along the axis with the largest stride, if the array has strides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InputError

Block = tuple[tuple[int, int, int], tuple[int, int, int], npt.NDArray[Any]]

THICKNESS = 64
# Most labels in one block: a slab of a wide volume is cut along its other axes too.
MOST_LABELS = 1 << 24


class Reversed:
    """An array[z, y, x] as array[x, y, z]: a view, which reads what is sliced."""

    def __init__(self, array: Any) -> None:
        self._array = array
        self.shape = tuple(reversed(array.shape))
        self.dtype = array.dtype
        strides = getattr(array, "strides", None)
        self.strides = None if strides is None else tuple(reversed(strides))

    def __getitem__(self, cut: tuple[slice, slice, slice]) -> npt.NDArray[Any]:
        return np.asarray(self._array[cut[::-1]]).transpose()


def label_type(array: Any) -> str:
    """The name of the array's number type in volume descriptions; InputError where labels cannot be of that type."""
    if isinstance(array, np.ma.MaskedArray) and np.ma.is_masked(array):
        raise InputError("array: some voxels are masked; say what they are with array.filled(0)")
    dtype = np.dtype(array.dtype)
    if dtype.kind == "b":
        return "u8"
    if dtype.kind in "uif" and (dtype.kind, dtype.itemsize) not in {("f", 2), ("f", 16)}:
        return f"{dtype.kind}{8 * dtype.itemsize}"
    raise InputError(f"array: labels are integers, got {dtype}")


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


def delivery(array: Any) -> Callable[[], Block | None]:
    """A function that gives the next block each time, and None after the last."""
    blocks = _blocks(array)
    return lambda: next(blocks, None)


def _blocks(array: Any) -> Iterator[Block]:
    shape = shape_of(array)
    steps = _steps(array, shape)
    for z in range(0, shape[2], steps[2]):
        for y in range(0, shape[1], steps[1]):
            for x in range(0, shape[0], steps[0]):
                origin = (x, y, z)
                end = tuple(min(o + s, n) for o, s, n in zip(origin, steps, shape, strict=True))
                dims = (end[0] - x, end[1] - y, end[2] - z)
                cut = np.asarray(array[x : end[0], y : end[1], z : end[2]])
                yield origin, dims, np.ravel(_unsigned(cut, origin), order="F")


def _steps(array: Any, shape: tuple[int, int, int]) -> list[int]:
    strides = getattr(array, "strides", None) or (1, 2, 3)
    slow_to_fast = sorted(range(3), key=lambda axis: -abs(strides[axis]))
    steps = list(shape)
    for axis in slow_to_fast:
        steps[axis] = min(shape[axis], THICKNESS)
        if steps[0] * steps[1] * steps[2] <= MOST_LABELS:
            break
    return steps


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
    return labels.astype(f"=u{bits // 8}", copy=False)


def _require(good: npt.NDArray[np.bool_], labels: npt.NDArray[Any], origin: tuple[int, int, int], what: str) -> None:
    if not good.all():
        at = tuple(int(i) for i in np.unravel_index(int(np.argmin(good)), good.shape))
        voxel = tuple(o + i for o, i in zip(origin, at, strict=True))
        raise InputError(f"array: expected {what} at voxel {voxel}, got {labels[at]}")
