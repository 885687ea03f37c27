# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pumice in Blender: opens label volumes, and path traces their compressed form in the viewport and for F12.

The compiled module `pumice` (a wheel of this extension) does the work; this package only translates Blender's scene for it.
A module imports only from lines below its own:

    __init__
    export_usd       export_gltf          verify               label_panel          import_volume
    label_files
    label_operators
    export_surfaces
    frame_file
    panels           engine               export_scene         import_scene         exact_mesh
    viewport         final_render         usd_stage            usd_values           proxy_update
    scene_reader     first_look           passes               scene_notes          label_colors         label_search
    volume_object    picture_texture      missing_boxes        overlay
    proxy
    proxy_material
    sync.*           registry             preferences
    label_table      properties           proxy_frame          cache                devices             mesh_file
    background       verify_maps
    reports
    native

`sync` converts Blender's data to plain values. sync.matrix, sync.camera, sync.parts, sync.edits, cache, devices, mesh_file and overlay do not
use Blender.

Nothing here touches the voxels: they stay in Rust, and arrays come through the buffer protocol.
"""

if "panels" in locals():  # Blender reloads scripts (F3 > Reload Scripts): fresh modules, same names
    import importlib
    import sys

    for _name in [n for n in sys.modules if n.startswith(__package__ + ".")]:
        del sys.modules[_name]
    importlib.invalidate_caches()

from . import (
    engine,
    exact_mesh,
    export_gltf,
    export_scene,
    export_usd,
    import_scene,
    import_volume,
    label_files,
    label_operators,
    label_panel,
    label_search,
    panels,
    preferences,
    properties,
    proxy_update,
    registry,
    verify,
    verify_maps,
    viewport,
)

# Registered in this order, unregistered in reverse.
MODULES = (
    properties,
    preferences,
    registry,
    proxy_update,
    import_volume,
    import_scene,
    export_scene,
    export_usd,
    export_gltf,
    exact_mesh,
    verify_maps,
    verify,
    viewport,
    engine,
    label_search,
    label_operators,
    label_files,
    label_panel,
    panels,
)


def register():
    """Called by Blender when the extension is enabled."""
    for module in MODULES:
        module.register()


def unregister():
    """Called by Blender when the extension is disabled."""
    for module in reversed(MODULES):
        module.unregister()
