"""From an array of labels to a figure: `python array_to_figure.py` writes cells.png. The README shows what follows."""

import numpy as np
import pumice

rng = np.random.default_rng(1)
points = rng.uniform(0, 96, (100, 3))                 # a hundred cells: each voxel belongs to the nearest point
grid = np.stack(np.indices((96, 96, 96)), axis=-1) + 0.5
labels = 1 + np.argmin([((grid - p) ** 2).sum(axis=-1) for p in points], axis=0).astype(np.uint16)

volume = pumice.compress(labels, spacing=(1, 1, 1), unit="um")
low = [label for label, top in zip(volume.labels.ids, volume.labels.high[:, 2]) if top < 70]
scene = pumice.figure(volume, labels=low, size=(640, 480), view=(30, 35))
picture = pumice.render(scene, volume, error=0.05)
picture.save("cells.png")
print(f"{picture.spp} samples a pixel, error about {100 * picture.error_estimate:.1f} %")
