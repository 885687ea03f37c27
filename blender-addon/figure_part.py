# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What scale bar and legend share: a mesh of rectangles in millimeters on paper with a text as its child, and colors that no light changes.

Each function writes only what differs: it runs after every change of the scene, and a write is a change.
"""

import bpy
import numpy as np

from .sync import dressing, nodes

COLLECTION = "Figure"


def create(context, name, kind, volume):
    """A new part of the figure with its text, in the figure's collection."""
    obj = bpy.data.objects.new(name, bpy.data.meshes.new(name))
    text = bpy.data.objects.new(f"{name} Text", bpy.data.curves.new(f"{name} Text", "FONT"))
    text.parent = obj
    text.data.materials.append(None)
    settings = obj.pumice_figure
    settings.kind, settings.volume, settings.text = kind, volume, text
    into = collection(context.scene)
    for one in (obj, text):
        into.objects.link(one)
    for other in context.selected_objects:
        other.select_set(False)
    obj.select_set(True)
    context.view_layer.objects.active = obj
    return obj


def collection(scene):
    """The collection of the figure's parts; a new one, in the scene, where there is none."""
    wishes = scene.pumice_figure
    if wishes.parts is None:
        wishes.parts = bpy.data.collections.new(COLLECTION)
    if wishes.parts not in scene.collection.children_recursive:
        scene.collection.children.link(wishes.parts)
    return wishes.parts


def parts(scene, kind=None):
    """The parts of the figure of a scene, those of one kind or all."""
    found = scene.pumice_figure.parts.objects if scene.pumice_figure.parts is not None else ()
    return [obj for obj in found if obj.pumice_figure.kind == kind or (kind is None and obj.pumice_figure.kind != "NONE")]


def text_of(obj):
    """The text of a part; None where it was deleted, or where a duplicate shares it with the part that it belongs to."""
    text = obj.pumice_figure.text
    return text if text is not None and text.parent == obj else None


def set_rectangles(mesh, rectangles):
    """Makes a mesh of rectangles (x, y, width, height), each with the material of its index."""
    corners = np.array(
        [(x + u * w, y + v * h, 0.0) for x, y, w, h in rectangles for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=np.float32
    ).reshape(-1, 3)
    there = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", there)
    if len(there) == corners.size and np.array_equal(there, corners.ravel()):
        return
    if len(there) == corners.size:
        mesh.vertices.foreach_set("co", corners.ravel())
    else:
        mesh.clear_geometry()
        mesh.from_pydata(corners.tolist(), [], [list(range(i, i + 4)) for i in range(0, len(corners), 4)])
        mesh.polygons.foreach_set("material_index", np.arange(len(rectangles), dtype=np.int32))
    mesh.update()


def set_text(text, body, *, size, place, align, spacing=1.0):
    """Sets what a text says and where its first line begins, in millimeters."""
    data = text.data
    for name, value in (("body", body), ("size", size), ("align_x", align), ("align_y", "TOP_BASELINE"), ("space_line", spacing)):
        set_value(data, name, value)
    for axis, value in enumerate((*place, 0.0)):
        if abs(text.location[axis] - value) > 1e-5:
            text.location[axis] = value


def set_colors(data, name, colors):
    """Gives an object's data one material for each color, which shines in just this color and is lit by nothing."""
    while len(data.materials) < len(colors):
        data.materials.append(None)
    while len(data.materials) > len(colors):
        data.materials.pop()
    for place, color in enumerate(colors):
        material, wanted = data.materials[place], tuple(np.float32(color).tolist())
        if material is not None and shown_color(material) == wanted:
            continue
        # A duplicate of a part shares the materials with it until it has a color of its own.
        if material is None or material.users > 1:
            material = data.materials[place] = bpy.data.materials.new(name)
            dressing.only_shader(material, "ShaderNodeEmission")
        nodes.surface(nodes.tree(material), "OUTPUT_MATERIAL").inputs["Color"].default_value = (*wanted, 1.0)
        material.diffuse_color = (*wanted, 1.0)  # for Solid shading


def shown_color(material):
    """The color of a material that `set_colors` made; None of another."""
    node = nodes.surface(nodes.tree(material), "OUTPUT_MATERIAL")
    return tuple(node.inputs["Color"].default_value)[:3] if node is not None and node.type == "EMISSION" else None


def set_value(owner, name, value):
    """Sets a property where it differs; numbers have single precision in Blender."""
    now = getattr(owner, name)
    if (np.float32(value) != np.float32(now)) if isinstance(value, float) else (value != now):
        setattr(owner, name, value)
