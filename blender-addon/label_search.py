# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The search line of the label panel: which rows of a label table a query finds, and the list of the first of them.

    query ──► pumice.AnnotationTable.query (Rust) ──► a flag for each row ──► the list: at most 200 rows, each a number
                                                      and, with Shown Only, the table's `visible`

The list is a small collection of the window manager, so that a search makes no undo step and nothing is stored in the file. It has row numbers
alone: what the panel shows of a label it reads from the table, which edits and undo change.
"""

import bpy
import numpy as np
from bpy.props import BoolProperty, CollectionProperty, IntProperty, PointerProperty, StringProperty

from . import active_volume, label_table, native
from .reports import one_line

# Most rows in the list. Blender walks through a whole list at each redraw.
MOST_HITS = 200

# By the table's session_uid: what the index was made of, and the index. Few tables are searched at a time.
_indices = {}
# Which labels were shown when the list was filled; None where the list does not depend on it.
_shown = None
MOST_INDICES = 8


class Index:
    """The names, types and numbers of one table, as the compiled module searches them."""

    def __init__(self, mesh):
        ids, kinds = label_table.ids(mesh), label_table.type_names(mesh)
        self.ids, self.names = ids, label_table.names(mesh) or [""] * len(ids)
        self.types = [kinds[place] for place in label_table.types(mesh).tolist()] if kinds else [""] * len(ids)
        self._table = native.require().AnnotationTable(ids, names=self.names, types=self.types, columns=label_table.numbers(mesh))

    def find(self, query):
        """A flag for each row; raises `pumice.InputError` for a query that has no meaning."""
        return self._table.query(query)


def index(mesh):
    """The index of a label table, made anew when something that can be searched has changed."""
    made_of = (len(mesh.vertices), mesh.get("pumice_names"), mesh.get("pumice_types"), tuple(mesh.attributes.keys()))
    kept = _indices.get(mesh.session_uid)
    if kept is None or kept[0] != made_of:
        while len(_indices) >= MOST_INDICES:
            _indices.pop(next(iter(_indices)))
        kept = _indices[mesh.session_uid] = (made_of, Index(mesh))
    return kept[1]


def table_of(context):
    """The label table of the active volume, as `active_volume` finds it, or None."""
    obj = active_volume.of(context)
    return obj.pumice.table if obj is not None else None


def rows(context):
    """The rows that the query of the panel finds in the active table, with Shown Only those of shown labels. Raises `pumice.InputError`."""
    search, table = context.window_manager.pumice_labels, table_of(context)
    if table is None:
        return np.zeros(0, dtype=np.int64)
    found = np.asarray(index(table).find(search.query), dtype=bool)
    return np.flatnonzero(found & label_table.visible(table) if search.shown_only else found)


def refresh(context, row=None):
    """Fills the list anew for the active object and the query. With `row`, that row of the table is in the list and active: among the hits
    around it, or before them where the query does not find it."""
    global _shown
    search, table = context.window_manager.pumice_labels, table_of(context)
    _shown = _shown_now(search, table)
    search.hits.clear()
    search.count, search.problem, search.table = 0, "", table.session_uid if table is not None else 0
    if table is None:
        return
    try:
        found = rows(context)
    except Exception as error:  # what is typed halfway is often no query yet: the panel says so
        search.problem = one_line(error)
        return
    search.count = len(found)
    place = int(np.searchsorted(found, row)) if row is not None else 0
    start = max(0, min(place - MOST_HITS // 2, len(found) - MOST_HITS))
    listed = found[start : start + MOST_HITS].tolist()
    if row is not None and row not in listed:
        listed = [row, *listed[: MOST_HITS - 1]]
    for one in listed:
        search.hits.add().row = one
    search.active = listed.index(row) if row is not None else 0


def _shown_now(search, table):
    return label_table.visible(table).tobytes() if search.shown_only and table is not None else None


class PumiceLabelHit(bpy.types.PropertyGroup):
    """A row of the list."""

    row: IntProperty(name="Row", description="Row of the label table", default=0)


class PumiceLabelSearch(bpy.types.PropertyGroup):
    """The search line and what it finds."""

    query: StringProperty(
        name="Search",
        description=(
            "Labels to list: words of the name, ids (17 42 100-199), type:axon, numbers (voxels>1000). "
            "All conditions must hold; - in front of one excludes"
        ),
        default="",
        options={"TEXTEDIT_UPDATE", "SKIP_SAVE"},
        update=lambda _search, context: refresh(context),
    )
    shown_only: BoolProperty(
        name="Shown Only",
        description="List only labels that are shown",
        default=False,
        update=lambda _search, context: refresh(context),
    )
    hits: CollectionProperty(type=PumiceLabelHit)
    active: IntProperty(name="Row", default=0)
    count: IntProperty(name="Hits", description="Labels that the query finds", default=0)
    problem: StringProperty(name="Problem", description="Why the query has no meaning", default="")
    table: IntProperty(name="Table", description="Session id of the table that was searched", default=0)


@bpy.app.handlers.persistent
def _follow(scene, _depsgraph=None):
    """Searches again once another volume is active, which undo and loading cause too, and with Shown Only once other labels are shown."""
    context = bpy.context
    active_volume.remember(context)
    search = getattr(context.window_manager, "pumice_labels", None)
    table = table_of(context) if getattr(context, "object", None) is not None else None
    if search is None:
        return
    if search.table != (table.session_uid if table is not None else 0) or _shown_now(search, table) != _shown:
        refresh(context)


@bpy.app.handlers.persistent
def _forget(*_):
    _indices.clear()
    active_volume.forget()


CLASSES = (PumiceLabelHit, PumiceLabelSearch)
HANDLERS = (
    (bpy.app.handlers.depsgraph_update_post, _follow),
    (bpy.app.handlers.undo_post, _follow),
    (bpy.app.handlers.redo_post, _follow),
    (bpy.app.handlers.load_pre, _forget),
    (bpy.app.handlers.load_post, _follow),
)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.WindowManager.pumice_labels = PointerProperty(type=PumiceLabelSearch)
    for handlers, call in HANDLERS:
        handlers.append(call)


def unregister():
    for handlers, call in HANDLERS:
        handlers.remove(call)
    del bpy.types.WindowManager.pumice_labels
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    _forget()
