# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mocks of objects that exist only with a window, and of the compiled module.

`Engine` and `Context` mock Blender's side of a viewport. `Module` mocks the compiled module with a session that only records calls, for
tests of edits and failures; pictures are tested with the real module.
"""

import copy
import json
import threading
import types
import zlib

import numpy as np


class Engine:
    """The part of a viewport's RenderEngine that the extension uses."""

    def __init__(self, address=4711):
        self.address, self.freed = address, False
        self.redraws = self.updates = 0
        self.line = ""
        self.reports = []

    def _alive(self):
        if self.freed:
            raise ReferenceError("StructRNA of type PumiceRenderEngine has been removed")

    def as_pointer(self):
        self._alive()
        return self.address

    @property
    def is_preview(self):
        self._alive()
        return False

    def tag_redraw(self):
        self._alive()
        self.redraws += 1

    def tag_update(self):
        self._alive()
        self.updates += 1

    def update_stats(self, _title, line):
        self._alive()
        self.line = line

    def get_preview_pixel_size(self, _scene):
        return 1

    def report(self, kind, line):
        self.reports.append((kind, line))

    def bind_display_space_shader(self, _scene):
        pass

    def unbind_display_space_shader(self):
        pass


class Context(types.SimpleNamespace):
    """A 3D viewport that looks through a camera object."""

    def __init__(self, bpy, size=(96, 64)):
        depsgraph = bpy.context.evaluated_depsgraph_get()
        camera = bpy.context.scene.camera
        super().__init__(
            region=types.SimpleNamespace(width=size[0], height=size[1]),
            region_data=types.SimpleNamespace(
                view_perspective="PERSP",
                view_matrix=camera.matrix_world.normalized().inverted(),
                window_matrix=camera.calc_matrix_camera(depsgraph, x=size[0], y=size[1]),
            ),
            space_data=types.SimpleNamespace(
                clip_start=camera.data.clip_start, clip_end=camera.data.clip_end, camera=camera
            ),
        )

    def look(self, camera):
        """Moves the view to a camera object."""
        self.region_data.view_matrix = camera.matrix_world.normalized().inverted()


class Texture:
    """Replaces the texture, and records what would have been drawn."""

    def __init__(self):
        self.drawn = []

    def draw(self, _engine, _scene, frame, width, height):
        self.drawn.append((frame, width, height))


