# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames and lights the first volumes of a scene so that they look good at once. Objects that the user has made are not changed.

    the view        frames the objects, its clip range reaches around them, Solid mode shows the labels' colours, Rendered is switched on
    the camera      is made where there is none, or moved where it is still Blender's own at startup; its clip range grows if it must
    a sun           is made where the scene has none
    the world       becomes a light sky where it is missing, or still the grey that Blender starts with
    cube and light  are hidden where they are still those of Blender's startup file: they would stand inside the volume
"""

import math

import bpy
import numpy as np
from mathutils import Matrix, Vector

from . import volume_object
from .reports import Refused
from .sync import nodes

# Of Blender's startup file.
STARTUP_CAMERA_PLACE = Vector((7.358891, -6.925791, 4.958309))
STARTUP_GREY = 0.050876
STARTUP_LIGHT_PLACE = Vector((4.076245, 1.005454, 5.903862))
STARTUP_LIGHT_WATTS = 1000.0

# Dim enough beside the sun for shadows to read under Blender's AgX view, which lifts them.
SKY = (0.46, 0.49, 0.53)
SUN_COLOR = (1.0, 0.95, 0.87)
SUN_STRENGTH = 4.0
SUN_ANGLE_DEG = 24.0
# From the subject to the camera: around the vertical axis, above the horizon.
VIEW_DEG = (24.0, 24.0)
# Half of the picture that the object may fill: 4 % stay free on each side.
FILL = 0.92


def prepare(context, *objects, frame_camera=True, light=True, rendered=False):
    """Sets up view, camera, sun and world for new objects; with `rendered` the views show the rendered picture."""
    context.view_layer.update()
    bounds = np.array([[tuple(corner) for corner in volume_object.bounds(obj)] for obj in objects])
    low, high = Vector(bounds[:, 0].min(axis=0)), Vector(bounds[:, 1].max(axis=0))
    centre, radius = (low + high) / 2.0, max((high - low).length / 2.0, 1e-6)
    _hide_startup(context.scene)
    if frame_camera:
        _camera(context, objects, centre, radius)
    if light:
        _sun(context)
        _world(context.scene)
    _views(context, centre, radius, rendered)


def _hide_startup(scene):
    """Hides cube and light of Blender's startup file, if nobody has touched them."""
    for obj in scene.objects:
        if _is_startup_cube(obj) or _is_startup_light(obj):
            obj.hide_viewport = obj.hide_render = True


def _is_startup_cube(obj):
    if obj.name != "Cube" or obj.type != "MESH" or len(obj.data.vertices) != 8 or obj.modifiers or obj.matrix_world != Matrix():
        return False
    return all(abs(abs(value) - 1.0) < 1e-6 for vertex in obj.data.vertices for value in vertex.co)


def _is_startup_light(obj):
    if obj.name != "Light" or obj.type != "LIGHT" or obj.data.type != "POINT" or obj.data.energy != STARTUP_LIGHT_WATTS:
        return False
    return (obj.matrix_world.translation - STARTUP_LIGHT_PLACE).length < 1e-4


def clip_range(distance, radius):
    """Near and far clip distances around a sphere at a distance: generous, but with a ratio that Blender's depth buffer can resolve."""
    far = max(1000.0, 4.0 * (distance + radius))
    return max(far * 1e-6, min(0.1, radius * 1e-2)), far


def _direction():
    around, above = (math.radians(v) for v in VIEW_DEG)
    return Vector((math.sin(around) * math.cos(above), -math.cos(around) * math.cos(above), math.sin(above)))


def _camera(context, objects, centre, radius):
    scene = context.scene
    camera = scene.camera
    fresh = camera is not None and (camera.matrix_world.translation - STARTUP_CAMERA_PLACE).length < 1e-4
    if camera is None:
        camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        context.collection.objects.link(camera)
        scene.camera = camera
    elif not fresh or camera.type != "CAMERA":
        _reach(camera, centre, radius)
        return
    turn = _direction().to_track_quat("Z", "Y").to_matrix()
    corners = np.concatenate([_corners(obj) for obj in objects])
    eye = turn @ Vector(_stand(corners, turn, camera.data, scene.render))
    camera.matrix_world = Matrix.Translation(eye) @ turn.to_4x4()
    camera.data.clip_start, camera.data.clip_end = clip_range((eye - centre).length, radius)


