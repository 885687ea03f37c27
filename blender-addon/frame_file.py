# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The current frame as a scene file in a temporary folder, for calls of the compiled module that read a file as the command does."""

import os
import tempfile

from . import export_scene


def saved_frame(operator, context):
    """(temporary folder, path of the scene file in it); the operator reports what was left out. Whoever uses the file ends the folder."""
    parts, left_out = export_scene.parts_to_export(context.evaluated_depsgraph_get())
    for line in left_out:
        operator.report({"WARNING"}, line)
    folder = tempfile.TemporaryDirectory(prefix="pumice-")
    path = os.path.join(folder.name, "scene.json")
    export_scene.save(parts, path)
    return folder, path
