# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a material of the scene from the shader that is linked to the output of a Blender material.

    Principled BSDF                 its inputs, see `principled`
    another shader by itself        where the Principled BSDF can say the same, see `simple_shaders`
    no nodes (before Blender 5.0)   the viewport's color, metallic and roughness
    anything else                   the plain material, with a line that says so

A linked input is read as its own unlinked value and reported, unless the linked node is a constant. Fields with their default value are
not written, because a figure has 10⁵ materials.
"""

from . import nodes, principled, simple_shaders
from .surface import PLAIN, Surface


def read(material, of_labels=True):
    """(the scene's material, whether labels have colours of their own, what was left out); `material` may be None."""
    if material is None:
        return dict(PLAIN), of_labels, []
    by_label = of_labels and material.pumice.colors_by_label
    surface = Surface(f"Material {material.name}", by_label)
    _read(material, surface)
    return surface.fields, by_label, surface.left_out


class Dresses:
    """Materials of meshes, each read once however many objects use it; valid for one reading of a scene."""

    def __init__(self):
        self._read = {}

    def read(self, material):
        """(the scene's material, what was left out); `material` may be None."""
        key = None if material is None else material.original.session_uid
        if key not in self._read:
            dress, _, left_out = read(material, of_labels=False)
            self._read[key] = (dress, left_out)
        return self._read[key]


def _read(material, surface):
    tree = nodes.tree(material)
    if tree is None:
        surface.set_color("base_color", material.diffuse_color)
        surface.set_unit("metallic", material.metallic)
        surface.set_unit("roughness", material.roughness)
        return
    for socket in ("Volume", "Displacement"):
        if nodes.surface(tree, "OUTPUT_MATERIAL", socket) is not None:
            surface.leave_out(f"{socket} is not drawn")
    node = nodes.surface(tree, "OUTPUT_MATERIAL")
    if node is None:
        simple_shaders.black(surface)
    elif node.mute:
        surface.leave_out(f"{node.bl_label} is muted; a plain material is drawn")
    elif node.type == "BSDF_PRINCIPLED":
        principled.read(node, surface)
    elif node.type in simple_shaders.READERS:
        simple_shaders.READERS[node.type](node, surface)
    else:
        surface.leave_out(f"expected a Principled BSDF, got {node.bl_label}; a plain one is drawn")
