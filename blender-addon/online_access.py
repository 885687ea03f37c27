# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's *Online Access*: without it nothing is asked of a server."""

import bpy

from . import native
from .reports import Refused


def check(paths):
    """Raises Refused where one of the paths is on a server, and Blender may not go online."""
    url = next((path for path in paths if native.is_on_server(path)), None)
    if url is not None and not bpy.app.online_access:
        raise Refused(f"{url}: Blender may not go online; switch on Preferences › System › Network › Allow Online Access")
