# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The world's light: a Background node of one colour or of an equirectangular picture.

    Background ◄─ Environment Texture ◄─ Mapping (turned about z) ◄─ Texture Coordinate (Generated or Object)

Cycles looks the picture up at the mapped direction, so the picture rotates the opposite way, except for type TEXTURE, which is the
inverse. Other nodes of a world (skies, mixes, other rotations) are not drawn; a line names the node.
"""

import math

from . import nodes, sky_file

BLACK = {"environment": {"constant": {"radiance": [0.0, 0.0, 0.0]}}, "backdrop": None}


def read(world):
    """The scene's world, and what was left out of Blender's."""
    if world is None:
        return BLACK, []
    read, left_out = _read(world)
    seen = getattr(world, "cycles_visibility", None)
    if seen is not None:
        if not seen.camera:
            read = {**read, "backdrop": [[0.0] * 3] * 2}
        hidden = [ray for ray in ("diffuse", "glossy", "transmission") if not getattr(seen, ray)]
        if hidden:
            left_out.append(f"World: it is seen by {' and '.join(hidden)} rays all the same")
    return read, left_out


def _read(world):
    tree = nodes.tree(world)
    if tree is None:
        return _constant(world.color, 1.0), []
    left_out = []
    if nodes.surface(tree, "OUTPUT_WORLD", "Volume") is not None:
        left_out.append("World: Volume is not drawn")
    node = nodes.surface(tree, "OUTPUT_WORLD")
    if node is None:
        return BLACK, left_out
    if node.bl_idname != "ShaderNodeBackground" or node.mute:
        return BLACK, [*left_out, f"World: {node.bl_label} is not drawn yet; the sky is black"]
    strength, whole = nodes.value(node.inputs["Strength"])
    if not whole:
        left_out.append("World: what is linked to Strength is not drawn; its own value is used")
    if strength < 0.0:
        left_out.append("World: negative light is not drawn")
    strength = max(0.0, float(strength))
    picture = nodes.source(node.inputs["Color"])
    if picture is not None and picture.type == "TEX_ENVIRONMENT" and not picture.mute:
        found, missing = _picture(picture, strength)
        return found, left_out + missing
    color, whole = nodes.value(node.inputs["Color"])
    if not whole:
        left_out.append(f"World: {picture.bl_label} is not drawn yet; the Background's own color is")
    return _constant(color, strength), left_out


def _constant(color, strength):
    radiance = [max(0.0, float(c) * float(strength)) for c in list(color)[:3]]
    return {"environment": {"constant": {"radiance": radiance}}, "backdrop": None}


def _picture(node, strength):
    """(world of an Environment Texture, what was left out); black where it cannot be drawn."""
    if node.image is None:
        # As Cycles shows a picture that is missing.
        return _constant((1.0, 0.0, 1.0), strength), ["World: its Environment Texture has no image"]
    if node.projection != "EQUIRECTANGULAR":
        return BLACK, [f"World: the projection {node.projection.replace('_', ' ').lower()} is not drawn; the sky is black"]
    left_out = []
    if node.interpolation != "Linear":
        left_out.append(f"World: {node.image.name} is drawn with linear interpolation")
    rotation = _rotation(node, left_out)
    try:
        path, missing = sky_file.path_of(node.image)
    except sky_file.NotDrawn as error:
        return BLACK, [*left_out, f"World: {error}; the sky is black"]
    left_out += [f"World: {line}" for line in missing]
    image = {"path": path, "rotation_rad": rotation, "strength": strength}
    return {"environment": {"image": image}, "backdrop": None}, left_out


def _rotation(node, left_out):
    """The picture's rotation about +z, counter-clockwise seen from above."""
    total, texture = 0.0, node.texture_mapping
    if any(texture.rotation) or any(texture.translation) or any(s != 1.0 for s in texture.scale):
        left_out.append("World: the Texture Mapping in the node's properties is not drawn")
    source = nodes.source(node.inputs["Vector"])
    is_mapped = False
    while source is not None and source.type == "MAPPING" and not source.mute:
        rotation, location, scale = (_three(source, name, left_out) for name in ("Rotation", "Location", "Scale"))
        moved = any(location) and source.vector_type in {"POINT", "TEXTURE"}
        # The length of a direction does not matter.
        stretched = len(set(scale)) > 1 or scale[0] <= 0.0
        if any(rotation[:2]) or moved or stretched:
            left_out.append("World: of its Mapping only the rotation about Z is drawn")
        is_mapped = True
        total += rotation[2] if source.vector_type == "TEXTURE" else -rotation[2]
        source = nodes.source(source.inputs["Vector"])
    if source is None and is_mapped:
        left_out.append("World: nothing is linked to Vector of its Mapping; the picture is drawn as with Generated, where Cycles draws one color of it")
    if source is not None and (source.type != "TEX_COORD" or not _is_direction(node)):
        left_out.append(f"World: {source.bl_label} before its Environment Texture is not drawn")
    return math.remainder(total, 2.0 * math.pi)


def _three(node, name, left_out):
    socket = node.inputs.get(name)
    if socket is None or not socket.enabled:
        return (0.0, 0.0, 0.0)
    value, whole = nodes.value(socket)
    if not whole:
        left_out.append(f"World: what is linked to {name} of its Mapping is not drawn; its own value is used")
    return tuple(float(v) for v in list(value)[:3])


def _is_direction(node):
    """Whether the Texture Coordinate node at the end of the chain gives the world direction."""
    socket = node.inputs["Vector"]
    while socket.is_linked:
        link = socket.links[0]
        if link.from_node.type == "TEX_COORD":
            return link.from_socket.name == "Generated" or (link.from_socket.name == "Object" and link.from_node.object is None)
        socket = link.from_node.inputs["Vector" if link.from_node.type == "MAPPING" else 0]
    return False
