# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""F12: renders the scene with the compiled module and copies the finished picture to Blender's passes.

The render runs in a thread of its own with the interpreter released; the main thread asks Blender every few hundredths of a second
whether the user has cancelled. Pixels are copied with `foreach_set`, which takes 0.02 s for a full-HD picture; assigning `rect` takes
1.5 s.

    Combined    RGBA    scene-linear, times coverage
    others      as `passes` lists them; rows from the bottom, as Blender's are
"""

import dataclasses
import math
import threading

import numpy as np

from . import native, overlay, passes, preferences, provenance, registry, scene_reader
from .reports import Refused

def parts_of_frame(depsgraph, as_rendered=False, make_mesh=None):
    """(Parts, what was left out) of the frame that F12 draws; `as_rendered` where the graph is a viewport's, `make_mesh` as for
    `meshes.Geometries`."""
    scene = depsgraph.scene
    size, rect = scene_reader.final_frame(scene.render)
    camera = scene_reader.final_camera(depsgraph, size, rect)
    aspect = scene_reader.pixel_aspect(scene.render)
    film = scene_reader.film(scene, (rect[2] - rect[0], rect[3] - rect[1]), aspect)
    parts, left_out = scene_reader.read(depsgraph, camera, film, scene_reader.Kept(make_mesh), as_rendered=as_rendered)
    asked = passes.asked_for(depsgraph.view_layer_eval)
    if asked is not None:
        ranks = passes.ranks(depsgraph.view_layer_eval)
        parts = dataclasses.replace(parts, film={**parts.film, "passes": asked, "cryptomatte_ranks": ranks})
    return parts, scene_reader.render_warnings(scene, depsgraph.view_layer_eval) + left_out


def limits(wishes):
    """Limits of a final render, which ends at the first that is reached."""
    return {
        "spp": wishes.samples,
        "seconds": wishes.time_seconds if wishes.use_time else None,
        "error": wishes.error_percent / 100.0 if wishes.use_error else None,
    }


def render(engine, depsgraph):
    """Renders the frame of a dependency graph into an engine's passes."""
    pumice = native.require()
    wishes = depsgraph.scene.pumice
    engine.update_stats("Pumice", "reading the scene")
    parts, left_out = parts_of_frame(depsgraph)
    for line in left_out:
        engine.report({"WARNING"}, line)
    scene = parts.made(pumice)
    volumes = [registry.wait(source, engine.test_break) for source in parts.sources()]
    if engine.test_break():
        return
    for placed, volume in zip((parts.placed[key] for key in sorted(parts.placed)), volumes):
        if placed.differs(volume):
            engine.report({"WARNING"}, placed.differs(volume))

    work = Work(pumice, scene, volumes, parts.geometries(), preferences.backend(wishes), limits(wishes))
    picture = work.watch(engine)
    if picture is not None:
        for line in picture.notices:
            engine.report({"WARNING"}, line)
        hand_over(engine, depsgraph.view_layer_eval, picture)
        said = provenance.fields(pumice.__version__, scene, volumes, parts.geometries(), picture, wishes.seed)
        said |= passes.metadata(depsgraph.view_layer_eval, picture, pumice.cryptomatte_hash)
        for key, value in said.items():
            # On the result of `begin_result` it would be lost.
            engine.get_result().stamp_data_add_field(key, value)


class Work:
    """A render in a thread of its own."""

    def __init__(self, pumice, scene, volumes, meshes, backend, stop):
        self.pumice, self.stop = pumice, stop
        self.job = pumice.Job()
        self.point = None
        self.picture = self.error = None
        arguments = dict(meshes=meshes, backend=backend, job=self.job, on_progress=self._progress, **stop)
        self.thread = threading.Thread(target=self._run, args=(scene, volumes, arguments), name="pumice render")
        self.thread.start()

    def _run(self, scene, volumes, arguments):
        try:
            self.picture = self.pumice.render(scene, volumes, **arguments)
        except BaseException as error:  # raised again in `watch`
            self.error = error

    def _progress(self, point):
        self.point = point

    def watch(self, engine):
        """The picture, or None when the user cancelled; raises what the render raised."""
        while self.thread.is_alive():
            self.thread.join(0.05)
            if engine.test_break():
                self.job.cancel()
            if self.point is not None:
                engine.update_progress(self._fraction(self.point))
                engine.update_stats("Pumice", progress_line(self.point, self.stop))
        if isinstance(self.error, self.pumice.Cancelled):
            return None
        if self.error is not None:
            raise self.error
        return self.picture

    def _fraction(self, point):
        """Progress towards the nearest limit, 0 to 1. Error falls with the root of the samples."""
        reached = [point.spp / self.stop["spp"]]
        if self.stop["seconds"]:
            reached.append(point.seconds / self.stop["seconds"])
        if self.stop["error"] and point.error_estimate:
            reached.append((self.stop["error"] / point.error_estimate) ** 2)
        return min(1.0, max(reached))


def progress_line(point, stop):
    """The status text while it renders."""
    said = f"sample {point.spp} of {stop['spp']}"
    if point.error_estimate is not None and math.isfinite(point.error_estimate):
        said += f" · error {overlay.percent(point.error_estimate)}"
    return f"{said} · {point.seconds:.1f} s"


def hand_over(engine, view_layer, picture):
    """Fills the passes of the engine's result."""
    height, width = picture.color.shape[:2]
    # A pass of our own must be added before the result is begun, or the result lacks it.
    result = engine.begin_result(0, 0, width, height, layer=view_layer.name)
    try:
        layer = result.layers[0]
        combined = np.ones((height, width, 4), dtype=np.float32)
        combined[..., :3] = picture.color
        if picture.alpha is not None:
            combined[..., 3] = picture.alpha
        _fill(layer, "Combined", combined)
        for one in passes.wanted(view_layer):
            pixels = one.pixels(picture)
            if not pixels:
                engine.report({"WARNING"}, f"The picture has no pass {one.in_blender}; it is left empty")
            for name, plane in zip(one.names(view_layer), pixels):
                if name in layer.passes:
                    _fill(layer, name, plane)
    finally:
        engine.end_result(result)


def _fill(layer, name, pixels):
    """Copies pixels, rows from the top, into a pass."""
    target = layer.passes[name]
    flat = np.ascontiguousarray(pixels[::-1], dtype=np.float32).ravel()
    expected = len(target.rect) * target.channels
    if flat.size != expected:
        raise Refused(f"Pass {name}: Blender expects {expected} values, the picture has {flat.size}")
    target.rect.foreach_set(flat)
