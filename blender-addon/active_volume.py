# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The volume that the panel of labels and the operators work on: the active object, or the volume that this object belongs to.

    active object                          volume
    a volume                               this one
    scale bar, legend, the text of one     the volume that it was made for
    an object that cuts                    of the volumes that it cuts, the one that was active last, or the only one
    anything else                          none

Which volume was active last is remembered while Blender runs, and not in the file.
"""

import bpy

from .properties import is_volume

MAKE_ACTIVE = "Make a volume active first"

# Name and session uid of the volume that was active last.
_last = (None, 0)


def of(context):
    """The volume of the active object; None where there is none."""
    return belonging(context, context.object)


def belonging(context, obj):
    """The volume that an object is or belongs to, in the view layer; None where there is none. Reads alone, so that panels may ask."""
    if obj is None or is_volume(obj):
        return obj
    part = obj if obj.pumice_figure.kind != "NONE" or obj.parent is None else obj.parent
    if part.pumice_figure.kind != "NONE":
        volume = part.pumice_figure.volume
        return volume if volume is not None and is_volume(volume) and _is_in(context, volume) else None
    if obj.pumice.cut == "NONE":
        return None
    last = bpy.data.objects.get(_last[0]) if _last[0] is not None else None
    chosen = obj.pumice.cut_volumes
    if last is not None and last.session_uid == _last[1] and is_volume(last) and _is_in(context, last):
        if chosen is None or chosen.all_objects.get(last.name) == last:
            return last
    among = context.view_layer.objects if chosen is None else chosen.all_objects
    found = [one for one in among if is_volume(one) and _is_in(context, one)]
    return found[0] if len(found) == 1 else None


def remember(context):
    """Notes which volume is active; called after each change of the scene."""
    global _last
    obj = getattr(context, "object", None)
    if obj is not None and is_volume(obj):
        _last = (obj.name, obj.session_uid)


def forget():
    """Another file is opened."""
    global _last
    _last = (None, 0)


def _is_in(context, obj):
    return context.view_layer.objects.get(obj.name) == obj
