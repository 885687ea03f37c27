# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a 3D viewport: each viewport has one session, which refines in a thread of the compiled module.

    Blender                         this module                       session (Rust)
    view_update: scene changed ───► sync: parts, edits ─────────────► edit(…) returns at once
    view_draw:   redraw        ───► draw: camera moved? ────────────► edit(camera)
                                    newest frame to a texture ◄────── latest()
    timer, 60 Hz               ───► poll: serial moved? tag a redraw

Nothing here waits, neither for a frame nor for a volume's file. Orbiting causes no view_update, so draw compares the camera itself.
This module keeps no engine object alive: an engine that Blender freed raises ReferenceError in the next poll, which ends its session.
"""

import dataclasses
import os
import time

import bpy

from . import missing_boxes, native, overlay, picture_texture, preferences, registry, scene_reader, time_settings, true_overlays
from .reports import Refused, log, one_line
from .sync import camera as camera_math
from .sync import edits, instances, lens, matrix

ACTIVE_SECONDS = 1.0 / 60.0
# While nothing is computed, only to notice that Blender freed the engine.
RESTING_SECONDS = 0.5
# After edits of labels of which only what the extension wrote was read, when all is read.
OWED_SECONDS = 0.5

_viewports = {}


def of(engine):
    """The viewport of an engine; a new one where there is none. Blender may give a new engine the address of a freed one."""
    key = engine.as_pointer()
    found = _viewports.get(key)
    if found is not None and found.engine is not engine:
        found.close()
        found = None
    if found is None:
        found = _viewports[key] = Viewport(engine, key)
    return found


def of_region(region):
    """The viewport that draws in a region of Blender's window; None where there is none."""
    return next((found for found in _viewports.values() if region is not None and found.region == region), None)


def last_drawn():
    """The viewport that was drawn last; None where there is none."""
    return max(_viewports.values(), key=lambda found: found.drawn_at, default=None)


def close_all():
    """Ends every session."""
    for viewport in list(_viewports.values()):
        viewport.close()


def redraw_all():
    """Makes every viewport read the scene again."""
    for viewport in list(_viewports.values()):
        viewport.tag_update()


