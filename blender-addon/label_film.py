# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The label film: which label of which volume every pixel of the last picture sees, so that picking asks no renderer.

    a viewport's picture     its session's worker makes the film once, after each change of what is seen; until then there is none
    no viewport              the scene camera's picture, as F12 frames it, is drawn with one sample and no bounces, and kept

Pixels of the film are counted from the upper left, as in scenes and in the Label pass. Blender counts pixels of a region from the lower left,
and a viewport may be drawn with fewer pixels than its region has; `film_from_region` leads from one to the other.
"""

import dataclasses
import time
from typing import NamedTuple

import bpy
import numpy as np

from . import final_render, label_table, native, persistent, preferences, registry, scene_reader, viewport
from .properties import is_volume
from .reports import Refused, of_limit
from .sync import edits
from .sync.parts import Parts

# Longest wait for the film of a viewport's picture. It comes with the first samples, so a user who clicks on a picture hardly ever waits.
PATIENCE_SECONDS = 2.0

# The scene camera's film.
_kept = None


@dataclasses.dataclass(frozen=True, eq=False)
class LabelFilm:
    """`pixels` are (height, width, 2): number of the instance, and row of the label table plus 1, 0 where there is no label; `uids` are the
    session uids of the volume objects by number."""

    pixels: np.ndarray
    uids: dict

    def at(self, x, y):
        """(volume object, row of its label table) under a pixel, None where there is no label. Raises Refused outside of the film."""
        height, width = self.pixels.shape[:2]
        if not (0 <= x < width and 0 <= y < height):
            raise Refused(f"x, y: expected a pixel of the picture, 0 to {width - 1} across and 0 to {height - 1} down, got {x}, {y}")
        found = self.inside(x, y, x + 1, y + 1)
        return next(((obj, int(rows[0])) for obj, rows in found), None)

    def inside(self, x0, y0, x1, y1):
        """[(volume object, rows of its label table)] of all labels seen in columns x0 to x1 - 1 and lines y0 to y1 - 1."""
        part = self.pixels[max(0, y0) : max(0, y1), max(0, x0) : max(0, x1)].reshape(-1, 2)
        part = np.unique(part[part[:, 1] > 0], axis=0)
        shown = volumes(self.uids)
        seen = [(shown.get(number), part[part[:, 0] == number, 1] - 1) for number in np.unique(part[:, 0]).tolist()]
        return [(obj, rows[rows < len(obj.pumice.table.vertices)]) for obj, rows in seen if obj is not None]


def film_from_region(x, y, region_size, film_size):
    """The pixel of the film under a pixel of a region, whose lower left pixel is 0, 0. Outside of the region the nearest one counts."""
    width, height = film_size
    across = int((x + 0.5) * width / region_size[0])
    up = int((y + 0.5) * height / region_size[1])
    return min(max(across, 0), width - 1), height - 1 - min(max(up, 0), height - 1)


def volumes(uids):
    """{number: volume object with a label table} of instances; those whose object is gone are left out."""
    objects = {obj.session_uid: obj for obj in bpy.data.objects if is_volume(obj) and obj.pumice.table is not None}
    return {number: objects[uid] for number, uid in uids.items() if uid in objects}


def selections(uids):
    """[(numbers of instances, which labels are selected)] of each label table of which some labels are."""
    tables = {}
    for number, obj in volumes(uids).items():
        tables.setdefault(obj.pumice.table.session_uid, (obj.pumice.table, []))[1].append(number)
    found = [(numbers, label_table.selected(table)) for table, numbers in tables.values()]
    return [(numbers, flags) for numbers, flags in found if flags.any()]


def uids_of(shown):
    """Session uids of the volume objects of a viewport by number."""
    return {number: scene_reader.volume_uid(key) for key, number in shown.numbers.items() if key in shown.sent.placed} if shown.sent else {}


def owners_of(shown):
    """{number: session uid} of what a viewport shows, volumes and meshes: of the object, or of what makes instances of it."""
    if not shown.sent:
        return {}
    return {number: key[0] for key, number in shown.numbers.items() if key in shown.sent.placed or key in shown.sent.meshes}


def size_of(shown):
    """Pixels across and down of a viewport's film; Refused where it shows nothing."""
    if shown.sent is None:
        raise Refused("The viewport has no picture yet")
    return shown.sent.film["width"], shown.sent.film["height"]


def of_viewport(shown, patience_seconds=0.0):
    """The film of a viewport's picture; None if it is not there after that time."""
    end = time.monotonic() + patience_seconds
    while (film := shown.labels()) is None and time.monotonic() < end and shown.awaits_labels:
        time.sleep(0.005)
    return None if film is None else LabelFilm(film.pixels, uids_of(shown))


def of_last_picture(context):
    """The film of the picture in the region of `context`, else of the viewport drawn last, else of the scene's camera. Raises Refused."""
    shown = None if bpy.app.background else viewport.of_region(context.region) or viewport.last_drawn()
    if shown is None:
        return of_camera(context)
    film = of_viewport(shown, PATIENCE_SECONDS)
    if film is None:
        raise Refused("The viewport's labels are not known yet: its picture has just changed; try again")
    return film


def of_camera(context):
    """The film of the scene's camera, as F12 frames it; drawn again only if the scene has changed."""
    global _kept
    make_mesh = _kept.make_mesh if _kept is not None else persistent.Meshes()
    make_mesh.next_frame()
    reading = scene_reader.Kept(make_mesh)
    parts, _ = final_render.parts_of_frame(context.evaluated_depsgraph_get(), as_rendered=True, kept=reading)
    shown = registry.wait_all(parts.wanted(), lambda: False)
    if _kept is None or shown != _kept.volumes or edits.between(_kept.parts, parts, _kept.parts.numbers()):
        _kept = _Kept(parts, shown, make_mesh, _drawn(parts, shown, preferences.backend(context.scene.pumice)))
    return _kept.film


class _Kept(NamedTuple):
    """A film of the scene's camera, and what it was made of."""

    parts: Parts
    volumes: list
    make_mesh: persistent.Meshes
    film: LabelFilm


def _drawn(parts, shown, backend):
    """The film of a scene with its open volumes, from a session of its own."""
    pumice = native.require()
    # Light does not change what is seen first.
    parts = dataclasses.replace(parts, settings={**parts.settings, "bounces": 0})
    session = pumice.Session(parts.made(pumice), shown, meshes=parts.geometries(), backend=backend, spp=1)
    try:
        while (film := session.label_film()) is None:
            if session.status.error is not None:
                raise Refused(f"The labels of the camera's picture cannot be found: {of_limit(session.status.error)}")
            time.sleep(0.002)
    finally:
        session.stop()
    numbers = parts.numbers()
    return LabelFilm(film.pixels, {numbers[key]: scene_reader.volume_uid(key) for key in parts.placed})


@bpy.app.handlers.persistent
def _forget(*_):
    global _kept
    _kept = None


def register():
    bpy.app.handlers.load_pre.append(_forget)


def unregister():
    bpy.app.handlers.load_pre.remove(_forget)
    _forget()
