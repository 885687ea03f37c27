# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties that Pumice adds to Blender's data: settings of the scene, of a view layer, of a volume object, of a material.

A label never gets a property group: tables of 100,000 labels live in mesh attributes, see `label_table`.
"""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

BACKENDS = (
    ("AUTO", "Automatic", "The device chosen in the extension's preferences; by default the best graphics processor", 0),
    ("CPU", "Processor", "The path tracer for the processor: runs everywhere", 1),
)
MODES = (
    ("PATH", "Path Tracing", "All light, with as many bounces as set", 0),
    ("ONE_BOUNCE", "Direct Light", "Light that comes straight from sun and sky: faster, darker in crevices", 1),
    ("AMBIENT_OCCLUSION", "Ambient Occlusion", "White surfaces under a white sky, without materials and lights", 2),
)
CUTS = (
    ("NONE", "None", "The object cuts nothing", 0),
    ("PLANE", "Plane", "Removes the side of the object that its own +Z axis points to. Costs little", 1),
    ("BOX", "Box", "Removes what is inside the empty's cube, or inside the mesh's bounding box. Costs little", 2),
)
LODS = (
    ("VOXELS", "Voxels", "Every voxel, exactly", 0),
    ("CELLS", "Cells of 4³", "Cells of 4³ voxels: coarser. Saves memory; on the processor hardly any time", 1),
    ("BOXES", "Boxes", "Boxes of up to 16³ voxels: a blocking draft in little memory. On the processor not faster", 2),
    ("DISTANCE", "By Distance", "Chosen for each box by its size in pixels", 3),
)


def _tag(settings, _context):
    """Tags the data as changed: Blender does this itself for changes in its panels, but not for those of scripts."""
    settings.id_data.update_tag()

# Options of a path that may begin with "//": Blender 5 warns of such a path where they are missing, earlier versions do not know them.
RELATIVE_PATH = {"ANIMATABLE"} | ({"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (5, 0, 0) else set())


class PumiceLinkedFile(bpy.types.PropertyGroup):
    """The file of a linked volume object, see `tracked_file`."""

    block: PointerProperty(name="File", description="Data-block with the path of the file", type=bpy.types.Volume, options={"HIDDEN"})


class PumiceSceneSettings(bpy.types.PropertyGroup):
    """Settings of the renderer, stored in the scene."""

    verdict: StringProperty(
        name="Verdict", description="The last comparison with Cycles, in one sentence", default="", options={"HIDDEN"}
    )
    verdict_page: StringProperty(
        name="Page", description="The page of the last comparison with Cycles", subtype="FILE_PATH", default="", options={"HIDDEN"}
    )

    samples: IntProperty(
        name="Samples",
        description="Samples per pixel in a final render. Halving the noise takes four times as many",
        min=1,
        max=1 << 24,
        default=128,
    )
    viewport_samples: IntProperty(
        name="Viewport Samples",
        description="Samples per pixel after which the viewport stops refining",
        min=1,
        max=1 << 24,
        default=256,
    )
    use_viewport_denoise: BoolProperty(
        name="Denoise Viewport",
        description=(
            "Denoise the viewport's picture until it is done, always with the statistical denoiser. Labels stay sharp, "
            "faint shadows may blur. The finished picture is not denoised"
        ),
        default=False,
    )
    use_denoise: BoolProperty(
        name="Denoise",
        description=(
            "Denoise final renders: smoother, and biased, no longer the mean of their samples. "
            "The pass Noisy Image has the picture before"
        ),
        default=False,
    )
    denoiser: EnumProperty(
        name="Denoiser",
        description="The filter of final renders",
        items=(
            ("STATISTICAL", "Statistical", "Average pixels of one label that a statistical test cannot tell apart", 0),
            (
                "OIDN",
                "Open Image Denoise",
                "Intel's neural network, in Blender's own copy. Less noise from few samples, some seconds of all processors, "
                "and it may invent structure",
                1,
            ),
        ),
        default="STATISTICAL",
    )
    use_error: BoolProperty(
        name="Error Target",
        description="End a render, also in the viewport, when its estimated relative error is at most the value below",
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
    use_time: BoolProperty(name="Time Limit", description="End a final render after a number of seconds", default=False)
    time_seconds: FloatProperty(
        name="Seconds",
        description="Seconds of sampling after which a final render ends",
        min=0.1,
        soft_max=3600.0,
        default=60.0,
    )
    mode: EnumProperty(name="Light", description="Which light the picture shows", items=MODES, default="PATH")
    bounces: IntProperty(
        name="Bounces",
        description="Maximum number of bounces of light from surface to surface, as in Cycles",
        min=0,
        max=1 << 20,
        soft_max=64,
        default=32,
    )
    clamp_direct: FloatProperty(
        name="Direct Light",
        description=(
            "Limit for the light that the first surface may add to a sample, as in Cycles; 0 is no limit. "
            "Removes bright specks, and makes the picture darker"
        ),
        min=0.0,
        soft_max=100.0,
        default=0.0,
    )
    clamp_indirect: FloatProperty(
        name="Indirect Light",
        description=(
            "Limit for the light that further bounces may add to a sample, as in Cycles, whose default is 10; 0 is no limit. "
            "Removes bright specks, and makes the picture darker"
        ),
        min=0.0,
        soft_max=100.0,
        default=0.0,
    )
    use_adaptive: BoolProperty(
        name="Noise Threshold",
        description="Stop sampling pixels with little noise. Renders faster, but the picture is slightly biased",
        default=False,
    )
    adaptive_threshold: FloatProperty(
        name="Noise Threshold",
        description="Estimated relative error below which a pixel gets no more samples",
        min=1e-4,
        max=1.0,
        precision=4,
        default=0.01,
    )
    adaptive_min_samples: IntProperty(
        name="Min Samples",
        description="Minimum samples per pixel with a noise threshold. With few, small bright details may be missed",
        min=4,
        max=4096,
        default=16,
    )
    smooth_voxels: BoolProperty(
        name="Smooth Voxels",
        description=(
            "Shade voxels with smooth normals, from the shape of their label nearby, instead of as flat faces. "
            "Costs some look-ups at each hit; outlines stay blocky"
        ),
        default=False,
    )
    use_ao_distance: BoolProperty(
        name="Limit Reach", description="Limit the distance over which ambient occlusion darkens", default=False
    )
    ao_distance: FloatProperty(
        name="Reach", description="Distance within which surfaces occlude each other", min=1e-6, default=2.0, subtype="DISTANCE"
    )
    lod: EnumProperty(name="Detail", description="Finest element that is traced", items=LODS, default="VOXELS")
    lod_pixels: FloatProperty(
        name="Pixels",
        description="Largest size in pixels of an element that is drawn instead of the finer ones inside it. More is coarser. On the processor not faster",
        min=0.01,
        soft_max=16.0,
        default=1.0,
    )
    seed: IntProperty(
        name="Seed", description="Seed of the random numbers: the same seed gives the same picture", min=0, default=0
    )
    filter_pixels: FloatProperty(
        name="Filter Width",
        description="Radius of the Blackman-Harris pixel filter, as in Cycles: 1.5 spans three pixels",
        min=0.01,
        max=8.0,
        default=1.5,
    )
    backend: EnumProperty(name="Device", description="Device that computes the picture", items=BACKENDS, default="AUTO")
    ramp: PointerProperty(
        name="Color Ramp", description="Texture whose color ramp colors labels by number", type=bpy.types.Texture, options={"HIDDEN"}
    )
    linked_files: CollectionProperty(
        name="Linked Files", description="Files of linked volumes, which packers find by them", type=PumiceLinkedFile, options={"HIDDEN"}
    )


class PumiceViewLayerSettings(bpy.types.PropertyGroup):
    """Passes that a view layer gets in addition to Blender's own."""

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
            "Light that shadow catchers keep in the shadows on them: multiply a background by it, then put Combined over it. "
            "Combined then has no caught shadows"
        ),
        default=False,
    )
    use_pass_variance: BoolProperty(
        name="Variance", description="Estimated variance of the picture, per channel", default=False
    )
    use_pass_samples: BoolProperty(
        name="Sample Count", description="Samples that each pixel got: fewer where the noise threshold was reached", default=False
    )


