# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that Blender's Cryptomatte node finds Pumice's mattes by name, in F12 renders and in files of the command."""

import subprocess

import numpy as np
import pumice
import pytest

from test_real_volumes import SIZE, SPP, exr, scene  # noqa: F401  (scene is a fixture)


def composed(blender, scene, tmp_path, source, matte, image=None):  # noqa: F811
    """The matte of a name by Blender's compositor, from a new render or from an image."""
    if blender.app.version >= (5, 0, 0):
        tree = blender.data.node_groups.new("Mattes", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
        out = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        out = tree.nodes.new("CompositorNodeComposite")
    scene.render.use_compositing = True
    node = tree.nodes.new("CompositorNodeCryptomatteV2")
    node.source = source
    if image is not None:
        node.image = image
    else:
        node.scene = scene
    node.layer_name = "ViewLayer.CryptoObject"
    node.matte_id = matte
    tree.links.new(node.outputs["Matte"], out.inputs[0])
    # Writes only the composited picture.
    if blender.app.version >= (5, 0, 0):
        scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(tmp_path / f"{source}.exr")
    blender.ops.render.render(write_still=True)
    written = exr(tmp_path / f"{source}.exr")
    return next(v for k, v in written.items() if k.endswith((".R", ".V", ".Y")))


@pytest.mark.parametrize("source", ["RENDER", "IMAGE"])
def test_the_compositor_finds_labels_by_name(scene, blender, pumice_command, tmp_path, source):  # noqa: F811
    layer = blender.context.view_layer
    layer.use_pass_cryptomatte_object, layer.pass_cryptomatte_depth = True, 6
    assert blender.ops.pumice.export_scene(filepath=str(tmp_path / "scene.json")) == {"FINISHED"}
    command = [pumice_command, "render", "scene.json", "-o", "command.exr", "--spp", str(SPP), "--backend", "cpu"]
    subprocess.run([*command, "--passes", "cryptomatte"], cwd=tmp_path, check=True, capture_output=True)
    file = exr(tmp_path / "command.exr")
    ids = np.stack([file[f"CryptoObject{n:02}.{c}"] for n in range(3) for c in "rb"], axis=-1)
    covered = np.stack([file[f"CryptoObject{n:02}.{c}"] for n in range(3) for c in "ga"], axis=-1)
    values, counts = np.unique(ids[covered > 0], return_counts=True)
    wanted = values[np.argmax(counts)]
    labels = pumice.open(blender.context.object.pumice.filepath).labels.ids
    as_float = lambda name: np.uint32(pumice.cryptomatte_hash(name)).view(np.float32)  # noqa: E731
    name = next(str(i) for i in labels if as_float(str(i)) == wanted)
    expected = np.where(ids == wanted, covered, 0).sum(axis=-1)
    image = blender.data.images.load(str(tmp_path / "command.exr")) if source == "IMAGE" else None
    matte = composed(blender, scene, tmp_path, source, name, image)
    assert matte.shape == SIZE[::-1] and 0 < expected.mean() < 1
    np.testing.assert_allclose(matte, expected, atol=1e-6)
    # Negative control: another name gives another matte.
    other = composed(blender, scene, tmp_path, source, name + "0000", image)
    assert np.abs(other - expected).max() > 0.5
