# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares lights with Cycles: the radiance of a Lambert plane under a lamp, computed from what the extension reads by the definition in
docs/scene.md, and rendered by Cycles.

    E = strength cos                             sun
    E = power / 4π · cos / d²                    point, spot within its cone
    E = power / π · cos cos' / d²                area, small against its distance, with a spread of 180°
    radiance = albedo / π · color · E
"""

import math

import numpy as np
import pytest
from mathutils import Euler, Matrix, Vector

import cycles_oracle

ALBEDO = 0.5
# A lamp of width 0.3 at distance 4 differs from a point by (0.15 / 4)² / 2, which is 0.07 %; Cycles' noise adds as much.
TOLERANCE = 3e-3


@pytest.fixture
def read(extension, drawn):
    return lambda obj: extension.scene_reader.lights.read(obj, obj.matrix_world)


def lamp(bpy, kind, *, at=(0.0, 0.0, 4.0), turn=(0.0, 0.0, 0.0), scale=(1.0, 1.0, 1.0), **fields):
    data = bpy.data.lights.new("lamp", kind)
    data.energy = 100.0 if kind != "SUN" else 3.0
    for name, value in fields.items():
        setattr(data, name, value)
    obj = bpy.data.objects.new("lamp", data)
    obj.matrix_world = Matrix.LocRotScale(Vector(at), Euler(turn), Vector(scale))
    bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.update()
    return obj


def radiance(part, value):
    """Radiance of the plane at the origin, by the formulas above."""
    color = np.array(value["color"])
    if part == "suns":
        return ALBEDO / math.pi * color * value["strength"] * max(0.0, -value["direction"][2])
    kind, shape = next(iter(value["shape"].items()))
    if kind == "area":
        columns = np.array(shape["world_from_light"]).reshape(4, 3)
        at, along = columns[3], -columns[2] / np.linalg.norm(columns[2])
    else:
        at, along = np.array(shape["position"]), None
    distance = np.linalg.norm(at)
    received = value["power_w"] * at[2] / distance**3
    if kind == "area":
        received *= (-at @ along) / distance / math.pi
    else:
        received /= 4 * math.pi
    if kind == "spot":
        along = np.array(shape["direction"]) / np.linalg.norm(shape["direction"])
        assert -at @ along / distance > math.cos(shape["angle_rad"] / 2) and shape["blend"] == 0.0
    return ALBEDO / math.pi * color * received


CASES = {
    "point": ("POINT", {}),
    "point, exposed and coloured": ("POINT", {"exposure": 1.5, "color": (1.0, 0.4, 0.1), "at": (1.0, 2.0, 3.0)}),
    "ball": ("POINT", {"shadow_soft_size": 0.1, "use_soft_falloff": False, "scale": (3.0, 3.0, 3.0)}),
    "point by area": ("POINT", {"normalize": False}),
    "ball by area": ("POINT", {"normalize": False, "shadow_soft_size": 0.1, "use_soft_falloff": False}),
    "warm": ("POINT", {"use_temperature": True, "temperature": 2700.0}),
    "spot": ("SPOT", {"spot_blend": 0.0}),
    "spot, turned": ("SPOT", {"spot_blend": 0.0, "at": (1.0, 0.0, 4.0), "turn": (0.1, 0.2, 0.0), "normalize": False}),
    "sun": ("SUN", {"turn": (0.4, 0.3, 0.0), "angle": 0.05}),
    "sun by area": ("SUN", {"turn": (0.4, 0.3, 0.0), "angle": 0.05, "normalize": False, "energy": 3e3}),
    "sharp sun by area": ("SUN", {"angle": 0.0, "normalize": False}),
    "square": ("AREA", {"shape": "SQUARE", "size": 0.2}),
    "rectangle, scaled": ("AREA", {"shape": "RECTANGLE", "size": 0.1, "size_y": 0.2, "scale": (2.0, 1.0, 5.0)}),
    "disk, turned": ("AREA", {"shape": "DISK", "size": 0.2, "at": (1.0, 0.0, 4.0), "turn": (0.3, 0.5, 0.2)}),
    "ellipse by area": ("AREA", {"shape": "ELLIPSE", "size": 0.2, "size_y": 0.1, "normalize": False, "scale": (1.5, 2.0, 1.0)}),
    "rectangle by area": ("AREA", {"shape": "RECTANGLE", "size": 0.2, "size_y": 0.1, "normalize": False}),
}


@pytest.mark.parametrize("name", CASES)
def test_a_plane_is_as_bright_as_in_cycles(blender, read, tmp_path, name):
    kind, fields = CASES[name]
    newer = {"exposure", "normalize", "use_temperature"} & set(fields)
    if newer and not hasattr(blender.types.Light, "exposure") and blender.app.version < (4, 5, 0):
        pytest.skip("lights of this Blender have no such setting")
    scene = cycles_oracle.prepare(blender, tmp_path)
    cycles_oracle.plane(blender, ALBEDO)
    obj = lamp(blender, kind, **fields)
    part, value, left_out = read(obj)
    assert left_out == []
    theirs = cycles_oracle.picture(blender, scene).mean(axis=(0, 1))
    assert theirs.max() > 0
    assert radiance(part, value) == pytest.approx(theirs, rel=TOLERANCE)


def emission(bpy, light, strength, color):
    """Gives a light a node tree with one Emission node."""
    light.use_nodes = True
    node = next(n for n in light.node_tree.nodes if n.type == "EMISSION")
    node.inputs["Strength"].default_value, node.inputs["Color"].default_value = strength, color
    return node


def test_an_emission_node_counts_and_what_else_is_linked_is_named(blender, read, tmp_path):
    scene = cycles_oracle.prepare(blender, tmp_path)
    cycles_oracle.plane(blender, ALBEDO)
    obj = lamp(blender, "POINT")
    node = emission(blender, obj.data, 2.5, (0.9, 0.5, 0.1, 1.0))
    part, value, left_out = read(obj)
    assert left_out == []
    assert radiance(part, value) == pytest.approx(cycles_oracle.picture(blender, scene).mean(axis=(0, 1)), rel=TOLERANCE)
    tree = obj.data.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs[0], node.inputs["Strength"])
    assert read(obj)[2] == ["Light lamp: what is linked to Strength of its Emission is not drawn; its own value is used"]


def test_the_output_is_the_one_that_cycles_takes(blender, read, tmp_path):
    scene = cycles_oracle.prepare(blender, tmp_path)
    cycles_oracle.plane(blender, ALBEDO)
    obj = lamp(blender, "POINT")
    emission(blender, obj.data, 2.5, (0.9, 0.5, 0.1, 1.0))
    tree = obj.data.node_tree
    other, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputLight")
    other.inputs["Strength"].default_value = 0.5
    tree.links.new(other.outputs[0], output.inputs["Surface"])
    output.target = "CYCLES"
    next(n for n in tree.nodes if n.type == "OUTPUT_LIGHT" and n != output).is_active_output = True
    part, value, left_out = read(obj)
    assert left_out == []
    assert radiance(part, value) == pytest.approx(cycles_oracle.picture(blender, scene).mean(axis=(0, 1)), rel=TOLERANCE)


def test_the_comparison_notices_wrong_units(blender, read, tmp_path):
    """Negative control: a π too few, an area left out of account, a scale of the object's."""
    scene = cycles_oracle.prepare(blender, tmp_path)
    cycles_oracle.plane(blender, ALBEDO)
    obj = lamp(blender, "AREA", shape="DISK", size=0.2, scale=(2.0, 1.0, 1.0))
    part, value, _ = read(obj)
    theirs = cycles_oracle.picture(blender, scene).mean(axis=(0, 1))
    for factor in (1 / math.pi, math.pi / 4, 2.0, 1.02):
        wrong = dict(value, power_w=factor * value["power_w"])
        assert radiance(part, wrong) != pytest.approx(theirs, rel=TOLERANCE)


