# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The label colors in the material of a proxy: a Color Attribute node before the base color, so that EEVEE and Cycles show what Pumice shows.

    material.pumice.colors_by_label     on     Color Attribute "Label Color" ──► Base Color, where nothing else is linked
                                        off    the node is removed: labels have the material's own base color

Pumice itself takes the colors from the label table, and does not look at the node.
"""

from .sync import nodes

# The color attribute of the mesh, and the node that reads it.
LABEL_COLOR = "Label Color"


def follow(material):
    """Adds or removes the node of a material, which may be None, as its *Colors by Label* says."""
    tree = nodes.tree(material) if material is not None else None
    shader = nodes.surface(tree, "OUTPUT_MATERIAL") if tree is not None else None
    socket = None if shader is None else shader.inputs.get("Base Color") or shader.inputs.get("Color")
    if socket is None:
        return
    mine = tree.nodes.get(LABEL_COLOR)
    if not material.pumice.colors_by_label:
        if mine is not None:
            tree.nodes.remove(mine)
    elif not socket.is_linked:
        if mine is None:
            mine = tree.nodes.new("ShaderNodeVertexColor")
            mine.name, mine.layer_name = LABEL_COLOR, LABEL_COLOR
            mine.location = (shader.location[0] - 220.0, shader.location[1])
        tree.links.new(mine.outputs["Color"], socket)
