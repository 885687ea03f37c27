"""Reads and writes the references that are checked in: Cycles' mean picture of each rung with its noise, and the rate of false alarms.

    references/NAME.npz    mean       float32 (height, width, 3)
                           error      float16: standard error of the mean, in 2⁻¹² of the picture's mean
                           tiles      float32 (rows, columns, 3): variance of the mean of each tile
                           total      float64 (3,): variance of the mean of the whole
                           about      JSON text: Blender's version, seeds, samples, the rung's digest, the calibration
"""

import json
from pathlib import Path

import numpy as np

from verdict import Reference, judge

FOLDER = Path(__file__).resolve().parent / "references"


def path_of(name):
    return FOLDER / f"{name}.npz"


def load(name):
    """(reference, facts about it) of a rung."""
    with np.load(path_of(name)) as file:
        mean, about = file["mean"].astype(np.float64), json.loads(str(file["about"]))
        error = file["error"].astype(np.float64) * mean.mean() / 4096
        return Reference(mean, error**2, file["tiles"].astype(np.float64), file["total"], about["seeds"]), about


def save(name, reference, about):
    error = np.sqrt(reference.variance) * 4096 / reference.mean.mean()
    np.savez_compressed(
        path_of(name),
        mean=reference.mean.astype(np.float32),
        error=error.astype(np.float16),
        tiles=reference.tile_variance.astype(np.float32),
        total=reference.total_variance,
        about=json.dumps(about),
    )


def calibrated(pictures, seeds):
    """Verdicts on each set of `seeds` pictures against a reference of all others. As all are by Cycles, all should agree."""
    verdicts = []
    for first in range(0, len(pictures), seeds):
        others = np.concatenate([pictures[:first], pictures[first + seeds :]])
        verdicts.append(judge(pictures[first : first + seeds], Reference.of(others)))
    return verdicts