def test_the_cone_of_a_scaled_spot_is_as_wide_as_in_cycles(blender, read, tmp_path):
    """The edge of the cone on the plane is where the angle that was read puts it."""
    scene = cycles_oracle.prepare(blender, tmp_path, size=64, samples=16)
    cycles_oracle.plane(blender, ALBEDO)
    scene.camera.data.ortho_scale, scene.camera.matrix_world = 8.0, Matrix.Translation((0.0, 0.0, 9.0))
    obj = lamp(blender, "SPOT", at=(0.0, 0.0, 4.0), scale=(1.4, 1.4, 0.7), spot_size=0.5, spot_blend=0.0)
    part, value, left_out = read(obj)
    assert left_out == ["Light lamp: its cone is scaled unevenly, and drawn round"]
    seen = cycles_oracle.picture(blender, scene).max(axis=-1)
    # At the edge the light is still two thirds of that in the middle, and the pixel filter blurs it.
    lit = seen > 0.33 * seen.max()
    radius = 4.0 * math.tan(value["shape"]["spot"]["angle_rad"] / 2)
    assert math.sqrt(lit.sum() * (8.0 / 64) ** 2 / math.pi) == pytest.approx(radius, rel=0.03)
    assert value["shape"]["spot"]["angle_rad"] > 0.9, "the object's scale doubles the width of the cone"


