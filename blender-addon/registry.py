# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The volumes that are open in this process, by file. Each is opened once, however many objects, viewports and renders show it.

Opening takes from milliseconds to seconds, so a thread does it; a caller that needs the volume asks again (`request`) or waits (`wait`).
A file that changed on disk counts as another one. A volume is closed, which frees its memory, once no object of the file shows it; undo that
brings the object back opens it again. Threads only call the compiled module, never Blender.
"""

import os
import threading
import time

import bpy

from . import file_paths, native
from .reports import Refused, one_line


class Entry:
    """A volume that is open, is being opened, or cannot be opened."""

    def __init__(self, path):
        self.path = path
        self.volume = None
        self.error = None
        self.done = threading.Event()
        self.job = native.require().Job()
        threading.Thread(target=self._open, name="pumice open", daemon=True).start()

    def _open(self):
        try:
            self.volume = native.require().open(self.path, job=self.job)
        except BaseException as error:  # an exception cannot leave the thread: the caller reads it here
            self.error = one_line(error)
        finally:
            self.done.set()


_entries = {}


def request(path):
    """The entry of a file; starts opening it if there is none yet. Raises Refused if the file is missing."""
    key = _key(path)
    entry = _entries.get(key)
    if entry is None:
        for other in [k for k in _entries if k[0] == key[0]]:
            _entries.pop(other).job.cancel()
        entry = _entries[key] = Entry(path)
    return entry


def adopt(path, volume):
    """Registers a volume that is already open as that of a file."""
    entry = Entry.__new__(Entry)
    entry.path, entry.volume, entry.error = path, volume, None
    entry.job, entry.done = native.require().Job(), threading.Event()
    entry.done.set()
    _entries[_key(path)] = entry


def wait(path, cancelled):
    """Waits for the volume of a file; returns None once `cancelled()` returns true. Raises Refused."""
    return wait_for(request(path), cancelled)


def wait_for(entry, cancelled):
    """As `wait`, for an entry, also in a thread."""
    while not entry.done.wait(0.05):
        if cancelled():
            return None
    if entry.error:
        raise Refused(entry.error)
    return entry.volume


def forget_unused():
    """Closes volumes that no object of the file shows."""
    used = {file_paths.find(o)[0] for o in bpy.data.objects if o.pumice.filepath}
    for key in [k for k in _entries if k[0] not in used]:
        _entries.pop(key).job.cancel()


def _key(path):
    try:
        status = os.stat(path)
    except OSError:
        raise Refused(f"{path}: the volume's file is missing; set its path in the object's Pumice panel") from None
    return (path, status.st_size, status.st_mtime_ns)


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
    for handlers, call in HANDLERS:
        handlers.remove(call)
    deadline = time.monotonic() + 5.0
    for entry in _entries.values():
        entry.job.cancel()
    for entry in _entries.values():
        entry.done.wait(max(0.0, deadline - time.monotonic()))
    _entries.clear()
