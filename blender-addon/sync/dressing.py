# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes a Blender material of a material of the scene: one Principled BSDF with its values, what `principled` reads the other way round."""

from . import nodes
from .surface import DEFAULTS, PLAIN

# The scene's defaults of all fields (docs/scene.md).
WHOLE = {
    **PLAIN,
    **DEFAULTS,
    "subsurface_radius": [0.05, 0.01, 0.005],
    "coat_roughness": 0.03,
    "coat_ior": 1.5,
    "coat_tint": [1.0, 1.0, 1.0],
    "sheen_roughness": 0.5,
    "sheen_tint": [1.0, 1.0, 1.0],
}
# Inputs of the node by field; colours get an alpha of 1.
INPUTS = {
    "base_color": "Base Color",
    "metallic": "Metallic",
    "roughness": "Roughness",
    "ior": "IOR",
    "alpha": "Alpha",
    "specular": "Specular IOR Level",
    "specular_tint": "Specular Tint",
    "transmission": "Transmission Weight",
    "subsurface": "Subsurface Weight",
    "subsurface_radius": "Subsurface Radius",
    "coat": "Coat Weight",
    "coat_roughness": "Coat Roughness",
    "coat_ior": "Coat IOR",
    "coat_tint": "Coat Tint",
    "sheen": "Sheen Weight",
    "sheen_roughness": "Sheen Roughness",
    "sheen_tint": "Sheen Tint",
    "emission": "Emission Color",
}


def dress(material, fields):
    """Replaces the nodes of a material by one Principled BSDF with the scene's `fields`; fields that are missing have their defaults."""
    node = only_shader(material, "ShaderNodeBsdfPrincipled")
    whole = {**WHOLE, **fields}
    node.distribution = "MULTI_GGX" if whole["multiscatter"] else "GGX"
    for field, name in INPUTS.items():
        set_value(node.inputs[name], whole[field])
    # Radii and radiance of the scene are whole values, which Blender divides in two factors.
    node.inputs["Subsurface Scale"].default_value = 1.0
    node.inputs["Emission Strength"].default_value = 1.0


def only_shader(material, idname):
    """A new shader node, linked to the output of a material that has no other nodes."""
    tree = nodes.ensure(material)
    tree.nodes.clear()
    node, output = tree.nodes.new(idname), tree.nodes.new("ShaderNodeOutputMaterial")
    output.location = (300.0, 0.0)
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return node


def set_value(socket, value):
    """Sets an input to a number or a list of numbers; a colour of three numbers gets an alpha of 1."""
    if isinstance(value, list) and len(value) == 3 and socket.type == "RGBA":
        value = [*value, 1.0]
    socket.default_value = value
