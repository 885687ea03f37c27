# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A volume as an object: its matrix maps voxels to the scene, its mesh is the proxy, and its labels are a table of attributes.

    scene ◄── matrix_world = [place] · [display scale] · world_from_index ◄── voxels = mesh coordinates

Blender stores an object's matrix as location, rotation and scale, which cannot shear. If the axes of a file are not at right angles,
the object therefore gets an empty as parent, and the *parent inverse* matrix holds the whole transform.
"""

import bpy
import numpy as np
from mathutils import Matrix, Vector

from . import label_table, proxy, proxy_material
from .sync import nodes

SHEAR_TOLERANCE = 1e-5
# Most groups that an import makes: a list of more slots helps nobody.
MOST_GROUPS = 32


def create(context, volume, *, name, filepath, source_path, longest_side, placement):
    """A new object for an open volume, linked to the active collection.

    `placement` is CENTER (the volume's middle to the scene's origin, standing on nothing), ALIGN (in the same frame as the first
    volume of the scene, with its display scale) or FILE (where the file says, scaled). Its proxy is the volume's box until
    `proxy_update` makes it.
    """
    world = np.array(volume.world_from_index, dtype=np.float64)
    dims = np.array(volume.dims, dtype=np.float64)
    scale, moved = _display(context.scene, world, dims, longest_side, placement)
    scene_from_index = world.copy()
    scene_from_index[:3] *= scale
    scene_from_index[:3, 3] += moved

    labels = volume.labels
    table = label_table.create(name, labels)
    mesh = bpy.data.meshes.new(name)
    obj = bpy.data.objects.new(name, mesh)
    obj.data.materials.append(material(name))
    settings = obj.pumice
    settings.filepath, settings.source_path, settings.table = filepath, source_path, table
    settings.display_scale = scale
    settings.unit, settings.spacing, settings.dims = volume.unit, volume.spacing, volume.dims
    settings.labels, settings.content_hash = len(labels.ids), volume.content_hash
    proxy.box(mesh, volume.dims)
    obj["pumice_offset"] = [float(v) for v in moved]  # what was added after scaling: volumes are aligned by it
    context.collection.objects.link(obj)
    place(context, obj, scene_from_index)
    return obj


def place(context, obj, scene_from_index):
    """Gives an object any matrix, also a sheared one."""
    wanted = Matrix([list(row) for row in scene_from_index])
    location, rotation, size = wanted.decompose()
    rebuilt = Matrix.LocRotScale(location, rotation, size)
    step = max(abs(v) for row in wanted.to_3x3() for v in row)
    wrong = max(abs(a - b) for x, y in zip(wanted.to_3x3(), rebuilt.to_3x3()) for a, b in zip(x, y))
    if wrong <= SHEAR_TOLERANCE * step:
        obj.matrix_basis = wanted
        return
    frame = bpy.data.objects.new(f"{obj.name} frame", None)
    frame.empty_display_size = 1.0
    context.collection.objects.link(frame)
    obj.parent = frame
    obj.matrix_parent_inverse = wanted


def material(name):
    """The default material: automatic label colours, half matt."""
    made = bpy.data.materials.new(name)
    tree = nodes.ensure(made)
    made.pumice.colors_by_label = True
    proxy_material.follow(made)
    node = tree.nodes["Principled BSDF"]
    node.inputs["Roughness"].default_value = 0.45
    node.inputs["Specular IOR Level"].default_value = 0.35
    return made


def group_by_type(obj):
    """Makes a group, which is a material slot, for each type of the label table, where there are several; the first slot is the first's."""
    table = obj.pumice.table
    kinds = label_table.type_names(table)
    if len(kinds) < 2:
        return
    for place, kind in enumerate(kinds[:MOST_GROUPS]):
        made = obj.material_slots[0].material if place == 0 else material(obj.name)
        made.name = f"{obj.name} {kind or 'other'}"
        if place:
            obj.data.materials.append(made)
    # Types beyond the last group are in it.
    label_table.set_slots(table, slice(None), label_table.types(table).clip(max=MOST_GROUPS - 1))


def bounds(obj):
    """(low, high) corner of an object in the scene."""
    corners = [obj.matrix_world @ Vector(corner) for corner in obj.bound_box]
    low = Vector([min(c[axis] for c in corners) for axis in range(3)])
    high = Vector([max(c[axis] for c in corners) for axis in range(3)])
    return low, high


def _display(scene, world, dims, longest_side, placement):
    """(display scale, what is added after scaling)."""
    corners = np.array([[x, y, z, 1.0] for x in (0, dims[0]) for y in (0, dims[1]) for z in (0, dims[2])])
    corners = (world @ corners.T).T[:, :3]
    low, high = corners.min(axis=0), corners.max(axis=0)
    first = next((o for o in scene.objects if o.pumice.filepath), None)
    if placement == "ALIGN" and first is not None:
        return first.pumice.display_scale, np.array(list(first.get("pumice_offset", (0.0, 0.0, 0.0))))
    side = (high - low).max()
    scale = longest_side / side if side > 0.0 else 1.0
    # Blender keeps it in single precision: what is stored is what is used.
    scale = float(np.float32(scale))
    if placement == "FILE":
        return scale, np.zeros(3)
    return scale, -scale * (low + high) / 2.0
