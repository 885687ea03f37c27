# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where Open Image Denoise is: Blender has a copy of its own, for Cycles and the compositor.

    PUMICE_OIDN is set    that library
    else                  Blender's own
    else                  the one that the system finds, or a line that says what to set
"""

import os
from pathlib import Path

import bpy

# Beside Blender's own folder, such as 5.0: Linux, macOS, Windows.
PLACES = ("lib/libOpenImageDenoise.so.2", "lib/libOpenImageDenoise.*dylib", "blender.shared/OpenImageDenoise.dll")


def library():
    """The path of Blender's own library; None if it is in none of the known places."""
    folder = bpy.utils.resource_path("LOCAL")
    found = [path for place in PLACES for path in sorted(Path(folder).parent.glob(place))] if folder else []
    return found[0] if found else None


def name():
    """Open Image Denoise as `pumice.render` takes it."""
    if os.environ.get("PUMICE_OIDN") or (found := library()) is None:
        return "oidn"
    return f"oidn:{found}"