class Module:
    """The part of the compiled module that the extension uses."""

    __version__ = "0.0.0"

    class PumiceError(Exception):
        pass

    class InputError(PumiceError, ValueError):
        pass

    class PumiceWarning(UserWarning):
        pass

    class Cancelled(PumiceError):
        pass

    class InternalError(PumiceError):
        pass

    class Job:
        def __init__(self):
            self.cancelled, self.fraction = False, None

        def cancel(self):
            self.cancelled = True

    class Mesh:
        """Keeps its arrays."""

        content_hash = "1" * 32

        def __init__(self, positions, triangles, materials=None, *, normals=None):
            self.positions, self.triangles, self.materials, self.normals = positions, triangles, materials, normals

    class LabelGroups:
        """Keeps its columns."""

        def __init__(self, ids, groups, colors, materials, *, colored=None):
            self.ids, self.groups, self.colors = np.array(ids), np.array(groups), np.array(colors)
            self.materials, self.colored = list(materials), list(colored)

        def with_colors(self, ids, colors):
            changed = copy.deepcopy(self)
            changed.colors[np.searchsorted(self.ids, ids)] = colors
            changed.sent = len(ids)
            return changed

    class Scene:
        def __init__(self, value, labels=None):
            self.value, self.labels = value, labels or {}

        @classmethod
        def from_dict(cls, value):
            return cls(copy.deepcopy(value))

        def to_json(self):
            return json.dumps(self.value)

        def with_labels(self, instance, *, visible=None, groups=None):
            return type(self)(self.value, {**self.labels, instance: (visible, groups)})

    class Session:
        made = []

        def __init__(self, scene, volumes, meshes=(), backend="auto", spp=None, error=None, denoise=False):
            self.scene, self.volumes, self.limits = scene.value, list(volumes), (backend, spp, error)
            self.labels = scene.labels
            self.denoise = denoise
            self.meshes = list(meshes)
            self.edits, self.frame = [], None
            self.status = types.SimpleNamespace(state="rendering", error=None, backend="cpu", device="Processor", compiling=None, notices=[], revision=1)
            type(self).made.append(self)

        def edit(self, *edits):
            self.edits += edits

        def set_labels(self, instance, *, visible=None, groups=None):
            for name, value in (("visible", visible), ("groups", groups)):
                if value is not None:
                    self.edits.append({"edit": name, "id": instance, name: value})

        def add(self, instance, volume):
            self.edits.append({"edit": "add", "instance": instance})
            self.volumes.append(volume)

        def add_mesh(self, fields, mesh):
            self.edits.append({"edit": "add_mesh", "mesh": fields})
            self.meshes.append(mesh)

        def latest(self, after=0):
            return self.frame if self.frame is not None and self.frame.serial > after else None

        def show(self, serial, **over):
            fields = dict(serial=serial, spp=serial, error_estimate=float("inf"), seconds=0.1, width=4, height=2, filtered=False)
            self.frame = types.SimpleNamespace(**{**fields, **over})

        def stop(self):
            self.status.state = "stopped"

    def __init__(self):
        self.Session.made = []
        self.may_open = threading.Event()
        self.may_open.set()
        self.renders, self.notices, self.alpha = [], [], None
        self.during_render = lambda job, on_progress: None
        self.renderers, self.has_samples = [], True

    def open(self, path, labels=None, job=None):
        assert self.may_open.wait(10)
        if labels is None:
            return Volume(path)
        return Part(self, path, labels)

    def is_on_server(self, path):
        return "://" in path

    def probe(self, path, job=None, **choice):
        return {"warnings": []}

    def compress(self, source, job=None, **choice):
        return Volume(source)

    def Renderer(self, *, backend="auto"):  # noqa: N802 (a class of the module)
        self.renderers.append(Renderer(self, backend))
        return self.renderers[-1]

    def render(self, scene, volumes, meshes=(), job=None, on_progress=None, unfinished=False, denoise=False, **limits):
        """A picture in which every pixel of every pass has a different value."""
        self.renders.append((scene.value, list(volumes), limits))
        self.during_render(job, on_progress)
        if job.cancelled and not unfinished:
            raise self.Cancelled("cancelled")
        width, height = scene.value["film"]["width"], scene.value["film"]["height"]
        at = np.arange(width * height, dtype=np.float32).reshape(height, width)
        depth = at + 0.5
        depth[0, 0] = np.inf
        passes = {"depth": depth, "label": at.astype(np.uint32) + 7}
        for place, name in enumerate(("albedo", "normal", "variance", "position", "diffuse_direct", "environment", "shadow_catcher")):
            passes[name] = np.stack([at + place, at * 2 + place, at * 3 + place], axis=2)
        color = np.stack([at, at * 2, at * 3], axis=2)
        manifests = {}
        for name, matte in (("cryptomatte_label", "17"), ("cryptomatte_type", 'a "type" ß')):
            if name in scene.value["film"].get("passes", []):
                ranks = np.arange(scene.value["film"]["cryptomatte_ranks"], dtype=np.float32)
                passes[name] = at[:, :, None, None] + np.stack([ranks, ranks / 128], axis=1)
                manifests[name] = {matte: 0x0123ABCD}
        notices = list(self.notices)
        made = dict(backend="cpu", mean_spp=4.0, error_estimate=0.0123, notices=notices, noisy=None, denoised=None)
        if denoise:
            made |= dict(noisy=color + np.float32(0.25), denoised="statistical, biased")
        return types.SimpleNamespace(color=color, alpha=self.alpha, passes=passes, manifests=manifests, **made)

    def cryptomatte_hash(self, name):
        """A hash that differs from the real one and has as many digits."""
        return zlib.crc32(name.encode())


