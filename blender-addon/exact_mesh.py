# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make Exact Mesh: an ordinary mesh of the surface of a volume's shown labels, for whoever goes on in Cycles.

    volume object ──► faces of the voxels (thread, progress, ESC) ──► mesh object in the same place, flat, closed by shared corners
                      attribute `label` of each face: row of the label table      a material slot for each group, and each color in it

The faces are counted first, which takes no memory, and refused where Cycles would need more than the limit.
"""

import json
import os

import bpy
import numpy as np
from bpy.props import BoolProperty, FloatProperty

from . import label_table, native, preferences, registry, volume_place
from .background import InBackground, Work
from .properties import is_volume
from .reports import Refused
from .sync import cuts, dressing, materials, nodes
from .sync.surface import PLAIN

# Bytes that a face takes in Blender's mesh and Cycles' BVH together: 520 were measured, and a tenth more is allowed for.
BYTES_A_FACE = 570
# Most materials. Where the colors of labels make more, one material a group reads the attribute `base_color` of the faces.
MOST_MATERIALS = 256
# Custom properties: of a mesh object, the volume that it was made of; of a mesh and a material, that this module made it.
OF_VOLUME, MADE = "pumice_volume", "pumice_made"


class Group:
    """The labels of one material slot: its material, the scene's fields of it, and whether labels' colors replace its base color."""

    def __init__(self, material):
        self.material = material
        self.fields, self.colored, self.left_out = materials.read(material)


class Wanted:
    """What is asked of one volume, read from Blender before the thread starts; and its arrays, once they are made."""

    def __init__(self, obj):
        self.obj, self.name, table = obj, obj.name, obj.pumice.table
        self.entry = registry.request_shown(obj)
        place = volume_place.fit(obj.data)
        if place is None:
            raise Refused(f"{obj.name}: {volume_place.LOST}")
        self.object_from_index = place.object_from_index
        dresses = [slot.material for slot in obj.material_slots] or [None]
        self.groups = [Group(material) for material in dresses]
        self.left_out = [line for group in self.groups for line in group.left_out]
        self.shown = self.table_ids = None
        if table is not None:
            self.shown, self.of = label_table.visible(table), label_table.slots(table).clip(max=len(dresses) - 1)
            self.table_ids, self.colors = label_table.ids(table), label_table.colors(table)[:, :3].clip(0.0, 1.0)
        self.volume = self.faces = None

    def open(self, job):
        """Waits for the volume."""
        pumice = native.require()
        while not self.entry.done.wait(0.05):
            if job.cancelled:
                raise pumice.Cancelled("cancelled")
        if self.entry.error:
            raise Refused(self.entry.error)
        self.volume = self.entry.volume
        if self.shown is None:
            self.shown = np.ones(len(self.volume.labels.ids), dtype=bool)
            self.of = np.zeros(len(self.shown), dtype=np.int32)
            self.colors = self.volume.labels.auto_colors(self.shown)
        if self.table_ids is not None:
            label_table.require_rows(self.table_ids, self.volume.labels, self.name)

    @property
    def ids(self):
        """Ids of the labels that are shown."""
        return self.volume.labels.ids[self.shown].tolist()


class PUMICE_OT_make_exact_mesh(InBackground, bpy.types.Operator):
    """Make meshes of the exact surfaces of the selected volumes, for Cycles. Takes 570 bytes of memory for each face there"""

    bl_idname = "pumice.make_exact_mesh"
    bl_label = "Make Exact Mesh"
    bl_options = {"UNDO"}

    merged: BoolProperty(
        name="Merge Faces",
        description=(
            "Make rectangles of neighboring faces of one label in one plane: a half to a quarter of the memory. "
            "Edges then end within others, where a single ray may slip through"
        ),
        default=False,
    )
    memory_gb: FloatProperty(
        name="Memory Limit",
        description="Refuse surfaces for which Cycles would need more memory, in gigabytes",
        min=1e-4,
        soft_max=256.0,
        default=8.0,
    )
    hide_volume: BoolProperty(
        name="Hide the Volume", description="Hide the volume in viewports and renders; the mesh takes its place", default=True
    )

    def invoke(self, context, event):
        self._interactive = True
        return context.window_manager.invoke_props_dialog(self)

    def begin(self, context):
        pumice = native.require()
        chosen = [obj for obj in context.selected_objects if is_volume(obj)]
        if not chosen and context.object is not None and is_volume(context.object):
            chosen = [context.object]
        if not chosen:
            raise Refused("Make Exact Mesh: no volume is selected; select one that was imported as a label volume")
        if any(cuts.is_cut(obj) and not obj.hide_render for obj in context.scene.objects):
            self.report({"WARNING"}, "Cuts are not in the mesh: it is the whole surface")
        if context.scene.pumice.smooth_voxels:
            self.report({"WARNING"}, "Smooth Voxels is not in the mesh: its faces are flat")
        if preferences.memory_limit_bytes():
            raise Refused("The exact mesh needs whole volumes in memory: set Memory Limit in the extension's preferences to 0")
        wanted = [Wanted(obj) for obj in chosen]
        merged, limit = self.merged, int(self.memory_gb * 1e9) // BYTES_A_FACE

        def call(job, tell):
            left = limit
            for one in wanted:
                one.open(job)
                tell(f"Counting faces of {one.name}")
                try:
                    count = pumice.count_faces(one.volume, one.ids, merged=merged, limit=left, job=job)
                except pumice.InputError as error:
                    raise Refused(too_many(one.name, limit, error)) from error
                if count == 0:
                    raise Refused(f"{one.name}: no label is shown, so there is no surface")
                left -= count
                tell(f"Making {count} faces of {one.name}: {gigabytes(count)} in Cycles")
                one.faces = pumice.surface(one.volume, one.ids, merged=merged, shared_corners=True, job=job)
            return wanted

        return Work("Opening volumes", call, tells=True)

    def finish(self, context, result):
        for one in result:
            made, used = make(context, one)
            for line in one.left_out:
                self.report({"WARNING"}, line)
            if self.hide_volume:
                one.obj.hide_render = True
                one.obj.hide_set(True)
            count = len(made.data.polygons)
            self.report({"INFO"}, f"{made.name}: {count} faces, {used} materials; Cycles takes about {gigabytes(count)}")


def gigabytes(faces):
    """Memory of so many faces in Cycles, for people."""
    return f"{faces * BYTES_A_FACE / 1e9:.2g} GB"


def too_many(name, limit, error):
    """The line for a surface beyond the limit."""
    return f"{name}: {error}; {gigabytes(limit)} at {BYTES_A_FACE} bytes a face in Cycles: hide labels, merge faces, or allow more memory"


def make(context, one):
    """(mesh object of a volume's faces, number of its materials); it replaces the one that was made of the volume before."""
    volume = one.obj
    made = next((o for o in context.scene.objects if o.type == "MESH" and o.get(OF_VOLUME) == volume), None)
    name = f"{volume.name} exact"
    if made is None:
        made = bpy.data.objects.new(name, bpy.data.meshes.new(name))
        made[OF_VOLUME] = volume
        for collection in volume.users_collection:
            collection.objects.link(made)
    else:
        made.data = bpy.data.meshes.new(name)
        forget_unused()
    mesh = made.data
    mesh[MADE], mesh.name = True, name
    fill(mesh, one.faces)
    volume_place.move(mesh, one.object_from_index)
    used = wear(mesh, one)
    follow(made, volume)
    labels = one.volume.labels
    rows = zip(labels.ids.tolist(), labels.names, labels.types)
    made["labels"] = json.dumps([[label, name or None, kind or None] for label, name, kind in rows], ensure_ascii=False)
    made["data_hash"], made["source"] = one.volume.content_hash, os.path.basename(volume.pumice.source_path or volume.pumice.filepath)
    return made, used


def follow(made, volume):
    """Places an object by all that places a volume: parent, own matrix, constraints."""
    made.parent, made.parent_type = volume.parent, volume.parent_type
    made.parent_bone, made.parent_vertices = volume.parent_bone, volume.parent_vertices
    made.matrix_parent_inverse, made.matrix_basis = volume.matrix_parent_inverse.copy(), volume.matrix_basis.copy()
    made.constraints.clear()
    for constraint in volume.constraints:
        made.constraints.copy(constraint)


def forget_unused():
    """Removes meshes and materials that this module made and that nothing uses any more."""
    for blocks in (bpy.data.meshes, bpy.data.materials):
        for block in [b for b in blocks if b.get(MADE) and b.users == 0]:
            blocks.remove(block)


def fill(mesh, faces):
    """Gives a mesh the corners, quads and labels of faces, flat."""
    count = len(faces.quads)
    mesh.vertices.add(len(faces.vertices))
    mesh.vertices.foreach_set("co", faces.vertices.astype(np.float32).ravel())
    mesh.loops.add(4 * count)
    mesh.loops.foreach_set("vertex_index", faces.quads.view(np.int32).ravel())
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * count, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.shade_flat()
    mesh.attributes.new("label", "INT", "FACE").data.foreach_set("value", faces.labels.view(np.int32))


def wear(mesh, one):
    """Gives a mesh its materials; returns how many."""
    # Each pair of a group and a color that faces have, and its number by row of the table.
    rows = np.unique(one.faces.labels)
    colored = np.array([group.colored for group in one.groups])[one.of[rows]]
    wanted = np.column_stack([one.of[rows], np.where(colored[:, None], one.colors[rows], 0.0)])
    wanted, number = np.unique(wanted, axis=0, return_inverse=True)
    by_attribute = len(wanted) > MOST_MATERIALS
    if by_attribute:
        wanted, number = np.unique(one.of[rows], return_inverse=True)
        wanted = wanted[:, None]
    for index, (place, *color) in enumerate(wanted.astype(float).tolist(), start=1):
        group, name = one.groups[int(place)], f"{one.name} {index}"
        if not group.colored:
            mesh.materials.append(group.material or dressed(name, PLAIN))
        elif by_attribute:
            mesh.materials.append(colored_by_faces(dressed(name, group.fields)))
        else:
            mesh.materials.append(colored_as(group, name, color))
    if by_attribute:
        of_face = np.ones((len(one.faces.labels), 4), dtype=np.float32)
        of_face[:, :3] = one.colors[one.faces.labels]
        mesh.attributes.new("base_color", "FLOAT_COLOR", "FACE").data.foreach_set("color", of_face.ravel())
    of_row = np.zeros(len(one.shown), dtype=np.int32)
    of_row[rows] = number.ravel()
    mesh.polygons.foreach_set("material_index", of_row[one.faces.labels])
    return len(wanted)


def colored_by_faces(material):
    """The material, whose base color is now the attribute `base_color` of the faces."""
    shader = nodes.surface(material.node_tree, "OUTPUT_MATERIAL")
    attribute = material.node_tree.nodes.new("ShaderNodeAttribute")
    attribute.attribute_name, attribute.location = "base_color", (-300.0, 0.0)
    material.node_tree.links.new(attribute.outputs["Color"], shader.inputs["Base Color"])
    return material


def colored_as(group, name, color):
    """A material of one color: a copy of the group's own where that is a Principled BSDF, else what Pumice draws of it."""
    tree = nodes.tree(group.material) if group.material is not None else None
    shader = nodes.surface(tree, "OUTPUT_MATERIAL") if tree is not None else None
    if shader is None or shader.type != "BSDF_PRINCIPLED" or shader.mute:
        return dressed(name, {**group.fields, "base_color": color})
    copy = group.material.copy()
    copy.name, copy.pumice.colors_by_label, copy[MADE] = name, False, True
    socket = nodes.surface(copy.node_tree, "OUTPUT_MATERIAL").inputs["Base Color"]
    for link in list(socket.links):
        copy.node_tree.links.remove(link)
    dressing.set_value(socket, color)
    return copy


def dressed(name, fields):
    """A new material of the scene's fields."""
    material = bpy.data.materials.new(name)
    material[MADE] = True
    dressing.dress(material, fields)
    return material


def _menu(self, context):
    if context.object is not None and is_volume(context.object):
        self.layout.separator()
        self.layout.operator(PUMICE_OT_make_exact_mesh.bl_idname)


def register():
    bpy.utils.register_class(PUMICE_OT_make_exact_mesh)
    bpy.types.VIEW3D_MT_object.append(_menu)


def unregister():
    bpy.types.VIEW3D_MT_object.remove(_menu)
    bpy.utils.unregister_class(PUMICE_OT_make_exact_mesh)
