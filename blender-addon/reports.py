# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors as one line for the user.

What a user can cause (a missing file, a scene without a camera) is a `Refused` or an error of the compiled module. Everything else
is a defect: its traceback goes to the console, and one line with its last place to the user. Neither takes Blender down.
"""

import traceback

from . import native


class Refused(Exception):
    """The user asked for what cannot be done; the text is one line that says what and where."""


def one_line(error):
    """What a user reads of an exception."""
    text = " ".join(str(error).split()) or type(error).__name__
    if _expected(error):
        return text
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({frames[-1].name}, line {frames[-1].lineno})" if frames else ""
    return f"Pumice has a defect: {type(error).__name__}: {text}{where}"


def log(error):
    """Writes the traceback of a defect to the console; what users cause is not worth one."""
    if not _expected(error):
        traceback.print_exception(error)


def _expected(error):
    kinds = (Refused, native.ModuleMissing, OSError)
    if native.pumice is not None:
        kinds += (native.pumice.PumiceError,)
    return isinstance(error, kinds)
