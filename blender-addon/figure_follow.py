# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes scale bars and legends follow camera, picture size, volume and label table.

    after a change of the scene    depsgraph_update_post    only what the change concerns
    in a new frame                 frame_change_post        all

Blender evaluates what they write before it draws or renders, and runs none of them while it draws. A script that renders updates the scene
first. What already is as it should be is not written.
"""

import bpy

from . import figure_part, legend, scale_bar
from .reports import Refused, log, one_line

FOLLOWS = {"SCALE_BAR": scale_bar.follow, "LEGEND": legend.follow}

_problems = {}


def follow(scene, depsgraph, touched=None):
    """Makes the parts of a scene's figure right; with `touched`, those that these changed data concern."""
    lines = {}
    for obj in figure_part.parts(scene):
        settings = obj.pumice_figure
        if touched is not None and not _concerns(obj, scene, touched):
            lines[obj.name] = _problems.get(scene.session_uid, {}).get(obj.name)
            continue
        try:
            lines[obj.name] = FOLLOWS[settings.kind](obj, scene, depsgraph)
        except Exception as error:  # a handler that raises is called no more
            if not isinstance(error, Refused):
                log(error)
            lines[obj.name] = f"{obj.name}: {one_line(error)}"
    _problems[scene.session_uid] = {name: line for name, line in lines.items() if line}


def problems(scene):
    """One line for each part of a scene's figure that is not as it should be."""
    return list(_problems.get(scene.session_uid, {}).values())


def _concerns(obj, scene, touched):
    volume, camera = obj.pumice_figure.volume, scene.camera
    near = {scene, obj, obj.pumice_figure.text, volume, camera}
    if volume is not None:
        near |= {volume.pumice.table, volume.parent}
    if camera is not None:
        near |= {camera.data, camera.parent, camera.data.dof.focus_object}
    return not near.isdisjoint(touched) or any(isinstance(one, (bpy.types.Material, bpy.types.NodeTree)) for one in touched)


@bpy.app.handlers.persistent
def _after_update(scene, depsgraph):
    if scene.pumice_figure.parts is not None:
        follow(scene, depsgraph, {update.id.original for update in depsgraph.updates})


@bpy.app.handlers.persistent
def _after_frame(scene, depsgraph):
    if scene.pumice_figure.parts is not None:
        follow(scene, depsgraph)


HANDLERS = (
    (bpy.app.handlers.depsgraph_update_post, _after_update),
    (bpy.app.handlers.frame_change_post, _after_frame),
)


def register():
    for handlers, one in HANDLERS:
        handlers.append(one)


def unregister():
    for handlers, one in reversed(HANDLERS):
        handlers.remove(one)
    _problems.clear()
