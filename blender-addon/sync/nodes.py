# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees of materials, worlds and lights: finds the tree in use, the shader linked to its output, and the value of an input."""

import bpy


def tree(owner):
    """The node tree that is in use; None without one. Since Blender 5.0 materials and worlds always use theirs."""
    in_use = owner.node_tree is not None and (bpy.app.version >= (5, 0, 0) or owner.use_nodes)
    return owner.node_tree if in_use else None


def ensure(owner):
    """The node tree of a new material or world."""
    if bpy.app.version < (5, 0, 0):
        owner.use_nodes = True
    return owner.node_tree


def surface(tree, output_type, socket="Surface"):
    """The node that reaches an input of the output that Cycles takes; None where nothing does. An output of Cycles alone comes before one of
    all engines, and one of another engine is none."""
    output = tree.get_output_node("CYCLES")
    return source(output.inputs[socket]) if output is not None and output.type == output_type else None


def source(socket):
    """The node that an input is linked to, past reroutes; None where it is not, or the link is muted."""
    while socket.is_linked:
        link = socket.links[0]
        if link.is_muted:
            return None
        node = link.from_node
        if node.type != "REROUTE":
            return node
        socket = node.inputs[0]
    return None


def value(socket):
    """(value of an input, whether it is exact): a linked constant is read; for any other link the input's own value is returned."""
    node = source(socket)
    if node is None:
        return socket.default_value, True
    constant = {"RGB": "RGBA", "VALUE": "VALUE"}.get(node.type)
    if constant is None or node.mute:
        return socket.default_value, False
    got = node.outputs[0].default_value
    if constant == socket.type:
        return got, True
    if constant == "VALUE" and socket.type in {"RGBA", "VECTOR"}:
        return (got, got, got, 1.0), True
    return socket.default_value, False
