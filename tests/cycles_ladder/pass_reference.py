"""Compares passes of light with Cycles' by tiles, and reads and writes the references that are checked in.

    pass_references/NAME.npz    means      float32 (kinds, rows, columns, 3): mean over seeds of each tile of 8 × 8 pixels
                                variances  float32: variance of that mean
                                about      JSON text: Blender's version, seeds, samples, the rung's digest, the kinds

The comparison uses light times the colour by which both programs divide it, and the diffuse colour. These do not depend on how each
program estimates the colours of glossy light and of transmission, which differ (docs/passes.md).

    means of tiles and of the whole, each kind and channel    Welch's t; none may exceed Šidák's bound at 1 % for a rung together
    a tile or the whole without noise in either picture       may differ only by rounding
"""

import json
from pathlib import Path

import numpy as np
import scipy.stats

FOLDER = Path(__file__).resolve().parent / "pass_references"
RUNGS = ("10_metal_and_plastic", "11_glass", "12_coat_and_sheen", "13_emissive")
KINDS = (
    *("diffuse_direct", "diffuse_indirect", "diffuse_color", "glossy_direct", "glossy_indirect"),
    *("transmission_direct", "transmission_indirect", "emission", "environment"),
)
PASSES = [f"{kind}_{part}" for kind in ("diffuse", "glossy", "transmission") for part in ("direct", "indirect", "color")]
PASSES += ["emission", "environment"]
TILE = 8
LEVEL = 0.01
# Differences below this share of a mean count as rounding: ten times what float32 sums of up to 2¹⁴ samples vary by.
ROUNDING = 2e-5


def path_of(name):
    return FOLDER / f"{name}.npz"


def of_seeds(pictures):
    """Means of each tile and, last, of the whole picture: (seeds, kinds, rows · columns + 1, 3) of (seeds, kinds, height, width, 3)."""
    seeds, kinds, height, width, channels = pictures.shape
    tiles = pictures.reshape(seeds, kinds, height // TILE, TILE, width // TILE, TILE, channels).mean(axis=(3, 5))
    parts = tiles.reshape(seeds, kinds, -1, channels)
    return np.concatenate([parts, pictures.mean(axis=(2, 3))[:, :, None]], axis=2)


def save(name, pictures, about):
    parts = of_seeds(np.asarray(pictures, dtype=np.float64))
    FOLDER.mkdir(exist_ok=True)
    np.savez_compressed(
        path_of(name),
        means=parts.mean(axis=0).astype(np.float32),
        variances=(parts.var(axis=0, ddof=1) / len(parts)).astype(np.float32),
        about=json.dumps({**about, "kinds": KINDS, "seeds": len(parts)}),
    )


def load(name):
    """(means, variances, about) of a reference."""
    with np.load(path_of(name)) as file:
        return file["means"].astype(np.float64), file["variances"].astype(np.float64), json.loads(str(file["about"]))


def drawn(rung, first, seeds):
    """Renders Pumice's passes of light: (seeds, kinds, height, width, 3)."""
    import pumice

    scene = json.loads(json.dumps(rung.scene))
    scene["film"]["passes"] = PASSES
    out = []
    for seed in range(first, first + seeds):
        scene["settings"]["seed"] = seed
        made = pumice.render(pumice.Scene.from_dict(scene), rung.volumes, meshes=rung.meshes, spp=rung.spp, backend="cpu").passes
        light = {name: made[name].astype(np.float64) for name in PASSES}
        for kind in ("diffuse", "glossy", "transmission"):
            for part in ("direct", "indirect"):
                light[f"{kind}_{part}"] *= light[f"{kind}_color"]
        out.append([light[kind] for kind in KINDS])
    return np.array(out)


def judge(pictures, reference):
    """Result for each kind: {kind: (number of means beyond the bound, least probability times the number of all means)}."""
    means, variances, about = reference
    parts = of_seeds(pictures)
    n = len(parts)
    apart = parts.mean(axis=0) - means
    va, vb = parts.var(axis=0, ddof=1) / n, variances
    # Allows for the rounding of float32 sums, where there is little or no noise.
    floor = (ROUNDING * np.maximum(np.abs(means), means.mean(axis=(1, 2), keepdims=True))) ** 2
    t = np.abs(apart) / np.sqrt(va + vb + floor + 1e-30)
    freedom = (va + vb + floor + 1e-30) ** 2 / (va**2 / (n - 1) + vb**2 / (about["seeds"] - 1) + 1e-62)
    chances = 2 * scipy.stats.t.sf(t, freedom)
    bound = 1.0 - (1.0 - LEVEL) ** (1.0 / t.size)
    found = {}
    for kind, of_kind in zip(KINDS, chances):
        found[kind] = (int((of_kind < bound).sum()), float(of_kind.min() * t.size))
    return found


def guilty(found):
    return sorted(kind for kind, (beyond, _) in found.items() if beyond)
