"""From an array of labels to a figure: `python array_to_figure.py OUT.png`"""

import sys

import numpy as np
import pumice

# A hundred cells: each voxel belongs to the nearest of a hundred points.
rng = np.random.default_rng(1)
points = rng.uniform(0, 96, (100, 3))
grid = np.stack(np.indices((96, 96, 96)), axis=-1) + 0.5
labels = 1 + np.argmin([((grid - p) ** 2).sum(axis=-1) for p in points], axis=0).astype(np.uint16)

volume = pumice.compress(labels, spacing=(1, 1, 1), unit="um")  # lossless: 1.7 MB of labels
shown = [label for label, z in zip(volume.labels.ids, volume.labels.high[:, 2]) if z < 70]
scene = pumice.figure(volume, labels=shown, size=(640, 480), view_deg=(30, 35))
picture = pumice.render(scene, volume, error=0.05)
picture.save(sys.argv[1])
print(f"{volume}: {picture.spp} samples a pixel, error about {100 * picture.error_estimate:.1f} %")
