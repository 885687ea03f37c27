# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads single shaders linked to a material's output, expressed as a Principled BSDF.

    Diffuse              base color, no specular layer: bit for bit the same in Cycles
    Emission             that emission on black
    Transparent, grey g  black of alpha 1 − g
    Metallic (F82)       metallic 1, the edge as specular tint
    Glass, white         transmission 1
    Glossy, white        metallic 1: the Fresnel term of a white metal is 1 at every angle
    Sheen (microfiber)   sheen 1 on black

A coloured Glossy or Glass has no Fresnel term of the Principled kind; an approximation is drawn, and a line says so.
"""

from . import principled


def black(surface):
    """A black surface that absorbs all light."""
    surface.set("base_color", [0.0, 0.0, 0.0])
    surface.set("roughness", 1.0)
    surface.set("specular", 0.0)


def diffuse(node, surface):
    """Diffuse BSDF."""
    black(surface)
    surface.set_color("base_color", surface.color(node, "Color"))
    surface.must_be_plain(node, Roughness=0.0, Normal=None)


def emission(node, surface):
    """Emission."""
    black(surface)
    strength = surface.number(node, "Strength")
    surface.set("emission", [c * strength for c in surface.color(node, "Color")])


def transparent(node, surface):
    """Transparent BSDF."""
    black(surface)
    color = surface.color(node, "Color")
    if max(color) - min(color) > 0.0:
        surface.leave_out("a Transparent BSDF is drawn grey")
    surface.set_unit("alpha", 1.0 - sum(color) / 3.0)


def metallic(node, surface):
    """Metallic BSDF (Blender 4.3)."""
    if node.fresnel_type != "F82":
        surface.leave_out("a Metallic BSDF of physical conductors is drawn by its base color and edge tint")
    surface.set("metallic", 1.0)
    surface.set_color("base_color", surface.color(node, "Base Color"))
    surface.set_color("specular_tint", surface.color(node, "Edge Tint"))
    _rough(node, surface)
    surface.must_be_plain(node, Anisotropy=0.0, Normal=None, Thin_Film_Thickness=0.0)


def glossy(node, surface):
    """Glossy BSDF."""
    surface.set("metallic", 1.0)
    surface.set_color("base_color", surface.color(node, "Color"))
    if surface.fields["base_color"] != [1.0, 1.0, 1.0]:
        surface.leave_out("a Glossy BSDF of another color than white is drawn as metal, which is brighter at the edges")
    _rough(node, surface)
    surface.must_be_plain(node, Anisotropy=0.0, Normal=None)


def glass(node, surface):
    """Glass BSDF. The Principled's glass takes the root of its colour at each of the two surfaces."""
    surface.set("transmission", 1.0)
    color = surface.color(node, "Color")
    surface.set_color("base_color", [c * c for c in color])
    if surface.fields["base_color"] != [1.0, 1.0, 1.0]:
        surface.leave_out("the color of a Glass BSDF is not drawn in its reflection")
    principled.ior(node, surface)
    _rough(node, surface)
    surface.must_be_plain(node, Normal=None, Thin_Film_Thickness=0.0)


def sheen(node, surface):
    """Sheen BSDF."""
    black(surface)
    if node.distribution != "MICROFIBER":
        surface.leave_out("an Ashikhmin Sheen BSDF is drawn as microfiber")
    surface.set("sheen", 1.0)
    surface.set_unit("sheen_roughness", surface.number(node, "Roughness"))
    surface.set_color("sheen_tint", surface.color(node, "Color"))
    surface.must_be_plain(node, Normal=None)


def _rough(node, surface):
    surface.set_unit("roughness", surface.number(node, "Roughness"))
    surface.set("multiscatter", node.distribution == "MULTI_GGX")
    if node.distribution not in {"MULTI_GGX", "GGX"}:
        surface.leave_out(f"the distribution {node.distribution.replace('_', ' ').capitalize()} is drawn as GGX")


READERS = {
    "BSDF_DIFFUSE": diffuse,
    "EMISSION": emission,
    "BSDF_TRANSPARENT": transparent,
    "BSDF_METALLIC": metallic,
    "BSDF_GLOSSY": glossy,
    "BSDF_GLASS": glass,
    "BSDF_SHEEN": sheen,
}
