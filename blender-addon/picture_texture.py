# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws a frame over the whole region; each frame is uploaded once, by its serial.

A coarse frame has fewer pixels than the region and is stretched. Frames are scene-linear; Blender's viewport applies the view transform.
"""

import gpu
from gpu_extras.presets import draw_texture_2d


def upload(frame):
    """A texture of a frame, from the frame's own memory, rows from the bottom: nothing is copied in Python."""
    pixels = gpu.types.Buffer("FLOAT", (frame.height, frame.width, 4), frame)
    return gpu.types.GPUTexture((frame.width, frame.height), format="RGBA32F", data=pixels)


class PictureTexture:
    """The texture of the last frame drawn."""

    def __init__(self):
        self._texture = None
        self._of = None

    def draw(self, engine, scene, frame, width, height):
        """Draws a frame over `width` × `height` pixels of the region."""
        if self._of is not frame:
            self._texture, self._of = upload(frame), frame
        gpu.state.blend_set("ALPHA_PREMULT")
        engine.bind_display_space_shader(scene)
        draw_texture_2d(self._texture, (0, 0), width, height)
        engine.unbind_display_space_shader()
        gpu.state.blend_set("NONE")
