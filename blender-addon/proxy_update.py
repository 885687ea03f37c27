# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps the proxies of volumes up to date with their label tables.

    in a window         a change of the scene ──► timer, 0.1 s: stamps differ? ──► thread: surface ──► timer: writes the mesh
                                                                 only colors or groups: written at once
    in background mode  at the import, by `pumice.update_proxy`, and before another engine renders: timers do not run there

The proxy of a volume with several time steps is of the one that the scene's frame shows. While an animation plays, a surface that is being
made is finished and written before the next is begun. In background mode each frame that another engine renders gets its own; in a window a
render runs in a thread that may not write meshes.

What is written this way is no undo step of its own: undo brings a table back, and its proxy follows.
"""

import threading

import bpy

from . import file_paths, native, proxy, proxy_material, registry, time_settings, volume_place
from .background import InBackground, Work
from .properties import is_volume
from .reports import Refused, log

SECONDS = 0.1

# Surfaces that are being made, by the session_uid of their mesh: (what is wanted, work).
_making = {}


def refresh(obj, volume, object_from_index=None):
    """Makes the proxy of an object up to date, at once; `volume` is its open volume. `object_from_index` as for `proxy.write`, which is then
    done in any case."""
    wanted = proxy.Wanted(obj)
    if volume.time_step != wanted.time_step:
        volume = registry.wait_for(registry.request_shown(obj), lambda: False)
    if object_from_index is not None or not wanted.has_shape(obj.data):
        proxy.write(obj, wanted, wanted.surface(volume), object_from_index)
    elif not wanted.has_colors(obj.data):
        proxy.write_colors(obj, wanted)
    follow_materials(obj)


def follow_materials(obj):
    """Makes the materials of an object show label colors, or not, as they say."""
    for slot in obj.material_slots:
        proxy_material.follow(slot.material)


def refresh_all():
    """Makes all proxies up to date, at once. A volume whose file is missing keeps the proxy that it has."""
    for obj in _volumes():
        try:
            refresh(obj, registry.wait_for(registry.request_shown(obj), lambda: False))
        except (Refused, native.ModuleMissing) as error:
            log(error)


def _follow_frame(scene, depsgraph):
    """Makes the proxies of volumes with several time steps those of a frame that is being rendered, in background mode."""
    for obj in filter(time_settings.is_series, _volumes()):
        try:
            wanted = proxy.Wanted(obj, obj.evaluated_get(depsgraph), time_settings.now(scene))
            if not wanted.has_shape(obj.data):
                volume = registry.wait(file_paths.find(obj)[0], lambda: False, wanted.time_step, wanted.labels())
                proxy.write(obj, wanted, wanted.surface(volume))
        except (Refused, native.ModuleMissing) as error:
            log(error)


class PUMICE_OT_update_proxy(InBackground, bpy.types.Operator):
    """Make the proxies of the selected volumes from the labels that are shown now. In a window this happens by itself"""

    bl_idname = "pumice.update_proxy"
    bl_label = "Update Proxy"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        if _chosen(context):
            return True
        cls.poll_message_set("Select an object that was imported as a label volume")
        return False

    def invoke(self, context, event):
        self._interactive = True
        return self.execute(context)

    def begin(self, context):
        self.chosen = [(obj, proxy.Wanted(obj)) for obj in _chosen(context)]
        calls = [_call(obj, wanted) for obj, wanted in self.chosen]
        return Work("Making proxies", lambda job: [call(job) for call in calls])

    def finish(self, context, result):
        for (obj, wanted), surface in zip(self.chosen, result):
            proxy.write(obj, wanted, surface)
            follow_materials(obj)
            self.report({"INFO"}, f"{obj.name}: {len(surface.quads)} faces, cells of {' × '.join(map(str, surface.cell))} voxels")


def _chosen(context):
    chosen = [obj for obj in context.selected_objects if is_volume(obj)]
    if not chosen and context.object is not None and is_volume(context.object):
        chosen = [context.object]
    return [obj for obj in chosen if _has_proxy(obj)]


def _volumes():
    """An object for each proxy of the file that can be written."""
    by_mesh = {obj.data: obj for obj in bpy.data.objects if is_volume(obj) and _has_proxy(obj)}
    return list(by_mesh.values())


def _has_proxy(obj):
    """Whether an object has a proxy that may be written: not while it is edited, not where its data is another file's, and not where it
    does not tell its place any more, which *Not Drawn* says."""
    return obj.pumice.table is not None and obj.mode != "EDIT" and obj.data.library is None and volume_place.fit(obj.data) is not None


def _tick():
    """The timer: begins and ends the making of surfaces; returns the seconds to the next call, or None where nothing is left to do."""
    seen = set()
    for obj in _volumes():
        seen.add(obj.data.session_uid)
        try:
            _step(obj)
        except Exception as error:  # one volume must not keep the others from being updated
            log(error)
            _making.pop(obj.data.session_uid, None)
    for gone in set(_making) - seen:
        _making.pop(gone)[1].job.cancel()
    return SECONDS if _making else None


def _step(obj):
    mesh, wanted = obj.data, proxy.Wanted(obj)
    key = mesh.session_uid
    if key in _making and (wanted.has_shape(mesh) or _making[key][0].still_stamp != wanted.still_stamp):
        _making.pop(key)[1].job.cancel()
    if wanted.has_shape(mesh):
        if not wanted.has_colors(mesh):
            proxy.write_colors(obj, wanted)
        follow_materials(obj)
    elif key not in _making:
        _making[key] = (wanted, Work("Making a proxy", _call(obj, wanted)))
    elif not _making[key][1].thread.is_alive():
        made, work = _making.pop(key)
        if work.error is not None:
            # Until something changes it is not tried again: a volume that is missing stays so.
            log(work.error)
            return
        proxy.write(obj, made, work.result)
        follow_materials(obj)
        if not wanted.has_shape(mesh):
            # The frame has changed meanwhile.
            _making[key] = (wanted, Work("Making a proxy", _call(obj, wanted)))


def _call(obj, wanted):
    """What a thread does to make the surface that is wanted; Refused where the volume's file is missing."""
    entry = registry.request(file_paths.find(obj)[0], wanted.time_step, wanted.labels())

    def call(job):
        volume = registry.wait_for(entry, lambda: job.cancelled)
        if volume is None:
            raise native.require().Cancelled("cancelled")
        return wanted.surface(volume, job)

    return call


