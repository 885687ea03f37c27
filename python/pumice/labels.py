"""Columns of labels: which are drawn, and their groups and colours. 10⁵ labels travel as arrays, without an object for each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native, arguments
from .checked import checked
from .errors import InputError

LabelFlags = tuple[npt.ArrayLike, npt.ArrayLike]
"""Ids (n,) in rising order, and for each whether it is drawn (n,)."""


class LabelGroups:
    """Groups of a volume's labels with a common material, for `Scene.with_labels` and `Session.set_labels`; immutable.

    Label `ids[i]`, ids rising, belongs to group `groups[i]` and has the colour `colors[i]`: linear Rec. 709, (n, 3), or (n, 4) whose alpha is
    ignored. `materials`: one for each group, with the fields of a material in the scene file (docs/scene.md). `colored`: for each group,
    whether the labels' colours replace the material's `base_color`; without it they do everywhere. Labels of a group past the last have the
    style's common material.
    """

    @checked
    def __init__(
        self,
        ids: npt.ArrayLike,
        groups: npt.ArrayLike,
        colors: npt.ArrayLike,
        materials: Sequence[dict[str, Any]],
        *,
        colored: Sequence[bool] | None = None,
    ) -> None:
        text = arguments.json_text("materials", list(materials))
        own = [True] * len(materials) if colored is None else [bool(one) for one in colored]
        group, color = _column("groups", groups, np.uint32), _colors(colors)
        self._native = _native.LabelGroups(_column("ids", ids, np.uint64), group, color, text, own)

    @checked
    def with_colors(self, ids: npt.ArrayLike, colors: npt.ArrayLike) -> LabelGroups:
        """The same groups, in which label `ids[i]`, ids rising, has the colour `colors[i]`, as `LabelGroups` takes it. InputError where a label
        is in no group. Labels of a group that is not `colored` keep its material's colour.

        To recolour a few of 10⁵ labels takes a fraction of the time of making their groups again.
        """
        changed = object.__new__(LabelGroups)
        changed._native = self._native.with_colors(_column("ids", ids, np.uint64), _colors(colors))
        return changed


def flags(visible: LabelFlags | None) -> tuple[Any, Any] | None:
    """The columns as the compiled part takes them."""
    if visible is None:
        return None
    ids, shown = visible
    return _column("ids", ids, np.uint64), _column_of(np.asarray(shown, dtype=bool)).view(np.uint8)


def _colors(colors: npt.ArrayLike) -> Any:
    """Colours as four numbers each; InputError where they are not three or four."""
    four = np.asarray(colors, dtype=np.float32)
    if four.ndim != 2 or four.shape[1] not in (3, 4):
        raise InputError(f"colors: expected an array (n, 3) or (n, 4), got {four.shape}")
    return _column_of(four if four.shape[1] == 4 else np.pad(four, ((0, 0), (0, 1)), constant_values=1.0))


def _column(name: str, values: npt.ArrayLike, kind: type[np.unsignedinteger[Any]]) -> Any:
    """One column of whole numbers; InputError where a number does not fit."""
    return _column_of(arguments.whole_numbers(name, values, int(np.iinfo(kind).max)).astype(kind, copy=False))


def _column_of(values: npt.NDArray[Any]) -> Any:
    """The array in one piece of memory. (As `Any`, because the types of Python 3.11 do not know that arrays are buffers.)"""
    return np.ascontiguousarray(values)
