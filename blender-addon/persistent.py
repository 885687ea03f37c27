# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What final renders keep from one frame of an animation to the next, until the render job ends or another file is opened.

    volumes             stay open for the whole process, see `registry`
    renderer            a `pumice.Renderer` for each scene: hierarchies, tables, the device with its programs
    styles of labels    read again, and the same object where they are equal
    triangles           read again, and the same `pumice.Mesh` where they are equal, so that its hierarchy is kept

Everything is read anew for each frame: Blender makes the dependency graph of a render for each of them, whose data have other addresses. What is
equal is found by content, so a frame cannot show what an earlier one had.
"""

import hashlib

import bpy
import numpy as np

from . import native, scene_reader


class Kept:
    """What is kept for one scene and backend."""

    def __init__(self, backend):
        self.backend = backend
        self.renderer = native.require().Renderer(backend=backend)
        self._meshes, self._styles = Meshes(), None

    def reading(self):
        """A cache for `scene_reader.read`, for the next frame."""
        self._meshes.next_frame()
        reading = scene_reader.Kept(self._meshes, self._styles)
        self._styles = reading.styles
        return reading


class Meshes:
    """Makes meshes; of arrays that an earlier frame had, it returns that frame's mesh."""

    def __init__(self):
        self._former, self._made = {}, {}

    def next_frame(self):
        """A frame begins: forgets what the last one did not use."""
        self._former, self._made = self._made, {}

    def __call__(self, *arrays, **more):
        content = hashlib.blake2b(digest_size=16)
        for name, array in [*(("", array) for array in arrays), *sorted(more.items())]:
            content.update(f"{name}{array.dtype.str}{array.shape}".encode())
            content.update(np.ascontiguousarray(array).data)
        key = content.digest()
        for known in (self._made, self._former):
            if key in known:
                self._made[key] = known[key]
                return known[key]
        self._made[key] = native.require().Mesh(*arrays, **more)
        return self._made[key]


_kept = {}


def of(scene, backend):
    """What is kept for a scene; new where nothing is, or where another backend is to draw."""
    key = scene.original.session_uid
    kept = _kept.get(key)
    if kept is None or kept.backend != backend:
        kept = _kept[key] = Kept(backend)
    return kept


def drop(*_):
    """Forgets everything. Blender calls it when a render job ends."""
    _kept.clear()


# Blender removes other handlers when it opens a file.
_at_end = bpy.app.handlers.persistent(drop)
_ENDS = ("render_complete", "render_cancel", "load_pre")


def register():
    for end in _ENDS:
        getattr(bpy.app.handlers, end).append(_at_end)


def unregister():
    for end in _ENDS:
        getattr(bpy.app.handlers, end).remove(_at_end)
    drop()
