# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a whole scene from Blender's dependency graph, for viewport, final render and export alike.

Because all three read the same scene, their pictures are the same, bit for bit where size and samples agree.
"""

import json

import bpy
import numpy as np

from . import figure_follow, time_settings
from .properties import is_volume
from .reports import Refused
from .sync import camera as camera_math
from .sync import cuts, drawn, instances, lens, lights, materials, meshes, object_rays, world
from .sync.parts import Parts, PlacedCut

# Types of objects that have a surface which Pumice does not draw.
DRAWN_BY_OTHERS = {"MESH", "CURVE", "CURVES", "SURFACE", "FONT", "META", "POINTCLOUD", "VOLUME", "GREASEPENCIL"}
# Most objects that are named in one line.
MOST_NAMES = 8


class Kept:
    """Cache of data that is costly to read, kept from one reading to the next: styles of labels, and triangles."""

    def __init__(self, make_mesh=None, styles=None):
        """`make_mesh` as for `meshes.Geometries`; `styles` are those of an earlier reading, which compares what it reads with them, or such as
        a live view has."""
        self.styles = styles or instances.Styles()
        self.geometries = meshes.Geometries(make_mesh)


def read(depsgraph, camera, film, kept, *, space=None, as_rendered=False):
    """(Parts, what was left out) of a scene as the dependency graph has it.

    `camera` and `film` are the scene's own form already. `space` is the 3D viewport that looks, for its local view. `as_rendered`
    reads what a final render would out of a viewport's graph, and raises Refused where that graph lacks something.
    """
    scene = depsgraph.scene
    # The evaluated one: of the original, a render of an animation leaves the nodes as they are.
    light, left_out = world.read(depsgraph.scene_eval.world)
    if scene.pumice_figure.use_backdrop:
        light = {**light, "backdrop": [list(scene.pumice_figure.backdrop)] * 2}
    placed, triangles, others, seen, dresses, cutting = {}, {}, [], set(), materials.Dresses(), []
    lists, frame = {"suns": [], "lights": []}, time_settings.now(scene)
    kept.geometries.begin(depsgraph)
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
            part, value, missing = lights.read(obj, instance.matrix_world)
            left_out += missing
            if part is not None:
                lists[part].append(value)
        elif is_volume(obj):
            one, missing = instances.placed(obj, instance.matrix_world, kept.styles, frame)
            left_out += missing
            if one is not None:
                placed[_key(instance)] = one
        elif drawn.CUTS and cuts.is_cut(obj):
            shape, missing = cuts.read(obj, instance.matrix_world)
            left_out += missing
            cutting += [(obj.original, shape)] if shape is not None else []
        elif drawn.MESHES and obj.type == "MESH":
            one, missing = meshes.placed(obj, instance.matrix_world, kept.geometries, dresses)
            left_out += missing
            if one is not None:
                triangles[_key(instance)] = one
        elif obj.type in DRAWN_BY_OTHERS and not (drawn.MESHES and obj.type in meshes.KINDS):
            others.append(obj.name)
    kept.geometries.end()
    for uid in [uid for uid, name in (rendered or {}).items() if name is not None and uid not in seen]:
        raise Refused(f"{rendered[uid]} is hidden in the viewport and not in renders; show it, or hide it from renders too")
    left_out += others_left_out(others)
    # Volumes are known by now, so a cut can name those that it cuts.
    cuts_read = []
    for obj, shape in cutting:
        chosen, missing = cuts.targets(obj, placed)
        left_out += missing
        cuts_read.append(PlacedCut(shape, None if chosen is None else tuple(chosen)))
    cuts_read.sort(key=lambda cut: json.dumps([cut.shape, cut.volumes], sort_keys=True))
    # In an order that does not depend on names or on Blender's: a light's place among the others reaches the random numbers.
    for values in lists.values():
        values.sort(key=lambda value: json.dumps(value, sort_keys=True))
    parts = Parts(camera, film, light, settings(scene.pumice), cuts=cuts_read, placed=placed, meshes=triangles, **lists)
    return parts, list(dict.fromkeys(left_out))


def others_left_out(names):
    """A line about objects that are not drawn, by name."""
    names = sorted(set(names))
    if not names:
        return []
    shown = ", ".join(names[:MOST_NAMES]) + (f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else "")
    return [f"Not drawn: {shown}"]


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
    if drawn.CLAMPS:
        out["clamp_direct"], out["clamp_indirect"] = wishes.clamp_direct, wishes.clamp_indirect
    if drawn.ADAPTIVE and wishes.use_adaptive:
        out["adaptive"] = {"threshold": wishes.adaptive_threshold, "min_spp": wishes.adaptive_min_samples}
    if drawn.SMOOTH_VOXELS and wishes.smooth_voxels:
        out["smooth_voxels"] = True
    return out


def film(scene, size, pixel_aspect=1.0):
    """A film of `size` pixels; Blender counts half the filter's width."""
    out = {
        "width": int(size[0]),
        "height": int(size[1]),
        "filter": {"blackman_harris": {"width": 2.0 * scene.pumice.filter_pixels}},
    }
    if pixel_aspect != 1.0:
        out["pixel_aspect"] = pixel_aspect
    if drawn.TRANSPARENT and scene.render.film_transparent:
        out["transparent"] = True
    return out


