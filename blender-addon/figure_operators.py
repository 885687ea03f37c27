# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators of the figure: presets, the size of Output, a scale bar, a legend, and a probe that says what the picture will cost.

    preset    dpi   samples   error   bounces       The size on paper stays.
    Draft     100        64    10 %         4
    Figure    300     4,096     2 %        16
    Final     600    65,536   0.5 %        32
"""

import dataclasses
import math

import bpy
from bpy.props import EnumProperty

from . import active_volume, figure_follow, figure_part, figure_settings, final_render, legend, native, overlay, preferences, registry
from .background import InBackground, Work
from .reports import Refused, log, one_line

# dpi, samples, error in percent, bounces.
VALUES = {"DRAFT": (100, 64, 10.0, 4), "FIGURE": (300, 4096, 2.0, 16), "FINAL": (600, 65536, 0.5, 32)}
PRESETS = (
    ("DRAFT", "Draft", "100 dpi, error 10 %, 4 bounces: for the layout", 0),
    ("FIGURE", "Figure", "300 dpi, error 2 %, 16 bounces: for a screen and most journals", 1),
    ("FINAL", "Final", "600 dpi, error 0.5 %, 32 bounces: for print", 2),
)
# A probe has at most this many pixels, samples and seconds.
PROBE_PIXELS, PROBE_SAMPLES, PROBE_SECONDS = 40_000, 64, 4.0


class _OfFigure:
    """An operator on the figure; its `change` returns what to tell the user."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        try:
            said = self.change(context)
        except Exception as error:
            log(error)
            self.report({"ERROR"}, one_line(error))
            return {"CANCELLED"}
        if said:
            self.report({"INFO"}, said)
        return {"FINISHED"}


class PUMICE_OT_figure_preset(_OfFigure, bpy.types.Operator):
    """Set resolution, samples, error and bounces for a stage of the work. The size on paper stays"""

    bl_idname = "pumice.figure_preset"
    bl_label = "Figure Preset"

    preset: EnumProperty(name="Preset", description="Stage of the work", items=PRESETS, default="FIGURE")

    def change(self, context):
        scene = context.scene
        figure, wishes = scene.pumice_figure, scene.pumice
        if not figure_settings.is_written(scene):
            figure_settings.read_size(scene)
        figure.dpi, wishes.samples, wishes.error_percent, wishes.bounces = VALUES[self.preset]
        wishes.use_error = True
        return size_line(scene)


class PUMICE_OT_figure_size(_OfFigure, bpy.types.Operator):
    """Take the figure's size from Output's resolution, or write it there"""

    bl_idname = "pumice.figure_size"
    bl_label = "Figure Size"

    action: EnumProperty(
        name="Action",
        description="Which of the two follows",
        items=(
            ("WRITE", "Write", "Write the figure's size to Output", 0),
            ("READ", "Read", "Take the size from Output", 1),
        ),
        default="WRITE",
    )

    def change(self, context):
        (figure_settings.write_size if self.action == "WRITE" else figure_settings.read_size)(context.scene)
        context.scene.update_tag()
        return size_line(context.scene)


def _volume(context):
    """The active volume, as `active_volume` finds it. In Output, where the buttons are, Blender's `context.object` is None."""
    return active_volume.belonging(context, context.view_layer.objects.active)


class _AddsPart(_OfFigure):
    @classmethod
    def poll(cls, context):
        if _volume(context) is None:
            cls.poll_message_set(active_volume.MAKE_ACTIVE)
            return False
        if context.scene.camera is None:
            cls.poll_message_set("The scene has no camera; a scale bar and a legend stand in its view")
            return False
        return True

    def made(self, context, obj):
        """Lays out a new part; says what is not right with it."""
        figure_follow.follow(context.scene, context.evaluated_depsgraph_get())
        for line in figure_follow.problems(context.scene):
            self.report({"WARNING"}, line)
        if context.scene.camera.data.dof.use_dof:
            self.report({"WARNING"}, f"{obj.name} stands where the camera is sharp, so the volume may hide it")


class PUMICE_OT_add_scale_bar(_AddsPart, bpy.types.Operator):
    """Add a scale bar for the active volume to the camera's view, which follows both"""

    bl_idname = "pumice.add_scale_bar"
    bl_label = "Add Scale Bar"

    corner: EnumProperty(name="Corner", description="Corner of the picture", items=figure_settings.CORNERS, default="LOWER_RIGHT")

    def change(self, context):
        volume = _volume(context)
        obj = figure_part.create(context, "Scale Bar", "SCALE_BAR", volume)
        obj.pumice_figure.corner = self.corner
        self.made(context, obj)
        if volume.pumice.unit == "unknown":
            self.report({"WARNING"}, f"The file of {volume.name} states no unit; choose that of the scale bar in its panel")


