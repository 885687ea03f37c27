# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of `window_drive` that import stores as a user does: by URL from a server on loopback, by a link to Neuroglancer, and by dropping a folder.

Each dialog is confirmed with Return, and what is imported has the voxels that the store has. While *Online Access* is off, no dialog opens.
"""

import functools
import http.server
import json
import os
import subprocess
import sys
import threading
import urllib.parse

import bpy
import numpy as np

SIDES = (24, 16, 8)


def labels():
    """array[x, y, z] of eight labels."""
    x, y, z = np.indices(SIDES)
    return (1 + x // 12 + 2 * (y // 8) + 4 * (z // 4)).astype("<u4")


def write(folder):
    """A volume as Neuroglancer reads it: one raw chunk."""
    os.makedirs(f"{folder}/8_8_8")
    scale = {"key": "8_8_8", "size": SIDES, "resolution": [8, 8, 8], "voxel_offset": [0, 0, 0], "chunk_sizes": [SIDES], "encoding": "raw"}
    said = {"@type": "neuroglancer_multiscale_volume", "type": "segmentation", "data_type": "uint32", "num_channels": 1, "scales": [scale]}
    with open(f"{folder}/info", "w") as file:
        json.dump(said, file)
    with open(f"{folder}/8_8_8/" + "_".join(f"0-{side}" for side in SIDES), "wb") as file:
        file.write(labels().tobytes(order="F"))


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def steps(out, window, area, until, events, shot):
    """Imports in the viewport of `area`; `until`, `events` and `shot` are those of `window_drive`."""
    import pumice

    folder = f"{out}/stores"
    write(f"{folder}/cells.precomputed")
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    url = f"precomputed://http://127.0.0.1:{server.server_address[1]}/cells.precomputed"
    region = next(r for r in area.regions if r.type == "WINDOW")
    place = (region.x + region.width // 2, window.height - 1 - (region.y + region.height // 2))
    system = bpy.context.preferences.system

    def volumes():
        return {obj for obj in bpy.data.objects if obj.pumice.filepath}

    before = volumes()

    def invoked():
        with bpy.context.temp_override(window=window, area=area, region=region):
            return bpy.ops.pumice.import_url("INVOKE_DEFAULT")

    def confirmed(name, moved):
        """Takes a picture of the dialog that is open, and confirms it."""
        yield 1.0
        shot(name)
        assert volumes() == before, f"{name}: nothing is imported before the dialog is confirmed"
        yield from events((place[0], place[1] + moved), "keydown Return", "keyup Return")

    def imported(name, chosen=None):
        yield from until(lambda: volumes() != before, f"{name}: the volume is imported")
        (obj,) = volumes() - before
        np.testing.assert_array_equal(pumice.open(obj.pumice.filepath).decode(), labels())
        shown = sys.modules["bl_ext.user_default.pumice"].label_table.visible(obj.pumice.table)
        assert chosen is None or shown.sum() == chosen, f"{name}: {shown.sum()} labels are shown"
        yield 0.5
        shot(f"{name}_imported")
        bpy.data.objects.remove(obj)
        yield 0.5

    # Control: without Online Access no dialog opens, and Return imports nothing.
    window_manager = bpy.context.window_manager
    window_manager.clipboard = url
    system.use_online_access = False
    yield from events(place)
    try:
        refused = invoked() == {"CANCELLED"}
    except RuntimeError as error:
        refused = "Allow Online Access" in str(error)
    assert refused, "Blender may not go online"
    yield from events(place, "keydown Return", "keyup Return")
    yield 1.0
    assert volumes() == before

    system.use_online_access = True
    yield from events(place)
    invoked()
    yield from confirmed("url_dialog", 4)
    yield from confirmed("url_options", 8)
    yield from imported("url")

    state = {"layers": [{"type": "segmentation", "name": "cells", "source": url, "segments": ["2", "7"]}]}
    window_manager.clipboard = "https://neuroglancer-demo.appspot.com/#!" + urllib.parse.quote(json.dumps(state))
    yield from events(place)
    invoked()
    yield from confirmed("link_dialog", 4)
    yield from confirmed("link_options", 8)
    yield from imported("link", 2)

    yield from events(place)
    source = os.path.join(os.path.dirname(os.path.abspath(__file__)), "xdnd_source.py")
    process = subprocess.Popen(["python3", source, *map(str, place), f"{folder}/cells.precomputed"])
    yield from until(lambda: process.poll() is not None, "the folder is handed over")
    assert process.returncode == 0, f"the source of the drop ends with {process.returncode}"
    yield from confirmed("folder_options", 4)
    yield from imported("folder")
    server.shutdown()
