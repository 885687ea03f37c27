"""Measures Blender's view transforms: `LD_LIBRARY_PATH=… PYTHON measure.py OUT.npz`, with a Python that has Blender (`bpy`).

    OUT.npz   colors             (n, 3) scene-linear Rec. 709: 512 greys from 2⁻¹⁴ to 2¹⁰, black, 12,000 of any saturation, 12,000 whose
                                 channels are within a factor of five; all from 2⁻¹⁰ to 2⁵
              Standard, Filmic, AgX   (n, 3) values sent to an sRGB screen, 0 to 1, with 16 bits
"""

import os
import sys
from pathlib import Path

import bpy
import numpy as np

WIDTH = 256


def colors():
    random = np.random.default_rng(1)
    grey = np.repeat(2.0 ** np.linspace(-14, 10, 512)[:, None], 3, 1)
    strength = lambda: 2.0 ** random.uniform(-10, 5, (12000, 1))  # noqa: E731
    saturated = strength() * random.dirichlet([0.6] * 3, 12000) * 3
    ordinary = strength() * random.uniform(0.2, 1, (12000, 3))
    return np.vstack([grey, [[0, 0, 0]], saturated, ordinary]).astype(np.float32)


def shown(linear, view, folder):
    scene = bpy.context.scene
    height = -(-len(linear) // WIDTH)
    image = bpy.data.images.new("colors", WIDTH, height, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    pixels = np.zeros((height * WIDTH, 4), np.float32)
    pixels[: len(linear), :3], pixels[:, 3] = linear, 1
    image.pixels.foreach_set(pixels.ravel())
    scene.display_settings.display_device = "sRGB"
    scene.view_settings.view_transform, scene.view_settings.look = view, "None"
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "PNG", "16", "RGB"
    settings.color_management = "FOLLOW_SCENE"
    scene.render.dither_intensity = 0
    path = str(Path(folder) / "shown.png")
    image.save_render(path, scene=scene)
    for brought in Path(bpy.utils.resource_path("LOCAL")).glob("python/lib/python3*/site-packages"):
        sys.path.append(str(brought))
    import OpenImageIO

    file = OpenImageIO.ImageInput.open(path)
    # Blender stores the bottom row first.
    values = file.read_image(0, 0, 0, 3, "uint16").astype(np.float64)[::-1].reshape(-1, 3) / 65535
    file.close()
    return values[: len(linear)]


if __name__ == "__main__":
    linear = colors()
    views = {view: shown(linear, view, bpy.app.tempdir) for view in ("Standard", "Filmic", "AgX")}
    np.savez(sys.argv[1], colors=linear, **views)
    sys.stdout.flush()
    os._exit(0)
