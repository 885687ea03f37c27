# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parts of a scene the compiled module draws. What it does not is left out here, with a line that says so: the module itself
refuses a scene that has it (`render/src/undrawn.rs`)."""

TRANSPARENT = False
CLAMPS = False
ADAPTIVE = False
SMOOTH_VOXELS = False
MESHES = True
SHADOW_CATCHER = False
SMOOTH_MESHES = False
CUTS = True
# Fields of a material beyond base colour, metallic, roughness, specular, ior, emission and multiscatter.
LOBES = frozenset(
    {"specular_tint", "transmission", "subsurface", "subsurface_radius", "alpha", "coat", "coat_roughness", "coat_ior", "coat_tint"}
)
# Passes of a picture, and whether a scene must ask for them.
PASSES = frozenset({"depth", "normal", "label", "albedo", "variance"})
PASSES_ASKED = False
