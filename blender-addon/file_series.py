# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are the time steps of one series: their names differ in one number. Does not use Blender.

    t_08.tif   t_09.tif   t_10.tif      in the order of their numbers

The compiled module sorts files alike, and refuses numbers that are missing between others.
"""

import os
import re


def siblings(path):
    """The files, or folders of stores, whose names differ from that of `path` in its last number alone, in order; `path` alone if it has none."""
    folder, name = os.path.split(os.path.normpath(path))
    numbers = list(re.finditer(r"\d+", _stem(name)))
    if not numbers:
        return [path]
    before, after = name[: numbers[-1].start()], name[numbers[-1].end() :]
    pattern = re.compile(re.escape(before) + r"(\d+)" + re.escape(after))
    try:
        found = [(int(match[1]), match[0]) for match in map(pattern.fullmatch, os.listdir(folder or os.curdir)) if match]
    except OSError:
        return [path]
    return [os.path.join(folder, name) for _, name in sorted(found)] or [path]


def ordered(paths):
    """Paths in the order of the numbers in them."""
    return sorted(paths, key=lambda path: [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path)])


def _stem(name):
    """A name without its endings, whose digits number nothing: `.h5`, `.nii.gz`."""
    return re.sub(r"(\.[A-Za-z]\w*)+$", "", name)
