# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The Principled BSDF of Blender 4.2 and later: the scene's material has its lobes under its names.

    Subsurface Radius × Scale    subsurface_radius       Emission Color × Strength    emission
    distribution MULTI_GGX       multiscatter            Specular IOR Level           specular

Not drawn: anisotropy, thin films, rough diffuse (Oren-Nayar), normal and bump maps, thin walls. Lobes that weigh nothing are not read.
"""


def read(node, surface):
    """Reads a node into a Surface."""
    surface.set_color("base_color", surface.color(node, "Base Color"))
    surface.set_unit("metallic", surface.number(node, "Metallic"))
    surface.set_unit("roughness", surface.number(node, "Roughness"))
    surface.set("specular", surface.number(node, "Specular IOR Level"))
    surface.set_color("specular_tint", surface.color(node, "Specular Tint"))
    ior(node, surface)
    surface.set_unit("alpha", surface.number(node, "Alpha"))
    surface.set("multiscatter", node.distribution == "MULTI_GGX")
    strength = surface.number(node, "Emission Strength")
    if strength > 0.0:
        surface.set("emission", [c * strength for c in surface.color(node, "Emission Color")])

    surface.set_unit("transmission", surface.number(node, "Transmission Weight"))
    surface.set_unit("subsurface", surface.number(node, "Subsurface Weight"))
    if "subsurface" in surface.fields:
        scale = surface.number(node, "Subsurface Scale")
        surface.set("subsurface_radius", [r * scale for r in surface.color(node, "Subsurface Radius")])
        surface.must_be_plain(node, Subsurface_Anisotropy=0.0)
    surface.set_unit("coat", surface.number(node, "Coat Weight"))
    if "coat" in surface.fields:
        surface.set_unit("coat_roughness", surface.number(node, "Coat Roughness"))
        surface.set("coat_ior", max(1.0, surface.number(node, "Coat IOR")))
        surface.set_color("coat_tint", surface.color(node, "Coat Tint"))
        surface.must_be_plain(node, Coat_Normal=None)
    surface.set_unit("sheen", surface.number(node, "Sheen Weight"))
    if "sheen" in surface.fields:
        surface.set_unit("sheen_roughness", surface.number(node, "Sheen Roughness"))
        surface.set_color("sheen_tint", surface.color(node, "Sheen Tint"))
    surface.must_be_plain(
        node, Normal=None, Anisotropic=0.0, Thin_Film_Thickness=0.0, Diffuse_Roughness=0.0, Thin_Wall=0.0
    )


def ior(node, surface):
    """An index of refraction: the scene's begin at 1."""
    value = surface.number(node, "IOR")
    if value < 1.0:
        surface.leave_out(f"an IOR of {value:g} is not drawn; 1 is")
    surface.set("ior", max(1.0, value))
