# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Colors along a scale from 0 to 1, linear Rec. 709: four color maps, and the color ramp of the scene.

Blender has color ramps in nodes and in textures alone. The scene's is that of a texture, to which `scene.pumice.ramp` points: so it is saved,
copied and undone with the scene, and every node tree stays as it is. It begins as viridis.
"""

import bpy
import numpy as np

from . import label_table

MAPS = (
    ("VIRIDIS", "Viridis", "From dark blue to yellow, also for color-blind eyes", 0),
    ("MAGMA", "Magma", "From black through purple to light yellow", 1),
    ("INFERNO", "Inferno", "From black through red to light yellow", 2),
    ("PLASMA", "Plasma", "From blue through red to yellow", 3),
    ("RAMP", "Color Ramp", "The color ramp of the scene", 4),
)
# Nine sRGB steps of each map (N. Smith, S. van der Walt, E. Firing; CC0).
STEPS = {
    "VIRIDIS": "440154 472c7a 3b518b 2c718e 21908d 27ad81 5cc863 aadc32 fde725",
    "MAGMA": "000004 1d1147 51127c 822681 b63679 e65164 fb8861 fec287 fcfdbf",
    "INFERNO": "000004 210c4a 56106e 89226a bb3754 e35932 f98c0a f9c932 fcffa4",
    "PLASMA": "0d0887 4c02a1 7e03a8 a92395 cc4678 e56b5d f89441 fdc328 f0f921",
}


def colors(which, places, scene):
    """Colors (n, 3) at places from 0 to 1."""
    if which == "RAMP":
        ramp = of_scene(scene).color_ramp
        distinct, back = np.unique(places, return_inverse=True)
        return np.array([ramp.evaluate(place)[:3] for place in distinct.tolist()]).reshape(-1, 3)[back.ravel()]
    srgb = steps(which)
    return label_table.linear_from_srgb(np.stack([np.interp(places, np.linspace(0.0, 1.0, len(srgb)), axis) for axis in srgb.T], axis=1))


def steps(which):
    """The sRGB steps of a map, (9, 3) from 0 to 1."""
    return np.array([[int(text[at : at + 2], 16) for at in (0, 2, 4)] for text in STEPS[which].split()]) / 255.0


def of_scene(scene):
    """The texture that has the scene's color ramp, made where there is none. Not to be called while Blender draws."""
    texture = scene.pumice.ramp
    if texture is None or texture.color_ramp is None:
        texture = scene.pumice.ramp = bpy.data.textures.new("Pumice Color Ramp", "BLEND")
        texture.use_color_ramp = True
        elements, linear = texture.color_ramp.elements, label_table.linear_from_srgb(steps("VIRIDIS")).tolist()
        for place in range(1, len(linear) - 1):
            elements.new(place / (len(linear) - 1))
        for stop, color in zip(elements, linear):
            stop.color = (*color, 1.0)
    return texture
