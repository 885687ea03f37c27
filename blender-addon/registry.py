# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The volumes that are open in this process, by file and time step. Each is opened once, however many objects, viewports and renders show it.

Only labels that are shown are read. Where an object shows others later, their boxes and nodes alone are read and added (`pumice.Volume.with_labels`);
what has been read stays. A file of which most labels are shown is read whole.

Opening takes from milliseconds to seconds, so a thread does it; a caller that needs the volume asks again (`request`) or waits (`wait`).
A file that changed on disk counts as another one. A volume is closed, which frees its memory, once no object of the file shows it; undo that
brings the object back opens it again. Threads only call the compiled module, never Blender.

Time steps are opened when they are shown. Open are those that a viewport or a render shows (`hold`), and the `MOST_TIME_STEPS` that were used
last before; others are closed, and the opening of one that nobody shows any more is cancelled.

With a limit of memory in the preferences all volumes share a `pumice.PageMemory` and are drawn from disk: opening one makes pages of all its
labels in temporary files, so that any of them can be shown. A volume that was opened within another limit counts as another one.
"""

import itertools
import os
import threading
import time

import bpy
import numpy as np

from . import file_paths, label_table, native, preferences, time_settings
from .reports import Refused, one_line

# Time steps that stay open, most recently used first, beside those that are shown: to go back a frame opens nothing.
MOST_TIME_STEPS = 2
# Share of a file's labels from which on it is read whole.
MOST_LABELS = 0.5

_numbers = itertools.count(1)


class Entry:
    """A volume that is open, is being opened, or cannot be opened; `time_step` is None where its file has no time.

    `labels` are those that are read: (ids, which of them), None for all. `former` is an entry of the same file that has some of them. `memory` is
    that of volumes on disk, None where they are in memory."""

    def __init__(self, path, time_step=None, shown=None, former=None, memory=None):
        self.path, self.time_step, self.memory = path, time_step, memory
        if memory is not None:
            shown = former = None
        self.labels = joined(shown, former.labels) if former is not None else shown
        if self.labels is not None and np.count_nonzero(self.labels[1]) > MOST_LABELS * len(self.labels[1]):
            self.labels = None
        self._former = former
        self.part = next(_numbers)
        self.volume = None
        self.error = None
        self.done = threading.Event()
        self.job = native.require().Job()
        threading.Thread(target=self._open, name="pumice open", daemon=True).start()

    def file(self):
        """(path, time step)."""
        return self.path, self.time_step

    def has(self, shown):
        """Whether these labels are read, as `request` takes them."""
        if self.labels is None or shown is None:
            return self.labels is None
        (ids, read), (others, wanted) = self.labels, shown
        if ids is others or np.array_equal(ids, others):
            return not (wanted & ~read).any()
        return bool(np.isin(others[wanted], ids[read], assume_unique=True).all())

    def _open(self):
        try:
            self.volume = self._opened(native.require())
            # What reads all of a file though it was asked for some labels.
            if self.volume.is_whole and self.memory is None:
                self.labels, self.part = None, 0
            if self.time_step is not None:
                self.volume.content_hash  # viewports ask for it while Blender waits for them  # noqa: B018
        except BaseException as error:  # an exception cannot leave the thread: the caller reads it here
            # The reader names an option of the command.
            self.error = one_line(error).replace("--time-step", "time step")
        finally:
            self._former = None
            self.done.set()

    def _opened(self, pumice):
        reading = {} if self.time_step is None else {"time": self.time_step}
        if self.memory is not None:
            return pumice.open(self.path, memory=self.memory, job=self.job, **reading)
        if self.labels is not None:
            ids, read = self.labels
            if self._former is not None:
                self._former.done.wait()
            former = self._former.volume if self._former is not None else None
            try:
                if former is not None:
                    return former.with_labels(ids[read], job=self.job)
                return pumice.open(self.path, labels=ids[read], job=self.job, **reading)
            except pumice.InputError:
                # A file of another kind, or one that has changed since: all of it is read, and who shows it says what differs.
                pass
        return pumice.open(self.path, job=self.job, **reading)


def joined(some, others):
    """The labels of both, as `request` takes them."""
    if some is None or others is None:
        return None
    if np.array_equal(some[0], others[0]):
        return some[0], some[1] | others[1]
    ids = np.union1d(some[0][some[1]], others[0][others[1]])
    return ids, np.ones(len(ids), dtype=bool)


# By path, size, time of change, time step and limit of memory; the entry that was asked for last comes last.
_entries = {}
# Keys of the time steps that a reader shows, by reader.
_held = {}
# A render reads in a thread of its own.
_lock = threading.RLock()
# What volumes on disk share: one `pumice.PageMemory`, that of the limit in force.
_memory = None


def page_memory():
    """The memory that volumes on disk share, within the limit of the preferences; None where there is no limit."""
    global _memory
    limit = preferences.memory_limit_bytes()
    with _lock:
        if not limit:
            _memory = None
        elif _memory is None or _memory.limit != limit:
            _memory = native.require().PageMemory(limit)
        return _memory


def request(path, time_step=None, shown=None):
    """The entry of a file, or of a time step of it; starts opening it if there is none yet, or none that has the labels `shown`: (ids, which of
    them), None for all. Raises Refused if the file is missing."""
    memory = page_memory()
    key = _key(path, time_step, memory)
    with _lock:
        entry = _entries.pop(key, None)
        if entry is None:
            _close_others(key)
            entry = Entry(path, time_step, shown, memory=memory)
            if time_step is not None:
                _close_time_steps()
        elif not entry.has(shown):
            entry = Entry(path, time_step, shown, entry, memory)
        _entries[key] = entry
    return entry


def request_shown(obj, rows=None):
    """As `request`, of what a volume object shows at the frame of the scene, or next to it where it shows nothing; with the labels in these rows of
    its table (flags) instead of those that it shows."""
    table = obj.pumice.table
    if table is None:
        labels = None
    else:
        labels = label_table.ids(table), label_table.visible(table) if rows is None else rows
    return request(file_paths.find(obj)[0], time_settings.nearest(obj, time_settings.now()), labels)


def adopt(path, volume):
    """Registers a volume that is already open as that of a file."""
    entry = Entry.__new__(Entry)
    entry.path, entry.volume, entry.error = path, volume, None
    entry.time_step, entry.memory = volume.time_step, volume.memory
    entry.labels, entry.part = None, 0 if entry.memory is None else next(_numbers)
    entry.job, entry.done = native.require().Job(), threading.Event()
    entry.done.set()
    key = _key(path, entry.time_step, entry.memory)
    with _lock:
        _close_others(key)
        _entries[key] = entry


def wait(path, cancelled, time_step=None, shown=None):
    """Waits for the volume of a file; returns None once `cancelled()` returns true. Raises Refused. `shown` as for `request`."""
    return wait_for(request(path, time_step, shown), cancelled)


def wait_for(entry, cancelled):
    """As `wait`, for an entry, also in a thread."""
    while not entry.done.wait(0.05):
        if cancelled():
            return None
    if entry.error:
        raise Refused(entry.error)
    return entry.volume


def wait_all(files, cancelled):
    """As `wait`, for each (path, time step, labels) of a list."""
    reader = object()
    hold(reader, [(path, time_step) for path, time_step, _ in files])
    try:
        # All are asked for first: a file of which instances show different labels is then open with the labels of all.
        for path, time_step, shown in files:
            request(path, time_step, shown)
        return [wait(path, cancelled, time_step, shown) for path, time_step, shown in files]
    finally:
        hold(reader, ())


def hold(reader, files):
    """Notes the (path, time step) that a reader shows now, in place of those of before: these time steps stay open. `reader` is any value that
    stands for it; with no files it shows nothing any more."""
    with _lock:
        before = _held.pop(reader, set())
        keys = {(path, time_step) for path, time_step in files if time_step is not None}
        if keys:
            _held[reader] = keys
        for key in [k for k in _entries if (k[0], k[3]) in before and not _is_held(k) and not _entries[k].done.is_set()]:
            _entries.pop(key).job.cancel()
        _close_time_steps()


def forget_unused():
    """Closes volumes that no object of the file shows."""
    used = {file_paths.find(o)[0] for o in bpy.data.objects if o.pumice.filepath}
    with _lock:
        for key in [k for k in _entries if k[0] not in used]:
            _entries.pop(key).job.cancel()


def _close_others(key):
    """Closes what a file had before it changed, and what was opened of it within another limit."""
    for other in [k for k in _entries if k[0] == key[0] and (k[:3], k[4]) != (key[:3], key[4])]:
        _entries.pop(other).job.cancel()


def _close_time_steps():
    """Closes the time steps that nobody shows, but for those that were used last."""
    rest = [k for k, entry in _entries.items() if k[3] is not None and entry.done.is_set() and not _is_held(k)]
    for key in rest[: max(0, len(rest) - MOST_TIME_STEPS)]:
        del _entries[key]


def _is_held(key):
    return any((key[0], key[3]) in keys for keys in _held.values())


def _key(path, time_step, memory):
    try:
        status = os.stat(path)
    except OSError:
        raise Refused(f"{path}: the volume's file is missing; set its path in the object's Pumice panel") from None
    return (path, status.st_size, status.st_mtime_ns, time_step, 0 if memory is None else memory.limit)


@bpy.app.handlers.persistent
def _after_load(*_):
    forget_unused()


# Number of objects in the file when unused volumes were last closed. Counting takes microseconds, walking over 30,000 objects milliseconds.
_objects_seen = 0


@bpy.app.handlers.persistent
def _after_update(*_):
    global _objects_seen
    if len(bpy.data.objects) != _objects_seen:
        _objects_seen = len(bpy.data.objects)
        if _entries:
            forget_unused()


HANDLERS = (
    (bpy.app.handlers.load_post, _after_load),
    (bpy.app.handlers.depsgraph_update_post, _after_update),
    (bpy.app.handlers.undo_post, _after_load),
    (bpy.app.handlers.redo_post, _after_load),
)


def register():
    for handlers, call in HANDLERS:
        handlers.append(call)


def unregister():
    global _memory
    for handlers, call in HANDLERS:
        handlers.remove(call)
    deadline = time.monotonic() + 5.0
    for entry in _entries.values():
        entry.job.cancel()
    for entry in _entries.values():
        entry.done.wait(max(0.0, deadline - time.monotonic()))
    _entries.clear()
    _held.clear()
    _memory = None
