"""Makes forms.png: a piece of the shipped mouse cortex in the forms boxes, cells4, voxels and smooth, drawn by Blender's Cycles from the
stages that `pumice export` writes, with the camera, the sun and the world that are in them.

    target/venv-bpy/bin/python docs/images/forms.py [PUMICE]     half a minute

`cargo xtask test --only blender` makes that Python. Samples and denoiser are those of Blender 5.0.1; another Blender, or another kind of
processor, gives other bits of the same picture.
"""

import subprocess
import tempfile
from pathlib import Path

import bpy
import dendrites
import OpenImageIO

FORMS = ["boxes", "cells4", "voxels", "smooth"]
WIDTH, HEIGHT = 320, 250
BACKGROUND = 0.93


def drawn_by_cycles(stage, picture):
    """The pixels of a stage, over a flat background: height × width × 3, as sRGB."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    # The importer fills the world that is there.
    scene.world = bpy.data.worlds.new("world")
    bpy.ops.wm.usd_import(filepath=str(stage))
    scene.camera = next(thing for thing in bpy.data.objects if thing.type == "CAMERA")
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 256
    scene.cycles.use_denoising = True
    scene.render.film_transparent = True
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    scene.render.filepath = str(picture)
    bpy.ops.render.render(write_still=True)
    # OpenImageIO multiplies colours by alpha.
    pixels = OpenImageIO.ImageBuf(str(picture)).get_pixels(OpenImageIO.FLOAT)
    return pixels[..., :3] + (1 - pixels[..., 3:]) * BACKGROUND


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        scene = dendrites.scene(folder, WIDTH, HEIGHT)
        region = ["--region", ",".join(map(str, dendrites.REGION))]
        tiles = []
        for form in FORMS:
            stage = folder / f"{form}.usdc"
            export = [dendrites.command(), "export", scene, "-o", stage, "--form", form, "--for", "blender", *region]
            subprocess.run(export, check=True)
            tiles.append(drawn_by_cycles(stage, folder / f"{form}.png"))
    dendrites.write_png(Path(__file__).with_suffix(".png"), tiles)


if __name__ == "__main__":
    main()
