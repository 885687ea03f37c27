# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a render was made of, as metadata of Blender's result: Blender writes it into the OpenEXR and PNG files of the picture.

    pumice/version   version of the compiled module
    pumice/backend   backend that drew it
    pumice/scene     SHA-256 of the scene's JSON form, which File › Export › Pumice Scene writes: camera, lights, materials, settings
    pumice/volumes   hash of the voxels and ids of each volume, in the scene's order
    pumice/meshes    hash of the triangles of each mesh, in the scene's order
    pumice/seed      seed of the random numbers
    pumice/samples   samples of each pixel; the mean with a noise threshold
    pumice/error     estimated relative error of the mean of the samples; absent where it is unknown
    pumice/denoised  where the picture is denoised: `statistical, biased`, or `Open Image Denoise 2.3.3, biased`

Blender writes it whatever is chosen in Output › Metadata.
"""

import hashlib
import math

PREFIX = "pumice/"


def fields(version, scene, volumes, meshes, picture, seed):
    """The metadata of a picture by key; values are texts. `scene` is the `pumice.Scene` that was drawn, with these volumes and meshes."""
    found = {
        "version": version,
        "backend": picture.backend,
        "scene": hashlib.sha256(scene.to_json().encode()).hexdigest(),
        "volumes": " ".join(volume.content_hash for volume in volumes),
        "meshes": " ".join(mesh.content_hash for mesh in meshes),
        "seed": str(seed),
        "samples": f"{picture.mean_spp:g}",
    }
    if picture.error_estimate is not None and math.isfinite(picture.error_estimate):
        found["error"] = f"{picture.error_estimate:.3g}"
    if picture.denoised is not None:
        found["denoised"] = picture.denoised
    return {PREFIX + key: value for key, value in found.items() if value}
