"""Tables of labels of other programs, and the query line that chooses labels of any table."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from . import _native, arguments
from .arguments import Path
from .checked import checked
from .errors import InputError, PumiceWarning


class AnnotationTable:
    """Names, types, colours and numbers by label id. Row i belongs to `ids[i]`; rows are sorted by id. Arrays are read-only.

    `ids` (n,) uint64; `names` and `types`, empty where a row has none; `colors` (n, 3) float32, sRGB-encoded from 0 to 1, NaN where a row has
    none; `columns`, float64 by name, NaN where a row has no number; `format` and `notes`, the format of the file that it was read from and
    what its reader left out, a line each.
    """

    @checked
    def __init__(
        self,
        ids: npt.ArrayLike,
        *,
        names: Sequence[str] | None = None,
        types: Sequence[str] | None = None,
        colors: npt.ArrayLike | None = None,
        columns: Mapping[str, npt.ArrayLike] | None = None,
    ) -> None:
        listed = arguments.ids("ids", ids)
        n = len(listed)
        shades: list[tuple[float, float, float] | None] = [None] * n
        if colors is not None:
            given = np.asarray(colors, dtype=np.float32)
            if given.shape != (n, 3):
                raise InputError(f"colors: expected an array ({n}, 3), got {given.shape}")
            shades = [None if np.isnan(c).any() else (float(c[0]), float(c[1]), float(c[2])) for c in given]
        native = _native.AnnotationTable(
            listed,
            [""] * n if names is None else list(map(str, names)),
            [""] * n if types is None else list(map(str, types)),
            shades,
            [(name, _numbers(name, values).tolist()) for name, values in (columns or {}).items()],
        )
        self._take(native, "", ())

    def _take(self, native: _native.AnnotationTable, format: str, notes: Sequence[str]) -> None:
        self._native = native
        self.ids: npt.NDArray[np.uint64] = np.asarray(native.ids())
        self.names: list[str] = native.names()
        self.types: list[str] = native.types()
        self.colors: npt.NDArray[np.float32] = np.asarray(native.colors())
        self.columns: dict[str, npt.NDArray[np.float64]] = {name: np.asarray(values) for name, values in native.columns()}
        self.format = format
        self.notes: tuple[str, ...] = tuple(notes)

    @classmethod
    @checked
    def read(cls, path: Path) -> AnnotationTable:
        """Reads a file: see `read_label_table`."""
        native, format, notes = _native.read_label_table(arguments.path("path", path))
        table = cls.__new__(cls)
        table._take(native, format, notes)
        return table

    def __len__(self) -> int:
        return len(self.ids)

    def __repr__(self) -> str:
        return f"<pumice.AnnotationTable, {len(self)} rows, columns {list(self.columns)}>"

    def native(self) -> _native.AnnotationTable:
        """The table as the compiled part has it. Changes of the lists `names` and `types` do not reach it."""
        return self._native

    @checked
    def save(self, path: Path, *, format: str | None = None) -> None:
        """Writes a file, which appears complete or not at all.

        `format` is csv, tsv, itk-snap, freesurfer, slicer or neuroglancer; by default the file's name decides: .csv, .tsv, .txt or .label
        (ITK-SNAP), lut.txt, .lut or .ctab (FreeSurfer), .ctbl (3D Slicer), .json or info (Neuroglancer). A `PumiceWarning` tells what the
        format does not hold. ITK-SNAP, FreeSurfer and 3D Slicer need a colour for each label: InputError names one without.
        """
        for note in self._native.save(arguments.path("path", path), format):
            warnings.warn(note, PumiceWarning, stacklevel=3)

    @checked
    def query(self, line: str) -> npt.NDArray[np.bool_]:
        """Whether a query `line` holds, by row, (n,): see `query_labels`."""
        return np.array(self._native.query(line), dtype=bool)


@checked
def read_label_table(path: Path) -> AnnotationTable:
    """Reads a table of labels, whose format its content decides; InputError names the line and the column of a fault.

    Formats: CSV and TSV, label descriptions of ITK-SNAP, colour tables of FreeSurfer and 3D Slicer, segment properties of Neuroglancer. A
    `PumiceWarning` tells what the reader left out, as `notes` does.
    """
    table = AnnotationTable.read(path)
    for note in table.notes:
        warnings.warn(note, PumiceWarning, stacklevel=3)
    return table


@checked
def query_labels(
    line: str,
    ids: npt.ArrayLike,
    *,
    names: Sequence[str] | None = None,
    types: Sequence[str] | None = None,
    columns: Mapping[str, npt.ArrayLike] | None = None,
) -> npt.NDArray[np.bool_]:
    """Whether a query `line` holds, for each row of a table, (n,); InputError names the column of a fault in the line.

    The table: `ids` (n,), `names` and `types`, n texts each or none, and `columns`, n numbers each by name.

    All conditions, separated by spaces, must hold. A word: the name contains it, in any letters. `17 42 100-199`: ids and ranges, of which one
    must be the row's. `type:axon` and `name:"two words"` ask for a type or name that contains the text, an equals sign for one that is the text.
    `voxels>1000`: a number of `columns`, or `id`, compared by < <= > >= = or !=; NaN meets no comparison. `-` or `!` in front: the condition must
    not hold. What is in quotes is a text. An empty line and `*` hold for all rows. Whole numbers are compared exactly.
    """
    return np.asarray(
        _native.query_labels(
            line,
            arguments.ids("ids", ids),
            list(names or []),
            list(types or []),
            [(name, _numbers(name, values).tolist()) for name, values in (columns or {}).items()],
        )
    )


def _numbers(name: str, values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    given = np.asarray(values)
    if given.ndim != 1 or given.dtype.kind not in "uifb":
        raise InputError(f"{name}: expected an array (n,) of numbers, got {given.dtype} of shape {given.shape}")
    return given
