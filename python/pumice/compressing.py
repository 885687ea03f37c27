"""What functions that compress have in common: limits, what the caller says of labels, and what was written."""

from __future__ import annotations

import json
import os
import pathlib
from collections.abc import Mapping
from typing import Any, TypedDict

from . import _native, arguments
from .arguments import Path
from .errors import InputError
from .label_table import AnnotationTable

# Most threads that are accepted: more than any machine has, because each is started.
MOST_THREADS = 1024


class Limits(TypedDict):
    """Bytes to work with, if there is a limit, and threads, 0 for all cores."""

    memory_limit: int | None
    threads: int


def limits_of(memory_limit: int | None, threads: int) -> Limits:
    """Limits that are what they should be."""
    if memory_limit is not None:
        memory_limit = arguments.whole("memory_limit", memory_limit, 0, arguments.MOST_64)
    return Limits(memory_limit=memory_limit, threads=arguments.whole("threads", threads, 0, MOST_THREADS))


def labels_given(
    types: Mapping[int, str] | Path | None, table: AnnotationTable | Path | None
) -> tuple[str | pathlib.Path | _native.AnnotationTable | None, tuple[str, ...]]:
    """What the caller says of the labels, and what the reader of a table has to say."""
    if types is not None and table is not None:
        raise InputError("give types or table, not both")
    typed = type_table(types)
    table, told = table_of(table)
    return typed if table is None else table.native(), told


def outcome_of(written: str) -> dict[str, Any]:
    """What was written, from its JSON text."""
    outcome: dict[str, Any] = json.loads(written)
    outcome["dims"] = tuple(outcome["dims"])
    return outcome


def type_table(types: Mapping[int, str] | Path | None) -> str | pathlib.Path | None:
    """The text of a table id,type, or the file that has one."""
    if types is None:
        return None
    if isinstance(types, (str, os.PathLike)):
        return pathlib.Path(types)
    for label, name in types.items():
        if not isinstance(name, str):
            raise InputError(f"types: expected a text for label {label}, got {type(name).__name__}")
        if any(c in name for c in ',"\r\n') or name != name.strip() or not name:
            raise InputError(
                f"types: the name {name!r} of label {label} is empty, begins or ends with a space, or has a comma, a quote or a line break"
            )
    listed = zip(arguments.ids("types", types), types.values(), strict=True)
    return "".join(f"{label},{name}\n" for label, name in listed)


def table_of(table: AnnotationTable | Path | None) -> tuple[AnnotationTable | None, tuple[str, ...]]:
    """A table that is given or in a file, and what its reader has to say."""
    if isinstance(table, (str, os.PathLike)):
        read = AnnotationTable.read(table)
        return read, read.notes
    if table is not None and not isinstance(table, AnnotationTable):
        raise InputError(f"table: expected a path or an AnnotationTable, got {type(table).__name__}")
    return table, ()