def frame(context, points):
    """Frames points of the scene in the 3D viewports of the window; without a viewport, in the scene's camera, which keeps its direction."""
    points = np.array([tuple(point) for point in points])
    low, high = Vector(points.min(axis=0)), Vector(points.max(axis=0))
    centre, radius = (low + high) / 2.0, max((high - low).length / 2.0, 1e-6)
    spaces = [] if bpy.app.background else _spaces(context)
    for space in spaces:
        view = space.region_3d
        if view.view_perspective == "CAMERA":
            view.view_perspective = "PERSP"
        view.view_location, view.view_distance = centre, 2.5 * radius
        space.clip_start, space.clip_end = clip_range(view.view_distance, radius)
    if spaces:
        return
    camera = context.scene.camera
    if camera is None or camera.type != "CAMERA":
        raise Refused("There is neither a 3D viewport nor a camera to frame the labels in")
    turn, data = camera.matrix_world.to_quaternion().to_matrix(), camera.data
    if data.type == "ORTHO":
        sides = context.scene.render.resolution_x, context.scene.render.resolution_y
        # The scale is the length of the longer side.
        data.ortho_scale = 2.0 * radius / FILL * max(sides) / min(sides)
        eye = centre + turn @ Vector((0.0, 0.0, 4.0 * radius))
    else:
        eye = turn @ Vector(_stand(points, turn, data, context.scene.render))
    camera.matrix_world = Matrix.Translation(eye) @ turn.to_4x4()
    data.clip_start, data.clip_end = clip_range((eye - centre).length, radius)


def _corners(obj):
    """The vertices of an object's mesh in the scene, (n, 3)."""
    local = np.empty(3 * len(obj.data.vertices), dtype=np.float32)
    obj.data.vertices.foreach_get("co", local)
    place = np.array(obj.matrix_world)
    return local.reshape(-1, 3).astype(float) @ place[:3, :3].T + place[:3, 3]


def _stand(corners, turn, data, render):
    """The nearest position, along its own axes, from which a camera with this rotation sees all points.

    Each point p gives two planes per axis: |p − c across| ≤ t · (c − p back), with t the tangent of half the angle that may be filled. The
    tightest two of an axis intersect at the camera's best position along it; the larger of the two distances back satisfies both axes.
    """
    points = corners @ np.array(turn)
    longer = max(render.resolution_x, render.resolution_y)
    place, backs = [], []
    for axis, pixels in enumerate((render.resolution_x, render.resolution_y)):
        t = math.tan(data.angle / 2.0) * pixels / longer * FILL
        plus = (t * points[:, 2] + points[:, axis]).max()
        minus = (t * points[:, 2] - points[:, axis]).max()
        place.append((plus - minus) / 2.0)
        backs.append((plus + minus) / (2.0 * t))
    return (*place, max(backs))


def _reach(camera, centre, radius):
    """A camera of the user's own keeps its place; only its far clip distance grows until it includes the object."""
    if camera.type == "CAMERA":
        distance = (camera.matrix_world.translation - centre).length
        camera.data.clip_end = max(camera.data.clip_end, distance + 2.0 * radius)


def _sun(context):
    if any(o.type == "LIGHT" and o.data.type == "SUN" for o in context.scene.objects):
        return
    light = bpy.data.lights.new("Pumice Sun", "SUN")
    light.energy, light.color, light.angle = SUN_STRENGTH, SUN_COLOR, math.radians(SUN_ANGLE_DEG)
    sun = bpy.data.objects.new("Pumice Sun", light)
    # The light comes from above and behind the shoulder of the viewer.
    toward = _direction()
    right = Vector((0.0, 0.0, 1.0)).cross(toward).normalized()
    source = toward * 0.55 - right * 0.65 + toward.cross(right) * 0.9
    sun.matrix_world = source.to_track_quat("Z", "Y").to_matrix().to_4x4()
    context.collection.objects.link(sun)


def _world(scene):
    if scene.world is None:
        scene.world = bpy.data.worlds.new("Pumice World")
        tree = nodes.ensure(scene.world)
        if tree.nodes.get("Background") is None:
            background = tree.nodes.new("ShaderNodeBackground")
            output = tree.nodes.new("ShaderNodeOutputWorld")
            tree.links.new(background.outputs[0], output.inputs["Surface"])
        background = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBackground")
    else:
        tree = nodes.tree(scene.world)
        background = tree.nodes.get("Background") if tree is not None else None
        if background is None or background.inputs["Strength"].default_value != 1.0:
            return
        color = background.inputs["Color"]
        if color.is_linked or any(abs(c - STARTUP_GREY) > 1e-4 for c in list(color.default_value)[:3]):
            return
    background.inputs["Color"].default_value = (*SKY, 1.0)


def _views(context, centre, radius, rendered):
    """Makes all 3D viewports of the window frame the objects."""
    for space in _spaces(context):
        view = space.region_3d
        view.view_location = centre
        view.view_distance = 2.5 * radius
        space.clip_start, space.clip_end = clip_range(view.view_distance, radius)
        if space.shading.color_type == "MATERIAL":
            space.shading.color_type = "VERTEX"
        if rendered:
            space.shading.type = "RENDERED"


def look_through_camera(context):
    """Makes all 3D viewports of the window look through the scene's camera."""
    for space in _spaces(context):
        space.region_3d.view_perspective = "CAMERA"


def _spaces(context):
    """The 3D viewports of the window; none without a window."""
    window = context.window
    if window is None:
        return []
    areas = [area for area in window.screen.areas if area.type == "VIEW_3D"]
    return [space for area in areas for space in area.spaces if space.type == "VIEW_3D"]
