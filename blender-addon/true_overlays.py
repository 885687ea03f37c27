# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Takes over the overlays that Blender would draw from the proxy: the outline of selected objects, the floor, the axes and the view plane's grid.

    a 3D viewport that Pumice draws in Rendered     taken: Blender's own flags are off, the artist's wishes are in `Screen.pumice_overlays`
    any other                                       given back: Blender's flags are the wishes, the screen keeps nothing

`object_outline` and `floor_grid` draw what is wished in taken viewports. One function, `sweep`, brings all viewports to the state that they are to
have, whatever happened before: another shading or engine, an area that was split, closed or moved to another window. Blender forbids writes
while it draws, so drawing only notices that a sweep is due.

    a file is saved                 save_pre gives all back, save_post takes again: the file has the artist's settings
    another file is opened          load_pre gives back, since Blender may keep the screens of this one
    a file of an autosave           it has taken flags with the wishes beside them; load_post finds wishes of another run, and gives them back
    a click on Blender's own box    the flag is on in a taken viewport: the wish changes, and the flag is off again

A space has no place for properties, so its entry on the screen is found by its address, and after a load by the place of its area. A copy of a
taken viewport has the flags off and no entry. It is known by its view, which is that of the one it was copied from.
"""

import secrets

import bpy
from bpy.props import BoolProperty, CollectionProperty, IntProperty

from . import preferences
from .reports import log

FLAGS = ("show_outline_selected", "show_floor", "show_axis_x", "show_axis_y", "show_axis_z", "show_ortho_grid")
OFF = dict.fromkeys(FLAGS, False)
# How often taken viewports are looked at, for what no redraw and no message tells: an area that shows another editor, a window that closed.
LOOK_SECONDS = 0.5

# Marks entries of this run and file: addresses of another mean nothing.
_run = secrets.token_hex(4)
# Names of all spaces, and of those taken, at the last sweep.
_known, _taken = set(), set()
# A sweep that fails must not keep the picture away.
_failed = False
_messages = object()


def _redraw(_entry=None, _context=None):
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


class PumiceTakenOverlays(bpy.types.PropertyGroup):
    """The artist's wishes in one taken viewport; `name` says which space, `area` the place of its area on the screen."""

    area: IntProperty()
    show_outline_selected: BoolProperty(
        name="Outline Selected", description="Outline selected objects where Pumice's picture shows them", update=_redraw
    )
    show_floor: BoolProperty(name="Grid Floor", description="Show the ground plane grid, hidden behind Pumice's picture", update=_redraw)
    show_axis_x: BoolProperty(name="X", description="Show the X axis, hidden behind Pumice's picture", update=_redraw)
    show_axis_y: BoolProperty(name="Y", description="Show the Y axis, hidden behind Pumice's picture", update=_redraw)
    show_axis_z: BoolProperty(name="Z", description="Show the Z axis, hidden behind Pumice's picture", update=_redraw)
    show_ortho_grid: BoolProperty(
        name="Grid", description="Show the grid in orthographic side views, behind Pumice's picture", update=_redraw
    )


def decided(flags, wishes, is_wanted):
    """(flags, wishes) that a viewport is to have: from Blender's flags and the wishes that are kept, None where it is not taken; `is_wanted` says
    whether it is to be taken.

    A flag that is on although it was taken was switched by the artist. One alone is a click, or a key that toggles what is seen, and changes
    the wish; several at once come from a script that switches them on."""
    if wishes is not None:
        on = [flag for flag in FLAGS if flags[flag]]
        wishes = {**wishes, **{flag: len(on) > 1 or not wishes[flag] for flag in on}}
    elif not is_wanted:
        return flags, None
    else:
        wishes = flags
    return (OFF, dict(wishes)) if is_wanted else (dict(wishes), None)


def wishes_of(space):
    """The entry of a space that is taken; None of any other."""
    return space.id_data.pumice_overlays.get(name_of(space)) if is_view(space) else None


