"""Draws random scenes with Pumice and with Cycles: `python random_scenes.py --blender PYTHON FIRST END`, with the module `pumice` installed.

The ladder's scenes and those of `pumice bench convergence` are chosen, and what nobody thought of is in none of them. Here materials, lights,
skies and bounces follow from the scene's number. For each scene a line says

    noise      variance of Pumice's pixels between seeds over that of Cycles', by `pumice bench convergence`'s measure
    estimate   the error that Pumice estimates over its true one, both as root mean squares over the seeds
    tiles      largest difference of the means of a tile of 8 × 8 pixels, in standard errors: some 3 to 4 is chance

A scene with more noise than Cycles' or with a tile beyond 6 is worth a look. `docs/cycles.md` has what is known to differ, such as rough glass.
"""

import argparse
import math
import sys
import tempfile
from pathlib import Path

import by_cycles
import numpy as np
import rung as rungs

# What a squared mean is raised by where it is divided by: `rel_mse::EPSILON`.
FLOOR = 0.01
TILE = 8

MATERIALS = ["plastic", "metal", "glass", "coat", "sheen", "matte", "rough glass", "veil", "glow"]
SHARES = [0.25, 0.15, 0.08, 0.12, 0.08, 0.2, 0.04, 0.04, 0.04]
# Labels of the base's crop that a scene shows at least.
LABELS = 9


class Random:
    """The random numbers of a scene."""

    def __init__(self, number):
        self.rng = np.random.default_rng(number)

    def between(self, low, high):
        return float(self.rng.uniform(low, high))

    def magnitude(self, low, high):
        return math.exp(self.between(math.log(low), math.log(high)))

    def is_so(self, probability):
        return bool(self.rng.random() < probability)

    def of(self, things, shares=None):
        return things[self.rng.choice(len(things), p=shares)]

    def color(self, low=0.05, high=0.95):
        return [round(self.between(low, high), 3) for _ in range(3)]

    def around(self, spread):
        return self.rng.normal(size=3) * spread


def material(by, kind):
    """A material of a kind."""
    own = {
        "metal": lambda: {"metallic": 1.0, "specular_tint": by.color(0.5, 1.0)},
        "glass": lambda: {"transmission": 1.0, "roughness": 0.0, "ior": by.between(1.1, 1.8)},
        "rough glass": lambda: {"transmission": by.between(0.3, 1.0), "ior": by.between(1.1, 1.8)},
        "coat": lambda: {"coat": by.between(0.2, 1.0), "coat_roughness": by.between(0.0, 0.4)},
        "sheen": lambda: {"sheen": by.between(0.2, 1.0)},
        "matte": lambda: {"specular": 0.0, "roughness": 1.0},
        "veil": lambda: {"alpha": by.between(0.2, 0.8)},
        "glow": lambda: {"emission": [v * by.magnitude(0.3, 8.0) for v in by.color()]},
    }
    return {"base_color": by.color(), "roughness": by.between(0.0, 1.0), **own.get(kind, dict)()}


def light(by, number):
    """One of a number of lights of about the same sum, on the side of the camera."""
    away = by.around(1.0)
    away = np.array([away[0], -abs(away[1]), abs(away[2])])
    place = away / np.linalg.norm(away) * by.magnitude(1.0, 8.0)
    kind = by.of(["point", "spot", "area"])
    power = by.magnitude(5.0, 300.0) / max(1.0, number / 3) * max(1.0, place @ place / 4)
    soft = by.is_so(0.5)
    if kind == "area":
        seen = place + by.around(0.5)
        matrix = rungs.looking(place, place - seen)
        spread = by.of([math.pi, math.pi, 1.4, 0.5])
        size = [by.magnitude(0.1, 4.0), by.magnitude(0.1, 4.0)]
        shape = {"world_from_light": matrix, "outline": by.of(["rectangle", "ellipse"]), "size": size, "spread_rad": spread}
    else:
        shape = {"position": place.tolist(), "radius": by.of([0.0, 0.05, 0.3]), "soft_falloff": soft}
    if kind == "spot":
        direction = (by.around(0.3) - place).tolist()
        shape |= {"direction": direction, "angle_rad": by.between(0.2, 2.0), "blend": by.between(0.0, 1.0)}
    return {"shape": {kind: shape}, "power_w": power, "color": by.color(0.4, 1.0)}


