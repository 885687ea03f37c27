# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Light objects as suns and lamps of the scene.

    Blender                                           scene
    color × temperature × color of its Emission       color
    strength × 2^exposure × strength of its Emission  strength of a sun (W/m²), power_w of a lamp (W)
    Normalize off (4.5)                               power times the lamp's area: watts per area become watts
    size of an area light, scaled by its object       size, and the matrix as it is
    radius of a point or spot light                   radius; as in Cycles, its object's scale does not matter

With Normalize off Cycles takes the area of a sphere as 4πr² (4 if r is 0), and of a sun of angle a as π sin²(a/2) (1 if a is 0).
"""

import math

from . import matrix, nodes

TURN = 2.0 * math.pi


def read(obj, world_from_light):
    """(part, value, what was left out) of a light object: part is `suns` or `lights`, None where it gives no light."""
    light = obj.data
    lamp = _Lamp(obj, matrix.rows(world_from_light))
    # A light portal of Cycles emits no light: it guides the sampling of the sky, which changes only the noise.
    if light.type == "AREA" and getattr(getattr(light, "cycles", None), "is_portal", False):
        return None, None, []
    part, value = (lamp.sun() if light.type == "SUN" else lamp.lamp())
    if value is not None:
        lamp.look_for_what_is_not_drawn()
    return part, value, lamp.left_out


class _Lamp:
    """One light while it is read."""

    def __init__(self, obj, world):
        self.obj, self.light, self.world = obj, obj.data, world
        self.left_out = []

    def leave_out(self, what):
        self.left_out.append(f"Light {self.obj.name}: {what}")

    def sun(self):
        """A sun; None where it has no direction."""
        direction = self._direction()
        if direction is None:
            return None, None
        angle = min(float(self.light.angle), math.pi)
        strength, color = self._strength_and_color()
        if not getattr(self.light, "normalize", True):
            strength *= math.pi * math.sin(angle / 2.0) ** 2 if angle > 0.0 else 1.0
        return "suns", {"direction": direction, "strength": strength, "color": color, "angle_rad": angle}

    def lamp(self):
        """A point, spot or area light; None where it gives no light."""
        shape, area = {"POINT": self._point, "SPOT": self._spot, "AREA": self._area}[self.light.type]()
        if shape is None:
            return None, None
        power, color = self._strength_and_color()
        if not getattr(self.light, "normalize", True):
            power *= area
        visible = bool(self.obj.visible_camera)
        return "lights", {"shape": shape, "power_w": power, "color": color, "visible_to_camera": visible}

    def _strength_and_color(self):
        light = self.light
        if light.energy < 0.0:
            self.leave_out("negative light is not drawn")
        color = [max(0.0, float(c)) for c in light.color]
        if getattr(light, "use_temperature", False):
            color = [c * max(0.0, float(t)) for c, t in zip(color, light.temperature_color)]
        strength = max(0.0, float(light.energy)) * 2.0 ** float(getattr(light, "exposure", 0.0))
        # A light may have unused nodes, also in Blender 5.0.
        if light.use_nodes and light.node_tree is not None:
            factor, tint = self._emission()
            strength, color = strength * factor, [c * t for c, t in zip(color, tint)]
        return strength, color

    def _emission(self):
        """(strength, colour) of the Emission node that a light's nodes are, where they are one."""
        node = nodes.surface(self.light.node_tree, "OUTPUT_LIGHT")
        if node is None:
            return 0.0, [1.0] * 3
        if node.type != "EMISSION" or node.mute:
            self.leave_out(f"its node {node.bl_label} is not drawn; strength and color are the light's own")
            return 1.0, [1.0] * 3
        values = []
        for name in ("Strength", "Color"):
            value, whole = nodes.value(node.inputs[name])
            if not whole:
                self.leave_out(f"what is linked to {name} of its Emission is not drawn; its own value is used")
            values.append(value)
        factor, tint = float(values[0]), [float(c) for c in list(values[1])[:3]]
        if min(factor, *tint) < 0.0:
            self.leave_out("negative light of its Emission is not drawn")
        return max(0.0, factor), [max(0.0, c) for c in tint]

    def _direction(self):
        """Light travels along the object's own -z; None where that is scaled to nothing."""
        direction = [-self.world[r][2] for r in range(3)]
        length = math.hypot(*direction)
        if length < 1e-18:
            self.leave_out("scaled to nothing, so it has no direction; it is left out")
            return None
        return [d / length for d in direction]

    def _ball(self):
        """(fields of a point light, its area)."""
        radius = max(0.0, float(self.light.shadow_soft_size))
        soft = radius > 0.0 and bool(getattr(self.light, "use_soft_falloff", False))
        area = 2.0 * TURN * radius**2 if radius > 0.0 else 4.0
        return {"position": [self.world[r][3] for r in range(3)], "radius": radius, "soft_falloff": soft}, area

    def _point(self):
        ball, area = self._ball()
        return {"point": ball}, area

    def _spot(self):
        ball, area = self._ball()
        direction = self._direction()
        if direction is None:
            return None, area
        # The cone is one of the lamp's own space: scale across against scale along opens it.
        across = [math.hypot(*(self.world[r][c] for r in range(3))) for c in range(2)]
        along = math.hypot(*(self.world[r][2] for r in range(3)))
        angle = min(float(self.light.spot_size), math.pi)
        wider = sum(across) / (2.0 * along)
        if any(abs(a / along - 1.0) > 1e-4 for a in across):
            angle = 2.0 * math.atan(math.tan(angle / 2.0) * wider) if angle < math.pi else angle
            self.leave_out("its cone is scaled unevenly, and drawn round")
        return {"spot": {**ball, "direction": direction, "angle_rad": angle, "blend": float(self.light.spot_blend)}}, area

    def _area(self):
        light, world = self.light, self.world
        size = [float(light.size), float(light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size)]
        outline = "ellipse" if light.shape in {"DISK", "ELLIPSE"} else "rectangle"
        sides = [math.hypot(*(world[r][c] for r in range(3))) * size[c] for c in range(2)]
        area = sides[0] * sides[1] * (math.pi / 4.0 if outline == "ellipse" else 1.0)
        if area < 1e-30 or self._direction() is None:
            self.leave_out("an area of 0 gives no light; it is left out")
            return None, area
        if not matrix.is_invertible(world):
            self.leave_out("its axes lie in a plane; it is left out")
            return None, area
        # A parent that is scaled unevenly shears a turned lamp.
        world, is_sheared = matrix.without_shear(world)
        if is_sheared:
            self.leave_out("its shear is not drawn; its sides are at right angles")
        # The length of z does not matter, but the matrix must be invertible.
        shape = {
            "world_from_light": matrix.twelve(matrix.unit_axes(world, only=2)),
            "outline": outline,
            "size": size,
            "spread_rad": min(float(light.spread), math.pi),
        }
        return {"area": shape}, area

    def look_for_what_is_not_drawn(self):
        """Names settings that Cycles obeys and Pumice does not."""
        obj, light = self.obj, self.light
        cycles = getattr(light, "cycles", None)
        if not getattr(light, "use_shadow", True) or not getattr(cycles, "cast_shadow", True):
            self.leave_out("it casts shadows all the same")
        if getattr(cycles, "max_bounces", 1024) < 1024:
            self.leave_out("its Max Bounces are not limited")
        if light.use_custom_distance:
            self.leave_out("Custom Distance has no effect, as in Cycles")
        if light.type == "SUN" and light.angle > 0.0 and obj.visible_camera:
            self.leave_out("the camera does not see it")
        if not obj.is_shadow_catcher:
            self.leave_out("it lights shadow catchers as other lights do")
        hidden = [ray for ray in ("diffuse", "glossy", "transmission") if not getattr(obj, f"visible_{ray}")]
        if hidden:
            self.leave_out(f"it is seen by {' and '.join(hidden)} rays all the same")
        self.left_out += linking(obj, f"Light {obj.name}")


def linking(obj, owner):
    """Lines about the light linking of an object."""
    links = getattr(obj, "light_linking", None)
    if links is not None and (links.receiver_collection or links.blocker_collection):
        return [f"{owner}: light linking is not drawn"]
    return []
