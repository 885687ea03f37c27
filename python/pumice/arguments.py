"""Checks integers, ids and limits from callers, because the compiled part accepts only values that fit into its types."""

from __future__ import annotations

import json
import numbers
import operator
import os
from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple, TypedDict, get_args

import numpy as np
import numpy.typing as npt

from .errors import InputError

Path = str | os.PathLike[str]
Level = Literal["fast", "default", "small"]

MOST_32 = (1 << 32) - 1
MOST_64 = (1 << 64) - 1


Axes = Literal[
    "xyz", "zyx", "tyx", "cyx", "tzyx", "ztyx", "czyx", "zcyx", "tcyx", "ctyx", "tczyx", "tzcyx", "ctzyx", "cztyx", "ztcyx", "zctyx"
]
Missing = Literal["fill", "error"]
Store = Literal["ome-zarr", "precomputed"]
OmeVersion = Literal["0.4", "0.5"]
Encoding = Literal["compressed_segmentation", "raw"]


class Choice(TypedDict, total=False):
    """Which of several volumes in a file, counted from 0; `array` is a name within an `.npz`. `axes` is the order of an array's axes. The rest
    describes a file without a header: `raw_dims` x, y, z, `raw_type`, `raw_big_endian`, and `raw_offset`, the bytes before the first voxel; or a
    volume at several levels or in chunks: `scale`, `roi`, `label`, `dataset`, `missing_chunks`, `relabel`."""

    layer: int | None
    time: int | None
    channel: int | None
    array: str | None
    axes: Axes | None
    raw_dims: Sequence[int] | None
    raw_type: str | None
    raw_big_endian: bool
    raw_offset: int
    scale: int | Sequence[float] | None
    roi: Sequence[Sequence[int | None]] | None
    label: str | None
    dataset: str | None
    missing_chunks: Missing | None
    relabel: Path | None


class Reading(Choice, total=False):
    """Keywords for what a file may not decide by itself: which of several volumes, and the voxel size."""

    spacing: Sequence[float] | None


class RawAs(NamedTuple):
    """The layout of a file without a header, as the compiled part takes it."""

    dims: tuple[int, int, int]
    label_type: str
    big_endian: bool
    offset: int


class StoreAs(NamedTuple):
    """What is read of a volume at several levels or in chunks, as the compiled part takes it: in the text forms of the command."""

    scale: str | None = None
    roi: str | None = None
    label: str | None = None
    dataset: str | None = None
    missing_chunks: str | None = None
    relabel: str | None = None


class ReadAs(NamedTuple):
    """A `Reading` with its numbers checked, as the compiled part takes it."""

    layer: int | None = None
    time: int | None = None
    channel: int | None = None
    array: str | None = None
    spacing: tuple[float, float, float] | None = None
    axes: Axes | None = None
    raw: RawAs | None = None
    store: StoreAs = StoreAs()


class RenderAs(NamedTuple):
    """A backend and limits, as the compiled part takes them."""

    backend: str
    spp: int | None
    seconds: float | None
    error: float | None


class AnnotateAs(NamedTuple):
    """What is drawn over a picture, as the compiled part takes it."""

    width_mm: float | None
    dpi: float | None
    scale_bar: str | None
    scale_bar_corner: str
    legend: int | None


def denoiser(denoise: Any) -> str | None:
    """The denoiser of a picture by name, and None for none: True stands for the statistical one; InputError for all else."""
    if isinstance(denoise, (bool, np.bool_)):
        return "statistical" if denoise else None
    if isinstance(denoise, str):
        return denoise
    raise InputError(f"denoise: expected True, False, 'statistical', 'oidn' or 'oidn:LIBRARY', got {denoise!r}")


def live_denoiser(denoise: Any) -> bool:
    """Whether a live picture is denoised, which only the statistical denoiser does; InputError for others."""
    if denoiser(denoise) not in (None, "statistical"):
        raise InputError(f"denoise: expected True, False or 'statistical', since other denoisers take too long for a live picture, got {denoise!r}")
    return denoiser(denoise) is not None


def whole(name: str, value: Any, least: int, most: int) -> int:
    """`value` as an int, from any integer type; InputError if it is not from `least` to `most`."""
    try:
        # Older versions of numpy take their truths for numbers, with a warning.
        if isinstance(value, np.bool_):
            raise TypeError
        number = operator.index(value)
    except TypeError:
        raise InputError(f"{name}: expected a whole number, got {value!r}") from None
    if not least <= number <= most:
        raise InputError(f"{name}: expected {least} to {most}, got {number}")
    return number


def ids(name: str, values: Iterable[Any] | npt.ArrayLike) -> list[int]:
    """Label ids, from a list or an array: see `whole_numbers`."""
    listed: list[int] = whole_numbers(name, values, MOST_64).tolist()
    return listed