def scene(number):
    """(fields as of a rung's file, what is in the scene)."""
    by = Random(number)
    default = by.of(["plastic", "matte", "coat", "metal"])
    kinds = {rank: by.of(MATERIALS, SHARES) for rank in range(LABELS) if by.is_so(0.6)}
    style = {"material": material(by, default), "materials": {str(rank): material(by, k) for rank, k in kinds.items()}}
    fields = {
        "what": f"random scene {number}",
        "crop": {"labels": [int(by.rng.integers(0, 15 - LABELS)), 15]},
        "view": {"eye": [by.between(-1.0, 3.2), by.between(-3.9, -2.6), by.between(0.4, 2.4)]},
        "scene": {"style": style, "settings": {"bounces": by.of([1, 3, 8, 16])}},
    }
    told = [by.of(["dark", "even", "picture", "spots"])]
    if told[0] in ("dark", "even"):
        radiance = [0.02, 0.02, 0.03] if told[0] == "dark" else by.color(0.2, 1.0)
        fields["scene"]["world"] = {"environment": {"constant": {"radiance": radiance}}}
    else:
        spots = range(by.rng.integers(1, 5))
        bright = [[by.between(-3.0, 3.0), by.between(0.1, 1.4), [v * by.magnitude(3, 300) for v in by.color(0.5, 1.0)]] for _ in spots]
        size = by.magnitude(0.03, 0.4) if told[0] == "picture" else 0.03
        fields["sky"] = {"width": 256, "bright": bright, "size": size, "floor": by.color(0.02, 0.2)}
        image = {"path": "", "rotation_rad": by.between(0.0, 6.0), "strength": by.magnitude(0.3, 2.0)}
        fields["scene"]["world"] = {"environment": {"constant": None, "image": image}}
    if by.is_so(0.35):
        direction = [by.between(-1.0, 1.0), by.between(-0.2, 1.0), -by.between(0.2, 1.0)]
        sun = {"direction": direction, "strength": by.magnitude(0.5, 5.0), "angle_rad": by.of([0.0, 0.0093, 0.1, 1.0])}
        fields["scene"]["suns"] = [sun]
        told.append("sun")
    lights = 0 if told[0] != "dark" and by.is_so(0.4) else by.of([1, 2, 3, 5, 12, 40])
    fields["scene"]["lights"] = [light(by, lights) for _ in range(lights)]
    told += [kind for one in fields["scene"]["lights"][:5] for kind in one["shape"]]
    if by.is_so(0.5):
        kind = by.of(["plastic", "matte", "metal", "coat"])
        fields["floor"] = {"height": -1.0, "half": 4.0, "material": material(by, kind)}
        told.append(f"{kind} floor")
    return fields, f"{' '.join(told)}, {lights} lights; {', '.join(sorted({default, *kinds.values()}))}"


def tiles(pictures):
    """Means of the tiles of grey pictures (seeds, height, width)."""
    seeds, height, width = pictures.shape
    return pictures.reshape(seeds, height // TILE, TILE, width // TILE, TILE).mean((2, 4))


def compared(ours, theirs, estimates):
    """The figures of a scene from its pictures (seeds, height, width, 3) and from the errors that Pumice estimates."""
    mean = 0.5 * (ours.mean(0) + theirs.mean(0))
    noise, other = (float((p.var(0, ddof=1) / (mean**2 + FLOOR)).mean()) for p in (ours, theirs))
    a, b = (tiles(p.mean(-1)) for p in (ours, theirs))
    # Where both are even the last bits differ.
    spread = np.sqrt((a.var(0, ddof=1) + b.var(0, ddof=1)) / len(a) + (1e-4 * b.mean(0)) ** 2 + 1e-12)
    return {
        "noise": noise / other,
        "estimate": math.sqrt(float(np.mean(np.square(estimates))) / noise),
        "tiles": float(np.abs((a.mean(0) - b.mean(0)) / spread).max()),
        "error": math.sqrt(noise),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("first", type=int, help="number of the first scene")
    parser.add_argument("end", type=int, help="number after that of the last")
    parser.add_argument("--blender", required=True, help="a Python that has bpy")
    parser.add_argument("--seeds", type=int, default=10, help="pictures by each program")
    parser.add_argument("--spp", type=int, default=16, help="samples per pixel")
    args = parser.parse_args()
    import pumice

    for number in range(args.first, args.end):
        fields, told = scene(number)
        with tempfile.TemporaryDirectory() as folder:
            rung = rungs.Rung(f"random-{number}", Path(folder), fields)
            theirs, _ = by_cycles.pictures(args.blender, rung, 0, args.seeds, spp=args.spp)
            ours, estimates = [], []
            for seed in range(args.seeds):
                rung.scene["settings"]["seed"] = seed
                picture = pumice.render(pumice.Scene.from_dict(rung.scene), rung.volumes, meshes=rung.meshes, spp=args.spp, backend="cpu")
                ours.append(picture.color.astype(np.float64))
                estimates.append(picture.error_estimate)
        found = compared(np.array(ours), theirs, estimates)
        figures = " ".join(f"{name} {value:.2f}" for name, value in found.items())
        print(f"{number}: {figures} | {told}, {fields['scene']['settings']['bounces']} bounces", flush=True)


if __name__ == "__main__":
    sys.exit(main())
