"""Which axis of a stored array is x, y and z, as the array says itself.

    h5py.Dataset       labels of its dimensions: dataset.dims[0].label
    zarr.Array         format 3: metadata.dimension_names; format 2: the attribute _ARRAY_DIMENSIONS, which xarray writes
    xarray.DataArray   dims
    netCDF4.Variable   dimensions

None of these packages is imported: an array is known by what it has. Names count in any letters. An array that says nothing is asked for `axes`
if it is stored (h5py, zarr and others with `attrs` and `chunks`), because such arrays are z, y, x in some programs and x, y, z in others, and
the wrong order mirrors the volume. Arrays in memory are x, y, z.
"""

from __future__ import annotations

from typing import Any

from .arguments import Axes
from .errors import InputError

Order = tuple[int, int, int]

ORDERS: dict[str, Order] = {"xyz": (0, 1, 2), "zyx": (2, 1, 0)}
# Most letters of a name in a message.
MOST_LETTERS = 20


def order_of(array: Any, axes: Axes | None) -> Order:
    """The axis of the array that is x, the one that is y and the one that is z.

    `axes` is what the caller says. InputError where the array says otherwise, and where nobody says it of a stored array.
    """
    if axes is not None and axes not in ORDERS:
        raise InputError(f"axes: expected 'xyz' or 'zyx' for an array, got {axes!r}")
    names = names_of(array)
    letters = [name.strip().lower() for name in names]
    if sorted(letters) == ["x", "y", "z"]:
        own = (letters.index("x"), letters.index("y"), letters.index("z"))
        if axes is not None and ORDERS[axes] != own:
            raise InputError(f"axes: expected no order, because the array names its axes {', '.join(names)}; got {axes!r}")
        return own
    if axes is None and (names or is_stored(array)) and len(array.shape) == 3:
        kind = f"{type(array).__module__.split('.')[0]} {type(array).__name__}"
        named = f"names its axes {', '.join(name[:MOST_LETTERS] or '(none)' for name in names)}" if names else "does not name its axes"
        raise InputError(f"axes: expected 'zyx' or 'xyz', because this array ({kind}) {named}; most programs store array[z, y, x]")
    return ORDERS[axes or "xyz"]


def names_of(array: Any) -> tuple[str, ...]:
    """Names of the axes in their order; none where the array has none."""
    for found in (
        getattr(getattr(array, "metadata", None), "dimension_names", None),
        getattr(array, "dims", None),
        getattr(array, "dimensions", None),
        _attribute(array, "_ARRAY_DIMENSIONS"),
    ):
        if found is None or isinstance(found, str) or not hasattr(found, "__iter__"):
            continue
        # h5py has an object for each axis, whose label may be empty; zarr has None for an axis without a name.
        names = tuple(name if isinstance(name, str) else str(getattr(name, "label", None) or "") for name in found)
        if len(names) == len(array.shape) and any(names):
            return names
    return ()


def _attribute(array: Any, name: str) -> Any:
    read = getattr(getattr(array, "attrs", None), "get", None)
    return read(name) if callable(read) else None


def is_stored(array: Any) -> bool:
    """Whether an array is in a file, as far as it can be told."""
    return hasattr(array, "attrs") and hasattr(array, "chunks")
