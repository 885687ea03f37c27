"""Says when a scene or a picture is saved whether the files that it names are there, so that it can be drawn again."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence

from .errors import PumiceWarning

# Most fields that one line names.
MOST_NAMED = 4


def warn_of_missing(saved: str, folder: str, paths: Sequence[tuple[str, os.PathLike[str]]]) -> None:
    """Issues a `PumiceWarning` where files that `saved` names, by field and path, are not there; relative paths count from `folder`. The
    warning points to the line that called the method of the package."""
    missing = [f"{field} ({os.fspath(path)})" for field, path in paths if not os.path.exists(os.path.join(folder, path))]
    if not missing:
        return
    named = ", ".join(missing[:MOST_NAMED]) + (f" and {len(missing) - MOST_NAMED} more" if len(missing) > MOST_NAMED else "")
    way_out = "save volumes (Volume.save) and meshes before, and name their files in the scene"
    warnings.warn(f"{saved}: cannot be drawn again, because there is no file for {named}; {way_out}", PumiceWarning, stacklevel=4)
