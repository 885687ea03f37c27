# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the extension has written into label tables lately, so that a live view need not read a whole table after each edit of its labels.

    label_table.set_visible, set_slots, set_color ─► note(table, column, rows)
    a viewport that read the table before          ─► since(table, its number): these columns and rows alone are read
    half a second later                            ─► the viewport reads all, because scripts write into tables without a word

To read and compare all columns of 118,251 labels takes 2 ms, and more where other work has emptied the processor's caches. Renders and exports
always read all.
"""

from collections import deque

import bpy

# Writes that are remembered for each table; a view that lags further behind reads all.
MOST_WRITES = 16
MOST_TABLES = 64

_number = 0
_writes = {}  # session_uid → (number, column, rows or None for all)


def now():
    """The number of the last write; a view keeps it before it reads."""
    return _number


def note(table, column, rows=None):
    """Remembers that a column of a table was written, in some rows or in all."""
    global _number
    _number += 1
    uid = table.session_uid
    if uid not in _writes and len(_writes) >= MOST_TABLES:
        _writes.clear()
    _writes.setdefault(uid, deque(maxlen=MOST_WRITES)).append((_number, column, rows))


def since(table, number):
    """{column: list of rows, or None for all} of a table's writes after that with this number; None where there is none, or where not all of
    them are known any more: then nobody knows what has changed."""
    writes = _writes.get(table.session_uid, ())
    later = [write for write in writes if write[0] > number]
    if not later or len(later) == MOST_WRITES:
        return None
    found = {}
    for _, column, rows in later:
        former = found.get(column, [])
        found[column] = None if rows is None or former is None else [*former, *rows]
    return found


@bpy.app.handlers.persistent
def forget(*_):
    """Undo and files bring other tables, or other contents of these."""
    _writes.clear()


HANDLERS = (bpy.app.handlers.undo_post, bpy.app.handlers.redo_post, bpy.app.handlers.load_post)


def register():
    for handlers in HANDLERS:
        handlers.append(forget)


def unregister():
    for handlers in reversed(HANDLERS):
        handlers.remove(forget)
    forget()
