# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the machine and not of a file: which device computes, as in Cycles' preferences, and how much memory volumes may take.

The limit of memory is not a property of a scene: a file that goes to a machine with other memory, such as one of a render farm, must not bring
the limit of the machine that it was made on.

Blender stores the choice from a list that is built at run time as a number, which means another device in another list. The choice is
therefore stored as text, and the list shows it.
"""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from . import devices, native

MIB = 1 << 20

# Blender does not keep the texts of a list built at run time alive.
_items = []
# Called when the choice has changed.
changed = []


def _choices(preferences):
    known = devices.listed(native.pumice) if native.pumice is not None else ()
    return devices.choices(known, kept=preferences.backend)


def _list(preferences, _context):
    _items[:] = [(name, label, text, place) for place, (name, label, text) in enumerate(_choices(preferences))]
    return _items


def _get(preferences):
    return [choice[0] for choice in _choices(preferences)].index(preferences.backend)


def _set(preferences, place):
    preferences.backend = _choices(preferences)[place][0]


def _tell(_preferences, _context):
    for call in changed:
        call()


class PumicePreferences(bpy.types.AddonPreferences):
    """Settings of the extension for all files."""

    bl_idname = __package__

    backend: StringProperty(name="Backend", default="auto", update=_tell)
    device: EnumProperty(
        name="Device",
        description="Device that computes the picture of scenes whose device is Automatic",
        items=_list,
        get=_get,
        set=_set,
    )
    memory_limit: IntProperty(
        name="Memory Limit",
        description="MiB of memory that volumes hold at most while they are drawn. They are then drawn from temporary files, with the "
        "same picture; a limit that is too small for a scene is refused with one that suffices. 0 is no limit: volumes are read whole",
        min=0,
        max=(1 << 31) - 1,
        default=0,
        update=_tell,
    )
    true_overlays: BoolProperty(
        name="True Overlays",
        description="In viewports that Pumice draws, Pumice draws outlines of selected objects, grid and axes too, true to its picture. "
        "Off, Blender draws them from the proxies, which are within about a cell of the picture",
        default=True,
        update=_tell,
    )

    def draw(self, _context):
        layout = self.layout
        if native.pumice is None:
            layout.label(text=native.MISSING, icon="ERROR")
            return
        layout.use_property_split = True
        layout.prop(self, "device")
        layout.prop(self, "memory_limit", text="Memory Limit (MiB)")
        layout.prop(self, "true_overlays")
        column = layout.column()
        column.active = False
        for device in devices.listed(native.pumice):
            mark = "CHECKMARK" if device["chosen"] else "BLANK1"
            name = f"{device['backend']} on {devices.short(device['device'])}"
            column.label(text=f"{name}: {device['reason']}", icon=mark)


def backend(wishes):
    """The backend that draws a scene with these settings, as the compiled module names it."""
    if wishes.backend != "AUTO":
        return wishes.backend.lower()
    chosen = _chosen()
    return chosen.backend if chosen is not None else "auto"


def memory_limit_bytes():
    """Bytes that all open volumes may hold while they are drawn; 0 without a limit."""
    chosen = _chosen()
    return chosen.memory_limit * MIB if chosen is not None else 0


def true_overlays():
    """Whether Pumice draws outlines and grid itself in viewports that it draws."""
    chosen = _chosen()
    return chosen.true_overlays if chosen is not None else True


def _chosen():
    """The preferences; an extension that was enabled by a script alone has none."""
    return getattr(bpy.context.preferences.addons.get(__package__), "preferences", None)


def register():
    bpy.utils.register_class(PumicePreferences)


def unregister():
    bpy.utils.unregister_class(PumicePreferences)
