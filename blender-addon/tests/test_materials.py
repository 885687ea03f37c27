# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that the fields read from a shader mean the same as the shader.

The oracle is Cycles: on a ball, a Principled BSDF with the fields that were read must look like the original shader, with the same
seed.
"""

import math

import numpy as np
import pytest

import cycles_oracle

# Cycles mostly runs the same code for both, so most pictures are equal. Otherwise they differ by rounding.
TOLERANCE = 1e-6


@pytest.fixture
def read(extension, drawn):
    materials = __import__(f"{extension.__name__}.sync.materials", fromlist=["read"])
    return materials.read


@pytest.fixture
def ball(blender, tmp_path):
    """A function from a material to Cycles' picture of a ball with it, under a grey sky and two suns."""
    scene = cycles_oracle.prepare(blender, tmp_path, size=32, samples=16)
    blender.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, radius=1.0)
    obj = blender.context.object
    blender.ops.object.shade_smooth()
    cycles_oracle.camera(blender, (0.0, -4.0, 0.0), (math.pi / 2, 0.0, 0.0), ortho_scale=2.2)
    scene.world = world = blender.data.worlds.new("sky")
    if blender.app.version < (5, 0, 0):
        world.use_nodes = True
    background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.3, 0.4, 0.6, 1.0)
    for turn in ((0.9, 0.2, 0.0), (0.4, -1.2, 0.0)):
        sun = blender.data.objects.new("sun", blender.data.lights.new("sun", "SUN"))
        sun.data.energy, sun.data.angle, sun.rotation_euler = 2.0, 0.6, turn
        scene.collection.objects.link(sun)

    def look(material):
        obj.data.materials.clear()
        obj.data.materials.append(material)
        return cycles_oracle.picture(blender, scene)

    return look


def material(bpy, kind=None, **inputs):
    """A new material with one shader; `inputs` are named with _ for spaces."""
    made = bpy.data.materials.new("dress")
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    if kind is not None:
        node = tree.nodes.new(kind)
        for name, value in inputs.items():
            if name.islower():
                setattr(node, name, value)
            else:
                node.inputs[name.replace("_", " ")].default_value = value
        tree.links.new(node.outputs[0], output.inputs["Surface"])
    return made


