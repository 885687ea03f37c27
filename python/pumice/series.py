"""Time series: volumes of one size, time step after time step, in one file whose time steps share what stands still."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Unpack

import numpy.typing as npt

from . import _native, arguments
from .arguments import Choice, Level, Path
from .blocks import Frame
from .checked import checked
from .compressing import labels_given, limits_of, outcome_of
from .errors import InputError
from .label_table import AnnotationTable
from .volume import choice_of, described_source, warn

Job = _native.Job
TimeSteps = Literal["all"] | str | tuple[int, int]


@checked
def compress_series(
    source: Path | Sequence[Path] | Sequence[Any] | Any,
    out: Path,
    *,
    time_steps: TimeSteps | None = None,
    level: Level = "default",
    spacing: Sequence[float] | None = None,
    unit: str = "",
    world_from_index: npt.ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
    types: Mapping[int, str] | Path | None = None,
    table: AnnotationTable | Path | None = None,
    memory_limit: int | None = None,
    threads: int = 0,
    resume: bool = False,
    restart: bool = False,
    job: Job | None = None,
    **choice: Unpack[Choice],
) -> dict[str, Any]:
    """Compresses a time series into the `.pumice` file `out`, whose time steps `open(out, time=n)` opens one by one.

    `source` is a file with several time steps, of which `time_steps` chooses `"all"` or the first and the last such as `(0, 19)`; a path with `{t}` in
    place of a number, or a list of paths; an array[t, x, y, z], with `axes="zyx"` an array[t, z, y, x]; or a list of arrays of three axes. One time
    step is read at a time. All must have the same size, type and place. Labels have one table for all time steps.

    With `resume`, finished chunks of files are kept in the folder `out` + `.parts` until all are done, and those that are there are not made again;
    `restart` removes them first. An array takes neither: see `compress_part`.

    `level` is that of `Volume.save`, the other keywords are as for `compress`, those of reading a file as for `open`. Returns `dims`, and the
    numbers of `time_steps`, `labels`, `boxes` and `bytes_disk`."""
    given, told = labels_given(types, table)
    limits = limits_of(memory_limit, threads)
    described, read_as = described_frames(_frames_of(source), time_steps, spacing, unit, world_from_index, names, choice)
    written, odd = _native.compress_series(
        described,
        arguments.path("out", out),
        time_steps=steps_text(time_steps),
        level=level,
        given=given,
        **limits,
        resume=resume,
        restart=restart,
        read_as=read_as,
        job=job,
    )
    warn([*told, *odd])
    return outcome_of(written)


def described_frames(
    frames: Sequence[Any],
    time_steps: TimeSteps | None,
    spacing: Sequence[float] | None,
    unit: str,
    world_from_index: npt.ArrayLike | None,
    names: Mapping[int, str] | None,
    choice: Choice,
    chunks: str | None = None,
) -> tuple[list[Any], arguments.ReadAs]:
    """Frames as the compiled part takes them, and how they are read: some `chunks` of arrays alone, where they are given."""
    described: list[Any] = []
    read_as = arguments.ReadAs()
    for frame in frames:
        one, read_as = described_source(frame, spacing, unit, world_from_index, names, choice_of(frame, choice), chunks)
        described.append(one)
    if len({isinstance(one, str) for one in described}) != 1:
        raise InputError("source: expected paths alone, or arrays alone, of at least one time step")
    if time_steps is not None and not isinstance(described[0], str):
        raise InputError("time_steps: an array is read as it is; choose by slicing it")
    return described, read_as


def _frames_of(source: Any) -> Sequence[Any]:
    """The path, paths or arrays of three axes that a source stands for."""
    if isinstance(source, (str, os.PathLike)):
        return [source]
    if isinstance(source, (list, tuple)):
        return source
    if not hasattr(source, "dtype") or not hasattr(source, "shape"):
        raise InputError(f"source: expected paths or arrays, got {type(source).__name__}")
    if len(source.shape) != 4:
        raise InputError(f"source: expected an array of four axes with time first, got shape {tuple(source.shape)}")
    return [Frame(source, step) for step in range(source.shape[0])]


def steps_text(time_steps: TimeSteps | None) -> str | None:
    """Time steps as the command takes them."""
    if time_steps is None or isinstance(time_steps, str):
        return time_steps
    try:
        first, last = time_steps
    except (TypeError, ValueError):
        raise InputError(f"time_steps: expected 'all', or the first and the last time step, got {time_steps!r}") from None
    return "-".join(str(arguments.whole("time_steps", step, 0, arguments.MOST_32)) for step in (first, last))
