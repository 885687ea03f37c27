# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees of materials, worlds and lights: which there is, and which shader reaches its output."""

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


def surface(tree, output_type):
    """The node whose shader reaches the surface of the active output; None where nothing does."""
    outputs = [n for n in tree.nodes if n.type == output_type]
    active = next((n for n in outputs if n.is_active_output), outputs[0] if outputs else None)
    if active is None or not active.inputs["Surface"].is_linked:
        return None
    link = active.inputs["Surface"].links[0]
    while link.from_node.type == "REROUTE":
        links = link.from_node.inputs[0].links
        if not links:
            return None
        link = links[0]
    return link.from_node
