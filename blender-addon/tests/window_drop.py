# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of `window_drive` that drop files on the viewport through the window system, as from a file manager (`xdnd_source`).

Two volumes whose matrices and units differ are dropped together: both are imported, with one display scale, and stand to each other as their
files say. A file of another kind is not taken.
"""

import os
import subprocess

import bpy
import numpy as np

# Voxels to the world of each file, and its unit: the second volume is 0.5 µm along x from the first, which is in nm.
FILES = {
    "left": (np.array([[40.0, 0, 0, 100], [0, 40.0, 0, 0], [0, 0, 50.0, 0], [0, 0, 0, 1]]), "nm"),
    "right": (np.array([[0, -0.02, 0, 0.6], [0.02, 0, 0, 0.1], [0, 0, 0.05, 0], [0, 0, 0, 1]]), "um"),
}
NM = {"nm": 1.0, "um": 1000.0}


def steps(out, window, area, until, events, shot):
    """Drops in the viewport of `area`; `until`, `events` and `shot` are those of `window_drive`."""
    import pumice

    region = next(r for r in area.regions if r.type == "WINDOW")
    place = (region.x + region.width // 2, window.height - 1 - (region.y + region.height // 2))
    for name, (matrix, unit) in FILES.items():
        dense = np.arange(1, 9, dtype=np.uint8).reshape(2, 2, 2).repeat(4, 0).repeat(4, 1).repeat(4, 2)
        pumice.compress(dense, world_from_index=matrix, unit=unit).save(f"{out}/{name}.pumice")
    with open(f"{out}/notes.text", "w") as file:
        file.write("no volume\n")

    def dropped(*names):
        """Drops files, and returns the exit status of the source."""
        source = os.path.join(os.path.dirname(os.path.abspath(__file__)), "xdnd_source.py")
        process = subprocess.Popen(["python3", source, *map(str, place), *(f"{out}/{name}" for name in names)])
        yield from until(lambda: process.poll() is not None, f"{names} are handed over")
        assert process.returncode == 0, f"{names}: the source ends with {process.returncode}"
        yield 1.0

    def volumes():
        return {obj.name for obj in bpy.data.objects if obj.pumice.filepath}

    before = volumes()
    bpy.ops.ed.undo_push(message="before dropping")
    yield from events(place)

    # Control: a file of another kind asks nothing and imports nothing, also after Return.
    yield from dropped("notes.text")
    shot("drop_refused")
    yield from events(place, "key Return")
    yield 2.0
    assert volumes() == before, "a text is no volume"

    # Two volumes: one dialog for both, and Return imports them.
    yield from dropped("left.pumice", "right.pumice")
    shot("drop_dialog")
    assert volumes() == before, "nothing is imported before the dialog is confirmed"
    yield from events(place, "key Return")
    yield from until(lambda: volumes() >= {"left", "right"}, "both are imported")
    yield 1.0
    shot("dropped")
    made = {name: bpy.data.objects[name] for name in FILES}
    # One display scale: units of Blender a nanometer.
    scales = {name: obj.pumice.display_scale / NM[FILES[name][1]] for name, obj in made.items()}
    assert abs(scales["left"] / scales["right"] - 1.0) < 1e-5, scales
    # The map from nanometers of the file to the scene, found through each of them, is one and the same; the scale is in single precision.
    maps = [
        np.array(obj.matrix_world) @ np.linalg.inv(np.diag([NM[FILES[name][1]]] * 3 + [1.0]) @ FILES[name][0])
        for name, obj in made.items()
    ]
    assert np.allclose(maps[0], maps[1], rtol=1e-4, atol=1e-4), maps
    # Control: with the other's matrix it is not.
    wrong = np.array(made["left"].matrix_world) @ np.linalg.inv(np.diag([NM["um"]] * 3 + [1.0]) @ FILES["right"][0])
    assert not np.allclose(maps[0], wrong, rtol=1e-2, atol=1e-2)

    # One step of undo takes both away.
    yield from events(place, "key ctrl+z")
    yield from until(lambda: volumes() == before, "one undo takes both away")