@bpy.app.handlers.persistent
def _after_edit(_scene, depsgraph):
    # What only moves has the same proxy.
    if any(update.is_updated_geometry or update.is_updated_shading for update in depsgraph.updates):
        _after_change()


@bpy.app.handlers.persistent
def _after_change(*_):
    if not bpy.app.background and not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=SECONDS)


# Whether another engine renders, in background mode.
_renders_by_others = False


@bpy.app.handlers.persistent
def _before_render(scene, *_):
    global _renders_by_others
    # In a window the timer has done it, and a render runs in a thread that may not write meshes.
    if bpy.app.background and scene.render.engine != "PUMICE":
        _renders_by_others = True
        refresh_all()


@bpy.app.handlers.persistent
def _after_render(*_):
    global _renders_by_others
    _renders_by_others = False


@bpy.app.handlers.persistent
def _after_frame(scene, depsgraph):
    if _renders_by_others:
        _follow_frame(scene, depsgraph)
    elif threading.current_thread() is threading.main_thread():
        _after_change()


HANDLERS = (
    ("depsgraph_update_post", _after_edit),
    ("frame_change_post", _after_frame),
    ("load_post", _after_change),
    ("undo_post", _after_change),
    ("redo_post", _after_change),
    ("render_init", _before_render),
    ("render_complete", _after_render),
    ("render_cancel", _after_render),
)


def register():
    bpy.utils.register_class(PUMICE_OT_update_proxy)
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister():
    for name, handler in reversed(HANDLERS):
        getattr(bpy.app.handlers, name).remove(handler)
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    for _, work in _making.values():
        work.job.cancel()
    _making.clear()
    bpy.utils.unregister_class(PUMICE_OT_update_proxy)