def name_of(space):
    """The name of a space in this run of Blender, while this file is open."""
    return f"{_run}:{space.as_pointer():x}"


def is_view(space):
    return isinstance(space, bpy.types.SpaceView3D)


def is_rendered(space, scene):
    """Whether Pumice draws the picture of a 3D viewport, and is to draw its overlays."""
    return space.shading.type == "RENDERED" and scene.render.engine == "PUMICE" and preferences.true_overlays()


def awaited(context):
    """Whether a viewport that Pumice draws is about to be taken over: its picture must not be seen with the proxy's overlays until then."""
    space = context.space_data
    if bpy.app.background or not is_view(space) or not is_rendered(space, context.scene) or name_of(space) in _taken:
        return False
    soon()
    return not _failed


def sweep(gives_all_back=False):
    """Brings every viewport to the state that it is to have; writes nothing where all is right."""
    global _known, _taken
    shown = {} if gives_all_back else {window.screen: window.scene for window in bpy.context.window_manager.windows}
    spaces = [
        (screen, place, area, space)
        for screen in bpy.data.screens
        for place, area in enumerate(screen.areas)
        for space in area.spaces
        if is_view(space)
    ]
    names = {name_of(space) for *_, space in spaces}
    kept, of_other_run = {}, {}
    for screen in bpy.data.screens:
        for entry in screen.pumice_overlays:
            wishes = {flag: getattr(entry, flag) for flag in FLAGS}
            if entry.name.startswith(_run):
                kept[entry.name] = wishes
            else:
                of_other_run[screen, entry.area] = wishes
    views = {_view(space): kept[name_of(space)] for *_, space in spaces if name_of(space) in kept}
    wanted, changed = {}, False
    for screen, place, area, space in spaces:
        name, is_active = name_of(space), area.spaces.active == space
        flags = {flag: getattr(space.overlay, flag) for flag in FLAGS}
        wishes = kept.get(name)
        if wishes is None and name not in _known and flags == OFF:
            wishes = of_other_run.get((screen, place)) if is_active else None
            wishes = views.get(_view(space)) if wishes is None else wishes
        is_wanted = is_active and screen in shown and is_rendered(space, shown[screen])
        new_flags, wishes = decided(flags, wishes, is_wanted)
        if wishes is not None:
            wanted.setdefault(screen, []).append((name, place, wishes))
        for flag in FLAGS:
            if new_flags[flag] != flags[flag]:
                setattr(space.overlay, flag, new_flags[flag])
                changed = True
    for screen in bpy.data.screens:
        changed |= _keep(screen, wanted.get(screen, []))
    _known, _taken = names, {name for entries in wanted.values() for name, *_ in entries}
    if changed:
        _redraw()


def _keep(screen, entries):
    """Makes these the entries of a screen; whether they were others."""
    found = screen.pumice_overlays
    if [(one.name, one.area, {flag: getattr(one, flag) for flag in FLAGS}) for one in found] == entries:
        return False
    found.clear()
    for name, place, wishes in entries:
        one = found.add()
        one.name, one.area = name, place
        for flag in FLAGS:
            setattr(one, flag, wishes[flag])
    return True


def _view(space):
    """Position, direction and lens of a view: a copy of a space has the same, another space hardly ever."""
    region = space.region_3d
    if region is None:
        return None
    numbers = (*region.view_location, *region.view_rotation, region.view_distance, space.lens, space.clip_start, space.clip_end)
    return (region.view_perspective, numbers)


def safely(gives_all_back=False):
    """A sweep whose failure goes to the log."""
    global _failed
    try:
        sweep(gives_all_back)
        _failed = False
    except Exception as error:
        _failed = True
        log(error)


def soon():
    """Sweeps when Blender does not draw, before the next redraw."""
    if bpy.app.background:
        return
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    bpy.app.timers.register(_tick, first_interval=0.0, persistent=True)


