"""Volumes that never are in memory as a whole: compressed from file to file, or in parts, some of its chunks each, on any machine, which are
joined to the file of the whole volume."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Unpack

import numpy.typing as npt

from . import _native, arguments
from .arguments import Choice, Level, Path
from .blocks import Frame
from .checked import checked
from .compressing import labels_given, limits_of, outcome_of
from .errors import InputError
from .label_table import AnnotationTable
from .series import TimeSteps, described_frames, steps_text
from .volume import choice_of, described_source, warn

Job = _native.Job
Chunks = str | int | Iterable[int]


@checked
def chunk_count(dims: Sequence[int]) -> int:
    """Number of chunks of 1024³ voxels of a volume of `dims` voxels along x, y, z. They are numbered from 0 in Morton order of the grid of chunks."""
    x, y, z = (arguments.whole("dims", size, 0, arguments.MOST_32) for size in dims)
    return _native.chunk_count((x, y, z))


@checked
def compress_file(
    source: Path | Any,
    out: Path,
    *,
    level: Level = "default",
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
) -> dict[str, Any]:
    """Compresses `source` into the `.pumice` file `out`, as `pumice compress` does: neither voxels nor result are in memory as a whole.

    `source` and the other keywords are as for `compress`, those of reading as for `open`, and `level` is as for `Volume.save`; but `memory_limit`
    need not hold the result. The file appears complete or not at all. Returns `dims`, and the numbers of `labels`, `boxes` and `bytes_disk`."""
    given, told = labels_given(types, table)
    limits = limits_of(memory_limit, threads)
    described, read_as = described_source(source, spacing, unit, world_from_index, names, choice_of(source, choice))
    written, odd = _native.compress_file(
        described,
        arguments.path("out", out),
        level=level,
        given=given,
        **limits,
        read_as=read_as,
        job=job,
    )
    warn([*told, *odd])
    return outcome_of(written)


@checked
def compress_part(
    source: Path | Sequence[Path] | Sequence[Any] | Any,
    out: Path,
    chunks: Chunks,
    *,
    time_steps: TimeSteps | None = None,
    fingerprint: str = "",
    spacing: Sequence[float] | None = None,
    unit: str = "",
    world_from_index: npt.ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
    memory_limit: int | None = None,
    threads: int = 0,
    job: Job | None = None,
    **choice: Unpack[Choice],
) -> None:
    """Compresses some `chunks` of `source` into the part `out`: a number, numbers, or a text such as `"0,4-7"`. Only their voxels are read.

    `source` and the other keywords are as for `compress`, those of reading as for `open`; names, types and numbers of a table are given to
    `merge`. A time series, all of it or its `time_steps`, is taken as well: a part has its chunks at all of them. A file is told from others by
    its content. An array is told by its shape, its type and `fingerprint`, a text of your choice; parts with others are not merged."""
    text = _text_of(chunks)
    limits = limits_of(memory_limit, threads)
    frames: Sequence[Any]
    if isinstance(source, (list, tuple)):
        frames = source
    else:
        shape: tuple[int, ...] = getattr(source, "shape", ())
        frames = [Frame(source, step) for step in range(shape[0])] if len(shape) == 4 else [source]
    described, read_as = described_frames(frames, time_steps, spacing, unit, world_from_index, names, choice, text)
    name, told = "", ""
    if not isinstance(described[0], str):
        # The number of time steps is compared by itself.
        name, told = "an array", f"{frames[0].dtype} {tuple(frames[0].shape)} {fingerprint}"
    elif fingerprint:
        raise InputError("fingerprint: a file is told by its content; only arrays take it")
    odd = _native.compress_part(
        described,
        arguments.path("out", out),
        chunks=text,
        time_steps=steps_text(time_steps),
        source_name=name,
        fingerprint=told,
        **limits,
        read_as=read_as,
        job=job,
    )
    warn(odd)


@checked
def merge(
    parts: Iterable[Path],
    out: Path,
    *,
    level: Level = "default",
    types: Mapping[int, str] | Path | None = None,
    table: AnnotationTable | Path | None = None,
    memory_limit: int | None = None,
    threads: int = 0,
    job: Job | None = None,
) -> dict[str, Any]:
    """Joins the `parts` of a volume or of a time series, in any order, to the `.pumice` file `out`: the bytes that `pumice compress` makes of the whole volume. InputError
    names the part that does not belong to the others, and chunks that are missing or come twice.

    `level` is as for `Volume.save`, `types` and `table` as for `compress`. One chunk is in memory at a time, beside the table of labels. Returns
    `dims`, and the numbers of `labels`, `boxes` and `bytes_disk`, of a time series also of `time_steps`."""
    given, told = labels_given(types, table)
    limits = limits_of(memory_limit, threads)
    written, odd = _native.merge(
        _paths_of(parts),
        arguments.path("out", out),
        level=level,
        given=given,
        **limits,
        job=job,
    )
    warn([*told, *odd])
    return outcome_of(written)


@checked
def merge_into_part(
    parts: Iterable[Path],
    out: Path,
    *,
    memory_limit: int | None = None,
    threads: int = 0,
    job: Job | None = None,
) -> None:
    """Joins some `parts` of a volume or of a time series, in any order, to the part `out`: the bytes that `compress_part` makes of all of their
    chunks. It is merged with the other parts later; names, types and numbers of a table are given then. `memory_limit` and `threads` are as for
    `compress`."""
    _native.merge_into_part(_paths_of(parts), arguments.path("out", out), **limits_of(memory_limit, threads), job=job)


def _paths_of(parts: Iterable[Path]) -> list[str]:
    if isinstance(parts, (str, bytes, os.PathLike)):
        raise InputError("parts: expected a list of paths, got one path")
    return [arguments.path("parts", part) for part in parts]


def _text_of(chunks: Chunks) -> str:
    if isinstance(chunks, str):
        return chunks
    if isinstance(chunks, Iterable):
        return ",".join(str(arguments.whole("chunks", number, 0, arguments.MOST_64)) for number in chunks)
    return str(arguments.whole("chunks", chunks, 0, arguments.MOST_64))
