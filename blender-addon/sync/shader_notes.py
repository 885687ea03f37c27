# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The shader of a Blender material as plain values, so that it survives a file that has no words for it.

    note    {"name": …, "shader": type of the node at the output, "settings": {property: value}, "inputs": {identifier: value},
             "linked": [names of the inputs that a texture or another node feeds]}

What feeds an input is not in the note: the file keeps of it what its own materials can say, and `apply` leaves those inputs alone.
"""

import bpy

from . import dressing, materials, nodes

# Sockets whose value is numbers; shaders and the like have none.
WITH_VALUE = {"VALUE", "RGBA", "VECTOR", "INT", "BOOLEAN"}


def note(material):
    """(note, what it lacks) of a material."""
    owner = f"Material {material.name}"
    tree = nodes.tree(material)
    if tree is None:
        # Before Blender 5.0 a material may have no nodes; it is drawn by its viewport values.
        fields, _, left_out = materials.read(material, of_labels=False)
        return {"name": material.name, "fields": fields}, left_out
    lacks = [
        f"{owner}: its {socket.lower()} is not in the file"
        for socket in ("Volume", "Displacement")
        if nodes.surface(tree, "OUTPUT_MATERIAL", socket) is not None
    ]
    node = nodes.surface(tree, "OUTPUT_MATERIAL")
    if node is None or node.mute or any(socket.type == "SHADER" and nodes.source(socket) for socket in node.inputs):
        what = "nothing" if node is None else node.bl_label
        return {"name": material.name}, [*lacks, f"{owner}: its nodes ({what} at the output) arrive as the file's own materials have them"]
    inputs, linked = {}, []
    for socket in node.inputs:
        if socket.type not in WITH_VALUE:
            continue
        value, whole = nodes.value(socket)
        if whole:
            inputs[socket.identifier] = plain(value)
        else:
            linked.append(socket.name)
    if linked:
        lacks.append(f"{owner}: what is linked to {', '.join(linked)} arrives as the file's own materials have it")
    return {"name": material.name, "shader": node.bl_idname, "settings": settings(node), "inputs": inputs, "linked": linked}, lacks


def apply(material, said):
    """Gives a material that an importer made the shader of a note; returns the names of values that this Blender lacks or refuses."""
    if "fields" in said:
        dressing.dress(material, said["fields"])
    if "shader" not in said:
        return []
    tree = nodes.ensure(material)
    node = nodes.surface(tree, "OUTPUT_MATERIAL")
    if node is None or node.bl_idname != said["shader"]:
        node = dressing.only_shader(material, said["shader"])
    refused = []
    for name, value in said["settings"].items():
        try:
            setattr(node, name, value)
        except (AttributeError, TypeError, ValueError):
            refused.append(f"{node.bl_label}.{name}")
    by_identifier = {socket.identifier: socket for socket in node.inputs}
    for identifier, value in said["inputs"].items():
        socket = by_identifier.get(identifier)
        if socket is None or socket.type not in WITH_VALUE:
            refused.append(f"{node.bl_label}.{identifier}")
            continue
        for link in list(socket.links):
            tree.links.remove(link)
        socket.default_value = value
    return refused


def settings(node):
    """Choices of a node besides its inputs, such as the distribution of microfacets."""
    common = set(bpy.types.ShaderNode.bl_rna.properties.keys())
    own = [p for p in node.bl_rna.properties if p.identifier not in common and not p.is_readonly]
    return {p.identifier: plain(getattr(node, p.identifier)) for p in own if p.type in {"ENUM", "BOOLEAN", "INT", "FLOAT", "STRING"}}


def plain(value):
    """A value of Blender as JSON has it."""
    if isinstance(value, (bool, int, float, str)):
        return value
    return [plain(one) for one in value]