class PUMICE_OT_add_legend(_AddsPart, bpy.types.Operator):
    """Add a legend of the active volume to the camera's view, which follows its label table"""

    bl_idname = "pumice.add_legend"
    bl_label = "Add Legend"

    entries: EnumProperty(
        name="Entries",
        description="What the legend lists",
        items=(
            ("GROUPS", "Groups", "Each group of labels, which is a material slot", 0),
            ("SELECTED", "Selected Labels", "The labels that are selected now", 1),
        ),
        default="GROUPS",
    )
    corner: EnumProperty(name="Corner", description="Corner of the picture", items=figure_settings.CORNERS, default="UPPER_LEFT")

    def change(self, context):
        volume, labels = _volume(context), ""
        if self.entries == "SELECTED":
            labels = legend.selected(volume.pumice.table)
            if not labels:
                raise Refused("No label is selected; search and select those that the legend is to list")
        shown, problems = legend.entries(volume, labels)
        if not shown:
            raise Refused("; ".join(problems) or f"{volume.name} shows no label")
        obj = figure_part.create(context, "Legend", "LEGEND", volume)
        obj.pumice_figure.corner, obj.pumice_figure.labels = self.corner, labels
        self.made(context, obj)


class PUMICE_OT_figure_estimate(InBackground, bpy.types.Operator):
    """Draw the frame small for some seconds, and say how long the whole picture will take and how exact it will be"""

    bl_idname = "pumice.figure_estimate"
    bl_label = "Estimate"

    def invoke(self, context, event):
        self._interactive = True
        return self.execute(context)

    def begin(self, context):
        pumice = native.require()
        parts, _ = final_render.parts_of_frame(context.evaluated_depsgraph_get(), as_rendered=True)
        self._size = parts.film["width"], parts.film["height"]
        small = dataclasses.replace(parts, film=probe_film(parts.film))
        scene, geometries = small.made(pumice), small.geometries()
        wanted, backend = small.wanted(), preferences.backend(context.scene.pumice)

        def call(job):
            volumes = registry.wait_all(wanted, lambda: False)
            limits = {"spp": PROBE_SAMPLES, "seconds": PROBE_SECONDS}
            picture = pumice.render(scene, volumes, meshes=geometries, backend=backend, job=job, **limits)
            return picture, small.film["width"] * small.film["height"]

        return Work("Drawing a probe", call)

    def finish(self, context, result):
        picture, count = result
        scene = context.scene
        scene.pumice_figure.estimate = estimate(picture, count, self._size, final_render.limits(scene.pumice))
        self.report({"INFO"}, scene.pumice_figure.estimate)


def probe_film(film):
    """The film of a probe: the same view in fewer pixels, without passes."""
    share = min(1.0, math.sqrt(PROBE_PIXELS / (film["width"] * film["height"])))
    sides = {side: max(1, round(film[side] * share)) for side in ("width", "height")}
    return {name: value for name, value in {**film, **sides}.items() if name not in {"passes", "cryptomatte_ranks"}}


def estimate(picture, probe_pixels, size, limits):
    """What a picture of this size takes until the first of its limits, from a probe of `probe_pixels` pixels.

    Seconds are in proportion to pixels and samples, and the error to one over the root of the samples. That is not exact: a larger picture
    has smoother pixels, and adaptive sampling ends earlier.
    """
    samples, error = limits["spp"], picture.error_estimate
    if error is None or not math.isfinite(error):
        return "The probe got too few samples to know an error"
    unit_error = error * math.sqrt(picture.spp)
    unit_seconds = picture.seconds / picture.spp * (size[0] * size[1] / probe_pixels)
    if limits["error"]:
        # Samples come in fours, one for each of the independent estimates that the error is found from.
        samples = min(samples, 4 * math.ceil((unit_error / limits["error"]) ** 2 / 4))
    if limits["seconds"]:
        samples = min(samples, max(1, int(limits["seconds"] / unit_seconds)))
    error = overlay.percent(unit_error / math.sqrt(samples))
    wanted = f"{samples:,} samples of {size[0]:,} × {size[1]:,} pixels"
    return f"About {duration(samples * unit_seconds)} for {wanted}, error about {error} (a guess from {picture.spp} samples)"


def duration(seconds):
    """A time for people."""
    if seconds < 90.0:
        return f"{seconds:.2g} s" if seconds < 10.0 else f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{seconds / 3600.0:.1f} h"


def size_line(scene):
    """Size of the picture in pixels and on paper, as Output says it now."""
    width, height = figure_settings.written_pixels(scene.render)
    width_mm, height_mm = figure_settings.size_mm(scene)
    return f"{width:,} × {height:,} pixels, {width_mm:.1f} × {height_mm:.1f} mm at {scene.pumice_figure.dpi} dpi"


CLASSES = (
    PUMICE_OT_figure_preset,
    PUMICE_OT_figure_size,
    PUMICE_OT_add_scale_bar,
    PUMICE_OT_add_legend,
    PUMICE_OT_figure_estimate,
)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
