"""Reads and writes the references that are checked in: Cycles' mean picture of each rung with its noise, and the rate of false alarms; and
has pictures tested against them.

    references/NAME.npz    mean       float32 (height, width, 3)
                           error      float16: standard error of the mean, in 2⁻¹² of the picture's mean
                           tiles      float32 (rows, columns, 3): variance of the mean of each tile
                           total      float64 (3,): variance of the mean of the whole
                           about      JSON text: Blender's version, seeds, samples, the rung's digest, the calibration

The test of equality is that of `pumice.ReferencePicture.judge` (picture/src/agreement/equality.rs). Two of a hundred sets of pictures that
agree fail it by chance. So a failure is tested again (`heard`) with four times the seeds, all of them new. A picture that agrees fails both
times in about 1 of 2,500 cases, while a real difference only becomes clearer.
"""

import json
from pathlib import Path

import numpy as np
import pumice

FOLDER = Path(__file__).resolve().parent / "references"


def path_of(name):
    return FOLDER / f"{name}.npz"


def load(name):
    """(reference, facts about it) of a rung."""
    with np.load(path_of(name)) as file:
        mean, about = file["mean"].astype(np.float64), json.loads(str(file["about"]))
        error = file["error"].astype(np.float64) * mean.mean() / 4096
        noise = {"variance": error**2, "tile_variance": file["tiles"], "total_variance": file["total"]}
        return pumice.ReferencePicture(mean, **noise, seeds=about["seeds"]), about


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


def heard(draw, reference, seeds):
    """What the test finds of `draw(first, n)`, which returns pictures of n seeds from number `first` on. A failure is tested again with four
    times as many new seeds."""
    first = reference.judge(draw(0, seeds))
    return first if first["agrees"] else reference.judge(draw(seeds, 4 * seeds))


def calibrated(pictures, seeds):
    """What the test finds of each set of `seeds` pictures against a reference of all others. As all are by Cycles, all should agree."""
    found = []
    for first in range(0, len(pictures), seeds):
        others = np.concatenate([pictures[:first], pictures[first + seeds :]])
        found.append(pumice.ReferencePicture.of(others).judge(pictures[first : first + seeds]))
    return found
