# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What Pumice keeps in Blender's data: settings of the scene, of a view layer, of a volume object, of a material.

A label never gets a property group: tables of 100,000 labels live in mesh attributes, see `label_table`.
"""

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

BACKENDS = (
    ("AUTO", "Automatic", "What the extension's preferences name; by themselves, the best graphics processor", 0),
    ("CPU", "Processor", "The path tracer for the processor: runs everywhere", 1),
)
MODES = (
    ("PATH", "Path Tracing", "All light, with as many bounces as set", 0),
    ("ONE_BOUNCE", "Direct Light", "Light that comes straight from sun and sky: faster, darker in crevices", 1),
    ("AMBIENT_OCCLUSION", "Ambient Occlusion", "White surfaces under a white sky, without materials and lights", 2),
)
CUTS = (
    ("NONE", "None", "The object cuts nothing", 0),
    ("PLANE", "Plane", "Takes away what the object's own +Z points to. Cheap", 1),
    ("BOX", "Box", "Takes away what is in the empty's cube, or in the mesh's bounding box. Cheap", 2),
)
LODS = (
    ("VOXELS", "Voxels", "Every voxel, exactly", 0),
    ("CELLS", "Cells of 4³", "Coarser and faster", 1),
    ("BOXES", "Boxes", "Boxes of up to 16³ voxels: a blocking draft", 2),
    ("DISTANCE", "By Distance", "As fine as the picture's pixels need", 3),
)


def _tag(settings, _context):
    """Has Blender pass the change on: it does so by itself for changes in its panels, not for those of scripts."""
    settings.id_data.update_tag()


class PumiceSceneSettings(bpy.types.PropertyGroup):
    """How the picture is computed."""

    samples: IntProperty(
        name="Samples",
        description="Samples of each pixel in a final render. Halving the noise takes four times as many",
        min=1,
        max=1 << 24,
        default=128,
    )
    viewport_samples: IntProperty(
        name="Viewport Samples",
        description="Samples of each pixel after which the viewport rests",
        min=1,
        max=1 << 24,
        default=256,
    )
    use_viewport_denoise: BoolProperty(
        name="Denoise Viewport",
        description=(
            "Filter the noise of the viewport's picture until it is done. Edges stay, fine shadows may blur. "
            "The finished picture, and every render, is what was sampled"
        ),
        default=False,
    )
    use_error: BoolProperty(
        name="Error Target",
        description="End a render when its estimated relative error is as low as set here",
        default=False,
    )
    error_percent: FloatProperty(
        name="Error",
        description="Estimated relative error of the picture at which a render ends",
        min=0.01,
        max=100.0,
        default=2.0,
        subtype="PERCENTAGE",
    )
    use_time: BoolProperty(name="Time Limit", description="End a final render after some time", default=False)
    time_seconds: FloatProperty(
        name="Seconds",
        description="Seconds of sampling after which a final render ends",
        min=0.1,
        soft_max=3600.0,
        default=60.0,
    )
    mode: EnumProperty(name="Light", description="Which light is counted", items=MODES, default="PATH")
    bounces: IntProperty(
        name="Bounces",
        description="Times that light is passed on from surface to surface",
        min=0,
        max=1 << 20,
        soft_max=64,
        default=32,
    )
    clamp_direct: FloatProperty(
        name="Direct Light",
        description=(
            "Most that light at the first surface may add to a sample, as in Cycles; 0 is no limit. "
            "Takes bright specks away, and light with them"
        ),
        min=0.0,
        soft_max=100.0,
        default=0.0,
    )
    clamp_indirect: FloatProperty(
        name="Indirect Light",
        description=(
            "Most that light after further bounces may add to a sample, as in Cycles, whose default is 10; 0 is no limit. "
            "Takes bright specks away, and light with them"
        ),
        min=0.0,
        soft_max=100.0,
        default=0.0,
    )
    use_adaptive: BoolProperty(
        name="Noise Threshold",
        description="Pixels that are good enough get no more samples. Renders sooner; the picture is then a little biased",
        default=False,
    )
    adaptive_threshold: FloatProperty(
        name="Noise Threshold",
        description="Estimated relative error of a pixel below which it rests",
        min=1e-4,
        max=1.0,
        precision=4,
        default=0.01,
    )
    adaptive_min_samples: IntProperty(
        name="Min Samples",
        description="Samples that every pixel gets before it may rest. With few, small bright things are missed",
        min=4,
        max=4096,
        default=16,
    )
    smooth_voxels: BoolProperty(
        name="Smooth Voxels",
        description=(
            "Shades voxels by the direction in which their label falls off instead of by their flat faces. "
            "Costs some look-ups at each hit; shapes stay blocks"
        ),
        default=False,
    )
    use_ao_distance: BoolProperty(
        name="Limit Reach", description="Ambient occlusion looks only so far", default=False
    )
    ao_distance: FloatProperty(
        name="Reach", description="Reach of ambient occlusion", min=1e-6, default=2.0, subtype="DISTANCE"
    )
    lod: EnumProperty(name="Detail", description="What is traced", items=LODS, default="VOXELS")
    lod_pixels: FloatProperty(
        name="Pixels",
        description="An element that spans at most so many pixels may stand for the finer ones in it",
        min=0.01,
        soft_max=16.0,
        default=1.0,
    )
    seed: IntProperty(
        name="Seed", description="Every random number follows from it: same seed, same picture", min=0, default=0
    )
    filter_pixels: FloatProperty(
        name="Filter Width",
        description="Reach of the Blackman-Harris pixel filter, as in Cycles: 1.5 spans three pixels",
        min=0.01,
        max=8.0,
        default=1.5,
    )
    backend: EnumProperty(name="Device", description="What computes the picture", items=BACKENDS, default="AUTO")


class PumiceViewLayerSettings(bpy.types.PropertyGroup):
    """Which passes a view layer gets beside Blender's own."""

    use_pass_label: BoolProperty(
        name="Label",
        description=(
            "A pass with the label that each pixel sees: its row in the label table plus 1, and 0 where there is none. "
            "Whole numbers up to 16,777,216 are exact"
        ),
        default=False,
    )
    use_pass_denoising: BoolProperty(
        name="Denoising Data",
        description="Base color and normal of first surfaces, for the Denoise node of the compositor",
        default=False,
    )
    use_pass_shadow_catcher: BoolProperty(
        name="Shadow Catcher",
        description=(
            "What is left of the light of shadow catchers, to multiply a background with; "
            "Combined then has no shadows of theirs, and is to be laid over it"
        ),
        default=False,
    )
    use_pass_variance: BoolProperty(
        name="Variance", description="Estimated variance of the picture, each channel", default=False
    )
    use_pass_samples: BoolProperty(
        name="Sample Count", description="Samples that each pixel got: fewer where a noise threshold ended them", default=False
    )