def whole_numbers(name: str, values: Iterable[Any] | npt.ArrayLike, most: int) -> npt.NDArray[np.uint64]:
    """Whole numbers from 0 to `most` as an array (n,), from a list of numbers of any integer type, also mixed, or an array of one.

    A list is read number by number, because numpy makes floats of [2**63, 1], which round ids. Floats are refused, even whole ones, since nobody
    can tell what they were; so are booleans, which choose rows and are no ids.
    """
    if not hasattr(values, "dtype"):
        return np.array([_of_list(name, value, most) for value in values], dtype=np.uint64)  # type: ignore[union-attr]
    given = np.asarray(values)
    if given.ndim != 1:
        raise InputError(f"{name}: expected a list of whole numbers, got an array of shape {given.shape}")
    if given.dtype.kind == "O":
        return whole_numbers(name, given.tolist(), most)
    if given.size == 0:
        return np.zeros(0, dtype=np.uint64)
    if given.dtype.kind == "f":
        raise InputError(
            f"{name}: expected whole numbers, got {given.dtype}, which rounds ids; numpy makes it of int64 and uint64 together: convert them first"
        )
    if given.dtype.kind not in "iu":
        raise InputError(f"{name}: expected whole numbers, got an array of {given.dtype}")
    if given.min() < 0 or given.max() > most:
        raise InputError(f"{name}: expected 0 to {most}, got {given.min() if given.min() < 0 else given.max()}")
    return given.astype(np.uint64)


def _of_list(name: str, value: Any, most: int) -> int:
    if isinstance(value, bool):
        raise InputError(f"{name}: expected a whole number, got {value!r}")
    return whole(name, value, 0, most)


def json_text(name: str, value: Any) -> str:
    """The JSON form of fields, in which numpy's numbers and arrays may stand for Python's, also as keys; InputError for what JSON lacks."""
    try:
        try:
            return json.dumps(value, allow_nan=False, default=_of_numpy)
        except TypeError:
            # Keys are not given to `default`.
            return json.dumps(_with_plain_keys(value), allow_nan=False, default=_of_numpy)
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"{name}: {error}") from error


def _of_numpy(value: Any) -> Any:
    if isinstance(value, (np.generic, np.ndarray)) and value.dtype.kind in "biufO":
        return value.tolist()
    raise TypeError(f"expected what JSON has, got {type(value).__name__}")


def _with_plain_keys(value: Any) -> Any:
    if isinstance(value, dict):
        return {int(key) if isinstance(key, np.integer) else key: _with_plain_keys(one) for key, one in value.items()}
    return [_with_plain_keys(one) for one in value] if isinstance(value, (list, tuple)) else value


def region(voxels: Iterable[Any]) -> tuple[int, int, int, int, int, int]:
    """The lowest voxel of a region and the one beyond its highest, as six numbers."""
    numbers = [whole("region", value, 0, MOST_32) for value in voxels]
    if len(numbers) != 6:
        raise InputError(f"region: expected six numbers x0, y0, z0, x1, y1, z1, got {len(numbers)}")
    x0, y0, z0, x1, y1, z1 = numbers
    return x0, y0, z0, x1, y1, z1


def reading(given: Choice | Reading) -> ReadAs:
    """The choice with its numbers checked."""
    checked: dict[str, Any] = dict(given)
    for name in ("layer", "time", "channel"):
        if checked.get(name) is not None:
            checked[name] = whole(name, checked[name], 0, MOST_32)
    if checked.get("spacing") is not None:
        checked["spacing"] = three_lengths(checked["spacing"])
    checked["axes"] = order(checked.get("axes"))
    layout = {name: checked.pop(name) for name in ("raw_dims", "raw_type", "raw_big_endian", "raw_offset") if name in checked}
    store = {name: checked.pop(name) for name in StoreAs._fields if checked.get(name) is not None}
    for name in StoreAs._fields:
        checked.pop(name, None)
    if unknown := [name for name in checked if name not in ReadAs._fields or name in ("raw", "store")]:
        raise TypeError(f"unexpected keyword argument {unknown[0]!r}")
    return ReadAs(**checked, raw=raw_layout(**layout), store=_store(store))


def _store(given: dict[str, Any]) -> StoreAs:
    """What is read of a store, from keywords that are not None."""
    for name in ("label", "dataset", "missing_chunks"):
        if name in given and not isinstance(given[name], str):
            raise InputError(f"{name}: expected a text, got {given[name]!r}")
    if "scale" in given:
        given["scale"] = scale_text(given["scale"])
    if "roi" in given:
        given["roi"] = roi_text(given["roi"])
    if "relabel" in given:
        given["relabel"] = os.path.abspath(path("relabel", given["relabel"]))
    return StoreAs(**given)


def scale_text(scale: Any) -> str:
    """A level, or three lengths of a voxel, in the command's text form; a text is taken as it is."""
    if isinstance(scale, str):
        return scale
    if isinstance(scale, numbers.Integral) and not isinstance(scale, bool):
        return str(whole("scale", scale, 0, MOST_32))
    try:
        lengths = [float(length) for length in scale]
    except (TypeError, ValueError):
        raise InputError(f"scale: expected the number of a level, or three lengths of a voxel, got {scale!r}") from None
    return ",".join(map(repr, lengths))