def pixel_aspect(render):
    """Width of a final render's pixels over their height."""
    return render.pixel_aspect_x / render.pixel_aspect_y


def final_frame(render):
    """(whole size, part to draw as x0, y0, x1, y1 from the lower left) of a final render, in Blender's whole-number steps."""
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
    whole = lens.read(obj.evaluated_get(depsgraph), depsgraph)
    if rect == (0, 0, *size):
        return whole
    return camera_math.crop(whole, size, rect, pixel_aspect(depsgraph.scene.render))


def render_warnings(scene, view_layer):
    """One line for each setting of a view layer that a final render ignores."""
    out, render = figure_follow.problems(scene), scene.render
    for override, what in (("material_override", "Material Override"), ("world_override", "World Override")):
        if getattr(view_layer, override, None) is not None:
            out.append(f"View layer {view_layer.name}: {what} is not drawn")
    for switch, what in (("use_solid", "Surfaces"), ("use_sky", "Environment")):
        if not getattr(view_layer, switch):
            out.append(f"View layer {view_layer.name}: {what} is off, and drawn all the same")
    out += object_rays.of_collections(view_layer)
    if scene.camera is not None and scene.camera.type == "CAMERA" and lens.is_sheared(scene.camera):
        out.append(f"Camera {scene.camera.name}: its shear is not drawn; its axes are at right angles")
    if render.film_transparent and getattr(getattr(scene, "cycles", None), "film_transparent_glass", False):
        out.append("Transparent Glass is not drawn: what is seen through glass is opaque")
    if render.film_transparent and not drawn.TRANSPARENT:
        out.append("A transparent film is not drawn yet; the background is opaque")
    cycles = getattr(scene, "cycles", None)
    exposure = getattr(cycles, "film_exposure", 1.0)
    if exposure != 1.0:
        out.append(f"Film Exposure of Cycles, {exposure:.3g}, is not drawn")
    off = [kind for kind in ("reflective", "refractive") if not getattr(cycles, f"caustics_{kind}", True)]
    if off:
        out.append(f"{' and '.join(off).capitalize()} caustics are off in Cycles, and drawn all the same")
    if getattr(cycles, "use_fast_gi", False):
        out.append("Fast GI Approximation of Cycles is not drawn: light bounces as often as Bounces says")
    if render.use_motion_blur:
        out.append("Motion blur is not drawn")
    return out


def _in_view(instance, space):
    """Whether a viewport in local view shows the object."""
    owner = instance.parent if instance.is_instance and instance.parent else instance.object
    if not isinstance(space, bpy.types.SpaceView3D) or space.local_view is None:
        return True
    return owner.original.local_view_get(space)


def _in_renders(view_layer):
    """Names, by uid, of the objects in a final render that Pumice reads; None for those that only make instances of others."""
    found = {}

    def walk(layer):
        if layer.exclude or layer.collection.hide_render:
            return
        for obj in layer.collection.objects:
            if not obj.hide_render and (_is_read(obj) or obj.instance_type == "COLLECTION"):
                found[obj.original.session_uid] = obj.name if _is_read(obj) else None
        for child in layer.children:
            walk(child)

    walk(view_layer.layer_collection)
    return found


def _is_read(obj):
    cuts_here, mesh_here = drawn.CUTS and cuts.is_cut(obj), drawn.MESHES and obj.type in meshes.KINDS
    return obj.type == "LIGHT" or is_volume(obj) or cuts_here or mesh_here


def volume_uid(key):
    """The session uid of the object behind a key of `_key`: of the volume itself, not of what makes instances of it."""
    return key[0] if len(key) == 1 else key[1]


def _key(instance):
    """A key that lasts as long as Blender's object, through undo and renaming."""
    if not instance.is_instance:
        return (instance.object.original.session_uid,)
    parent = instance.parent.original.session_uid if instance.parent else 0
    return (parent, instance.object.original.session_uid, *instance.persistent_id)