def principled_of(bpy, fields):
    """A Principled BSDF from the fields of a scene's material, which are that node's inputs."""
    made = material(bpy, "ShaderNodeBsdfPrincipled")
    node = next(n for n in made.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    names = {
        "base_color": "Base Color", "metallic": "Metallic", "roughness": "Roughness", "specular": "Specular IOR Level",
        "specular_tint": "Specular Tint", "ior": "IOR", "transmission": "Transmission Weight", "subsurface": "Subsurface Weight",
        "coat": "Coat Weight", "coat_roughness": "Coat Roughness", "coat_ior": "Coat IOR", "coat_tint": "Coat Tint",
        "sheen": "Sheen Weight", "sheen_roughness": "Sheen Roughness", "sheen_tint": "Sheen Tint", "alpha": "Alpha",
        "subsurface_radius": "Subsurface Radius", "emission": "Emission Color",
    }  # fmt: skip
    node.inputs["Subsurface Scale"].default_value = node.inputs["Emission Strength"].default_value = 1.0
    node.inputs["Emission Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    node.distribution = "MULTI_GGX" if fields.get("multiscatter", True) else "GGX"
    for field, value in fields.items():
        if field == "multiscatter":
            continue
        socket = node.inputs[names[field]]
        socket.default_value = (*value, 1.0) if socket.type == "RGBA" else value
    return made


RED, WHITE = (0.8, 0.2, 0.1, 1.0), (1.0, 1.0, 1.0, 1.0)
EXACT = {
    "principled": ("ShaderNodeBsdfPrincipled", {
        "Base_Color": RED, "Roughness": 0.4, "Specular_IOR_Level": 0.8, "Specular_Tint": (0.5, 0.9, 1.0, 1.0), "IOR": 1.3,
        "Coat_Weight": 0.6, "Coat_Roughness": 0.1, "Coat_IOR": 1.7, "Coat_Tint": (0.9, 0.8, 0.5, 1.0),
        "Sheen_Weight": 0.3, "Sheen_Roughness": 0.4, "Sheen_Tint": (0.2, 0.9, 0.3, 1.0), "distribution": "GGX",
        "Emission_Color": (0.1, 0.2, 0.4, 1.0), "Emission_Strength": 0.5, "Alpha": 0.7,
    }),
    "principled glass": ("ShaderNodeBsdfPrincipled", {"Base_Color": RED, "Roughness": 0.3, "Transmission_Weight": 0.8}),
    "principled metal": ("ShaderNodeBsdfPrincipled", {"Base_Color": RED, "Metallic": 0.9, "Specular_Tint": (0.5, 1.0, 0.2, 1.0)}),
    "diffuse": ("ShaderNodeBsdfDiffuse", {"Color": RED}),
    "emission": ("ShaderNodeEmission", {"Color": RED, "Strength": 1.7}),
    "transparent grey": ("ShaderNodeBsdfTransparent", {"Color": (0.4, 0.4, 0.4, 1.0)}),
    "white glass": ("ShaderNodeBsdfGlass", {"Color": WHITE, "Roughness": 0.2, "IOR": 1.4}),
    "white glossy": ("ShaderNodeBsdfAnisotropic", {"Color": WHITE, "Roughness": 0.5}),
    "sheen": ("ShaderNodeBsdfSheen", {"Color": RED, "Roughness": 0.6}),
    "metallic": ("ShaderNodeBsdfMetallic", {"Base_Color": RED, "Edge_Tint": (0.3, 0.6, 1.0, 1.0), "Roughness": 0.3}),
    "nothing": (None, {}),
}  # fmt: skip


@pytest.mark.parametrize("name", EXACT)
def test_what_is_read_looks_as_the_shader_does(blender, read, ball, name):
    kind, inputs = EXACT[name]
    if kind is not None and not hasattr(blender.types, kind):
        pytest.skip(f"this Blender has no {kind}")
    made = material(blender, kind, **inputs)
    fields, _, left_out = read(made)
    assert left_out == []
    ours, theirs = ball(principled_of(blender, fields)), ball(made)
    assert np.abs(ours - theirs).max() <= TOLERANCE * theirs.max()


@pytest.mark.parametrize("targets", [("EEVEE", "ALL"), ("ALL", "CYCLES"), ("EEVEE",)], ids="-".join)
def test_the_output_is_the_one_that_cycles_takes(blender, read, ball, targets):
    """The first of the outputs is the active one."""
    made = material(blender, None)
    tree = made.node_tree
    tree.nodes.clear()
    for number, target in enumerate(targets):
        shader, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
        shader.inputs["Color"].default_value = (0.1 + 0.6 * number, 0.5, 0.2, 1.0)
        tree.links.new(shader.outputs[0], output.inputs["Surface"])
        output.target, output.is_active_output = target, number == 0
    fields, _, left_out = read(made)
    ours, theirs = ball(principled_of(blender, fields)), ball(made)
    assert left_out == [] and np.abs(ours - theirs).max() <= TOLERANCE * max(theirs.max(), 0.1)


def test_the_comparison_notices_a_lobe_that_is_lost_or_a_little_rough(blender, read, ball):
    """Negative control: the comparison detects a change of each relevant field."""
    kind, inputs = EXACT["principled"]
    made = material(blender, kind, **inputs)
    theirs, (fields, _, _) = ball(made), read(made)
    for field, value in [("coat", 0.0), ("sheen", 0.1), ("specular", 0.5), ("alpha", 0.75), ("base_color", [0.78, 0.2, 0.1])]:
        ours = ball(principled_of(blender, {**fields, field: value}))
        assert np.abs(ours - theirs).max() > TOLERANCE * theirs.max(), field


NEAR = {
    "red glossy": ("ShaderNodeBsdfAnisotropic", {"Color": RED}, "a Glossy BSDF of another color than white"),
    "red glass": ("ShaderNodeBsdfGlass", {"Color": RED}, "the color of a Glass BSDF is not drawn in its reflection"),
    "red transparent": ("ShaderNodeBsdfTransparent", {"Color": RED}, "a Transparent BSDF is drawn grey"),
    "rough diffuse": ("ShaderNodeBsdfDiffuse", {"Roughness": 0.5}, "Roughness is not drawn"),
    "anisotropic": ("ShaderNodeBsdfPrincipled", {"Anisotropic": 0.4}, "Anisotropic is not drawn"),
    "thin film": ("ShaderNodeBsdfPrincipled", {"Thin_Film_Thickness": 400.0}, "Thin Film Thickness is not drawn"),
    "rough principled": ("ShaderNodeBsdfPrincipled", {"Diffuse_Roughness": 0.3}, "Diffuse Roughness is not drawn"),
    "thin glass": ("ShaderNodeBsdfPrincipled", {"IOR": 0.8}, "an IOR of 0.8 is not drawn"),
    "brighter than white": ("ShaderNodeBsdfDiffuse", {"Color": (1.5, 0.5, 0.5, 1.0)}, "base color is drawn as 1"),
    "beckmann": ("ShaderNodeBsdfAnisotropic", {"Color": WHITE, "distribution": "BECKMANN"}, "distribution Beckmann"),
    "another shader": ("ShaderNodeBsdfTranslucent", {}, "expected a Principled BSDF, got Translucent BSDF"),
}


@pytest.mark.parametrize("name", NEAR)
def test_what_cannot_be_said_is_named(blender, read, name):
    kind, inputs, said = NEAR[name]
    socket = next((k.replace("_", " ") for k in inputs if not k.islower()), None)
    probe = material(blender, kind)
    if socket is not None and socket not in next(n for n in probe.node_tree.nodes if n.bl_idname == kind).inputs:
        pytest.skip(f"{kind} of this Blender has no {socket}")
    left_out = read(material(blender, kind, **inputs))[2]
    assert len(left_out) == 1 and said in left_out[0] and left_out[0].startswith("Material dress"), left_out


def link(made, kind, socket):
    """Adds a node of this kind and links it to an input of the material's shader."""
    tree = made.node_tree
    node = next(n for n in tree.nodes if n.bl_idname.startswith("ShaderNodeBsdf"))
    source = tree.nodes.new(kind)
    tree.links.new(source.outputs[0], node.inputs[socket])
    return source


def test_a_linked_constant_is_read_and_a_texture_is_named(blender, read):
    made = material(blender, "ShaderNodeBsdfPrincipled", Base_Color=RED)
    link(made, "ShaderNodeRGB", "Base Color").outputs[0].default_value = (0.1, 0.6, 0.2, 1.0)
    link(made, "ShaderNodeValue", "Roughness").outputs[0].default_value = 0.9
    fields, _, left_out = read(made)
    assert fields["base_color"] == pytest.approx([0.1, 0.6, 0.2]) and fields["roughness"] == pytest.approx(0.9)
    assert left_out == []
    link(made, "ShaderNodeTexNoise", "Roughness")
    link(made, "ShaderNodeBump", "Normal")
    fields, _, left_out = read(made)
    assert fields["roughness"] == pytest.approx(0.5), "expected the input's own value"
    assert left_out == [
        "Material dress: what is linked to Roughness is not drawn; its own value is used",
        "Material dress: Normal is not drawn",
    ]


def test_what_is_linked_to_a_base_color_that_labels_have_is_not_missed(blender, read):
    made = material(blender, "ShaderNodeBsdfPrincipled")
    made.pumice.colors_by_label = True
    link(made, "ShaderNodeTexNoise", "Base Color")
    assert read(made)[2] == []


def test_a_plain_material_is_short(blender, read):
    """Unused fields are left out, since a figure may have 10⁵ materials."""
    assert set(read(material(blender, "ShaderNodeBsdfPrincipled"))[0]) == {
        "base_color", "metallic", "roughness", "specular", "ior", "emission",
    }  # fmt: skip
    subsurface = read(material(blender, "ShaderNodeBsdfPrincipled", Subsurface_Weight=0.5, Subsurface_Scale=2.0))[0]
    assert subsurface["subsurface_radius"] == pytest.approx([2.0, 0.4, 0.2])


def test_the_module_takes_what_is_read(blender, read, extension):
    """The compiled module accepts a scene with each of the materials."""
    import pumice

    scene = {
        "version": 1,
        "camera": {"world_from_camera": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], "projection": {"orthographic": {"scale": 1}}},
        "film": {"width": 4, "height": 4, "filter": {"box": {"width": 1}}},
        "world": {"environment": {"constant": {"radiance": [1, 1, 1]}}},
    }
    cases = [*EXACT.values(), *(case[:2] for case in NEAR.values())]
    for kind, inputs in cases:
        if kind is not None and not hasattr(blender.types, kind):
            continue
        style = {"material": read(material(blender, kind, **inputs))[0]}
        instance = {"id": 1, "source": "a", "world_from_index": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], "style": style}
        pumice.Scene.from_dict({**scene, "instances": [instance]})
