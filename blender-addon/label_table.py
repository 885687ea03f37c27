# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The label table of a volume: a mesh that no object shows, with one vertex per label, in dense order (ids rising).

    attribute   type          what
    id_low      INT           lower 32 bits of the label's id
    id_high     INT           upper 32 bits
    color       FLOAT_COLOR   linear base colour
    own_color   BOOLEAN       whether `color` is the label's own (the file's or the user's), not an automatic one
    visible     BOOLEAN       whether the label is drawn
    slot        INT           the label's group: a material slot of the object, from 0
    select      BOOLEAN       whether the label is selected in the panel and in the viewport
    voxels      INT or FLOAT  number of voxels: FLOAT where one is above 2³¹ − 1
    others      INT or FLOAT  columns of numbers of the volume, by their names
    type        INT           index into the type names

    pumice_names, pumice_types   JSON lists of strings; absent where no label has a name or a type

Why attributes: 118,251 labels are 5.4 MB here and cost under a millisecond when the object moves; as property groups they are
116 MB and cost a third of a second each time. The object's own mesh cannot hold them, for an attribute is as long as its mesh.
"""

import json

import bpy
import numpy as np

from . import table_writes
from .reports import Refused

# Columns with a meaning of their own; others are numbers that the volume or the user brought.
FIXED = ("id_low", "id_high", "color", "own_color", "visible", "slot", "select", "type")
MOST_INT = 2**31 - 1
# Up to so many rows are colored one by one, in 2 µs each; above, to read and write the columns is faster. (A table of 118,251 labels: 0.4 ms.)
FEW_ROWS = 128
# Bytes of an attribute's name that every Blender keeps.
MOST_NAME = 63


def create(name, labels):
    """A new table of a volume's labels (`pumice.LabelTable`)."""
    count = len(labels.ids)
    mesh = bpy.data.meshes.new(f"{name} labels")
    mesh.vertices.add(count)
    ids = np.ascontiguousarray(labels.ids, dtype=np.uint64)
    _write(mesh, "id_low", "INT", "value", (ids & np.uint64(0xFFFFFFFF)).astype(np.uint32).view(np.int32))
    _write(mesh, "id_high", "INT", "value", (ids >> np.uint64(32)).astype(np.uint32).view(np.int32))

    # The file's colours are the user's own; all others are chosen so that neighbours differ.
    srgb = np.asarray(labels.colors, dtype=np.float64).reshape(count, 3)
    own = ~np.isnan(srgb).any(axis=1) if count else np.zeros(0, dtype=bool)
    color = np.ones((count, 4), dtype=np.float32)
    color[:, :3] = labels.auto_colors()
    color[own, :3] = linear_from_srgb(srgb[own])
    _write(mesh, "color", "FLOAT_COLOR", "color", color)
    _write(mesh, "own_color", "BOOLEAN", "value", own)
    _write(mesh, "visible", "BOOLEAN", "value", np.ones(count, dtype=bool))
    _write(mesh, "slot", "INT", "value", np.zeros(count, dtype=np.int32))
    _write(mesh, "select", "BOOLEAN", "value", np.zeros(count, dtype=bool))
    voxels = np.asarray(labels.voxels)
    is_small = not count or int(voxels.max()) <= MOST_INT
    _write(mesh, "voxels", *(("INT", "value", voxels.astype(np.int32)) if is_small else ("FLOAT", "value", voxels.astype(np.float32))))
    # Each vertex is in the middle of its label's bounds, in voxels, for the Spreadsheet and Geometry Nodes.
    middle = (np.asarray(labels.low, dtype=np.float32) + np.asarray(labels.high, dtype=np.float32) + 1.0) / 2.0
    # A label that is not there at the time step has no bounds.
    middle[voxels == 0] = 0.0
    mesh.vertices.foreach_set("co", middle.reshape(-1, 3).ravel())

    set_types(mesh, [str(t or "") for t in labels.types])
    set_names(mesh, [str(n or "") for n in labels.names])
    for name, values in getattr(labels, "columns", {}).items():
        set_number(mesh, name, values)
    return mesh


# Both halves of the ids that were read last, and the ids: they never change in a table, and to compare takes a fifth of the time of joining.
_ids = (None, None, None)


def ids(mesh):
    """Original ids, uint64, rising; not to be written to."""
    global _ids
    halves = [_read(mesh, name, "value", np.int32, 1) for name in ("id_low", "id_high")]
    low, high, found = _ids
    if not (np.array_equal(low, halves[0]) and np.array_equal(high, halves[1])):
        found = np.stack(halves, axis=1).view("<u8").ravel()
        found.flags.writeable = False
        _ids = (*halves, found)
    return found


def require_rows(table_ids, labels, owner):
    """Raises Refused where the ids of a table are not those of an open volume's labels: its file was replaced, such as by the Reload of
    another object. `owner` is the name of the volume object."""
    if not np.array_equal(table_ids, labels.ids):
        raise Refused(f"{owner}: the volume has changed since it was imported, so its label table does not fit; press Reload")


def visible(mesh):
    """Which labels are drawn."""
    return _read(mesh, "visible", "value", bool, 1)


def slots(mesh):
    """The group of each label, int32: a material slot of the object; 0 in tables of earlier versions."""
    if "slot" not in mesh.attributes:
        return np.zeros(len(mesh.vertices), dtype=np.int32)
    found = _read(mesh, "slot", "value", np.int32, 1)
    return np.maximum(found, 0, out=found)


