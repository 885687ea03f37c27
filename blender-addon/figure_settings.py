# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The figure of a scene: its size on paper, and what stands in it. These settings write Blender's own, so nothing is hidden.

    width_mm, height_mm, dpi ──► resolution_x, resolution_y in Output; resolution_percentage 100; square pixels
                                 and since Blender 5.0 the pixel density of the file

    pixels = mm / 25.4 · dpi, rounded; a size that was read back is therefore right to half a pixel

`scene.pumice_figure` are the settings of the scene, `object.pumice_figure` those of a scale bar or a legend.
"""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, IntProperty, PointerProperty, StringProperty

from .properties import is_volume

MM_PER_INCH = 25.4
# Of Blender's resolution.
LEAST_PIXELS, MOST_PIXELS = 4, 65536

CORNERS = (
    ("LOWER_LEFT", "Lower Left", "", 0),
    ("LOWER_RIGHT", "Lower Right", "", 1),
    ("UPPER_LEFT", "Upper Left", "", 2),
    ("UPPER_RIGHT", "Upper Right", "", 3),
)
PLANES = (
    ("MIDDLE", "Middle", "The bar is true for what lies as far from the camera as the middle of the volume", 0),
    ("FRONT", "Front", "The bar is true for what lies as far from the camera as the nearest corner of the volume", 1),
    ("DISTANCE", "Distance", "The bar is true for what lies at a distance from the camera", 2),
)
UNITS = (
    ("FILE", "As the File", "The unit that the volume's file states", 0),
    ("nm", "Nanometers", "Lengths of the file are nanometers", 1),
    ("um", "Micrometers", "Lengths of the file are micrometers", 2),
    ("mm", "Millimeters", "Lengths of the file are millimeters", 3),
    ("m", "Meters", "Lengths of the file are meters", 4),
)
KINDS = (
    ("NONE", "None", "", 0),
    ("SCALE_BAR", "Scale Bar", "", 1),
    ("LEGEND", "Legend", "", 2),
)


def pixels(length_mm, dpi):
    """The pixels of a length on paper, within what Blender takes."""
    return min(MOST_PIXELS, max(LEAST_PIXELS, round(length_mm / MM_PER_INCH * dpi)))


def millimeters(count, dpi):
    """The length on paper of a number of pixels."""
    return count * MM_PER_INCH / dpi


def written_pixels(render):
    """Width and height of what Output says now."""
    part = render.resolution_percentage / 100
    return max(1, int(render.resolution_x * part)), max(1, int(render.resolution_y * part))


def size_mm(scene):
    """Width and height on paper of what Output says now."""
    return tuple(millimeters(count, scene.pumice_figure.dpi) for count in written_pixels(scene.render))


def is_written(scene):
    """Whether Output has the size of the figure; if not, it was changed by hand."""
    wishes, render = scene.pumice_figure, scene.render
    wanted = (pixels(wishes.width_mm, wishes.dpi), pixels(wishes.height_mm, wishes.dpi))
    return written_pixels(render) == wanted and render.pixel_aspect_x == render.pixel_aspect_y


def write_size(scene):
    """Makes Output's size that of the figure."""
    wishes, render = scene.pumice_figure, scene.render
    render.resolution_x, render.resolution_y = pixels(wishes.width_mm, wishes.dpi), pixels(wishes.height_mm, wishes.dpi)
    render.resolution_percentage = 100
    render.pixel_aspect_x = render.pixel_aspect_y = 1.0
    if hasattr(render, "ppm_factor"):  # since Blender 5.0
        render.ppm_factor, render.ppm_base = wishes.dpi, MM_PER_INCH / 1000.0


def read_size(scene):
    """Makes the figure's size that of Output, which has as many pixels as before, all by its resolution."""
    scene.pumice_figure.width_mm, scene.pumice_figure.height_mm = size_mm(scene)


def _resized(settings, _context):
    write_size(settings.id_data)
    settings.id_data.update_tag()


def _changed(settings, _context):
    settings.id_data.update_tag()