def roi_text(roi: Any) -> str:
    """Three pairs of first voxel and the one after the last, in the command's text form; a text is taken as it is."""
    if isinstance(roi, str):
        return roi
    expected = "expected three pairs (first voxel, the one after the last), with None for the volume's end"
    try:
        pairs = [(pair.start, pair.stop) if isinstance(pair, slice) else tuple(pair) for pair in roi]
    except TypeError:
        raise InputError(f"roi: {expected}, got {roi!r}") from None
    if any(isinstance(pair, slice) and pair.step not in (None, 1) for pair in roi) or [len(pair) for pair in pairs] != [2, 2, 2]:
        raise InputError(f"roi: {expected}, got {roi!r}")
    ends = [["" if end is None else str(whole("roi", end, 0, MOST_64)) for end in pair] for pair in pairs]
    return ",".join(":".join(pair) for pair in ends)


def raw_layout(raw_dims: Any = None, raw_type: Any = None, raw_big_endian: Any = False, raw_offset: Any = 0) -> RawAs | None:
    """The layout of a file without a header; None where the file has one. InputError for a part of a layout."""
    if not isinstance(raw_big_endian, bool):
        raise InputError(f"raw_big_endian: expected True or False, got {raw_big_endian!r}")
    offset = whole("raw_offset", raw_offset, 0, MOST_64)
    if raw_dims is None or raw_type is None:
        for name, missing in (("raw_dims", raw_type), ("raw_type", raw_dims), ("raw_dims", raw_big_endian or None), ("raw_dims", offset or None)):
            if missing is not None:
                raise InputError(f"{name}: expected it too, because a file without a header needs raw_dims and raw_type")
        return None
    if not isinstance(raw_type, str):
        raise InputError(f"raw_type: expected the name of a number type such as 'u16', got {raw_type!r}")
    try:
        numbers = list(raw_dims)
    except TypeError:
        raise InputError(f"raw_dims: expected three whole numbers x, y, z, got {raw_dims!r}") from None
    if len(numbers) != 3:
        raise InputError(f"raw_dims: expected three whole numbers x, y, z, got {len(numbers)}")
    x, y, z = (whole("raw_dims", number, 0, MOST_64) for number in numbers)
    return RawAs((x, y, z), raw_type, raw_big_endian, offset)


def order(axes: Any) -> Axes | None:
    """The order of an array's axes, or of a TIFF file's pages; or None."""
    if axes is None or (isinstance(axes, str) and axes in get_args(Axes)):
        return axes  # type: ignore[return-value]
    raise InputError(f"axes: expected one of {', '.join(get_args(Axes))}, got {axes!r}")


def three_lengths(spacing: Iterable[Any]) -> tuple[float, float, float]:
    """Lengths along x, y, z."""
    try:
        lengths = [float(s) for s in spacing]
    except (TypeError, ValueError):
        lengths = []
    if len(lengths) != 3 or not all(map(is_length, lengths)):
        raise InputError(f"spacing: expected three lengths above 0, got {spacing!r}")
    return lengths[0], lengths[1], lengths[2]


def is_length(value: float) -> bool:
    """Whether a number is the length of a voxel: above 0, and such that its square is neither 0 nor infinite, as matrices need it."""
    return 0.0 < value < float("inf") and 0.0 < value * value < float("inf")


def path(name: str, value: Any) -> str:
    """A path as text."""
    try:
        text = os.fspath(value)
    except TypeError:
        text = value
    if not isinstance(text, str):
        raise InputError(f"{name}: expected a path, got {type(value).__name__}")
    return text


def positive(name: str, value: Any) -> float:
    """A finite number above 0."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = 0.0
    if isinstance(value, str) or not 0.0 < number < float("inf"):
        raise InputError(f"{name}: expected a number above 0, got {value!r}")
    return number


def limits(
    spp: int | None, seconds: float | None, error: float | None
) -> tuple[int | None, float | None, float | None]:
    """The limits at which a picture is done, checked."""
    return (
        None if spp is None else whole("spp", spp, 1, MOST_32),
        None if seconds is None else positive("seconds", seconds),
        None if error is None else positive("error", error),
    )


def render_as(backend: str, spp: int | None, seconds: float | None, error: float | None) -> RenderAs:
    """The backend, and the limits at which a picture is done, checked."""
    return RenderAs(backend, *limits(spp, seconds, error))


def annotate_as(
    width_mm: float | None, dpi: float | None, scale_bar: str | None, scale_bar_corner: str, legend: int | None
) -> AnnotateAs:
    """Size on paper, scale bar and legend, checked; the compiled part reads the texts of the bar and of its corner."""
    for name, length in (("width_mm", width_mm), ("dpi", dpi)):
        if length is not None and not (isinstance(length, numbers.Real) and 0 < length < float("inf")):
            raise InputError(f"{name}: expected a number above 0, got {length!r}")
    if scale_bar is not None and not isinstance(scale_bar, str):
        raise InputError(f"scale_bar: expected a text such as '10um', got {scale_bar!r}")
    if not isinstance(scale_bar_corner, str):
        raise InputError(f"scale_bar_corner: expected a text such as 'lower_left', got {scale_bar_corner!r}")
    return AnnotateAs(width_mm, dpi, scale_bar, scale_bar_corner, None if legend is None else whole("legend", legend, 1, MOST_32))
