# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that files which Blender writes of a render say what they were made of. PNG files are read chunk by chunk, OpenEXR by OpenImageIO."""

import hashlib
import struct

import pumice
import pytest

from test_real_volumes import scene  # noqa: F401


def texts(path):
    """The texts of a PNG file by keyword (ISO/IEC 15948 §11.3.4: tEXt, and iTXt without compression)."""
    data, found, at = path.read_bytes(), {}, 8
    while at < len(data):
        (length,) = struct.unpack_from(">I", data, at)
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        if kind in (b"tEXt", b"iTXt"):
            key, text = body.split(b"\0", 1)
            found[key.decode()] = (text.split(b"\0", 4)[-1] if kind == b"iTXt" else text).decode()
        at += 12 + length
    return found


def attributes(path):
    """The text attributes of an OpenEXR file by name."""
    import OpenImageIO

    spec = OpenImageIO.ImageInput.open(str(path)).spec()
    return {one.name: one.value for one in spec.extra_attribs if isinstance(one.value, str)}


def written(bpy, kind, path):
    """What a file of the frame, written by Blender, says under the names of Pumice."""
    scene = bpy.context.scene
    image = scene.render.image_settings
    if bpy.app.version >= (5, 0, 0):
        image.media_type = "MULTI_LAYER_IMAGE" if kind == "OPEN_EXR_MULTILAYER" else "IMAGE"
    image.file_format, scene.render.filepath = kind, str(path)
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    found = texts(path) if kind == "PNG" else attributes(path)
    return {key.removeprefix("pumice/"): value for key, value in found.items() if key.startswith("pumice/")}


@pytest.mark.parametrize("kind,ending", [("PNG", "png"), ("OPEN_EXR", "exr"), ("OPEN_EXR_MULTILAYER", "exr")])
def test_a_file_says_what_it_was_made_of(scene, blender, tmp_path, kind, ending):  # noqa: F811
    volume = pumice.open(blender.context.object.pumice.filepath)
    said = written(blender, kind, tmp_path / f"a.{ending}")
    assert blender.ops.pumice.export_scene(filepath=str(tmp_path / "scene.json")) == {"FINISHED"}
    exported = pumice.Scene.load(tmp_path / "scene.json")
    again = pumice.render(exported, volume, spp=4, backend="cpu")
    assert said == {
        "version": pumice.__version__,
        "backend": "cpu",
        "scene": hashlib.sha256(exported.to_json().encode()).hexdigest(),
        "volumes": volume.content_hash,
        "seed": "7",
        "samples": "4",
        "error": f"{again.error_estimate:.3g}",
    }
    # Negative control: another camera is another scene, another seed another seed.
    scene.camera.location.x += 0.01
    scene.pumice.seed = 8
    other = written(blender, kind, tmp_path / f"b.{ending}")
    assert other["scene"] != said["scene"] and other["seed"] == "8" and other["volumes"] == said["volumes"]


def test_meshes_are_named_also_where_metadata_of_blender_is_off(scene, blender, tmp_path):  # noqa: F811
    mesh = blender.data.meshes.new("floor")
    mesh.from_pydata([(-9, -9, -5), (9, -9, -5), (0, 9, -5)], [], [(0, 1, 2)])
    scene.collection.objects.link(blender.data.objects.new("floor", mesh))
    said = written(blender, "PNG", tmp_path / "a.png")
    # Blender may begin a triangle at any of its corners.
    corners, turns = [tuple(vertex.co) for vertex in mesh.vertices], ([0, 1, 2], [1, 2, 0], [2, 0, 1])
    assert said["meshes"] in {pumice.Mesh(corners, [turn], [0]).content_hash for turn in turns}
    mesh.vertices[0].co.x = -8.0
    mesh.update()
    assert written(blender, "PNG", tmp_path / "b.png")["meshes"] != said["meshes"]
    for name in dir(scene.render):
        if name.startswith("use_stamp"):
            setattr(scene.render, name, False)
    assert written(blender, "PNG", tmp_path / "c.png")["volumes"] == said["volumes"], "whatever Blender says of its own"
