# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets what Blender's USD importer reads wrong of a stage without notes, from the values that the stage has by USD's specification.

    sun                  strength and angle of the light, which the importer makes four times and twice as large
    spot                 the blend at which Cycles begins to fade where the stage does
    orthographic camera  a tenth of its width
    user properties      of `pumice export`: visibility to the camera, soft falloff, spread, shape of the aperture, size of the film

A file of `pumice export --for blender`, which says so in its documentation, is read right by the importer; of it only the user properties
are set.
"""

import json
import math

# Begins the note that `pumice export --for blender` writes.
FOR_BLENDER = "for Blender"


def set_all(scene, path, objects, use_scene):
    """Sets the values of imported objects; returns lines about those that could not be told apart."""
    from pxr import Usd

    stage = Usd.Stage.Open(path)
    is_specified = FOR_BLENDER not in stage.GetRootLayer().documentation
    by_name, lines = {obj.name: obj for obj in objects}, []
    for prim in stage.Traverse():
        kind = prim.GetTypeName()
        if kind != "Camera" and not kind.endswith("Light") or kind == "DomeLight":
            continue
        # The importer joins an Xform with the only prim below it.
        found = [by_name[name] for name in (prim.GetName(), prim.GetParent().GetName()) if name in by_name]
        obj = next((o for o in found if o.type == ("CAMERA" if kind == "Camera" else "LIGHT")), None)
        if obj is None:
            lines.append(f"{prim.GetPath()}: no imported object has this name, so it is as Blender's importer reads it")
        elif kind == "Camera":
            _camera(scene, prim, obj, is_specified, use_scene)
        else:
            _light(prim, obj, is_specified)
    return lines


def _light(prim, obj, is_specified):
    from pxr import UsdLux

    light, said = obj.data, UsdLux.LightAPI(prim)
    if is_specified and light.type == "SUN":
        angle = math.radians(UsdLux.DistantLight(prim).GetAngleAttr().Get())
        strength = said.GetIntensityAttr().Get() * 2.0 ** said.GetExposureAttr().Get()
        if not said.GetNormalizeAttr().Get() and angle > 0.0:
            # Without normalisation the intensity is radiance.
            strength *= math.pi * math.sin(0.5 * angle) ** 2
        light.energy, light.angle = strength, angle
    if light.type == "SPOT":
        shaping = UsdLux.ShapingAPI(prim)
        half = math.radians(shaping.GetShapingConeAngleAttr().Get())
        if is_specified and half > 0.0:
            start = half * (1.0 - shaping.GetShapingConeSoftnessAttr().Get())
            light.spot_blend = 1.0 - (math.sin(0.5 * start) / math.sin(0.5 * half)) ** 2
        light.spot_blend = _said(prim, "blend", light.spot_blend)
    if light.type == "AREA":
        light.spread = math.radians(_said(prim, "spread_deg", math.degrees(light.spread)))
    if light.type in {"POINT", "SPOT"}:
        light.use_soft_falloff = _said(prim, "soft_falloff", light.use_soft_falloff)
    obj.visible_camera = _said(prim, "visible_to_camera", obj.visible_camera)


def _camera(scene, prim, obj, is_specified, use_scene):
    camera = obj.data
    if is_specified and camera.type == "ORTHO":
        camera.ortho_scale *= 0.1
    depth = camera.dof
    depth.use_dof = depth.use_dof or bool(prim.GetAttribute("fStop").Get())
    depth.aperture_blades = _said(prim, "aperture_blades", depth.aperture_blades)
    depth.aperture_rotation = math.radians(_said(prim, "aperture_rotation_deg", math.degrees(depth.aperture_rotation)))
    depth.aperture_ratio = _said(prim, "aperture_ratio", depth.aperture_ratio)
    if not use_scene:
        return
    scene.camera, render = obj, scene.render
    size = _said(prim, "resolution", None)
    if size is not None:
        render.resolution_x, render.resolution_y = json.loads(size)
        render.resolution_percentage = 100
    aspect = _said(prim, "pixel_aspect", 1.0)
    # Blender accepts no value below 1.
    render.pixel_aspect_x, render.pixel_aspect_y = max(aspect, 1.0), max(1.0 / aspect, 1.0)


def _said(prim, name, otherwise):
    """The value of a user property; `otherwise` where the prim has none."""
    attribute = prim.GetAttribute(f"userProperties:{name}")
    return attribute.Get() if attribute and attribute.HasAuthoredValue() else otherwise
