"""Compresses a volume on the workers of a Dask cluster: one task a chunk, then tasks that join them. Needs `pip install "pumice[dask]"`.

    path or Dask array ─► a task for each chunk of 1024³ voxels ─► OUT.parts/chunk-000012.part             deterministic names
                          sixteen side by side are done ─► one part ─► OUT.parts/chunks-000000-000015.part in place of theirs
                          all done ─► merge, one chunk in memory at a time ─► OUT, byte for byte what `pumice compress` makes

A part appears under its name once it is whole. A task whose part is there does nothing, so what a worker had finished before it was killed, or a
run before it was interrupted, is not made again. All workers need the same folder for `out`, and for a source that is a file.
"""

from __future__ import annotations

import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt

from . import _native, arguments, parts
from .arguments import Choice, Level, Path
from .errors import InputError
from .label_table import AnnotationTable

try:
    from dask.base import tokenize
    from dask.delayed import delayed
except ImportError as error:
    raise ImportError('pumice.dask needs Dask: pip install "pumice[dask]"') from error


class _Placed:
    """Voxels that lie at `origin` of an array of `shape`; only they can be sliced."""

    def __init__(self, voxels: npt.NDArray[Any], origin: Sequence[int], shape: tuple[int, ...]) -> None:
        self._voxels, self._origin = voxels, origin
        self.shape, self.dtype, self.strides = shape, voxels.dtype, voxels.strides

    def __getitem__(self, cut: tuple[slice, ...]) -> npt.NDArray[Any]:
        return self._voxels[tuple(slice(s.start - low, s.stop - low) for s, low in zip(cut, self._origin, strict=True))]


def compress(
    source: Path | Any,
    out: Path,
    *,
    client: Any = None,
    compute: bool = True,
    level: Level = "default",
    types: Mapping[int, str] | Path | None = None,
    table: AnnotationTable | Path | None = None,
    fingerprint: str | None = None,
    fan_in: int = 16,
    spacing: Sequence[float] | None = None,
    unit: str = "",
    world_from_index: npt.ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
    memory_limit: int | None = None,
    threads: int = 1,
    **choice: Unpack[Choice],
) -> Any:
    """Compresses `source`, a file or store that all workers can read or an array of Dask, into the `.pumice` file `out`; returns its path.

    Merging is a tree: a task joins at most `fan_in` parts. `client` is a `distributed.Client`; without one, Dask's own choice computes. `compute=False` returns the `Delayed` of the path. The other
    keywords are those of `pumice.compress_part` and `pumice.merge`; `threads` are those of a task. A task on an array holds the voxels of its chunk, up
    to 1024³; a file is read in small blocks. `fingerprint` tells an array from others; by default it is the name that Dask gives it.

    Finished parts are kept in the folder `out` + `.parts`, which is removed once `out` is there."""
    target = pathlib.Path(os.path.abspath(arguments.path("out", out)))
    folder = target.with_name(target.name + ".parts")
    fan_in = arguments.whole("fan_in", fan_in, 2, arguments.MOST_32)
    folder.mkdir(exist_ok=True)
    keywords = {"spacing": spacing, "unit": unit, "world_from_index": world_from_index, "names": names} | dict(choice)
    keywords |= {"memory_limit": memory_limit, "threads": threads}
    merging = {"level": level, "types": types, "table": table, "memory_limit": memory_limit, "threads": threads}
    order = (2, 1, 0) if choice.get("axes") == "zyx" else (0, 1, 2)
    array: Any = source
    path = ""
    if isinstance(source, (str, os.PathLike)):
        path = arguments.path("source", source)
        path = path if _native.is_on_server(path) else os.path.abspath(path)
        dims = _dims_of(path, keywords)
    else:
        if not hasattr(source, "dtype") or not hasattr(source, "shape") or len(source.shape) != 3:
            raise InputError(f"source: expected a path or an array with three axes, got {type(source).__name__}")
        dims = (source.shape[order[0]], source.shape[order[1]], source.shape[order[2]])
        keywords["fingerprint"] = str(getattr(source, "name", "")) if fingerprint is None else fingerprint

    def one_chunk(part: str, number: int, above: Sequence[str]) -> Any:
        key = f"pumice-part-{tokenize(part)}"
        if path:
            return delayed(_part_of_file, pure=True)(path, part, number, above, keywords, dask_key_name=key)
        # Axes of the array, of which `zyx` ones are turned round.
        (region,) = _native.chunk_regions(dims, str(number))
        of_array = [region[order.index(axis)] for axis in range(3)]
        voxels = array[tuple(slice(low, high) for low, high in of_array)]
        origin, shape = [low for low, _ in of_array], tuple(array.shape)
        return delayed(_part_of_array, pure=True)(voxels, origin, shape, part, number, above, keywords, dask_key_name=key)

    def divided(numbers: range, above: Sequence[str]) -> list[Any]:
        step = 1
        while step * fan_in < len(numbers):
            step *= fan_in
        return [made(numbers[first : first + step], above) for first in range(0, len(numbers), step)]

    def made(numbers: range, above: Sequence[str]) -> Any:
        """A part with these chunks, or the task that makes it. `above` are the parts that take its place."""
        is_one = len(numbers) == 1
        part = str(folder / (f"chunk-{numbers[0]:06}.part" if is_one else f"chunks-{numbers[0]:06}-{numbers[-1]:06}.part"))
        if os.path.exists(part):
            return part
        if is_one:
            return one_chunk(part, numbers[0], above)
        # A list of tasks is passed on as the list of what they return.
        below = divided(numbers, [part, *above])
        return delayed(_join, pure=True)(below, part, above, memory_limit, threads, dask_key_name=f"pumice-join-{tokenize(part)}")

    tasks = divided(range(parts.chunk_count(dims)), [])
    merged = delayed(_merge)(tasks, str(target), str(folder), merging, dask_key_name=f"pumice-merge-{tokenize(str(target))}")
    if not compute:
        return merged
    return merged.compute() if client is None else client.compute(merged).result()


