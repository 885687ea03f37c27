# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Turns errors into one line for the user.

Errors that a user can cause (a missing file, a scene without a camera) are `Refused` or errors of the compiled module. Everything else
is a defect: its traceback goes to the console, and the user gets one line with the place where it was raised. Neither crashes Blender.
"""

import re
import traceback

from . import native

MIB = 1 << 20


class Refused(Exception):
    """The user's request cannot be carried out; the text is one line that says what and where."""


def one_line(error):
    """The text of an exception for the user."""
    text = " ".join(str(error).split()) or type(error).__name__
    if _expected(error):
        return of_limit(text)
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({frames[-1].name}, line {frames[-1].lineno})" if frames else ""
    return f"Pumice has a defect: {type(error).__name__}: {text}{where}"


def of_limit(text):
    """A line of the compiled module; what it says of its memory limit is told in terms of the preferences."""
    if "memory limit: " not in text:
        return text
    needed = re.search(r"\d+ bytes are too few, (\d+) are needed", text)
    if needed:
        return f"{text}; set Memory Limit in the extension's preferences to {-(-int(needed[1]) // MIB)} MiB or more"
    return text.replace("leave the limit out", "set Memory Limit in the extension's preferences to 0")


def log(error):
    """Writes the traceback of a defect to the console; errors that users cause get none."""
    if not _expected(error):
        traceback.print_exception(error)


def _expected(error):
    kinds = (Refused, native.ModuleMissing, OSError)
    if native.pumice is not None:
        kinds += (native.pumice.PumiceError,)
    return isinstance(error, kinds)
