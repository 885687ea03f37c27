# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Removes the parts of a scene that the compiled module does not draw, and adds a line that says so for each."""

TRANSPARENT = True
CLAMPS = True
ADAPTIVE = True
SMOOTH_VOXELS = True
MESHES = True
SHADOW_CATCHER = True
SMOOTH_MESHES = True
CUTS = True
# Passes of a picture, and whether a scene must ask for them.
PASSES = frozenset(
    {
        *("depth", "position", "normal", "label", "albedo", "variance", "samples", "emission", "environment"),
        *("diffuse_direct", "diffuse_indirect", "diffuse_color"),
        *("glossy_direct", "glossy_indirect", "glossy_color"),
        "shadow_catcher",
        *("cryptomatte_label", "cryptomatte_type"),
        *("transmission_direct", "transmission_indirect", "transmission_color"),
    }
)
PASSES_ASKED = True
