"""The memory that volumes share which are drawn from disk, and what was in it."""

from __future__ import annotations

import dataclasses
import json

from . import _native, arguments
from .checked import checked


@dataclasses.dataclass(frozen=True)
class PageFigures:
    """What was in memory of volumes that are drawn from disk: `limit_bytes`, `most_bytes` at once, `bytes_of_all` of everything, number of
    `pages`, and `loads` of pages, each time again."""

    limit_bytes: int
    most_bytes: int
    bytes_of_all: int
    pages: int
    loads: int


class PageMemory:
    """At most `limit` bytes of volumes that are drawn from disk: `pumice.open(path, memory=memory)`. Volumes with the same memory share the limit,
    in whatever sessions and renderers they are drawn."""

    @checked
    def __init__(self, limit: int) -> None:
        self._limit = limit_of("limit", limit)
        self._native = _native.PageMemory(self._limit)

    def __repr__(self) -> str:
        return f"<pumice.PageMemory of {self._limit} bytes>"

    @property
    def limit(self) -> int:
        """The limit in bytes."""
        return self._limit

    @property
    def figures(self) -> PageFigures:
        """What is drawn from disk now, and what was in memory since the memory was made."""
        return figures_of(self._native.figures())


def limit_of(name: str, value: int) -> int:
    """A limit in bytes that is one."""
    return arguments.whole(name, value, 1, arguments.MOST_64)


def figures_of(text: str) -> PageFigures:
    """Figures from their JSON text."""
    return PageFigures(**json.loads(text))
