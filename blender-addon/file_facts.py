# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the headers of files say before a voxel is read: lines for the dialog of the import, and menus for what a file leaves open.

    header ──► dims, voxel size, unit, directions, type, memory, warnings      lines
           ──► layers, time steps, channels, arrays, order of axes             menus; an answer is read with the header again

Of time steps all may be read, as one animated volume: `time_steps` answers the choice of `time` too.

Does not use Blender.
"""

import json
import os
import re
import threading

from . import cache, native
from .reports import one_line

# What a file may leave open, by the keyword of `pumice.compress` that answers it.
KEYWORDS = ("layer", "time", "channel", "array", "axes", "label", "dataset", "scale")
TIME_STEPS = "time_steps"
# Value of the menu of time steps that reads all of them.
ALL = "all"
# Files by which the folder of a store can be chosen.
DESCRIPTIONS = ("zarr.json", ".zarray", ".zgroup", ".zattrs", "info", "attributes.json")
# A longer menu does not fit on a screen: a number is typed instead.
MOST_IN_MENU = 64
# Files whose lines are shown one by one.
MOST_FILES = 8
# How long a server is waited for; Blender's window stands still meanwhile.
PATIENCE_SECONDS = 20.0
UNITS = {"um": "µm", "unknown": ""}
DIRECTIONS = {"R": "right", "L": "left", "A": "anterior", "P": "posterior", "S": "superior", "I": "inferior"}


class Facts:
    """The headers of files; each is read once for each set of answers. `is_kept(path, choice)` says whether a compressed form is there."""

    def __init__(self, paths, is_kept=lambda path, choice: False):
        self.paths, self._is_kept = list(paths), is_kept
        self._said, self._menus = {}, {}

    def of(self, path, choice):
        """What a file says, read with `choice`: the fields of `pumice.probe`, or one line that says why it cannot be read. Of a compressed volume it
        has `kind` and the file's bytes, because reading more of it may take as long as opening it."""
        choice = {name: value for name, value in choice.items() if name != TIME_STEPS}
        key = path, json.dumps(choice, sort_keys=True)
        if key not in self._said:
            self._said[key] = _answer(path, choice) if native.is_on_server(path) else _header(path, choice)
        return self._said[key]

    def open_choice(self, keyword):
        """What the first file that leaves it open says of a choice; None if none does."""
        found = (_choices(self.of(path, {})).get(keyword) for path in self.paths)
        return next((choice for choice in found if choice is not None), None)

    def answers_for(self, path, answers):
        """The answers that a file takes: those to what it leaves open, and what is no answer, such as the voxel size."""
        left = _choices(self.of(path, {}))
        if "axes" in left and "axes" in answers:
            # What the pages of a TIFF file are decides whether there are time steps and channels.
            left = {"axes": left["axes"]} | _choices(self.of(path, {"axes": answers["axes"]}))
        return {name: value for name, value in answers.items() if name not in (*KEYWORDS, TIME_STEPS) or (name if name != TIME_STEPS else "time") in left}

    def menu(self, keyword):
        """Items for a menu of Blender. It must find the same strings each time."""
        if keyword not in self._menus:
            choice = self.open_choice(keyword)
            values = [] if choice is None else choice["values"][:MOST_IN_MENU]
            self._menus[keyword] = [
                (v["value"], f"{v['value']}: {v['text']}" if v["text"] else v["value"], v["text"], number) for number, v in enumerate(values)
            ]
            if keyword == "time" and values:
                text = f"All {choice['count']} time steps, as one volume that follows the scene's frame"
                self._menus[keyword].append((ALL, "All", text, len(values)))
        return self._menus[keyword]

    def lines(self, answers):
        """(text, whether it is a warning) about the files, read with these answers."""
        told = []
        for path in self.paths[:MOST_FILES]:
            choice = self.answers_for(path, answers)
            said = self.of(path, choice)
            if isinstance(said, str):
                told.append((_without(said, path), True))
            elif len(self.paths) == 1:
                told += [(line, False) for line in _facts(said, self._is_kept(path, choice))]
                told += [(_without(line, path), True) for line in said["warnings"]]
            else:
                name = cache.base_name(path)
                told.append((f"{name}: {_size(said)}", False))
                told += [(f"{name}: {_without(line, path)}", True) for line in said["warnings"]]
        if len(self.paths) > MOST_FILES:
            told.append((f"and {len(self.paths) - MOST_FILES} more files", False))
        return told


def _answer(path, choice):
    """As `_header`, of a store on a server, which is not waited for without end."""
    answers = []
    job = native.require().Job()
    thread = threading.Thread(target=lambda: answers.append(_header(path, choice, job=job)), name="pumice header", daemon=True)
    thread.start()
    thread.join(PATIENCE_SECONDS)
    if not answers:
        job.cancel()
        return f"{path}: the server has not answered for {PATIENCE_SECONDS:.0f} seconds"
    return answers[0]


def _header(path, choice, **job):
    try:
        if not cache.is_compressed(path):
            return native.require().probe(path, **job, **choice)
        count = cache.time_steps(path)
        values = [{"value": str(step), "text": ""} for step in range(min(count, MOST_IN_MENU))]
        choices = [{"keyword": "time", "count": count, "values": values, "is_series": True}] if count > 1 and "time" not in choice else []
        return {"kind": "pumice", "bytes_disk": os.path.getsize(path), "warnings": [], "choices": choices, "time_steps": count}
    except Exception as error:
        return one_line(error)


def _choices(said):
    """{keyword: choice} that a file leaves open."""
    return {} if isinstance(said, str) else {choice["keyword"]: choice for choice in said.get("choices", ())}


def _size(said):
    if said["kind"] == "pumice":
        steps = f" with {said['time_steps']} time steps" if said["time_steps"] > 1 else ""
        return f"compressed volume of {_bytes(said['bytes_disk'])}{steps}, opened as it is"
    x, y, z = said["dims"]
    size = " × ".join(f"{length:.6g}" for length in said["spacing"])
    unit = UNITS.get(said["unit"], said["unit"])
    return f"{x} × {y} × {z} voxels of {said['label_type']}, each {size} {unit}".rstrip() + ("" if unit else " (no unit)")


def _facts(said, is_kept):
    yield _size(said)
    if said["kind"] == "pumice":
        return
    letters = said["orientation"]
    if letters:
        yield f"{letters}: x, y and z run to {', '.join(DIRECTIONS[letter] for letter in letters)}"
    yield f"{said['format']}, {said['encoding']}; {_bytes(said['bytes_uncompressed'])} of voxels"
    if is_kept:
        yield "Compressed before: opens at once"
    else:
        yield f"Compressing takes about {_bytes(said['bytes_expected'])} of memory"


def _bytes(count):
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{max(count / 1e6, 0.1):.3g} MB"


def _without(line, path):
    """A line of the reader without the path and without the option of the command: the dialog has both beside it."""
    return re.sub(r" \(give --[^()]*\)$", "", line.removeprefix(f"{path}: "))
