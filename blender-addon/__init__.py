# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pumice in Blender: opens label volumes, and path traces their compressed form in the viewport and for F12.

The compiled module `pumice` (a wheel of this extension) does the work; this package only translates Blender's scene for it.
A module imports only from lines below its own:

    __init__
    reload_volume    import_url
    export_usd       export_gltf          verify               label_panel          import_volume        import_state
    figure_panel
    label_files          pick_tool        figure_operators     object_outline
    label_box            label_outline    floor_grid
    label_pick
    label_operators      label_film
    export_surfaces                       add_cut              cut_gizmo
    frame_file
    panels           engine               export_scene         import_scene         exact_mesh
    viewport         final_render         usd_stage            usd_values           proxy_update
    persistent       render_work          render_result
    scene_reader     first_look           passes               scene_notes          label_colors         label_search
    figure_follow    import_dialog
    scale_bar            legend           true_overlays    grid_shader
    volume_object    picture_texture      missing_boxes        overlay              opening              color_ramp
    provenance           figure_frame         figure_part          proxy                oidn
    proxy_material
    sync.*           registry             file_facts           label_carry          figure_settings
    preferences      active_volume
    label_table      properties           cache                devices              mesh_file            units
    file_paths       volume_place         table_writes         time_settings        file_series
    time_steps           tracked_file
    background       verify_maps          online_access
    reports
    native

`sync` converts Blender's data to plain values. sync.matrix, sync.camera, sync.parts, sync.edits, cache, devices, mesh_file, overlay,
file_facts, file_series, opening, time_steps and units do not use Blender.

Nothing here touches the voxels: they stay in Rust, and arrays come through the buffer protocol.
"""

if "panels" in locals():  # Blender reloads scripts (F3 > Reload Scripts): fresh modules, same names
    import importlib
    import sys

    for _name in [n for n in sys.modules if n.startswith(__package__ + ".")]:
        del sys.modules[_name]
    importlib.invalidate_caches()

from . import (
    add_cut,
    cut_gizmo,
    engine,
    exact_mesh,
    export_gltf,
    export_scene,
    export_usd,
    figure_follow,
    figure_operators,
    figure_panel,
    figure_settings,
    file_paths,
    floor_grid,
    import_scene,
    import_state,
    import_url,
    import_volume,
    label_box,
    label_film,
    label_files,
    label_operators,
    label_outline,
    label_panel,
    label_pick,
    label_search,
    object_outline,
    panels,
    persistent,
    pick_tool,
    preferences,
    properties,
    proxy_update,
    registry,
    reload_volume,
    table_writes,
    time_settings,
    true_overlays,
    verify,
    verify_maps,
    viewport,
)

# Registered in this order, unregistered in reverse.
MODULES = (
    properties,
    time_settings,
    preferences,
    file_paths,
    registry,
    table_writes,
    proxy_update,
    figure_settings,
    figure_follow,
    import_volume,
    import_state,
    import_url,
    reload_volume,
    import_scene,
    export_scene,
    export_usd,
    export_gltf,
    exact_mesh,
    add_cut,
    cut_gizmo,
    verify_maps,
    verify,
    true_overlays,
    viewport,
    persistent,
    engine,
    label_search,
    label_operators,
    label_film,
    label_pick,
    label_box,
    floor_grid,
    object_outline,
    label_outline,
    pick_tool,
    label_files,
    label_panel,
    figure_operators,
    figure_panel,
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
