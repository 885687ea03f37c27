# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A small time series for tests: slabs that stand still, a ball that moves along x, and a label that is there at two time steps alone."""

import json
import struct

import numpy as np
import pumice

from test_real_volumes import imported

STEPS, DIMS, SIZE, SPP = 5, (40, 20, 16), (48, 24), 2
SLABS, BALL, RARE = (1, 2, 3), 2**40, 777
# Time steps at which RARE is there.
SEEN = (2, 3)


def dense(step):
    """array[x, y, z] of ids at a time step."""
    x, y, z = np.indices(DIMS)
    ids = np.where(z < 4, 1 + x // 14, 0).astype(np.uint64)
    ids[(x - 5 - 7 * step) ** 2 + (y - 10) ** 2 + (z - 10) ** 2 < 20] = BALL
    if step in SEEN:
        ids[2:8, 14:19, 5:14] = RARE
    return ids


def write(path, steps=STEPS, first=0):
    """Writes the series as one compressed file."""
    pumice.compress_series([dense(first + step) for step in range(steps)], path, spacing=(2.0, 2.0, 3.0), unit="um")
    return path


def write_nifti(path, arrays):
    """Writes arrays[t][x, y, z] of 16 bits as one NIfTI file with time steps, or one array without."""
    several = len(arrays) > 1
    dims = [4 if several else 3, *arrays[0].shape, len(arrays), 1, 1, 1]
    head = bytearray(352)
    struct.pack_into("<i", head, 0, 348)
    struct.pack_into("<8h", head, 40, *dims)
    struct.pack_into("<2h", head, 70, 512, 16)
    struct.pack_into("<8f", head, 76, 1.0, 2.0, 2.0, 3.0, 1.0, 1.0, 1.0, 1.0)
    struct.pack_into("<2f", head, 108, 352.0, 1.0)
    head[123] = 3  # µm
    struct.pack_into("<h", head, 254, 1)
    struct.pack_into("<12f", head, 280, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 3, 0)
    head[344:348] = b"n+1\0"
    path.write_bytes(bytes(head) + b"".join(one.astype("<u2").tobytes(order="F") for one in arrays))
    return path


def write_tiff(path, arrays):
    """Writes arrays[t][x, y, z] of 16 bits as a hyperstack of ImageJ, a page for each z of each time step."""
    pages = [one[:, :, z].T.astype("<u2") for one in arrays for z in range(one.shape[2])]
    said = f"ImageJ=1.54f\nimages={len(pages)}\nslices={arrays[0].shape[2]}\nframes={len(arrays)}\nhyperstack=true\nunit=um\nspacing=3.0\n"
    text = said.encode() + b"\0"
    out = bytearray(struct.pack("<2sHI", b"II", 42, 8))
    for number, page in enumerate(pages):
        height, width = page.shape
        # A directory of twelve entries, then what does not fit into them, then the pixels.
        entries = 12 if number == 0 else 11
        after = len(out) + 2 + 12 * entries + 4
        resolution, words = after, text if number == 0 else b""
        at_text, at_pixels = after + 8, after + 8 + len(words) + len(words) % 2
        tags = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 16), (259, 3, 1, 1), (262, 3, 1, 1)]
        tags += [(270, 2, len(words), at_text)] if words else []
        tags += [(273, 4, 1, at_pixels), (277, 3, 1, 1), (278, 4, 1, height), (279, 4, 1, page.nbytes), (282, 5, 1, resolution), (283, 5, 1, resolution)]
        end = at_pixels + page.nbytes
        out += struct.pack("<H", entries) + b"".join(struct.pack("<HHII", *tag) for tag in tags)
        out += struct.pack("<I", end if number + 1 < len(pages) else 0)
        out += struct.pack("<II", 500000, 1000000) + words + b"\0" * (len(words) % 2) + page.tobytes()
    path.write_bytes(bytes(out))
    return path


def write_ome_zarr(path, arrays):
    """Writes arrays[t][x, y, z] of 16 bits as an OME-Zarr 0.4 of axes t, z, y, x, a chunk for each time step, not compressed."""
    stack = np.stack([one.T for one in arrays]).astype("<u2")
    axes = [{"name": "t", "type": "time"}, *({"name": name, "type": "space", "unit": "micrometer"} for name in "zyx")]
    scale = [{"type": "scale", "scale": [1.0, 3.0, 2.0, 2.0]}]
    (path / "0").mkdir(parents=True)
    (path / ".zgroup").write_text('{"zarr_format": 2}')
    scales = {"version": "0.4", "axes": axes, "datasets": [{"path": "0", "coordinateTransformations": scale}]}
    (path / ".zattrs").write_text(json.dumps({"multiscales": [scales]}))
    chunks = [1, *stack.shape[1:]]
    array = {"zarr_format": 2, "shape": list(stack.shape), "chunks": chunks, "dtype": "<u2", "compressor": None, "fill_value": 0, "order": "C"}
    (path / "0" / ".zarray").write_text(json.dumps({**array, "filters": None, "dimension_separator": "."}))
    for step, one in enumerate(stack):
        (path / "0" / f"{step}.0.0.0").write_bytes(one.tobytes())
    return path


def made(bpy, path, **options):
    """The series as a volume, in a scene that F12 renders in a moment; scene frame 1 shows time step 0."""
    obj = imported(bpy, path, time_steps="all", **options)
    scene = bpy.context.scene
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *SIZE, 100
    scene.pumice.samples, scene.pumice.bounces, scene.pumice.seed, scene.pumice.backend = SPP, 2, 7, "CPU"
    if bpy.app.version >= (5, 0, 0):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    render.image_settings.color_depth, render.image_settings.exr_codec = "32", "NONE"
    bpy.context.view_layer.pumice.use_pass_label = True
    return obj
