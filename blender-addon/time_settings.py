# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a volume with several time steps follows the scene's frame: `object.pumice_time`, with the names of Blender's own volume sequences.

The values may be animated, so those of an evaluated object count where there is one.
"""

import bpy
from bpy.props import EnumProperty, IntProperty, PointerProperty

from .time_steps import Playback

MODES = (
    ("CLIP", "Clip", "Nothing is shown before the first and after the last frame", 0),
    ("EXTEND", "Extend", "Hold: the first time step is shown before, the last one after", 1),
    ("REPEAT", "Repeat", "Loop: the time steps begin anew", 2),
    ("PING_PONG", "Ping-Pong", "The time steps run forward and backward in turn", 3),
)
OVERRIDE = {"LIBRARY_OVERRIDABLE"}


def _tag(settings, _context):
    """Tags the object as changed, as Blender does for changes in its panels, but not for those of scripts."""
    settings.id_data.update_tag()


class PumiceTimeSettings(bpy.types.PropertyGroup):
    """How a volume with several time steps is played."""

    time_steps: IntProperty(name="Time Steps", description="Number of time steps of the file; 0 of a volume without time", default=0, min=0, override=OVERRIDE)
    frame_duration: IntProperty(
        name="Frames", description="Number of time steps that are played, from the offset on", default=1, min=1, update=_tag, override=OVERRIDE
    )
    frame_start: IntProperty(
        name="Start", description="Frame of the scene at which the first time step is shown", default=1, update=_tag, override=OVERRIDE
    )
    frame_offset: IntProperty(
        name="Offset",
        description="Time step at which playing begins, counted from 0. With 1 for Frames it is the one that is shown, at every frame",
        default=0,
        min=0,
        update=_tag,
        override=OVERRIDE,
    )
    frame_step: IntProperty(
        name="Step", description="Frames of the scene for which each time step is shown", default=1, min=1, update=_tag, override=OVERRIDE
    )
    sequence_mode: EnumProperty(
        name="Mode", description="What is shown before the first and after the last frame", items=MODES, default="EXTEND", update=_tag, override=OVERRIDE
    )


def is_series(obj):
    """Whether the file of a volume object has several time steps."""
    return obj.pumice_time.time_steps > 1


def playback(obj):
    """How the series of an object is played."""
    of = obj.pumice_time
    return Playback(of.frame_start, of.frame_duration, of.frame_offset, of.frame_step, of.sequence_mode)


def shown(obj, frame):
    """The time step that a volume object shows at a frame; None where it shows nothing, and of a volume without time."""
    return playback(obj).shown(frame, obj.pumice_time.time_steps) if is_series(obj) else None


def nearest(obj, frame):
    """As `shown`, but where the mode shows nothing the nearest time step."""
    return playback(obj).nearest(frame, obj.pumice_time.time_steps) if is_series(obj) else None


def now(scene=None):
    """The frame of a scene, by default of the window's, with subframe and time remapping."""
    return (scene or bpy.context.scene).frame_current_final


def describe(obj, volume, played=None):
    """Notes how many time steps the file of an object has, and how they are played; without `played` as before, and all if all were."""
    of, before = obj.pumice_time, obj.pumice_time.time_steps
    of.time_steps = volume.time_steps or 0
    if played is not None:
        of.frame_start, of.frame_duration, of.frame_offset, of.frame_step, of.sequence_mode = played
    elif before != of.time_steps and of.frame_offset + of.frame_duration == before:
        of.frame_duration = max(1, of.time_steps - of.frame_offset)


def register():
    bpy.utils.register_class(PumiceTimeSettings)
    bpy.types.Object.pumice_time = PointerProperty(type=PumiceTimeSettings, override=OVERRIDE)


def unregister():
    del bpy.types.Object.pumice_time
    bpy.utils.unregister_class(PumiceTimeSettings)
