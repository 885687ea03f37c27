# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The world's light: a Background node of one colour.

What else a world's nodes can be (sky textures, pictures, mixes) is not drawn; the line that says so names the node.
"""

from . import nodes

BLACK = {"environment": {"constant": {"radiance": [0.0, 0.0, 0.0]}}, "backdrop": None}


def read(world):
    """The scene's world, and what was left out of Blender's."""
    if world is None:
        return BLACK, []
    tree = nodes.tree(world)
    if tree is None:
        return _constant(world.color, 1.0), []
    node = nodes.surface(tree, "OUTPUT_WORLD")
    if node is None:
        return BLACK, []
    if node.bl_idname != "ShaderNodeBackground":
        return BLACK, [f"World: {node.bl_label} is not drawn yet; the sky is black"]
    left_out = [
        f"World: what is linked to {socket.name} is not drawn yet; its own value is used"
        for socket in (node.inputs["Color"], node.inputs["Strength"])
        if socket.is_linked
    ]
    return _constant(node.inputs["Color"].default_value, node.inputs["Strength"].default_value), left_out


def _constant(color, strength):
    radiance = [max(0.0, float(c) * float(strength)) for c in list(color)[:3]]
    return {"environment": {"constant": {"radiance": radiance}}, "backdrop": None}
