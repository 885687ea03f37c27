# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of labels in files: what a file says goes into the label table of a volume, and the table goes into a file.

The compiled module reads and writes the formats (CSV, TSV, ITK-SNAP, FreeSurfer, 3D Slicer, Neuroglancer). Rows are matched by id. What a file
says replaces what the table has; labels without a row stay as they are.
"""

import os
import warnings

import bpy
import numpy as np
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from . import label_operators, label_search, label_table, native
from .reports import Refused

ENDINGS = (".csv", ".tsv", ".txt", ".label", ".lut", ".ctab", ".ctbl", ".json")


def read(path):
    """(`pumice.AnnotationTable`, what its reader left out) of a file."""
    with warnings.catch_warnings():
        # Its notes say the same.
        warnings.simplefilter("ignore")
        table = native.require().read_label_table(path)
    return table, list(table.notes)


def annotate(mesh, table):
    """Gives a label table what a `pumice.AnnotationTable` says; returns lines about rows and labels that have no counterpart."""
    ids = label_table.ids(mesh)
    rows = np.searchsorted(ids, table.ids).clip(max=max(0, len(ids) - 1))
    fits = ids[rows] == table.ids if len(ids) else np.zeros(len(table.ids), dtype=bool)
    rows, given = rows[fits], np.flatnonzero(fits)
    names = label_table.names(mesh) or [""] * len(ids)
    kinds = label_table.type_names(mesh)
    types = [kinds[place] for place in label_table.types(mesh).tolist()] if kinds else [""] * len(ids)
    for row, place in zip(rows.tolist(), given.tolist()):
        names[row] = table.names[place] or names[row]
        types[row] = table.types[place] or types[row]
    label_table.set_names(mesh, names)
    label_table.set_types(mesh, types)
    colored = ~np.isnan(table.colors[given]).any(axis=1)
    if colored.any():
        linear = label_table.linear_from_srgb(table.colors[given][colored].astype(float))
        label_table.set_color(mesh, rows[colored], linear)
    left_out = []
    for name, values in table.columns.items():
        if name == "voxels":
            left_out.append("column voxels: the volume itself says it")
            continue
        column = np.full(len(ids), np.nan, dtype=np.float32)
        column[rows] = values[given]
        label_table.set_number(mesh, name, column)
    unknown, silent = len(table.ids) - len(given), len(ids) - len(rows)
    if unknown:
        left_out.append(f"{unknown} rows of the table have no label in the volume")
    if silent:
        left_out.append(f"{silent} labels have no row in the table")
    return left_out


class PUMICE_OT_labels_import(label_operators.OnLabels, bpy.types.Operator, ImportHelper):
    """Read names, types, colors and numbers of the labels from a table: CSV, TSV, ITK-SNAP, FreeSurfer, 3D Slicer, Neuroglancer"""

    bl_idname = "pumice.labels_import"
    bl_label = "Import Label Table"

    filename_ext = ""
    filter_glob: StringProperty(default=";".join("*" + e for e in ENDINGS), options={"HIDDEN"})

    def invoke(self, context, event):
        return ImportHelper.invoke(self, context, event)

    def change(self, context, table):
        path = bpy.path.abspath(self.filepath)
        found, left_out = read(path)
        for line in left_out + annotate(table, found):
            self.report({"WARNING"}, f"{os.path.basename(path)}: {line}")
        label_operators.tag_users(table)
        label_search.refresh(context)
        return f"{os.path.basename(path)}: {len(found.ids):,} rows, {found.format}"


class PUMICE_OT_labels_export(label_operators.OnLabels, bpy.types.Operator, ExportHelper):
    """Write the label table: .csv, .tsv, .txt (ITK-SNAP), .lut (FreeSurfer), .ctbl (3D Slicer), .json (Neuroglancer)"""

    bl_idname = "pumice.labels_export"
    bl_label = "Export Label Table"
    bl_options = {"REGISTER"}

    filename_ext = ".csv"
    check_extension = None
    filter_glob: StringProperty(default=";".join("*" + e for e in ENDINGS), options={"HIDDEN"})

    changes_table = False

    def invoke(self, context, event):
        return ExportHelper.invoke(self, context, event)

    def change(self, _context, table):
        pumice, path = native.require(), bpy.path.abspath(self.filepath)
        if not os.path.isdir(os.path.dirname(os.path.abspath(path))):
            raise Refused(f"{os.path.dirname(path)}: there is no such folder")
        kinds, ids = label_table.type_names(table), label_table.ids(table)
        found = pumice.AnnotationTable(
            ids,
            names=label_table.names(table) or None,
            types=[kinds[place] for place in label_table.types(table).tolist()] if kinds else None,
            colors=label_table.srgb_from_linear(label_table.colors(table)[:, :3]),
            columns={name: values.astype(float) for name, values in label_table.numbers(table).items()},
        )
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            found.save(path)
        for warning in said:
            self.report({"WARNING"}, str(warning.message))
        return f"{os.path.basename(path)}: {label_operators.counted(len(ids))}"


CLASSES = (PUMICE_OT_labels_import, PUMICE_OT_labels_export)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