class PumiceMaterialSettings(bpy.types.PropertyGroup):
    """How a material dresses a volume."""

    colors_by_label: BoolProperty(
        name="Colors by Label",
        description="Labels that touch get different base colors; off, all have the Principled BSDF's",
        default=False,
        update=_tag,
    )


class PumiceVolumeSettings(bpy.types.PropertyGroup):
    """What an object knows of its volume, or how it cuts others; an object without `filepath` shows none."""

    filepath: StringProperty(
        name="Volume",
        description="The compressed volume that is drawn",
        subtype="FILE_PATH",
        default="",
        update=_tag,
    )
    source_path: StringProperty(
        name="Source", description="The file that it was compressed from", subtype="FILE_PATH", default=""
    )
    table: PointerProperty(
        name="Label Table", description="Mesh whose vertices are the labels, in dense order", type=bpy.types.Mesh
    )
    display_scale: FloatProperty(
        name="Display Scale",
        description="Blender units for one unit of the file",
        default=1.0,
        precision=6,
    )
    unit: StringProperty(name="Unit", description="Length unit of the file", default="unknown")
    spacing: FloatVectorProperty(
        name="Voxel Size", description="Size of a voxel in the file's unit", size=3, default=(1.0, 1.0, 1.0), precision=4
    )
    dims: IntVectorProperty(name="Voxels", description="Voxels along x, y and z", size=3, default=(0, 0, 0))
    labels: IntProperty(name="Labels", description="Number of labels", default=0)
    content_hash: StringProperty(name="Content", description="Hash of all voxels and ids", default="")
    cut: EnumProperty(
        name="Cut",
        description="What the object takes away from all volumes, so that one sees inside; it is not drawn itself",
        items=CUTS,
        default="NONE",
        update=_tag,
    )


CLASSES = (PumiceSceneSettings, PumiceViewLayerSettings, PumiceMaterialSettings, PumiceVolumeSettings)
OWNERS = (
    (bpy.types.Scene, PumiceSceneSettings),
    (bpy.types.ViewLayer, PumiceViewLayerSettings),
    (bpy.types.Material, PumiceMaterialSettings),
    (bpy.types.Object, PumiceVolumeSettings),
)


def is_volume(obj):
    """Whether an object shows a label volume."""
    return obj.type == "MESH" and bool(obj.pumice.filepath)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for owner, group in OWNERS:
        owner.pumice = PointerProperty(type=group)


def unregister():
    for owner, _ in reversed(OWNERS):
        del owner.pumice
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
