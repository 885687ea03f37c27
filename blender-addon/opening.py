# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens the files of an import in their compressed form, which is made and kept where there is none. Does not use Blender.

    source ──► is its compressed form there? ──yes──► open
                  │no
                  └──► compress ──► save under the name that `cache` gives

With a memory that limits what volumes hold, neither the source nor its compressed form is in memory as a whole, and the volume is opened to be
drawn from disk.

Of a series, one file has all time steps, and one of them is opened: the one that is shown first.
"""

import os
import warnings
from typing import Any, NamedTuple

from . import cache, native
from .reports import Refused
from .time_steps import Playback


class Wanted(NamedTuple):
    """A file to open."""

    source: str
    # How it is read: keywords of `pumice.compress`; for a series `time_steps` of `pumice.compress_series`, or `files`, the names of its files beside
    # `source`.
    choice: dict
    # The extension's own folder, for a compressed form that cannot be beside its source.
    folder: str
    # How a series is played, and the frame at which it is shown; all of it without a duration.
    playback: Playback = Playback(duration=0)
    frame: float = 1.0
    # A `pumice.PageMemory` for volumes that are drawn from disk; None for those in memory.
    memory: Any = None

    def open(self, path, job, **reading):
        """The volume of a compressed file."""
        pages = {} if self.memory is None else {"memory": self.memory}
        return native.require().open(path, job=job, **pages, **reading)


class Opened(NamedTuple):
    """A volume that is open."""

    source: str
    choice: dict
    # The compressed form.
    filepath: str
    volume: Any
    # What the reader found odd or assumed, one line each.
    warnings: list
    # How its time steps are played; of no meaning where it has none.
    playback: Playback = Playback()


def asks_server(wanted):
    """Whether any of the files is on a server."""
    return any(native.is_on_server(one.source) for one in wanted)


def open_all(wanted, job, tell):
    """The volumes of all files, in their order; `tell(text)` names the stage that is reached. Raises the error of the first that fails."""
    return [_open(one, job, tell) for one in wanted]


def _open(wanted, job, tell):
    """As `_read`, and tells what reading the voxels warned of."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        opened = _read(wanted, job, tell)
    ours = native.require().PumiceWarning
    for line in said:
        if not issubclass(line.category, ours):
            warnings.warn_explicit(line.message, line.category, line.filename, line.lineno)
    lines = [*opened.warnings, *(str(line.message) for line in said if issubclass(line.category, ours))]
    return opened._replace(warnings=list(dict.fromkeys(lines)))


def _kept(wanted, opens):
    """What `opens` gives of a compressed form that was found. Its error names a file that nobody chose, so it says what it is."""
    try:
        return opens()
    except native.require().InputError as error:
        raise Refused(f"{error}; it is the compressed form of {wanted.source}: delete it, and it is made anew") from error


def _read(wanted, job, tell):
    pumice, name = native.require(), cache.base_name(wanted.source)
    tell(f"Reading {name}")
    compressed = cache.is_compressed(wanted.source)
    files = [os.path.join(os.path.dirname(wanted.source), name) for name in wanted.choice.get("files", ())]
    reading = {name: value for name, value in wanted.choice.items() if name not in ("time_steps", "files")}
    if compressed and not files and cache.time_steps(wanted.source) > 1:
        return _one_of_series(wanted, job, reading)
    if compressed and not wanted.choice:
        return Opened(wanted.source, {}, wanted.source, wanted.open(wanted.source, job), [])
    is_series = len(reading) < len(wanted.choice)
    odd = [] if compressed else pumice.probe(wanted.source, job=job, **reading)["warnings"]
    places = cache.candidates(wanted.source, wanted.choice, wanted.folder)
    kept = cache.existing(places)
    if kept is not None:
        if is_series:
            return _kept(wanted, lambda: _at_frame(wanted, kept, job, odd))
        return _kept(wanted, lambda: Opened(wanted.source, wanted.choice, kept, wanted.open(kept, job), odd))
    target = cache.writable(places)
    tell(f"Compressing {name}")
    if is_series:
        pumice.compress_series(files or wanted.source, target, time_steps=wanted.choice.get("time_steps"), job=job, **reading)
        return _at_frame(wanted, target, job, odd)
    if wanted.memory is not None:
        pumice.compress_file(wanted.source, target, job=job, **wanted.choice)
        tell(f"Opening {name}")
        return Opened(wanted.source, wanted.choice, target, wanted.open(target, job), odd)
    volume = pumice.compress(wanted.source, job=job, **wanted.choice)
    tell(f"Saving {name}")
    volume.save(target, job=job)
    return Opened(wanted.source, wanted.choice, target, volume, odd)


def _one_of_series(wanted, job, reading):
    """Opens a compressed series as it is: all of it, or one time step, which is a series that is played nowhere else."""
    time_step, all_steps = reading.pop("time", None), wanted.choice.get("time_steps")
    if reading or all_steps not in (None, "all"):
        what = ", ".join(reading) or f"time_steps {all_steps}"
        raise Refused(f"{wanted.source}: {what}: a compressed series is opened as it is; Offset and Frames play a part of it")
    if all_steps is None:
        if time_step is None:
            count = cache.time_steps(wanted.source)
            raise Refused(f"{wanted.source}: the file has {count} time steps; choose one with time (0 to {count - 1}), or all with time_steps 'all'")
        if wanted.playback.duration == 0:
            wanted = wanted._replace(playback=wanted.playback._replace(offset=time_step, duration=1))
        if time_step >= cache.time_steps(wanted.source):
            native.require().open(wanted.source, time=time_step, job=job)  # says why not
    return _at_frame(wanted, wanted.source, job, [])


def _at_frame(wanted, path, job, odd):
    """Opens the time step of a compressed file that its playback shows at the frame, or next to it."""
    count, played = cache.time_steps(path), wanted.playback
    if played.duration == 0:
        played = played._replace(duration=count)
    if count == 1:
        volume = wanted.open(path, job)
    else:
        volume = wanted.open(path, job, time=played.nearest(wanted.frame, count))
    return Opened(wanted.source, wanted.choice, path, volume, odd, played)
