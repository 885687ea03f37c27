# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole scene from Blender's dependency graph: the one way to it, for viewport, final render and export alike.

That all three read the same is what makes their pictures the same, to the bit where size and samples agree.
"""

import bpy
import numpy as np

from . import registry
from .properties import is_volume
from .reports import Refused
from .sync import camera as camera_math
from .sync import instances, lights, world
from .sync.parts import Parts

# What has a surface, and is none of ours.
DRAWN_BY_OTHERS = {"MESH", "CURVE", "CURVES", "SURFACE", "FONT", "META", "POINTCLOUD", "VOLUME", "GREASEPENCIL"}


def read(depsgraph, camera, film, styles, *, space=None, as_rendered=False):
    """(Parts, what was left out) of a scene as the dependency graph has it.

    `camera` and `film` are the scene's own form already. `space` is the 3D viewport that looks, for its local view. `as_rendered`
    reads what a final render would out of a viewport's graph, and raises Refused where that graph lacks something.
    """
    scene = depsgraph.scene
    light, left_out = world.read(scene.world)
    placed, suns, others, seen = {}, [], 0, set()
    rendered = _in_renders(depsgraph.view_layer_eval) if as_rendered else None
    for instance in depsgraph.object_instances:
        if not instance.show_self:
            continue
        obj = instance.object
        if rendered is not None:
            owner = instance.parent if instance.is_instance and instance.parent else obj
            if owner.original.session_uid not in rendered:
                continue
            seen.add(owner.original.session_uid)
        if space is not None and not _in_view(instance, space):
            continue
        if obj.type == "LIGHT":
            sun, missing = lights.read(obj, instance.matrix_world)
            left_out += missing
            suns += [sun] if sun else []
        elif is_volume(obj):
            one, missing = instances.placed(obj, instance.matrix_world, styles, registry.locate)
            left_out += missing
            placed[_key(instance)] = one
        elif obj.type in DRAWN_BY_OTHERS:
            others += 1
    for uid in (rendered or {}).keys() - seen:
        raise Refused(f"{rendered[uid]} is hidden in the viewport and not in renders; show it, or hide it from renders too")
    if others:
        noun = "object is" if others == 1 else "objects are"
        left_out.append(f"{others} {noun} not drawn: Pumice draws volumes only, so far")
    # In an order that does not depend on names or on Blender's: a light's place among the others reaches the random numbers.
    suns.sort(key=lambda s: (s["direction"], s["strength"], s["color"], s["angle_rad"]))
    parts = Parts(camera, film, light, suns, settings(scene.pumice), placed)
    return parts, list(dict.fromkeys(left_out))


def settings(wishes):
    """The scene's settings from `scene.pumice`."""
    out = {
        "mode": wishes.mode.lower(),
        "bounces": wishes.bounces,
        "russian_roulette": True,
        "lod": {"distance": {"pixels": wishes.lod_pixels}} if wishes.lod == "DISTANCE" else wishes.lod.lower(),
        "seed": wishes.seed,
    }
    if wishes.use_ao_distance:
        out["ao_distance"] = wishes.ao_distance
    return out


def film(wishes, size):
    """A film of `size` pixels; Blender counts half the filter's width."""
    return {
        "width": int(size[0]),
        "height": int(size[1]),
        "filter": {"blackman_harris": {"width": 2.0 * wishes.filter_pixels}},
    }


def final_frame(render):
    """(whole size, part to draw as x0, y0, x1, y1 from the lower left) of a final render, in Blender's whole-number steps."""
    if render.pixel_aspect_x != render.pixel_aspect_y:
        raise Refused(
            f"Pixel aspect {render.pixel_aspect_x:g} : {render.pixel_aspect_y:g} is not drawn; "
            "set both to 1 in Output > Format"
        )
    if render.use_multiview:
        raise Refused("Stereoscopy is not drawn; switch it off in Output")
    width = max(1, int(render.resolution_x * render.resolution_percentage / 100))
    height = max(1, int(render.resolution_y * render.resolution_percentage / 100))
    rect = (0, 0, width, height)
    if render.use_border:
        # In single precision, as Blender has it: 0.7 of 100 pixels is 70 there, and 69 in double.
        sides = ((render.border_min_x, width), (render.border_min_y, height))
        sides += ((render.border_max_x, width), (render.border_max_y, height))
        rect = tuple(int(np.float32(part) * np.float32(pixels)) for part, pixels in sides)
        if rect[2] <= rect[0] or rect[3] <= rect[1]:
            raise Refused("The render region holds no pixel; draw a larger one or clear it")
    return (width, height), rect


def final_camera(depsgraph, size, rect):
    """The scene camera's view of the part `rect` of a picture of `size` pixels."""
    obj = depsgraph.scene.camera
    if obj is None:
        raise Refused("The scene has no camera; add one, or make one active")
    if obj.type != "CAMERA":
        raise Refused(f"Pumice looks through cameras only, and {obj.name} is none")
    evaluated = obj.evaluated_get(depsgraph)
    whole = from_camera(evaluated, size)
    return camera_math.crop(whole, size, rect) if rect != (0, 0, *size) else whole


def from_camera(obj, size):
    """The scene's camera from a camera object."""
    data = obj.data
    if data.type not in {"PERSP", "ORTHO"}:
        raise Refused(f"Camera {obj.name}: panoramas are not drawn; set its type to Perspective or Orthographic")
    return camera_math.from_lens(
        obj.matrix_world,
        kind=data.type,
        lens_mm=data.lens,
        ortho_scale=data.ortho_scale,
        sensor_fit=data.sensor_fit,
        sensor_mm=(data.sensor_width, data.sensor_height),
        shift=(data.shift_x, data.shift_y),
        clip=(data.clip_start, data.clip_end),
        size=size,
    )


def render_warnings(scene):
    """What a final render of the scene leaves out, beside its contents."""
    out = []
    if scene.render.film_transparent:
        out.append("A transparent film is not drawn yet; the background is opaque")
    if scene.render.use_motion_blur:
        out.append("Motion blur is not drawn")
    camera = scene.camera
    if camera is not None and camera.type == "CAMERA" and camera.data.dof.use_dof:
        out.append(f"Camera {camera.name}: depth of field is not drawn yet")
    return out


def _in_view(instance, space):
    """Whether a viewport in local view shows the object."""
    owner = instance.parent if instance.is_instance and instance.parent else instance.object
    if not isinstance(space, bpy.types.SpaceView3D) or space.local_view is None:
        return True
    return owner.original.local_view_get(space)


def _in_renders(view_layer):
    """Names by uid of the volumes and lights that a final render has."""
    found = {}

    def walk(layer):
        if layer.exclude or layer.collection.hide_render:
            return
        for obj in layer.collection.objects:
            if not obj.hide_render and (is_volume(obj) or obj.type == "LIGHT"):
                found[obj.original.session_uid] = obj.name
        for child in layer.children:
            walk(child)

    walk(view_layer.layer_collection)
    return found


def _key(instance):
    """A key that lasts as long as Blender's object, through undo and renaming."""
    if not instance.is_instance:
        return (instance.object.original.session_uid,)
    parent = instance.parent.original.session_uid if instance.parent else 0
    return (parent, instance.object.original.session_uid, *instance.persistent_id)