def _dims_of(source: str, keywords: dict[str, Any]) -> tuple[int, int, int]:
    from .volume import probe

    reading = {name: value for name, value in keywords.items() if name in arguments.Reading.__annotations__ or name in Choice.__annotations__}
    x, y, z = probe(source, **reading)["dims"]
    return x, y, z


def _is_there(part: str, above: Sequence[str]) -> bool:
    """Whether a part was made, and perhaps joined to another that is there in its place."""
    return any(map(os.path.exists, [part, *above]))


def _part_of_file(source: str, part: str, number: int, above: Sequence[str], keywords: dict[str, Any]) -> str:
    if not _is_there(part, above):
        parts.compress_part(source, part, number, **keywords)
    return part


def _part_of_array(
    voxels: Any, origin: Sequence[int], shape: tuple[int, ...], part: str, number: int, above: Sequence[str], keywords: dict[str, Any]
) -> str:
    if not _is_there(part, above):
        parts.compress_part(_Placed(np.asarray(voxels), origin, shape), part, number, **keywords)
    return part


def _join(made: Sequence[str], part: str, above: Sequence[str], memory_limit: int | None, threads: int) -> str:
    if not _is_there(part, above):
        parts.merge_into_part(made, part, memory_limit=memory_limit, threads=threads)
    for path in made:
        pathlib.Path(path).unlink(missing_ok=True)
    return part


def _merge(made: Sequence[str], out: str, folder: str, keywords: dict[str, Any]) -> str:
    # A worker that was killed when all was done, but before it could tell.
    if os.path.exists(out) and not os.path.exists(folder):
        return out
    parts.merge(made, out, **keywords)
    # Besides the parts that were merged, the folder may have others that these replaced, and what a killed worker was writing.
    for path in pathlib.Path(folder).iterdir():
        if path.name.startswith(".pumice-") or (path.name.startswith("chunk") and path.suffix == ".part"):
            path.unlink(missing_ok=True)
    pathlib.Path(folder).rmdir()
    return out
