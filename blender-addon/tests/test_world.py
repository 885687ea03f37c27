# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares worlds with Cycles: the radiance in several directions, computed from what the extension reads by the definition in
docs/scene.md, and rendered by Cycles."""

import math

import numpy as np
import pytest

import cycles_oracle

# Cycles' pixels are 32-bit floats; the interpolation of 8-bit textures is about as exact as this.
TOLERANCE = 2e-3


@pytest.fixture
def read(extension, drawn):
    return extension.scene_reader.world.read


def world(bpy, **inputs):
    made = bpy.data.worlds.new("sky")
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    bpy.context.scene.world = made
    node = next(n for n in made.node_tree.nodes if n.type == "BACKGROUND")
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    return made, node


def picture_file(folder, name="sky.exr", width=64):
    """An image file whose colours encode the place: red across, green down, and blue to break the symmetry."""
    import OpenImageIO

    height = width // 2
    across, down = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    pixels = np.stack([0.2 + across, 0.2 + down, 0.5 + 0.4 * np.sin(4 * math.pi * across)], axis=-1).astype(np.float32)
    if not name.endswith((".exr", ".hdr")):
        pixels = np.round(pixels / 1.3 * 255).astype(np.uint8)
    path = folder / name
    out = OpenImageIO.ImageOutput.create(str(path))
    out.open(str(path), OpenImageIO.ImageSpec(width, height, 3, "float" if pixels.dtype == np.float32 else "uint8"))
    out.write_image(pixels)
    out.close()
    return path


def textured(bpy, path, *, turn=None, kind="POINT", strength=1.5):
    made, background = world(bpy, Strength=strength)
    tree = made.node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = bpy.data.images.load(str(path))
    tree.links.new(node.outputs[0], background.inputs["Color"])
    if turn is not None:
        mapping, place = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
        mapping.vector_type = kind
        mapping.inputs["Rotation"].default_value = turn
        tree.links.new(place.outputs["Generated"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs[0], node.inputs["Vector"])
    return made, node


def looked_up(environment, direction):
    """Colour of an image sky in a direction, by its definition: the middle is at +x, the left quarter at +y, the first row at the top."""
    import OpenImageIO

    image = environment["image"]
    file = OpenImageIO.ImageInput.open(image["path"])
    assert file is not None, OpenImageIO.geterror()
    names = list(file.spec().channelnames)
    pixels = file.read_image(0, 0, 0, file.spec().nchannels, "float")[..., [names.index(c) for c in "RGB"]]
    height, width = pixels.shape[:2]
    x, y, z = direction / np.linalg.norm(direction)
    u = 0.5 - (math.atan2(y, x) - image["rotation_rad"]) / (2 * math.pi)
    v = math.acos(z) / math.pi
    column, row = u * width - 0.5, v * height - 0.5
    c, r = math.floor(column), math.floor(row)
    total = np.zeros(3)
    for dc, dr in ((0, 0), (0, 1), (1, 0), (1, 1)):
        weight = abs(1 - dc - (column - c)) * abs(1 - dr - (row - r))
        total += weight * pixels[np.clip(r + dr, 0, height - 1), (c + dc) % width]
    return image["strength"] * total


# Euler angles of the camera for each view.
VIEWS = [(1.2, 0.0, 0.3), (1.9, 0.0, 2.0), (math.pi / 2, 0.0, 4.5)]


def seen(bpy, scene, turn):
    """(direction, colour) in the middle of a narrow view with these Euler angles."""
    camera = cycles_oracle.camera(bpy, (0, 0, 0), turn, lens=5000.0)
    bpy.context.view_layer.update()
    direction = -np.array(camera.matrix_world.col[2])[:3]
    return direction, cycles_oracle.picture(bpy, scene).mean(axis=(0, 1))


TURNS = {
    "as it is": (None, "POINT"),
    "turned": ((0.0, 0.0, 0.7), "POINT"),
    "turned as a vector": ((0.0, 0.0, -1.1), "VECTOR"),
    "turned as a texture": ((0.0, 0.0, 0.7), "TEXTURE"),
    "turned as a normal": ((0.0, 0.0, 2.0), "NORMAL"),
}


@pytest.mark.parametrize("name", TURNS)
def test_a_picture_is_where_cycles_shows_it(blender, read, tmp_path, name):
    scene = cycles_oracle.prepare(blender, tmp_path, size=4, samples=1)
    turn, kind = TURNS[name]
    made, _ = textured(blender, picture_file(tmp_path), turn=turn, kind=kind)
    value, left_out = read(made)
    assert left_out == [] and value["environment"]["image"]["path"] == str(tmp_path / "sky.exr")
    for view in VIEWS:
        direction, theirs = seen(blender, scene, view)
        assert looked_up(value["environment"], direction) == pytest.approx(theirs, rel=TOLERANCE)
    # Negative control: the sky rotated by two degrees, or the other way.
    for wrong in (0.03, -2 * value["environment"]["image"]["rotation_rad"] or 0.1):
        image = dict(value["environment"]["image"])
        image["rotation_rad"] += wrong
        assert looked_up({"image": image}, direction) != pytest.approx(theirs, rel=TOLERANCE)


@pytest.mark.parametrize("name", ["sky.hdr", "sky.png"])
def test_other_files_are_written_anew_and_look_the_same(blender, read, tmp_path, name):
    scene = cycles_oracle.prepare(blender, tmp_path, size=4, samples=1)
    made, node = textured(blender, picture_file(tmp_path, name), turn=(0.0, 0.0, 0.7))
    value, left_out = read(made)
    path = value["environment"]["image"]["path"]
    assert left_out == [] and path.endswith(".exr")
    for view in VIEWS:
        direction, theirs = seen(blender, scene, view)
        assert looked_up(value["environment"], direction) == pytest.approx(theirs, rel=TOLERANCE)
    assert read(made)[0]["environment"]["image"]["path"] == path, "it is written once"
    node.image.colorspace_settings.name = "Non-Color"
    other = read(made)[0]["environment"]["image"]["path"]
    assert other != path, "another colour space gives another image"


def contrasts(folder, name):
    """A small picture of pixels that differ as much as they can: interpolating their codes is not interpolating their light."""
    import OpenImageIO

    pixels = np.random.default_rng(4).integers(0, 2, (4, 8, 3)).astype(np.float32)
    if name.endswith(".exr"):
        pixels *= 3
    path = folder / name
    out = OpenImageIO.ImageOutput.create(str(path))
    out.open(str(path), OpenImageIO.ImageSpec(8, 4, 3, "float" if name.endswith(".exr") else "uint8"))
    out.write_image(pixels)
    out.close()
    return path


@pytest.mark.parametrize("name", ["sky.exr", "sky.png"])
def test_pictures_in_srgb_are_interpolated_as_cycles_does(blender, extension, read, tmp_path, monkeypatch, name):
    scene = cycles_oracle.prepare(blender, tmp_path, size=4, samples=1)
    made, node = textured(blender, contrasts(tmp_path, name))
    node.image.colorspace_settings.name = "sRGB"
    value, left_out = read(made)
    assert left_out == [] and value["environment"]["image"]["path"] != str(tmp_path / name)
    views = [seen(blender, scene, view) for view in VIEWS]

    def difference(environment):
        # Of the largest light that is seen. Between two of 16 points a line is off by the curve's second derivative, at most 3.4, over
        # 8 · 16², in each of two directions: 3.3e-3 of the brightest pixel, which is not seen whole.
        light = max(theirs.max() for _, theirs in views)
        return max(np.abs(looked_up(environment, direction) - theirs).max() for direction, theirs in views) / light

    assert difference(value["environment"]) < 6e-3
    # Control: with the picture's own pixels it is off.
    monkeypatch.setattr(extension.sync.sky_file, "MOST_TIMES", 1)
    node.image.reload()
    monkeypatch.setattr(extension.sync.sky_file, "_folder", lambda: str(tmp_path))
    assert difference(read(made)[0]["environment"]) > 0.05


def translucent(folder, name):
    """A picture whose pixels have alpha of their own, or nothing, or all."""
    import OpenImageIO

    alpha = np.array([0.5, 0.0, 1.0, 0.8, 0.3])[np.arange(8) % 5]
    pixels = np.broadcast_to(np.stack([0.5 * np.ones(8), 0.25 * np.ones(8), 0.9 - 0.1 * np.arange(8), alpha], axis=-1), (4, 8, 4))
    kind = "uint8" if name.endswith("8.png") else "uint16"
    path = folder / name
    out = OpenImageIO.ImageOutput.create(str(path))
    spec = OpenImageIO.ImageSpec(8, 4, 4, kind)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    out.open(str(path), spec)
    out.write_image((pixels * np.iinfo(kind).max).round().astype(kind))
    out.close()
    return path


@pytest.mark.parametrize("mode", ["STRAIGHT", "CHANNEL_PACKED", "NONE"])
@pytest.mark.parametrize("name", ["bits8.png", "bits16.png"])
def test_alpha_of_a_picture_is_what_it_is_in_cycles(blender, read, tmp_path, name, mode):
    scene = cycles_oracle.prepare(blender, tmp_path, size=4, samples=1)
    made, node = textured(blender, translucent(tmp_path, name))
    node.image.alpha_mode = mode
    value, left_out = read(made)
    assert left_out == []
    views = [seen(blender, scene, view) for view in VIEWS]
    light = max(theirs.max() for _, theirs in views)
    # As for any picture in sRGB: see the test of contrasts.
    difference = max(np.abs(looked_up(value["environment"], direction) - theirs).max() for direction, theirs in views) / light
    assert difference < 6e-3
    if mode == "STRAIGHT":
        node.image.alpha_mode = "NONE"
        other = read(made)[0]["environment"]
        assert max(np.abs(looked_up(other, direction) - theirs).max() for direction, theirs in views) > 0.05 * light, "control: alpha shows"


def test_light_that_no_color_of_the_scene_has_is_black_and_said(blender, read, tmp_path):
    import OpenImageIO

    said = {}
    for name, color in (("grey.exr", (0.5, 0.5, 0.5)), ("wide.exr", (0.02, 1.0, 0.05))):
        pixels = np.full((4, 8, 3), 0.5, dtype=np.float32)
        pixels[1, 2] = color
        out = OpenImageIO.ImageOutput.create(str(tmp_path / name))
        out.open(str(tmp_path / name), OpenImageIO.ImageSpec(8, 4, 3, "float"))
        out.write_image(pixels)
        out.close()
        made, node = textured(blender, tmp_path / name)
        node.image.colorspace_settings.name = "Linear Rec.2020"
        said[name] = [read(made) for _ in range(2)]
    assert [left_out for _, left_out in said["grey.exr"]] == [[], []]
    for value, left_out in said["wide.exr"]:
        assert left_out == ["World: wide.exr has light below 0 or no number, of colors that Rec. 709 lacks; 0 is drawn in its place"]
    file = OpenImageIO.ImageInput.open(value["environment"]["image"]["path"])
    found = file.read_image(0, 0, 0, 3, "float")
    assert found.min() == 0.0 and found[1, 2].max() > 1.0 and (found == 0.0).sum() == 2


@pytest.mark.parametrize("targets", [("EEVEE", "ALL"), ("ALL", "CYCLES"), ("EEVEE",)], ids="-".join)
def test_the_output_is_the_one_that_cycles_takes(blender, read, tmp_path, targets):
    """The first of the outputs is the active one."""
    scene = cycles_oracle.prepare(blender, tmp_path, size=4, samples=1)
    made, background = world(blender, Color=(0.2, 0.4, 0.8, 1.0))
    tree = made.node_tree
    for old in [n for n in tree.nodes if n != background]:
        tree.nodes.remove(old)
    for number, target in enumerate(targets):
        shader, output = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
        shader.inputs["Color"].default_value = (0.1 + 0.3 * number, 0.5, 0.2, 1.0)
        tree.links.new(shader.outputs[0], output.inputs["Surface"])
        output.target, output.is_active_output = target, number == 0
    radiance = read(made)[0]["environment"]["constant"]["radiance"]
    assert radiance == pytest.approx(seen(blender, scene, VIEWS[0])[1], rel=1e-6, abs=1e-6)


def test_a_packed_image_is_written_too(blender, read, tmp_path):
    made, node = textured(blender, picture_file(tmp_path))
    node.image.pack()
    (tmp_path / "sky.exr").unlink()
    path = read(made)[0]["environment"]["image"]["path"]
    assert looked_up({"image": {"path": path, "rotation_rad": 0.0, "strength": 1.0}}, np.array([1.0, 0.0, 0.0]))[0] == pytest.approx(0.7)


def nodes_of(made, kind):
    return next(n for n in made.node_tree.nodes if n.type == kind)


def test_what_is_not_drawn_of_a_world_is_named(blender, read, tmp_path):
    made, node = textured(blender, picture_file(tmp_path), turn=(0.1, 0.0, 0.7))
    assert read(made)[1] == ["World: of its Mapping only the rotation about Z is drawn"]
    mapping = nodes_of(made, "MAPPING")
    mapping.inputs["Rotation"].default_value = (0.0, 0.0, 0.7)
    assert read(made)[1] == []
    made.node_tree.nodes.remove(nodes_of(made, "TEX_COORD"))
    assert read(made)[1] == [
        "World: nothing is linked to Vector of its Mapping; the picture is drawn as with Generated, where Cycles draws one color of it"
    ]
    node.projection = "MIRROR_BALL"
    assert read(made) == (read(None)[0], ["World: the projection mirror ball is not drawn; the sky is black"])
    node.projection = "EQUIRECTANGULAR"
    (tmp_path / "sky.exr").unlink()
    assert "is missing" in read(made)[1][-1]
    made.cycles_visibility.camera = made.cycles_visibility.glossy = False
    value, left_out = read(made)
    assert value["backdrop"] == [[0.0] * 3] * 2 and "glossy rays" in left_out[-1]

    made, background = world(blender)
    tree = made.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeTexSky").outputs[0], background.inputs["Color"])
    assert read(made)[1] == ["World: Sky Texture is not drawn yet; the Background's own color is"]


def test_negative_light_of_a_world_is_named(blender, read):
    made, _ = world(blender, Color=(0.2, 0.4, 0.8, 1.0), Strength=-0.5)
    value, left_out = read(made)
    assert value["environment"]["constant"]["radiance"] == [0.0] * 3 and left_out == ["World: negative light is not drawn"]


def test_a_constant_is_color_times_strength(blender, read, tmp_path):
    scene = cycles_oracle.prepare(blender, tmp_path, size=4, samples=1)
    made, background = world(blender, Color=(0.2, 0.4, 0.8, 1.0), Strength=1.75)
    assert read(made)[0]["environment"]["constant"]["radiance"] == pytest.approx(seen(blender, scene, VIEWS[0])[1], rel=1e-6)
    rgb = made.node_tree.nodes.new("ShaderNodeRGB")
    rgb.outputs[0].default_value = (0.9, 0.1, 0.2, 1.0)
    made.node_tree.links.new(rgb.outputs[0], background.inputs["Color"])
    value, left_out = read(made)
    assert left_out == []
    assert value["environment"]["constant"]["radiance"] == pytest.approx(seen(blender, scene, VIEWS[0])[1], rel=1e-6)