def own_color(mesh):
    """Which labels have a colour of their own."""
    return _read(mesh, "own_color", "value", bool, 1)


def colors(mesh):
    """Linear colours, (n, 4) float32."""
    return _read(mesh, "color", "color", np.float32, 4).reshape(-1, 4)


def colors_of(mesh, rows):
    """Linear colours of some rows, (n, 4) float32, in 1 µs each."""
    data = mesh.attributes["color"].data
    return np.array([data[row].color[:] for row in rows], dtype=np.float32).reshape(-1, 4)


def set_visible(mesh, flags):
    """Sets which labels are drawn; the caller tags the object."""
    _write(mesh, "visible", "BOOLEAN", "value", np.asarray(flags, dtype=bool))
    table_writes.note(mesh, "visible")


def set_slots(mesh, rows, slot):
    """Puts labels, by row, into a group; the caller tags the object."""
    all_slots = slots(mesh)
    all_slots[rows] = slot
    _write(mesh, "slot", "INT", "value", all_slots)
    table_writes.note(mesh, "slot")


def selected(mesh):
    """Which labels are selected; none in tables of earlier versions."""
    if "select" not in mesh.attributes:
        return np.zeros(len(mesh.vertices), dtype=bool)
    return _read(mesh, "select", "value", bool, 1)


def set_selected(mesh, flags):
    """Sets which labels are selected."""
    _write(mesh, "select", "BOOLEAN", "value", np.asarray(flags, dtype=bool))


def types(mesh):
    """Index into `type_names` by row, int32."""
    return _read(mesh, "type", "value", np.int32, 1)


def type_names(mesh):
    """The names that `types` counts through; empty where no label has a type."""
    return json.loads(mesh.get("pumice_types", "[]"))


def numbers(mesh):
    """The columns of numbers by name: the attributes of whole or real numbers that have no meaning of their own."""
    found = {}
    for attribute in mesh.attributes:
        if attribute.name in FIXED or attribute.domain != "POINT" or attribute.is_internal:
            continue
        if attribute.data_type in ("INT", "FLOAT"):
            kind = np.int32 if attribute.data_type == "INT" else np.float32
            found[attribute.name] = _read(mesh, attribute.name, "value", kind, 1)
    return found


def set_color(mesh, rows, linear, own=True):
    """Gives labels, by row, a colour, or each one its own; `own` says whether it is the user's. The caller tags the object."""
    rows = np.arange(len(mesh.vertices))[rows]
    if len(rows) <= FEW_ROWS:
        color, is_own = mesh.attributes["color"].data, mesh.attributes["own_color"].data
        linear, own = np.broadcast_to(linear, (len(rows), 3)), np.broadcast_to(own, len(rows))
        for row, one, is_its_own in zip(rows.tolist(), linear.tolist(), own.tolist()):
            color[row].color[:3], is_own[row].value = one, is_its_own
        table_writes.note(mesh, "color", rows.tolist())
        return
    color, is_own = colors(mesh), own_color(mesh)
    color[rows, :3] = linear
    is_own[rows] = own
    _write(mesh, "color", "FLOAT_COLOR", "color", color)
    _write(mesh, "own_color", "BOOLEAN", "value", is_own)
    table_writes.note(mesh, "color")


def names(mesh):
    """Names by row; empty where no label has one."""
    return json.loads(mesh.get("pumice_names", "[]"))


def set_names(mesh, names):
    """Sets the names by row."""
    if any(names):
        mesh["pumice_names"] = json.dumps(names, ensure_ascii=False)
    elif "pumice_names" in mesh:
        del mesh["pumice_names"]


def set_types(mesh, types):
    """Sets the types by row, as texts."""
    kinds = sorted(set(types))
    place = {kind: index for index, kind in enumerate(kinds)}
    _write(mesh, "type", "INT", "value", np.array([place[t] for t in types], dtype=np.int32))
    if any(types):
        mesh["pumice_types"] = json.dumps(kinds, ensure_ascii=False)
    elif "pumice_types" in mesh:
        del mesh["pumice_types"]


def set_number(mesh, name, values):
    """Sets a column of numbers, in single precision, NaN where a label has none. A name that the table itself uses gets `number` behind it."""
    name = f"{name} number" if name in (*FIXED, "voxels") else name.encode()[:MOST_NAME].decode(errors="ignore")
    _write(mesh, name, "FLOAT", "value", np.asarray(values, dtype=np.float32))


def srgb_from_linear(linear):
    """The inverse of `linear_from_srgb`."""
    linear = np.clip(linear, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)


def linear_from_srgb(srgb):
    """The sRGB curve of IEC 61966-2-1, element by element."""
    srgb = np.clip(srgb, 0.0, 1.0)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _write(mesh, name, kind, field, values):
    attribute = mesh.attributes.get(name)
    if attribute is None:
        attribute = mesh.attributes.new(name, kind, "POINT")
    if len(values):
        attribute.data.foreach_set(field, np.ascontiguousarray(values).ravel())


def _read(mesh, name, field, dtype, width):
    attribute = mesh.attributes.get(name)
    if attribute is None:
        raise Refused(f"Mesh {mesh.name}: it is no label table, or has lost its attribute {name}; undo that, or import the volume again")
    values = np.empty(len(mesh.vertices) * width, dtype=dtype)
    if len(values):
        attribute.data.foreach_get(field, values)
    return values
