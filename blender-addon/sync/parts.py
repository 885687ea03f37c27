# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene divided into the parts that can change separately.

Each part is a value of the scene's JSON form, so that parts are compared with `==`. Instances have a key that stays the same as long as
Blender's object exists; their id in the scene is assigned when the scene is written or sent.
"""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Placed:
    """A volume in its place: `source` is a path, `style` a `LabelStyle`, `content` the hash of its voxels and ids.

    `dims` are its voxels along x, y, z: a volume that is not open is drawn as a box. `time_step` is the one of the file that is shown, None where
    the file has no time. All time steps have the labels of the table. `part` tells volumes of the same file apart that have different labels of it;
    0 has all.
    """

    source: str
    world_from_index: list
    style: object
    content: str = ""
    dims: tuple = (0, 0, 0)
    time_step: int | None = None
    part: int = 0

    def instance(self, number):
        """The instance of the scene with this number, without its groups of labels."""
        reading = {} if self.time_step is None else {"reading": {"time": self.time_step}}
        return {
            "id": number,
            "source": self.source,
            **reading,
            "world_from_index": self.world_from_index,
            "style": self.style.fields(),
        }

    def file(self):
        """(path, time step) of the volume, as the registry opens it."""
        return self.source, self.time_step

    def labels(self):
        """The labels that are drawn, as the registry takes them: (ids, which of them), None for all."""
        columns = self.style.columns
        return None if columns is None or columns.visible.all() else (columns.ids, columns.visible)

    def _fits(self, volume):
        """Whether the volume is one that the object's label table was made from."""
        if self.time_step is not None:
            return self.style.columns is None or np.array_equal(self.style.columns.ids, volume.labels.ids)
        return self.content == volume.content_hash

    def differs(self, volume):
        """A line where the volume is not the one that the object's label table was made from; None where it is."""
        if self._fits(volume) or (self.time_step is None and self.content == ""):
            return None
        return f"{self.source}: the volume has changed since it was imported, so its label table may not fit; press Reload in its Pumice panel"

    def unfit(self, volume):
        """A line where only some labels are shown and the volume lacks one of these, which a renderer refuses; None where it can be drawn."""
        columns = self.style.columns
        if columns is None or self._fits(volume) or columns.visible.all():
            return None
        gone = np.setdiff1d(columns.ids[columns.visible], volume.labels.ids, assume_unique=True)
        if not len(gone):
            return None
        lacks = f"{len(gone)} of the labels that are shown, the first {gone[0]}"
        return f"{self.source}: the volume has changed since it was imported and lacks {lacks}; press Reload in its Pumice panel"


@dataclass(frozen=True)
class PlacedMesh:
    """A triangle mesh in its place: `geometry` is a `pumice.Mesh`; `name` stands for its file."""

    name: str
    geometry: object
    world_from_mesh: list
    materials: list
    shadow_catcher: bool = False

    def mesh(self, number):
        """The mesh of the scene with this number."""
        return {
            "id": number,
            "source": self.name,
            "world_from_mesh": self.world_from_mesh,
            "materials": self.materials,
            "shadow_catcher": self.shadow_catcher,
        }


@dataclass(frozen=True)
class PlacedCut:
    """A part of space that is removed: `shape` as the scene has it; `volumes` are the keys of those that it cuts, None for all."""

    shape: dict
    volumes: tuple | None = None

    def cut(self, numbers):
        """The cut of the scene; volumes without a number are left out."""
        chosen = None if self.volumes is None else [numbers[key] for key in self.volumes if key in numbers]
        return {"shape": self.shape, "instances": chosen}


@dataclass(frozen=True)
class Parts:
    """All parts of a scene."""

    camera: dict
    film: dict
    world: dict
    settings: dict
    suns: list = field(default_factory=list)
    lights: list = field(default_factory=list)
    cuts: list = field(default_factory=list)
    placed: dict = field(default_factory=dict)
    meshes: dict = field(default_factory=dict)

    def scene(self, numbers=None):
        """The scene's JSON form without the groups of labels; without `numbers` by key, volumes and meshes count from 1 in the order of
        their keys."""
        if numbers is None:
            numbers = self.numbers()
        ordered = sorted(self.placed, key=numbers.__getitem__)
        meshes = sorted(self.meshes, key=numbers.__getitem__)
        return {
            "version": 1,
            "instances": [self.placed[key].instance(numbers[key]) for key in ordered],
            "camera": self.camera,
            "film": self.film,
            "world": self.world,
            "suns": self.suns,
            "lights": self.lights,
            "meshes": [self.meshes[key].mesh(numbers[key]) for key in meshes],
            "cuts": self.cuts_of(ordered, numbers),
            "settings": self.settings,
        }

    def cuts_of(self, keys, numbers):
        """The cuts of the scene where these volumes are in it."""
        there = {key: numbers[key] for key in keys}
        return [cut.cut(there) for cut in self.cuts]

    def made(self, pumice, numbers=None):
        """The whole scene as a `pumice.Scene`, with the groups of labels; `numbers` as for `scene`."""
        numbers = self.numbers() if numbers is None else numbers
        scene = pumice.Scene.from_dict(self.scene(numbers))
        for key, placed in self.placed.items():
            scene = placed.style.on(scene, numbers[key], pumice)
        return scene

    def numbers(self):
        """Numbers by key: those of volumes count from 1 in the order of their keys, those of meshes after them."""
        return {key: number for number, key in enumerate([*sorted(self.placed), *sorted(self.meshes)], start=1)}

    def geometries(self, numbers=None):
        """The meshes' triangles, in the order of `scene()`."""
        numbers = self.numbers() if numbers is None else numbers
        return [self.meshes[key].geometry for key in sorted(self.meshes, key=numbers.__getitem__)]

    def sources(self):
        """(path, time step) of all instances, in the order of `scene()`."""
        return [self.placed[key].file() for key in sorted(self.placed)]

    def wanted(self):
        """(path, time step, labels) of all instances, in the order of `scene()`, as the registry takes them."""
        return [(*self.placed[key].file(), self.placed[key].labels()) for key in sorted(self.placed)]
