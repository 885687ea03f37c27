"""Deliberate faults, as controls of the comparison with Cycles: each function makes a scene (a dictionary) slightly wrong. The comparison
must detect each fault on the rungs where it is visible."""

import copy
import math

# Suffix of the names of mesh files with flat shading.
FLAT = "-flat.ply"


def wrong(scene, name):
    """A copy of the scene with the fault of this name."""
    scene = copy.deepcopy(scene)
    FAULTS[name](scene)
    return scene


def _materials(scene):
    for instance in scene["instances"]:
        yield instance["style"]["material"]
        yield from instance["style"]["materials"].values()
    for mesh in scene["meshes"]:
        yield from mesh["materials"]


def _scaled(values, factor):
    return [factor * v for v in values]


def _in_materials(field, factor):
    def fault(scene):
        for material in _materials(scene):
            value = material[field]
            material[field] = _scaled(value, factor) if isinstance(value, list) else factor * value

    return fault


def _sun(scene):
    for sun in scene["suns"]:
        sun["strength"] *= 1.02


def _lamps(scene):
    for lamp in scene["lights"]:
        lamp["power_w"] *= 1.02


def _balls(scene):
    for lamp in scene["lights"]:
        (shape,) = lamp["shape"].values()
        shape["soft_falloff"] = False


def _sky(scene):
    (kind, sky), = scene["world"]["environment"].items()
    if kind == "constant":
        sky["radiance"] = _scaled(sky["radiance"], 1.02)
    else:
        sky["strength"] *= 1.02


def _sky_turned(scene):
    scene["world"]["environment"]["image"]["rotation_rad"] += math.radians(4)


def _focal_length(scene):
    (kind, lens), = scene["camera"]["projection"].items()
    if kind == "perspective":
        lens["fov_rad"] = 2 * math.atan(math.tan(0.5 * lens["fov_rad"]) / 1.01)
    else:
        lens["scale"] /= 1.01


def _filter(scene):
    (kind, _), = scene["film"]["filter"].items()
    scene["film"]["filter"] = {"blackman_harris": {"width": 3}} if kind == "box" else {"box": {"width": 1}}


def _bounces(scene):
    # Seven bounces instead of eight would make no visible difference.
    bounces = scene["settings"]["bounces"]
    scene["settings"]["bounces"] = 1 if bounces == 0 else 0 if bounces == 1 else 2


def _shift(scene):
    scene["camera"]["shift"][0] += 0.005


def _focus(scene):
    scene["camera"]["aperture"]["focus_distance"] *= 1.05


def _aperture(scene):
    scene["camera"]["aperture"]["radius"] *= 1.05


def _cut(scene):
    # Moves the plane by a quarter of a voxel.
    across = scene["instances"][0]["world_from_index"][0]
    scene["cuts"][0]["shape"]["plane"]["point"][0] += 0.25 * across


def _second(scene):
    # Moves the second volume by a quarter of a voxel along its x axis.
    matrix = scene["instances"][1]["world_from_index"]
    matrix[9:] = [at + 0.25 * x for at, x in zip(matrix[9:], matrix[:3], strict=True)]


def _flat_normals(scene):
    for mesh in scene["meshes"]:
        mesh["source"] = mesh["source"].removesuffix(".ply") + FLAT


def _catcher(scene):
    # Makes the shadow a twentieth weaker.
    scene["meshes"][0]["materials"][0]["alpha"] = 0.95


def _no_catcher(scene):
    scene["meshes"][0]["shadow_catcher"] = False


FAULTS = {
    "flat normals": _flat_normals,
    "shadow 5 %": _catcher,
    "no catcher": _no_catcher,
    "cut 1/4 voxel": _cut,
    "second volume 1/4 voxel": _second,
    "albedo 2 %": _in_materials("base_color", 0.98),
    "roughness 5 %": _in_materials("roughness", 1.05),
    "coat 20 %": _in_materials("coat", 0.8),
    "coat roughness 5 %": _in_materials("coat_roughness", 1.05),
    "sheen roughness 5 %": _in_materials("sheen_roughness", 1.05),
    "alpha 2 %": _in_materials("alpha", 0.98),
    "ior 2 %": _in_materials("ior", 1.02),
    "emission 2 %": _in_materials("emission", 1.02),
    "sun 2 %": _sun,
    "lamps 2 %": _lamps,
    "balls": _balls,
    "sky 2 %": _sky,
    "sky turned 4°": _sky_turned,
    "focal length 1 %": _focal_length,
    "filter": _filter,
    "bounces": _bounces,
    "shift 0.005": _shift,
    "focus 5 %": _focus,
    "aperture 5 %": _aperture,
}
