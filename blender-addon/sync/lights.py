# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sun lights. Points, spots and areas are not drawn yet; each gives a line that says so."""


def read(obj, world_from_light):
    """(sun or None, what was left out) of a light object."""
    light = obj.data
    name = obj.name
    if light.type != "SUN":
        kind = light.type.capitalize()
        return None, [f"Light {name}: {kind} lights are not drawn yet; a Sun is"]
    left_out = []
    # A light may still leave its nodes unused in 5.0.
    if light.use_nodes and light.node_tree is not None and _nodes_say_more(light.node_tree):
        left_out.append(f"Light {name}: its nodes are not read yet; strength and color are the light's own")
    # Light travels along the object's own -z; scale of the object does not matter.
    direction = [-float(world_from_light[r][2]) for r in range(3)]
    length = sum(d * d for d in direction) ** 0.5
    if length < 1e-18:
        return None, left_out + [f"Light {name}: scaled to nothing, so it has no direction; it is left out"]
    color = [max(0.0, float(c)) for c in light.color]
    if getattr(light, "use_temperature", False):
        color = [c * max(0.0, float(t)) for c, t in zip(color, light.temperature_color)]
    strength = max(0.0, float(light.energy)) * 2.0 ** float(getattr(light, "exposure", 0.0))
    sun = {
        "direction": [d / length for d in direction],
        "strength": strength,
        "color": color,
        "angle_rad": min(float(light.angle), 3.141592653589793),
    }
    return sun, left_out


def _nodes_say_more(tree):
    """Whether a light's nodes are other than the ones that Blender gives a new light: one emission of strength 1, white."""
    shaders = [n for n in tree.nodes if n.type not in {"OUTPUT_LIGHT", "FRAME", "REROUTE"}]
    if len(shaders) != 1 or shaders[0].type != "EMISSION":
        return bool(shaders)
    inputs = shaders[0].inputs
    plain = list(inputs["Color"].default_value)[:3] == [1.0, 1.0, 1.0] and inputs["Strength"].default_value == 1.0
    return not plain or inputs["Color"].is_linked or inputs["Strength"].is_linked
