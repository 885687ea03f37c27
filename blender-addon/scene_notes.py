# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a USD file has no words for, or what Blender's importer reads wrong: the values of cameras, lights, objects and the scene as JSON.

    on the prim of each object    userProperties:pumice            name, visibility to rays, matrix if it shears; camera or light
    on the prim of each material  userProperties:pumice_material   see `sync.shader_notes`
    on /root/pumice               userProperties:pumice_scene      film, frames, colour management, Cycles, world, active camera

Blender's importer makes custom properties of user properties, from which the values are set. They are Blender's own numbers, so they
arrive bit for bit.
"""

from mathutils import Matrix

from .sync import matrix, nodes
from .sync.shader_notes import plain
from .volume_object import SHEAR_TOLERANCE

OBJECT = "pumice"
MATERIAL = "pumice_material"
SCENE = "pumice_scene"

VISIBILITY = (
    *("visible_camera", "visible_diffuse", "visible_glossy", "visible_transmission", "visible_volume_scatter", "visible_shadow"),
    *("is_shadow_catcher", "is_holdout", "shadow_terminator_geometry_offset", "shadow_terminator_shading_offset", "pass_index"),
)
# Before a value come those that its range or meaning depends on.
CAMERA = (
    *("type", "sensor_fit", "sensor_width", "sensor_height", "lens_unit", "lens", "ortho_scale"),
    *("shift_x", "shift_y", "clip_start", "clip_end"),
)
DEPTH_OF_FIELD = ("use_dof", "focus_distance", "aperture_fstop", "aperture_blades", "aperture_rotation", "aperture_ratio")
LIGHT = (
    *("color", "energy", "exposure", "normalize", "use_temperature", "temperature", "use_shadow", "use_custom_distance"),
    *("diffuse_factor", "specular_factor", "transmission_factor", "volume_factor"),
    *("angle", "shadow_soft_size", "use_soft_falloff", "spot_size", "spot_blend", "shape", "size", "size_y", "spread"),
)
CYCLES_LIGHT = ("cast_shadow", "max_bounces", "use_multiple_importance_sampling", "is_portal")
RENDER = (
    *("resolution_x", "resolution_y", "resolution_percentage", "pixel_aspect_x", "pixel_aspect_y", "fps", "fps_base"),
    *("use_border", "border_min_x", "border_max_x", "border_min_y", "border_max_y", "film_transparent", "use_motion_blur"),
)
DISPLAY = ("display_device",)
VIEW = ("view_transform", "look", "exposure", "gamma", "use_white_balance", "white_balance_temperature", "white_balance_tint")
UNITS = ("system", "scale_length", "length_unit")
CYCLES = (
    *("samples", "use_adaptive_sampling", "adaptive_threshold", "adaptive_min_samples", "seed", "max_bounces", "diffuse_bounces"),
    *("glossy_bounces", "transmission_bounces", "volume_bounces", "transparent_max_bounces", "sample_clamp_direct"),
    *("sample_clamp_indirect", "blur_glossy", "caustics_reflective", "caustics_refractive", "light_sampling_threshold"),
    *("min_light_bounces", "min_transparent_bounces", "film_exposure", "film_transparent_glass", "pixel_filter_type", "filter_width"),
    *("use_denoising", "use_fast_gi"),
)


def values(owner, names):
    """Properties of Blender's data by name; those that this Blender lacks are left out."""
    return {name: plain(getattr(owner, name)) for name in names if hasattr(owner, name)}


def set_values(owner, noted):
    """Sets properties; returns the names of those that this Blender lacks or refuses."""
    refused = []
    for name, value in noted.items():
        try:
            setattr(owner, name, value)
        except (AttributeError, TypeError, ValueError):
            refused.append(name)
    return refused


