# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A volume's material from the Principled BSDF of its first slot.

    Base Color, Metallic, Roughness, Specular IOR Level, IOR, Emission Color × Strength     are taken
    links into them, and lobes that weigh something (coat, sheen, transmission, …)          are named as left out
"""

from . import nodes

PLAIN = {
    "base_color": [0.8, 0.8, 0.8],
    "metallic": 0.0,
    "roughness": 0.5,
    "specular": 0.5,
    "ior": 1.5,
    "emission": [0.0, 0.0, 0.0],
}
TAKEN = (
    "Base Color",
    "Metallic",
    "Roughness",
    "Specular IOR Level",
    "IOR",
    "Emission Color",
    "Emission Strength",
)
LOBES = ("Subsurface Weight", "Transmission Weight", "Coat Weight", "Sheen Weight", "Anisotropic", "Thin Film Thickness")


def read(material):
    """(the scene's material, whether labels have colours of their own, what was left out); `material` may be None."""
    if material is None:
        return dict(PLAIN), True, []
    by_label = material.pumice.colors_by_label
    name = material.name
    tree = nodes.tree(material)
    if tree is None:
        plain = dict(PLAIN, base_color=_unit(material.diffuse_color), metallic=float(material.metallic))
        return dict(plain, roughness=float(material.roughness)), by_label, []
    node = nodes.surface(tree, "OUTPUT_MATERIAL")
    if node is None or node.type != "BSDF_PRINCIPLED":
        got = "nothing" if node is None else node.bl_label
        return dict(PLAIN), by_label, [f"Material {name}: expected a Principled BSDF, got {got}; a plain one is drawn"]

    value = {key: node.inputs[key].default_value for key in TAKEN}
    left_out = [
        f"Material {name}: what is linked to {key} is not drawn yet; its own value is used"
        for key in TAKEN
        if node.inputs[key].is_linked and not (key == "Base Color" and by_label)
    ]
    for key in LOBES:
        socket = node.inputs.get(key)
        if socket is not None and (socket.is_linked or socket.default_value > 0.0):
            left_out.append(f"Material {name}: {key} is not drawn yet")
    if node.inputs["Alpha"].is_linked or node.inputs["Alpha"].default_value < 1.0:
        left_out.append(f"Material {name}: Alpha is not drawn yet")
    strength = max(0.0, float(value["Emission Strength"]))
    read = {
        "base_color": _unit(value["Base Color"]),
        "metallic": _clamp(value["Metallic"]),
        "roughness": _clamp(value["Roughness"]),
        "specular": max(0.0, float(value["Specular IOR Level"])),
        "ior": max(1.0, float(value["IOR"])),
        "emission": [max(0.0, float(c)) * strength for c in list(value["Emission Color"])[:3]],
    }
    return read, by_label, left_out


def _unit(color):
    return [_clamp(c) for c in list(color)[:3]]


def _clamp(value):
    """Into 0 to 1, where Blender's own fields keep these values; only scripts and drivers can leave it."""
    return min(1.0, max(0.0, float(value)))
