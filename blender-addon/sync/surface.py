# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A material of the scene while it is read: its fields (docs/scene.md), and lines about what they cannot express."""

from . import nodes

# Always written; the values are the scene's defaults.
PLAIN = {
    "base_color": [0.8, 0.8, 0.8],
    "metallic": 0.0,
    "roughness": 0.5,
    "specular": 0.5,
    "ior": 1.5,
    "emission": [0.0, 0.0, 0.0],
}
# Written where they differ.
DEFAULTS = {
    "specular_tint": [1.0, 1.0, 1.0],
    "transmission": 0.0,
    "subsurface": 0.0,
    "coat": 0.0,
    "sheen": 0.0,
    "alpha": 1.0,
    "multiscatter": True,
}


class Surface:
    """Fields of a material, and lines about what was left out; `owner` begins each line."""

    def __init__(self, owner, by_label=False):
        self.owner, self.by_label = owner, by_label
        self.fields = dict(PLAIN)
        self.left_out = []

    def leave_out(self, what):
        """Adds a line."""
        self.left_out.append(f"{self.owner}: {what}")

    def value(self, node, name):
        """The value of a node's input; None where this Blender's node has no such input."""
        socket = node.inputs.get(name)
        if socket is None:
            return None
        value, whole = nodes.value(socket)
        # Labels have base colours of their own, so a link to the base colour is ignored.
        if not whole and not (self.by_label and name in {"Base Color", "Color"}):
            self.leave_out(f"what is linked to {name} is not drawn; its own value is used")
        return value

    def number(self, node, name, otherwise=0.0):
        """A number of at least 0."""
        value = self.value(node, name)
        return otherwise if value is None else max(0.0, float(value))

    def color(self, node, name):
        """Three numbers of at least 0."""
        return [max(0.0, float(c)) for c in list(self.value(node, name))[:3]]

    def set(self, field, value):
        """Sets a field; one that has its default is not written."""
        if field in PLAIN or value != DEFAULTS.get(field):
            self.fields[field] = value

    def set_unit(self, field, value):
        """Sets a number from 0 to 1. Blender's own fields keep it in this range; only scripts and drivers can exceed it."""
        self.set(field, clamped(value))

    def set_color(self, field, color):
        """Sets a colour of 0 to 1; Blender's may be brighter."""
        color = [float(c) for c in list(color)[:3]]
        if max(color) > 1.0:
            self.leave_out(f"{field.replace('_', ' ')} is drawn as 1 where it is above")
        self.set(field, [clamped(c) for c in color])

    def must_be_plain(self, node, **inputs):
        """Adds a line for each input that the scene cannot express and that has an effect: it is linked, or differs from the value given
        (None: only if linked)."""
        for name, rest in inputs.items():
            socket = node.inputs.get(name.replace("_", " "))
            if socket is None or not socket.enabled:
                continue
            if rest is None:
                unlike = nodes.source(socket) is not None
            else:
                value, whole = nodes.value(socket)
                unlike = not whole or float(value) != rest
            if unlike:
                self.leave_out(f"{socket.name} is not drawn")


def clamped(value):
    """The value clamped to 0 to 1."""
    return min(1.0, max(0.0, float(value)))
