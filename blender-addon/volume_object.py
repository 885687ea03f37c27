# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A volume as an object: its matrix maps voxels to the scene, its mesh is the proxy, and its labels are a table of attributes.

    scene ◄── matrix_world = [place] · [display scale] · world_from_index ◄── voxels = mesh coordinates (`volume_place`: until Apply)

Blender stores an object's matrix as location, rotation and scale, which cannot shear. If the axes of a file are not at right angles,
the object therefore gets an empty as parent, and the *parent inverse* matrix holds the whole transform.
"""

import bpy
import numpy as np
from mathutils import Matrix, Vector

from . import label_carry, label_table, proxy, proxy_material, units, volume_place
from .reports import Refused
from .sync import nodes

SHEAR_TOLERANCE = 1e-5
# Custom property of an object: the 16 numbers of the map from voxels to the world of the volume's file, row by row.
FILE_FROM_INDEX = "pumice_file_from_index"
# Cells of Blender's Voxel Remesh along the longest side. Its default is 0.1 of the mesh's units, which are voxels here: of 512 voxels it asks for
# 5,120 cells along each side, for which Blender 5.0.1 runs out of memory and aborts.
REMESH_CELLS = 128
# Most groups that an import makes: a list of more slots helps nobody.
MOST_GROUPS = 32


def create(context, volume, *, name, filepath, source_path, longest_side, placement, among=(), former=None):
    """A new object for an open volume, linked to the active collection.

    `placement` is CENTER (the volume's middle to the scene's origin, standing on nothing), ALIGN (in the same frame as the first
    volume of the scene, with its display scale) or FILE (where the file says, scaled). Volumes that are imported together, `among`, keep
    their places to each other: length and middle are those of all of them. `former` is a label table whose colors labels with the same ids
    get. Its proxy is the volume's box until `proxy_update` makes it.
    """
    world = np.array(volume.world_from_index, dtype=np.float64)
    scale, scene_from_file = _display(context, volume, among or [volume], longest_side, placement)
    return create_at(
        context, volume, scene_from_file @ world, name=name, filepath=filepath, source_path=source_path, scale=scale, former=former
    )


def create_at(context, volume, scene_from_index, *, name, filepath, source_path, scale, former=None):
    """As `create`, in a given place: the map from voxels to the scene, and `scale`, the number of Blender units per unit of the file."""
    labels = volume.labels
    table = label_table.create(name, labels)
    if former is not None:
        label_carry.colors(former, table, volume)
    mesh = bpy.data.meshes.new(name)
    proxy.box(mesh, volume.dims)
    mesh.remesh_voxel_size = max(volume.dims) / REMESH_CELLS
    obj = bpy.data.objects.new(name, mesh)
    obj.data.materials.append(material(name))
    settings = obj.pumice
    settings.filepath, settings.source_path, settings.table = filepath, source_path, table
    settings.display_scale = scale
    describe(obj, volume)
    context.collection.objects.link(obj)
    place(context, obj, scene_from_index)
    return obj


def describe(obj, volume):
    """Notes what a volume's file says of it."""
    settings = obj.pumice
    settings.unit, settings.spacing, settings.dims = volume.unit, volume.spacing, volume.dims
    # Of a series no hash says what all time steps are.
    settings.labels, settings.content_hash = len(volume.labels.ids), volume.content_hash if volume.time_steps is None else ""
    obj[FILE_FROM_INDEX] = [float(v) for v in np.ravel(volume.world_from_index)]


def file_from_index(obj):
    """The map from voxels to the world of the file, (4, 4) float64, as `describe` noted it; None in objects of earlier versions."""
    noted = obj.get(FILE_FROM_INDEX)
    return None if noted is None else np.array(noted).reshape(4, 4)


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
    color_by_label(made)
    node = tree.nodes["Principled BSDF"]
    node.inputs["Roughness"].default_value = 0.45
    node.inputs["Specular IOR Level"].default_value = 0.35
    return made


def color_by_label(material):
    """Makes a material show the labels' own colors."""
    material.pumice.colors_by_label = True
    proxy_material.follow(material)


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


def _display(context, volume, among, longest_side, placement):
    """(display scale, map from the world of its file to the scene) of a new volume, one of those that are imported together."""
    first = next((o for o in context.scene.objects if o.pumice.filepath), None)
    if placement == "ALIGN" and first is not None:
        context.view_layer.update()
        placed, of_file = volume_place.world_from_index(first), file_from_index(first)
        if placed is None or of_file is None:
            raise Refused(f"With the First Volume: {first.name} does not tell its place in its file; reload it, or choose another placement")
        ratio = units.ratio(volume.unit, first.pumice.unit)
        return _stored(first.pumice.display_scale * ratio), placed @ np.linalg.inv(of_file) @ np.diag([ratio, ratio, ratio, 1.0])
    # In the unit of the first of them.
    unit = among[0].unit
    corners = np.concatenate([_corners(one) * units.ratio(one.unit, unit) for one in among])
    low, high = corners.min(axis=0), corners.max(axis=0)
    side = (high - low).max()
    common = _stored(longest_side / side if side > 0.0 else 1.0)
    scale = _stored(common * units.ratio(volume.unit, unit))
    scene_from_file = np.diag([scale, scale, scale, 1.0])
    if placement != "FILE":
        scene_from_file[:3, 3] = -common * (low + high) / 2.0
    return scale, scene_from_file


def _corners(volume):
    """The corners of a volume in its world, (8, 3)."""
    x, y, z = volume.dims
    corners = np.array([[i, j, k, 1.0] for i in (0, x) for j in (0, y) for k in (0, z)])
    return (np.array(volume.world_from_index, dtype=np.float64) @ corners.T).T[:, :3]


def _stored(scale):
    """Blender keeps the display scale in single precision: what is stored is what is used."""
    return float(np.float32(scale))
