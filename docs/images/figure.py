"""Makes figure.png: a piece of the shipped mouse cortex in Blender, cut by a plane, with the scale bar and the legend of the extension.

    target/venv-bpy/bin/python docs/images/figure.py ZIP     a minute; ZIP is the extension, as `cargo xtask extension` packs it

Samples are those of the processor's renderer, so another machine gives the same picture.
"""

import os
import shutil
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve()
VOLUME = HERE.parents[2] / "data/connectomics_32x32x40nm.nrrd"


def main(extension, folder):
    os.environ["BLENDER_USER_RESOURCES"] = str(folder / "blender")
    import bpy

    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.extensions.package_install_files(filepath=extension, repo="user_default", enable_on_install=True)
    shutil.copyfile(VOLUME, folder / "cortex.nrrd")
    bpy.ops.pumice.import_volume(filepath=str(folder / "cortex.nrrd"))
    scene, volume = bpy.context.scene, bpy.context.object
    scene.render.engine, scene.view_settings.view_transform = "PUMICE", "Standard"
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.9, 0.92, 0.95, 1.0)
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 19.0
    scene.pumice_figure.width_mm, scene.pumice_figure.height_mm, scene.pumice_figure.dpi = 80.0, 50.0, 200
    scene.pumice.samples, scene.pumice.bounces, scene.pumice.backend = 96, 4, "CPU"
    bpy.data.lights["Pumice Sun"].energy = 2.0
    bpy.context.view_layer.update()

    bpy.ops.pumice.add_cut(shape="BOX")
    bpy.context.view_layer.objects.active = volume
    # Of the largest; the first of them is the cell body at the block's foot.
    bpy.ops.pumice.labels_select(ids="25024949, 24183237, 28336523, 28673074, 28792756, 28794499")
    bpy.ops.pumice.add_legend(entries="SELECTED")
    bpy.context.view_layer.objects.active = volume
    bpy.ops.pumice.add_scale_bar()
    bpy.context.object.pumice_figure.text_mm = 3.5

    image = scene.render.image_settings
    image.file_format, image.color_mode, image.compression = "PNG", "RGBA", 100
    scene.render.filepath = str(folder / "figure.png")
    bpy.ops.render.render(write_still=True)
    shutil.copyfile(scene.render.filepath, HERE.with_suffix(".png"))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        main(os.path.abspath(sys.argv[1]), Path(made))
        sys.stdout.flush()
        shutil.rmtree(made)
        # Blender may crash when an interpreter in which an engine ran shuts down.
        os._exit(0)
