# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads the compiled module, or says why it does not load.

The extension registers even if its wheel does not load (a platform without one, a damaged installation), so that the user
reads a reason instead of a traceback.
"""

try:
    import pumice
except ImportError as error:
    pumice = None
    MISSING = f"Pumice's compiled module does not load: {error}; install the extension's file for this platform"
else:
    MISSING = None


class ModuleMissing(Exception):
    """The compiled module does not load; its text says why."""


def is_on_server(path):
    """Whether a path is the URL of a place on a server, and not a file of this machine."""
    return pumice.is_on_server(path) if pumice is not None else "://" in path


def require():
    """The module `pumice`; raises ModuleMissing where it does not load."""
    if pumice is None:
        raise ModuleMissing(MISSING)
    return pumice