def _tick():
    safely()
    return LOOK_SECONDS if _taken else None


def _notice():
    """Of each 3D viewport that is drawn, by whichever engine: is it in the state that it is to have?"""
    space, scene = bpy.context.space_data, bpy.context.scene
    name = name_of(space)
    is_taken = name in _taken
    if is_taken:
        is_right = is_rendered(space, scene) and not any(getattr(space.overlay, flag) for flag in FLAGS)
    else:
        is_right = name in _known and not is_rendered(space, scene)
    if not is_right and not _failed:
        soon()


def _rows(self, context):
    """Boxes in the popover *Viewport Overlays* of a taken viewport."""
    entry = wishes_of(context.space_data)
    if entry is None:
        return
    column = self.layout.column()
    column.active = context.space_data.overlay.show_overlays
    # Blender's own boxes stand above, and are off meanwhile.
    column.label(text="True to Pumice's picture:")
    row = column.row(align=True)
    row.prop(entry, "show_ortho_grid")
    row.prop(entry, "show_floor")
    row = column.row(align=True)
    row.label(text="Axes")
    for axis in "xyz":
        row.prop(entry, f"show_axis_{axis}", toggle=True)
    column.prop(entry, "show_outline_selected")


def _message():
    if not bpy.app.background:
        safely()


def _listen():
    """Blender's messages come before the redraw that a change causes."""
    bpy.msgbus.clear_by_owner(_messages)
    keys = [(bpy.types.View3DShading, "type"), (bpy.types.RenderSettings, "engine")]
    keys += [(bpy.types.View3DOverlay, flag) for flag in FLAGS]
    for key in keys:
        bpy.msgbus.subscribe_rna(key=key, owner=_messages, args=(), notify=_message, options={"PERSISTENT"})


@bpy.app.handlers.persistent
def _before_save(*_):
    safely(gives_all_back=True)


@bpy.app.handlers.persistent
def _after_save(*_):
    if not bpy.app.background:
        safely()


@bpy.app.handlers.persistent
def _before_load(*_):
    safely(gives_all_back=True)


@bpy.app.handlers.persistent
def _after_load(*_):
    global _run, _known, _taken
    _run, _known, _taken = secrets.token_hex(4), set(), set()
    # In background mode Pumice draws no viewport, and gives back what the file has taken.
    safely(gives_all_back=bpy.app.background)
    _listen()
    soon()


HANDLERS = (
    (bpy.app.handlers.save_pre, _before_save),
    (bpy.app.handlers.save_post, _after_save),
    (bpy.app.handlers.save_post_fail, _after_save),
    (bpy.app.handlers.load_pre, _before_load),
    (bpy.app.handlers.load_post, _after_load),
    (bpy.app.handlers.load_post_fail, _after_load),
)
_handle = None


def register():
    global _handle
    bpy.utils.register_class(PumiceTakenOverlays)
    bpy.types.Screen.pumice_overlays = CollectionProperty(type=PumiceTakenOverlays, options={"HIDDEN"})
    for handlers, handler in HANDLERS:
        handlers.append(handler)
    bpy.types.VIEW3D_PT_overlay_guides.append(_rows)
    _handle = bpy.types.SpaceView3D.draw_handler_add(_notice, (), "WINDOW", "PRE_VIEW")
    preferences.changed.append(soon)
    _listen()
    soon()


def unregister():
    global _handle
    bpy.msgbus.clear_by_owner(_messages)
    preferences.changed.remove(soon)
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    safely(gives_all_back=True)
    bpy.types.SpaceView3D.draw_handler_remove(_handle, "WINDOW")
    _handle = None
    bpy.types.VIEW3D_PT_overlay_guides.remove(_rows)
    for handlers, handler in reversed(HANDLERS):
        handlers.remove(handler)
    del bpy.types.Screen.pumice_overlays
    bpy.utils.unregister_class(PumiceTakenOverlays)