class PumiceMaterialSettings(bpy.types.PropertyGroup):
    """How a material applies to the labels of a volume."""

    colors_by_label: BoolProperty(
        name="Colors by Label",
        description="Give each label the color of the label table. If off, all have the base color of the Principled BSDF",
        default=False,
        update=_tag,
    )


class PumiceVolumeSettings(bpy.types.PropertyGroup):
    """The volume that an object shows, or how the object cuts others; an object without `filepath` shows no volume."""

    filepath: StringProperty(
        name="Volume",
        description="The compressed volume that is drawn",
        subtype="FILE_PATH",
        default="",
        update=_tag,
        options=RELATIVE_PATH,
    )
    source_path: StringProperty(
        name="Source", description="File that the volume was compressed from", subtype="FILE_PATH", default="", options=RELATIVE_PATH
    )
    last_filepath: StringProperty(
        name="Last Place", description="Where the volume was when the file was saved, which a copy of the object needs", options={"HIDDEN"}
    )
    last_source_path: StringProperty(
        name="Last Place of the Source", description="Where the source was when the file was saved", options={"HIDDEN"}
    )
    tracked_file: PointerProperty(
        name="Tracked File",
        description="Data-block with the path of the volume, by which Blender and packers find the file",
        type=bpy.types.Volume,
        options={"HIDDEN"},
    )
    table: PointerProperty(
        override={"LIBRARY_OVERRIDABLE"},
        name="Label Table", description="Mesh with one vertex for each label, in order of id", type=bpy.types.Mesh
    )
    display_scale: FloatProperty(
        name="Display Scale",
        description="Number of Blender units per unit of the file",
        default=1.0,
        precision=6,
    )
    unit: StringProperty(name="Unit", description="Length unit of the file", default="unknown")
    spacing: FloatVectorProperty(
        name="Voxel Size", description="Size of a voxel in the file's unit", size=3, default=(1.0, 1.0, 1.0), precision=4
    )
    dims: IntVectorProperty(name="Voxels", description="Voxels along x, y and z", size=3, default=(0, 0, 0))
    labels: IntProperty(name="Labels", description="Number of labels", default=0)
    content_hash: StringProperty(name="Content", description="Hash of all voxels and ids; empty of a time series", default="")
    proxy_faces: IntProperty(
        name="Proxy Faces",
        description="Maximum number of faces of the mesh that stands for the volume in Solid mode, EEVEE and Cycles. More show finer shapes",
        min=6,
        soft_min=1_000,
        max=1 << 24,
        soft_max=1_000_000,
        default=50_000,
        update=_tag,
    )
    cut: EnumProperty(
        name="Cut",
        description="Part of space that the object removes from volumes, to show their inside. The object itself is not drawn",
        items=CUTS,
        default="NONE",
        update=_tag,
    )
    cut_volumes: PointerProperty(
        name="Volumes",
        description="Collection with the volumes that the object cuts; without one it cuts all volumes",
        type=bpy.types.Collection,
        update=_tag,
    )


CLASSES = (PumiceLinkedFile, PumiceSceneSettings, PumiceViewLayerSettings, PumiceMaterialSettings, PumiceVolumeSettings)
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
        owner.pumice = PointerProperty(type=group, override={"LIBRARY_OVERRIDABLE"})


def unregister():
    for owner, _ in reversed(OWNERS):
        del owner.pumice
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
