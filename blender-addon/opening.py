# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens the files of an import in their compressed form, which is made and kept where there is none. Does not use Blender.

    source ──► is its compressed form there? ──yes──► open
                  │no
                  └──► compress ──► save under the name that `cache` gives
"""

import os
from typing import Any, NamedTuple

from . import cache, native


class Wanted(NamedTuple):
    """A file to open."""

    source: str
    # How it is read: keywords of `pumice.compress`.
    choice: dict
    # Where its compressed form may be, the preferred place first.
    paths: list


class Opened(NamedTuple):
    """A volume that is open."""

    source: str
    choice: dict
    # The compressed form.
    filepath: str
    volume: Any
    # What the reader found odd or assumed, one line each.
    warnings: list


def open_all(wanted, job, tell):
    """The volumes of all files, in their order; `tell(text)` names the stage that is reached. Raises the error of the first that fails."""
    return [_open(one, job, tell) for one in wanted]


def _open(wanted, job, tell):
    pumice, name = native.require(), os.path.basename(wanted.source)
    tell(f"Reading {name}")
    compressed = cache.is_compressed(wanted.source)
    if compressed and not wanted.choice:
        return Opened(wanted.source, {}, wanted.source, pumice.open(wanted.source, job=job), [])
    odd = [] if compressed else pumice.probe(wanted.source, job=job, **wanted.choice)["warnings"]
    kept = cache.existing(wanted.paths)
    if kept is not None:
        return Opened(wanted.source, wanted.choice, kept, pumice.open(kept, job=job), odd)
    target = cache.writable(wanted.paths)
    tell(f"Compressing {name}")
    volume = pumice.compress(wanted.source, job=job, **wanted.choice)
    tell(f"Saving {name}")
    volume.save(target, job=job)
    return Opened(wanted.source, wanted.choice, target, volume, odd)