class PumiceFigureSettings(bpy.types.PropertyGroup):
    """The figure of a scene."""

    width_mm: FloatProperty(
        name="Width",
        description="Width on paper in millimeters. Writes Output's resolution",
        min=1.0,
        max=10_000.0,
        default=162.56,
        precision=2,
        update=_resized,
    )
    height_mm: FloatProperty(
        name="Height",
        description="Height on paper in millimeters. Writes Output's resolution",
        min=1.0,
        max=10_000.0,
        default=91.44,
        precision=2,
        update=_resized,
    )
    dpi: IntProperty(
        name="DPI",
        description="Pixels per inch on paper. Writes Output's resolution; the size on paper stays",
        min=18,
        max=4800,
        default=300,
        update=_resized,
    )
    use_backdrop: BoolProperty(
        name="Backdrop",
        description="Show the camera one color behind the scene instead of the world, which lights it all the same",
        default=False,
        update=_changed,
    )
    backdrop: FloatVectorProperty(
        name="Color", description="Color of the backdrop", subtype="COLOR", size=3, min=0.0, max=1.0, default=(1.0, 1.0, 1.0), update=_changed
    )
    parts: PointerProperty(
        name="Parts", description="Collection with the scale bars and legends that follow camera and volume", type=bpy.types.Collection
    )
    estimate: StringProperty(name="Estimate", description="What the last probe found", default="", options={"HIDDEN"})


class PumiceFigurePart(bpy.types.PropertyGroup):
    """What an object is in a figure, and how. All lengths are those on paper."""

    kind: EnumProperty(name="Kind", description="What the object is in a figure", items=KINDS, default="NONE", options={"HIDDEN"})
    volume: PointerProperty(
        name="Volume",
        description="Volume whose lengths or labels it shows",
        type=bpy.types.Object,
        poll=lambda _self, obj: is_volume(obj),
        update=_changed,
    )
    text: PointerProperty(name="Text", description="Object with the text", type=bpy.types.Object, options={"HIDDEN"})
    corner: EnumProperty(name="Corner", description="Corner of the picture", items=CORNERS, default="LOWER_RIGHT", update=_changed)
    margin_mm: FloatProperty(
        name="Margin", description="Distance from the picture's sides in millimeters", min=0.0, default=4.0, update=_changed
    )
    text_mm: FloatProperty(
        name="Text Size", description="Size of the type in millimeters; 1 point is 0.353 mm", min=0.1, default=3.0, update=_changed
    )
    color: FloatVectorProperty(
        name="Color", description="Color of text and bar", subtype="COLOR", size=3, min=0.0, max=1.0, default=(0.0, 0.0, 0.0), update=_changed
    )
    length: FloatProperty(
        name="Length",
        description="Length of the bar in the file's unit; 0 chooses 1, 2 or 5 times a power of ten for the view",
        min=0.0,
        default=0.0,
        update=_changed,
    )
    unit: EnumProperty(name="Unit", description="Unit of the volume's lengths", items=UNITS, default="FILE", update=_changed)
    plane: EnumProperty(
        name="Plane", description="Where the bar is true in a perspective view", items=PLANES, default="MIDDLE", update=_changed
    )
    distance: FloatProperty(
        name="Distance",
        description="Distance of the plane from the camera along its axis",
        min=1e-6,
        default=10.0,
        subtype="DISTANCE",
        update=_changed,
    )
    names_plane: BoolProperty(
        name="Name the Plane", description="Say in the text where the bar is true, in a perspective view", default=True, update=_changed
    )
    labels: StringProperty(
        name="Labels",
        description="Ids of the labels of a legend, with commas; the groups of the volume where it is empty",
        default="",
        update=_changed,
    )


CLASSES = (PumiceFigureSettings, PumiceFigurePart)
OWNERS = ((bpy.types.Scene, PumiceFigureSettings), (bpy.types.Object, PumiceFigurePart))


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for owner, group in OWNERS:
        owner.pumice_figure = PointerProperty(type=group)


def unregister():
    for owner, _ in reversed(OWNERS):
        del owner.pumice_figure
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