class Viewport:
    """The state of one viewport: its session, its parts and its newest frame."""

    def __init__(self, engine, key):
        self.engine = engine
        self.key = key
        self.session = None
        self.sent = None  # the parts as the session has them
        self.numbers = {}  # instance key → number in the session
        self.next_number = 1
        self.limits = None
        self.kept = scene_reader.Kept(styles=instances.Styles(follows_writes=True))
        self._reads_all_at = None  # when all of the label tables is read again
        self.waiting = {}  # instance key → entry that is being opened
        self._waited = {}  # the same before one of them was open
        self.volumes = {}  # instance key → volume that the session shows
        self.frame_read = None  # frame of the scene when it was read last
        self.notes = []
        self.camera_seen = None
        self._missing = []  # what is said of volumes that are not open
        self._undrawn = []  # and where they are
        self.frame = None
        self.texture = picture_texture.PictureTexture()
        self.active = False
        self.region, self.drawn_at = None, 0.0  # where and when it was drawn last
        self.awaits_labels = False
        self._wake()

    # Blender's calls

    def sync(self, context, depsgraph):
        """Reads the scene and sends what differs."""
        scene, styles = depsgraph.scene, self.kept.styles
        self.frame_read = time_settings.now(scene)
        styles.owes_reading, self._reads_all_at = False, None
        try:
            camera, film = view_of(context, depsgraph, self.engine)
            parts, left_out = scene_reader.read(
                depsgraph, camera, film, self.kept, space=getattr(context, "space_data", None)
            )
            parts, volumes = self._opened(parts)
            self._send(parts, volumes, scene.pumice)
            self.volumes = volumes
            registry.hold(self.key, [*parts.sources(), *(entry.file() for entry in self.waiting.values())])
            notes = self._missing + left_out[:1]
        except Exception as error:  # a viewport that raises takes no further updates: say it in the line instead
            log(error)
            notes = [one_line(error)]
        self.notes = notes
        if styles.owes_reading:
            self._reads_all_at = time.monotonic() + OWED_SECONDS
            self._wake()
        self.engine.tag_redraw()

    def draw(self, context, depsgraph):
        """Draws the newest frame, after sending a camera that moved."""
        scene = depsgraph.scene
        status = None
        if self.frame_read is not None and self.frame_read != time_settings.now(scene):
            self.tag_update()
        try:
            self._follow_camera(context, depsgraph)
            self._fetch()
            status = self.session.status if self.session is not None else None
        except Exception as error:
            log(error)
            self.notes = [one_line(error)]
        region = context.region
        self.region, self.drawn_at = region, time.monotonic()
        if self.frame is not None and not true_overlays.awaited(context):
            self.texture.draw(self.engine, scene, self.frame, region.width, region.height)
        missing_boxes.draw(self._boxes(context))
        self.engine.update_stats("Pumice", overlay.line(status, self.frame, self.notes))

    def labels(self):
        """The label film of what the session shows; None until it is there, when it tags a redraw. Never waits."""
        film = self.session.label_film() if self.session is not None else None
        self.awaits_labels = film is None and self.session is not None and self.session.status.error is None
        if self.awaits_labels:
            self._wake()
        return film

    # Between them

    def poll(self):
        """The timer: tags a redraw when there is a new frame; returns the seconds to the next call, or None to end."""
        if _viewports.get(self.key) is not self:
            return None
        try:
            if any(entry.done.is_set() for entry in self.waiting.values()):
                self._waited, self.waiting = self.waiting, {}
                self.engine.tag_update()
            if self._reads_all_at is not None and time.monotonic() >= self._reads_all_at:
                self._reads_all_at = None
                self.engine.tag_update()
            fresh = self._fetch()
            if self.awaits_labels:
                fresh = self.labels() is not None or fresh
            if fresh:
                self.engine.tag_redraw()
            else:
                self.engine.is_preview  # raises ReferenceError when Blender has freed the engine  # noqa: B018
        except ReferenceError:
            self.close()
            return None
        waits = self.waiting or self.awaits_labels or self._reads_all_at is not None
        resting = not waits and (self.session is None or self._state() != "rendering")
        if resting and self.active and not fresh:
            self.active = False
            self.engine.tag_redraw()  # the line says that it is done
        return ACTIVE_SECONDS if self.active else RESTING_SECONDS

    def tag_update(self):
        """Asks Blender for a view_update."""
        try:
            self.engine.tag_update()
        except ReferenceError:
            self.close()

    def close(self):
        """Ends the session; the viewport must not be used again."""
        if _viewports.get(self.key) is self:
            del _viewports[self.key]
        if bpy.app.timers.is_registered(self._tick):
            bpy.app.timers.unregister(self._tick)
        self._stop()
        registry.hold(self.key, ())

    # Inside

    def _opened(self, parts):
        """The parts whose volumes are open, and these volumes; the others are requested, and noted in the line."""
        self._missing, self._undrawn, volumes, ready = [], [], {}, {}
        waited = {**self._waited, **self.waiting}
        self._waited, self.waiting = {}, {}
        still = self.sent.sources() if self.sent is not None else []
        registry.hold(self.key, [*parts.sources(), *still, *(entry.file() for entry in waited.values())])
        for key, placed in parts.placed.items():
            former = waited.get(key) if _is_of_same_file(waited.get(key), placed) else None
            try:
                # One time step at a time: an animation that plays faster than they open shows some of them, instead of none.
                is_opening = former is not None and not former.done.is_set() and former.has(placed.labels())
                entry = former if is_opening else registry.request(*placed.file(), placed.labels())
            except (Refused, native.ModuleMissing) as error:
                self._missing.append(one_line(error))
                self._undrawn.append(placed)
                continue
            if not entry.done.is_set() or entry.time_step != placed.time_step:
                self.waiting[key] = entry
                of_time = "" if placed.time_step is None else f", time step {placed.time_step}"
                self._missing.append(f"opening {os.path.basename(placed.source)}{of_time}")
                self._wake()
                before = self._shown_before(key, placed, former)
                if before is None:
                    self._undrawn.append(placed)
                else:
                    volumes[key], ready[key] = before
            elif entry.error:
                self._missing.append(entry.error)
                self._undrawn.append(placed)
            else:
                if (unfit := placed.unfit(entry.volume)) is not None:
                    self._missing.append(unfit)
                    self._undrawn.append(placed)
                    continue
                # Another object may have reloaded the file, so what is open counts, not what this object was imported from.
                shown = entry.volume.content_hash
                is_known = (placed.content, placed.part) == (shown, entry.part)
                volumes[key], ready[key] = entry.volume, placed if is_known else dataclasses.replace(placed, content=shown, part=entry.part)
                self._missing += filter(None, [placed.differs(entry.volume)])
        return dataclasses.replace(parts, placed=ready), volumes

    def _shown_before(self, key, placed, former):
        """(volume, Placed) that stands for an instance until its time step, or more of its labels, are open, so that nothing flickers: what was opened
        last, in the new place and look, or with the labels that it had; None where there is none. `former` is the entry that was waited for."""
        look = placed
        if former is not None and former.done.is_set() and former.volume is not None and former.has(placed.labels()):
            volume, time_step, part = former.volume, former.time_step, former.part
        else:
            sent = self.sent.placed.get(key) if self.sent is not None else None
            volume = self.volumes.get(key)
            if volume is None or not _stands_for(sent, volume, placed):
                return None
            time_step, part = sent.time_step, sent.part
            if not volume.is_whole:
                look = dataclasses.replace(placed, style=sent.style)
        before = dataclasses.replace(look, time_step=time_step, content=volume.content_hash, part=part)
        return (volume, before) if before.unfit(volume) is None else None

    def _send(self, parts, volumes, wishes):
        """Makes the session show `parts`: starts a new one if its limits differ or it failed, otherwise sends edits."""
        limits = {
            "backend": preferences.backend(wishes),
            "spp": wishes.viewport_samples,
            "error": wishes.error_percent / 100.0 if wishes.use_error else None,
            "denoise": wishes.use_viewport_denoise,
        }
        if self.session is not None and (limits != self.limits or self._state() in {"failed", "stopped"}):
            if limits != self.limits or parts != self.sent:
                self._stop()
        if self.session is None:
            pumice = native.require()
            self.numbers = parts.numbers()
            self.next_number = len(self.numbers) + 1
            scene = parts.made(pumice, self.numbers)
            ordered = sorted(parts.placed, key=self.numbers.__getitem__)
            meshes = parts.geometries(self.numbers)
            self.session = pumice.Session(scene, [volumes[key] for key in ordered], meshes=meshes, **limits)
            self.limits, self.sent, self.frame = limits, parts, None
            self._wake()
            return
        changes = edits.between(self.sent, parts, self.numbers)
        if not changes:
            self.sent = parts
            return
        if changes.edits:
            self.session.edit(*changes.edits)
        pumice = native.require()
        for number, style, visibility_differs, groups_differ in changes.labels:
            visible, groups = style.visible() if visibility_differs else None, style.groups(pumice) if groups_differ else None
            self.session.set_labels(number, visible=visible, groups=groups)
        for key in changes.removed:
            del self.numbers[key]
        for key in changes.added:
            placed, number = parts.placed[key], self.next_number
            self.session.add(placed.instance(number), volumes[key])
            self.numbers[key] = number
            if placed.style.columns is not None:
                self.session.set_labels(number, visible=placed.style.visible(), groups=placed.style.groups(pumice))
            self.next_number += 1
        if changes.cuts_name_added:
            self.session.edit({"edit": "cuts", "cuts": parts.cuts_of(parts.placed, self.numbers)})
        for key in changes.added_meshes:
            if key not in self.numbers:
                self.numbers[key] = self.next_number
                self.next_number += 1
            mesh = parts.meshes[key]
            self.session.add_mesh(mesh.mesh(self.numbers[key]), mesh.geometry)
        self.sent = parts
        self._wake()

    def _boxes(self, context):
        """Lines of the boxes of volumes that are not open."""
        size = (context.region.width, context.region.height)
        view = context.region_data
        ends = []
        for placed in self._undrawn:
            clip_from_world = matrix.times(matrix.rows(view.window_matrix), matrix.rows(view.view_matrix))
            world_from_index = matrix.from_twelve(placed.world_from_index)
            ends += missing_boxes.lines(placed.dims, world_from_index, clip_from_world, size)
        return ends

    def _follow_camera(self, context, depsgraph):
        """Sends camera and film when the view moved since the last draw or update."""
        if self.session is None or self.sent is None:
            return
        seen = (_view_state(context), depsgraph.scene.pumice.filter_pixels)
        if seen == self.camera_seen:
            return
        camera, film = view_of(context, depsgraph, self.engine)
        self.camera_seen = seen
        moved = dataclasses.replace(self.sent, camera=camera, film=film)
        changes = edits.between(self.sent, moved, self.numbers)
        if changes.edits:
            self.session.edit(*changes.edits)
            self.sent = moved
            self._wake()

    def _fetch(self):
        """Takes the newest frame, if there is a newer one."""
        if self.session is None:
            return False
        newer = self.session.latest(self.frame.serial if self.frame is not None else 0)
        if newer is None:
            return False
        self.frame = newer
        return True

    def _state(self):
        return self.session.status.state

    def _wake(self):
        """Polls at full rate again. A timer that already does is left alone: registering it again would delay it at each redraw."""
        if self.active:
            return
        self.active = True
        if not hasattr(self, "_tick"):
            self._tick = lambda: self.poll()
        if bpy.app.timers.is_registered(self._tick):
            bpy.app.timers.unregister(self._tick)
        bpy.app.timers.register(self._tick, first_interval=ACTIVE_SECONDS, persistent=True)

    def _stop(self):
        if self.session is not None:
            self.session.stop()
        self.session, self.sent, self.frame, self.awaits_labels = None, None, None, False
        self.numbers, self.camera_seen = {}, None
        self.volumes = {}