def of_object(obj, name=None, world=None):
    """The note of an object; `name` replaces its own, and `world` its matrix."""
    world = obj.matrix_world if world is None else world
    noted = {"name": name or obj.name, "object": values(obj, VISIBILITY)}
    if shears(world):
        noted["matrix"] = matrix.twelve(world)
    if obj.type == "CAMERA":
        focus = obj.data.dof.focus_object
        noted["camera"] = values(obj.data, CAMERA)
        noted["depth_of_field"] = values(obj.data.dof, DEPTH_OF_FIELD)
        noted["focus"] = focus.name if focus is not None else None
    elif obj.type == "LIGHT":
        light = obj.data
        noted["light_type"], noted["light"] = light.type, values(light, LIGHT)
        noted["cycles"] = values(getattr(light, "cycles", None), CYCLES_LIGHT)
        emission = _emission(light)
        if emission is not None:
            noted["emission"] = [plain(emission.inputs[name].default_value) for name in ("Color", "Strength")]
    return noted


def set_object(obj, noted):
    """Sets an object's values from its note; returns the names of those that were refused."""
    obj.name = noted["name"]
    refused = set_values(obj, noted["object"])
    if "camera" in noted and obj.type == "CAMERA":
        refused += set_values(obj.data, noted["camera"]) + set_values(obj.data.dof, noted["depth_of_field"])
    if "light" in noted and obj.type == "LIGHT":
        obj.data.type = noted["light_type"]
        # A light that has another type is another class of Blender, so it is asked for anew.
        refused += set_values(obj.data, noted["light"]) + set_values(getattr(obj.data, "cycles", None), noted["cycles"])
        if "emission" in noted:
            _set_emission(obj.data, *noted["emission"])
    return refused


def of_scene(scene):
    """The note of the scene, without its world."""
    camera = scene.camera
    return {
        "camera": camera.name if camera is not None else None,
        "frame": scene.frame_current,
        "render": values(scene.render, RENDER),
        "display": values(scene.display_settings, DISPLAY),
        "view": values(scene.view_settings, VIEW),
        "units": values(scene.unit_settings, UNITS),
        "cycles": values(getattr(scene, "cycles", None), CYCLES),
    }


def set_scene(scene, noted):
    """Sets the scene's values from its note; returns the names of those that were refused."""
    scene.frame_current = noted["frame"]
    owners = {
        "render": scene.render,
        "display": scene.display_settings,
        "view": scene.view_settings,
        "units": scene.unit_settings,
        "cycles": getattr(scene, "cycles", None),
    }
    return [name for part, owner in owners.items() for name in set_values(owner, noted[part])]


def shears(world):
    """Whether location, rotation and scale cannot say a matrix."""
    world = Matrix(matrix.rows(world))
    rebuilt = Matrix.LocRotScale(*world.decompose())
    step = max(abs(v) for row in world.to_3x3() for v in row)
    return max(abs(a - b) for x, y in zip(world.to_3x3(), rebuilt.to_3x3()) for a, b in zip(x, y)) > SHEAR_TOLERANCE * step


def light_lacks(obj):
    """What the note of a light object lacks, one line each."""
    light, lacks = obj.data, []
    if light.use_nodes and light.node_tree is not None and _emission(light) is None:
        if nodes.surface(light.node_tree, "OUTPUT_LIGHT") is not None:
            lacks.append(f"Light {obj.name}: its nodes are not in the file; strength and color are the light's own")
    links = getattr(obj, "light_linking", None)
    if links is not None and (links.receiver_collection or links.blocker_collection):
        lacks.append(f"Light {obj.name}: light linking is not in the file")
    return lacks


def _emission(light):
    """The Emission node that a light's nodes are, with unlinked inputs; None otherwise."""
    if not light.use_nodes or light.node_tree is None:
        return None
    node = nodes.surface(light.node_tree, "OUTPUT_LIGHT")
    if node is None or node.type != "EMISSION" or node.mute:
        return None
    return None if any(nodes.source(node.inputs[name]) for name in ("Color", "Strength")) else node


def _set_emission(light, color, strength):
    light.use_nodes = True
    tree = light.node_tree
    node = nodes.surface(tree, "OUTPUT_LIGHT")
    if node is None or node.type != "EMISSION":
        tree.nodes.clear()
        node, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputLight")
        tree.links.new(node.outputs[0], output.inputs["Surface"])
    node.inputs["Color"].default_value, node.inputs["Strength"].default_value = color, strength
