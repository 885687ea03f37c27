# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""F12: renders the frame of a dependency graph into Blender's passes.

    read the frame ─► open its volumes ─► render, with frames for Blender and ESC meanwhile ─► passes
    scene_reader      registry            render_work, with the renderer of `persistent`       render_result

A cancelled render leaves what there is. In an animation, `persistent` keeps what two frames have in common.
"""

import dataclasses

import bpy

from . import native, oidn, passes, persistent, preferences, provenance, registry, render_result, render_work, scene_reader
from .reports import Refused


def parts_of_frame(depsgraph, as_rendered=False, kept=None):
    """(Parts, what was left out) of the frame that F12 draws; `as_rendered` where the graph is a viewport's, `kept` is a cache of
    `scene_reader`."""
    scene = depsgraph.scene
    size, rect = scene_reader.final_frame(scene.render)
    camera = scene_reader.final_camera(depsgraph, size, rect)
    aspect = scene_reader.pixel_aspect(scene.render)
    film = scene_reader.film(scene, (rect[2] - rect[0], rect[3] - rect[1]), aspect)
    parts, left_out = scene_reader.read(depsgraph, camera, film, kept or scene_reader.Kept(), as_rendered=as_rendered)
    asked = passes.asked_for(depsgraph.view_layer_eval)
    if asked is not None:
        ranks = passes.ranks(depsgraph.view_layer_eval)
        parts = dataclasses.replace(parts, film={**parts.film, "passes": asked, "cryptomatte_ranks": ranks})
    view_layer = depsgraph.view_layer_eval
    return parts, scene_reader.render_warnings(scene, view_layer) + passes.left_out_of(view_layer) + left_out


def limits(wishes):
    """Limits of a final render, which ends at the first that is reached."""
    return {
        "spp": wishes.samples,
        "seconds": wishes.time_seconds if wishes.use_time else None,
        "error": wishes.error_percent / 100.0 if wishes.use_error else None,
    }


def denoiser(wishes):
    """The denoiser of a final render, as `pumice.Renderer.render` takes it."""
    if not wishes.use_denoise:
        return False
    return oidn.name() if wishes.denoiser == "OIDN" else "statistical"


def is_watched():
    """Whether somebody may look at the picture while it renders."""
    return not bpy.app.background


def render(engine, depsgraph):
    """Renders the frame of a dependency graph into an engine's passes."""
    pumice = native.require()
    wishes, view_layer = depsgraph.scene.pumice, depsgraph.view_layer_eval

    # Read the frame.
    engine.update_stats("Pumice", "reading the scene")
    kept = persistent.of(depsgraph.scene, preferences.backend(wishes))
    parts, left_out = parts_of_frame(depsgraph, kept=kept.reading())
    for line in left_out:
        engine.report({"WARNING"}, line)
    scene = parts.made(pumice)

    # Open its volumes.
    volumes = registry.wait_all(parts.wanted(), engine.test_break)
    size = (parts.film["width"], parts.film["height"])
    if engine.test_break():
        render_result.leave_empty(engine, view_layer, size)
        return
    for placed, volume in zip((parts.placed[key] for key in sorted(parts.placed)), volumes):
        if (unfit := placed.unfit(volume)) is not None:
            raise Refused(unfit)
        if placed.differs(volume):
            engine.report({"WARNING"}, placed.differs(volume))

    # Render, and show what there is.
    growing, watched = render_result.Growing(engine, view_layer, size), is_watched()
    shown = dict(denoise=denoiser(wishes), growing=watched, growing_passes=watched and bool(passes.wanted(view_layer)))
    work = render_work.Work(pumice, kept.renderer, scene, volumes, parts.geometries(), limits(wishes), **shown)
    picture = work.watch(engine, growing)
    if picture is None:
        # If there is a coarse frame, it stays.
        if growing.is_empty:
            render_result.leave_empty(engine, view_layer, size)
        return
    for line in picture.notices:
        engine.report({"WARNING"}, line)
    said = provenance.fields(pumice.__version__, scene, volumes, parts.geometries(), picture, wishes.seed)
    render_result.hand_over(engine, view_layer, picture, said | passes.metadata(view_layer, picture, pumice.cryptomatte_hash))