def _is_of_same_file(one, placed):
    """Whether an entry of the registry or a Placed is a time step of the file of which another Placed is one; `one` may be None."""
    return one is not None and one.file()[0] == placed.source and None not in (one.time_step, placed.time_step)


def _stands_for(sent, volume, placed):
    """Whether a volume, as it was sent, may be drawn until that of `placed` is open: another time step of its file, or fewer labels of it."""
    return _is_of_same_file(sent, placed) or (sent is not None and sent.file() == placed.file() and not volume.is_whole)


def view_of(context, depsgraph, engine):
    """(camera, film) of a viewport; in a camera view with the camera's depth of field."""
    scene = depsgraph.scene
    region, view = context.region, context.region_data
    pixel = max(1, engine.get_preview_pixel_size(scene))
    size = (max(1, round(region.width / pixel)), max(1, round(region.height / pixel)))
    clip, aperture = (context.space_data.clip_start, context.space_data.clip_end), None
    camera = context.space_data.camera if view.view_perspective == "CAMERA" else None
    if camera is not None and camera.type == "CAMERA":
        camera = camera.evaluated_get(depsgraph)
        data = lens.require_flat(camera)
        clip, aperture = (data.clip_start, data.clip_end), lens.aperture(camera, depsgraph)
    world_from_view = matrix.inverse_rigid(matrix.rows(view.view_matrix))
    seen = camera_math.from_window(
        world_from_view, matrix.rows(view.window_matrix), clip=clip, size=size, aperture=aperture
    )
    return seen, scene_reader.film(scene, size)


def _view_state(context):
    """A value that is cheap to compute and changes when the view moves."""
    view, region, space = context.region_data, context.region, context.space_data
    numbers = [value for row in view.view_matrix for value in row]
    numbers += [value for row in view.window_matrix for value in row]
    return (tuple(numbers), region.width, region.height, space.clip_start, space.clip_end)


@bpy.app.handlers.persistent
def _before_load(*_):
    close_all()


def register():
    bpy.app.handlers.load_pre.append(_before_load)
    preferences.changed.append(redraw_all)


def unregister():
    preferences.changed.remove(redraw_all)
    bpy.app.handlers.load_pre.remove(_before_load)
    close_all()