def test_a_sheared_lamp_is_straightened_and_named(blender, read):
    """A parent that is scaled unevenly shears a turned lamp: direction, place and lengths stay, sides get right angles."""
    obj = lamp(blender, "AREA", shape="RECTANGLE", size=0.2, size_y=0.1, turn=(0.4, 0.3, 0.8))
    parent = blender.data.objects.new("parent", None)
    blender.context.collection.objects.link(parent)
    parent.scale, obj.parent = (2.0, 1.0, 1.0), parent
    blender.context.view_layer.update()
    world = np.array(obj.matrix_world)
    _, value, left_out = read(obj)
    assert left_out == ["Light lamp: its shear is not drawn; its sides are at right angles"]
    columns = np.array(value["shape"]["area"]["world_from_light"]).reshape(4, 3)
    lengths = np.linalg.norm(columns[:3], axis=1)
    turned = columns[:3] / lengths[:, None]
    assert turned @ turned.T == pytest.approx(np.eye(3), abs=1e-6)
    assert lengths[:2] == pytest.approx(np.linalg.norm(world[:3, :2], axis=0), rel=1e-6)
    assert turned[2] == pytest.approx(world[:3, 2] / np.linalg.norm(world[:3, 2]), abs=1e-6)
    assert columns[3] == pytest.approx(world[:3, 3]) and np.linalg.det(turned) * np.linalg.det(world[:3, :3]) > 0
    # An even scale shears nothing.
    parent.scale = (2.0, 2.0, 2.0)
    blender.context.view_layer.update()
    assert read(obj)[2] == []


def test_what_is_not_drawn_of_a_light_is_named(blender, read):
    obj = lamp(blender, "POINT", shadow_soft_size=0.2, use_shadow=False, use_custom_distance=True)
    obj.visible_glossy, obj.visible_camera = False, False
    obj.data.cycles.max_bounces = 3
    obj.light_linking.receiver_collection = blender.data.collections.new("these")
    sun = lamp(blender, "SUN")
    sun.visible_camera = True
    assert read(sun)[2] == [f"Light {sun.name}: the camera does not see it"]
    part, value, left_out = read(obj)
    said = " · ".join(left_out)
    assert value["shape"]["point"]["soft_falloff"] is True
    for what in ("shadows", "Max Bounces", "Custom Distance", "glossy rays", "light linking"):
        assert what in said, what
    assert value["visible_to_camera"] is False
    assert all(line.startswith("Light lamp: ") for line in left_out)


def test_negative_light_is_named(blender, read):
    for kind in ("SUN", "POINT", "AREA"):
        obj = lamp(blender, kind, energy=-5.0)
        _, value, left_out = read(obj)
        assert value.get("power_w", value.get("strength")) == 0.0
        assert f"Light {obj.name}: negative light is not drawn" in left_out
    assert not any("negative" in line for line in read(lamp(blender, "POINT"))[2])


def test_lights_that_give_none_are_left_out(blender, read):
    assert read(lamp(blender, "AREA", size=0.0))[0] is None
    assert read(lamp(blender, "SUN", scale=(1.0, 1.0, 0.0)))[0] is None
    portal = lamp(blender, "AREA")
    portal.data.cycles.is_portal = True
    assert read(portal) == (None, None, [])


def test_the_module_takes_what_is_read(blender, read, extension):
    """The compiled module accepts a scene with each kind of lamp."""
    import pumice

    lights = [read(lamp(blender, kind, **fields)) for kind, fields in CASES.values()]
    camera = cycles_oracle.camera(blender, (0, 0, 5), (0, 0, 0))
    parts = extension.scene_reader.Parts(
        extension.scene_reader.lens.read(camera),
        {"width": 4, "height": 4, "filter": {"box": {"width": 1.0}}},
        {"environment": {"constant": {"radiance": [0.0, 0.0, 0.0]}}},
        {},
        suns=[value for part, value, _ in lights if part == "suns"],
        lights=[value for part, value, _ in lights if part == "lights"],
    )
    scene = pumice.Scene.from_dict(parts.scene()).to_dict()
    assert len(scene["suns"]) == 3 and len(scene["lights"]) == len(CASES) - 3