class Renderer:
    """The module's renderer, whose pictures are those of `Module.render`; `show` publishes a frame."""

    def __init__(self, module, backend):
        self.module, self.backend, self.frame, self.growing = module, backend, None, None
        self.growing_passes = self.so_far = None

    def render(self, scene, volumes, *, growing=False, growing_passes=False, unfinished=False, **arguments):
        self.growing, self.growing_passes = growing, growing_passes
        return self.module.render(scene, volumes, backend=self.backend, unfinished=unfinished and self.module.has_samples, **arguments)

    def latest(self, after=0):
        return self.frame if self.frame is not None and self.frame.serial > after else None

    def take_so_far(self):
        taken, self.so_far = self.so_far, None
        return taken

    def show(self, serial, pixels, coarse=False):
        self.frame = Frame(np.asarray(pixels, dtype=np.float32), serial, coarse)


class Frame:
    """A frame, which numpy reads: rows from the bottom."""

    def __init__(self, pixels, serial, coarse):
        self.pixels, self.serial, self.coarse = pixels, serial, coarse
        self.height, self.width = pixels.shape[:2]

    def __array__(self, dtype=None, copy=None):
        return self.pixels


class Labels:
    """A label table with the interface of the module's."""

    def __init__(self, ids, names=None, colors=None, types_=None):
        self.ids = np.array(ids, dtype=np.uint64)
        count = len(ids)
        self.names = names or [""] * count
        self.voxels = np.arange(1, count + 1, dtype=np.uint64) ** 2
        self.low = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
        self.high = self.low + 4
        self.types = types_ or [""] * count
        self.colors = np.full((count, 3), np.nan, dtype=np.float32) if colors is None else np.float32(colors)

    def auto_colors(self):
        return np.linspace(0.1, 0.9, 3 * len(self.ids), dtype=np.float32).reshape(-1, 3)


class Volume:
    """A volume of 64³ voxels with three labels, one of them large."""

    def __init__(self, path="", world=None):
        self.path = path
        self.dims, self.spacing, self.unit = (64, 64, 32), (16.0, 16.0, 40.0), "nm"
        self.world_from_index = np.diag([16.0, 16.0, 40.0, 1.0]) if world is None else np.array(world, dtype=float)
        self.content_hash = "0" * 32
        self.time_step = self.time_steps = self.memory = None
        self.labels = Labels([3, 17, 98340797 + 2**33])

        self.is_whole = True

    def coarse_surface(self, visible, most_faces, job=None):
        """A cube of 16 voxels for each label that is visible, at 0, 16 and 48."""
        rows = np.flatnonzero(visible)
        corners = np.array([[bit & 1, bit >> 1 & 1, bit >> 2] for bit in range(8)])
        low = np.array([[0, 0, 0], [16, 16, 16], [48, 48, 16]])[rows]
        vertices = (low[:, None] + 16 * corners[None]).reshape(-1, 3).astype(np.float32)
        sides = np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]], dtype=np.uint32)
        quads = (8 * np.arange(len(rows), dtype=np.uint32)[:, None, None] + sides[None]).reshape(-1, 4)
        return types.SimpleNamespace(vertices=vertices, quads=quads, labels=np.repeat(rows, 6).astype(np.uint32), cell=(16, 16, 16))


class Part(Volume):
    """A volume of which some labels were read: `read`, their ids."""

    def __init__(self, module, path, labels):
        super().__init__(path)
        self.module, self.read = module, set(np.asarray(labels).tolist())
        self.is_whole = self.read == set(self.labels.ids.tolist())

    def with_labels(self, labels, job=None):
        assert self.module.may_open.wait(10)
        return Part(self.module, self.path, [*self.read, *np.asarray(labels).tolist()])
