"""Live pictures: a worker thread of the compiled part refines them, and Python edits the scene and takes frames. Only `pick` and `stop`
wait for the worker, at most for a slice of some tenths of a second."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native, arguments, mesh
from .checked import checked
from .labels import LabelFlags, LabelGroups, flags
from .mesh import Mesh
from .page_memory import PageFigures, figures_of
from .picture import Volumes, in_order, limit_without
from .scene import Scene
from .volume import Job, Volume


@dataclasses.dataclass(frozen=True)
class Status:
    """Status of a session: `state` is rendering, converged, failed or stopped; `backend` draws on `device`; `notices` has the device
    failures after which rendering continued, the latest last; `pages` is what was in memory of volumes that are drawn from disk, None where all
    is in memory; `compiling` is the backend whose programs are being compiled, while the processor draws."""

    state: str
    error: str | None
    revision: int
    backend: str
    device: str
    notices: list[str]
    counters: dict[str, int]
    pages: PageFigures | None = None
    compiling: str | None = None


@dataclasses.dataclass(frozen=True)
class Pick:
    """What lies under a pixel: ids of instance and label, the label's name, the voxel that was hit, its distance."""

    instance: int
    label: int
    name: str
    voxel: tuple[int, int, int]
    depth: float


@dataclasses.dataclass(frozen=True)
class LabelFilm:
    """What lies under the centre of every pixel, row 0 at the top: `pixels` is (height, width, 2), the id of the instance and the label's row
    in the label table plus 1, or the id of the mesh and 0; 0 and 0 where there is nothing. `depth` is (height, width), the distance of that
    surface from the camera along its view axis in world units; infinite where there is nothing. Glass and transparent surfaces count.
    `revision` is the revision of the scene that it was made of."""

    revision: int
    pixels: npt.NDArray[np.uint32]
    depth: npt.NDArray[np.float32]


Frame = _native.Frame


class Session:
    """A live picture of `scene`; arguments as for `render`. Without `spp`, `seconds` or `error` it is refined for ever.

    `denoise`: with True or "statistical", frames before the last are denoised (`Frame.filtered`); the last is the mean of its samples.
    `volumes`: as for `render`. Without them the scene's sources are opened first, which `job` may cancel; with `memory_limit` they are drawn from
    disk, and hold at most so many bytes. Volumes that several sessions share are opened with a `PageMemory` instead.
    """

    @checked
    def __init__(
        self,
        scene: Scene,
        volumes: Volumes | None = None,
        *,
        meshes: Sequence[Mesh] = (),
        backend: str = "auto",
        spp: int | None = None,
        seconds: float | None = None,
        error: float | None = None,
        denoise: bool | str = False,
        memory_limit: int | None = None,
        job: Job | None = None,
    ) -> None:
        how = arguments.render_as(backend, spp, seconds, error)
        self._native = _native.Session(
            scene._native,
            None if volumes is None else in_order(scene, volumes),
            mesh.natives(meshes),
            how,
            denoise=arguments.live_denoiser(denoise),
            memory_limit=limit_without(volumes, memory_limit),
            job=job,
        )

    @checked
    def edit(self, *edits: dict[str, Any]) -> int:
        """Applies all edits or, on an error, none, and returns the new revision at once; InputError names the field at fault."""
        return int(self._native.edit(arguments.json_text("edit", list(edits))))

    @checked
    def set_labels(
        self, instance: int, *, visible: LabelFlags | None = None, groups: LabelGroups | None = None
    ) -> int:
        """Chooses which labels of the `instance` with this id are drawn, and replaces the groups of its labels; returns the new revision.

        `visible`, `groups`: as `Scene.with_labels` takes them."""
        return int(self._native.set_labels(instance, flags(visible), None if groups is None else groups._native))

    @checked
    def add(self, instance: dict[str, Any], volume: Volume) -> int:
        """Adds an `instance`, by its fields in the scene, with its `volume`, or replaces the one with its id; returns the new revision."""
        return int(self._native.add(arguments.json_text("edit", instance), volume._native))

    @checked
    def add_mesh(self, fields: dict[str, Any], triangles: Mesh) -> int:
        """Adds a mesh, by its `fields` in the scene, with its `triangles`, or replaces the one with its id; returns the new revision."""
        return int(self._native.add_mesh(arguments.json_text("edit", fields), triangles._native))

    @checked
    def latest(self, after: int = 0) -> Frame | None:
        """The newest frame if its serial is above `after`, else None. numpy and Blender's `gpu.types.Buffer` read it without a copy."""
        return self._native.latest(after)

    def label_film(self) -> LabelFilm | None:
        """The labels that the newest revision shows, and their depth; None while the worker makes the film, which the first call asks for, or if that revision
        cannot be shown. A change of light, materials or colors keeps the film. Never waits, and copies nothing."""
        found = self._native.label_film()
        return None if found is None else LabelFilm(found[0], np.asarray(found[1]), np.asarray(found[2]))

    @checked
    def pick(self, x: int, y: int) -> Pick | None:
        """What lies under the centre of the pixel of the film in column `x` and row `y`, counted from 0 at the upper left; None where nothing is."""
        if not (0 <= x <= arguments.MOST_32 and 0 <= y <= arguments.MOST_32):
            return None
        found = self._native.pick(x, y)
        if found is None:
            return None
        instance, label, name, voxel, depth = found
        return Pick(instance, label, name, (voxel[0], voxel[1], voxel[2]), depth)

    @property
    def status(self) -> Status:
        """The current status."""
        state, error, revision, backend, device, compiling, notices, counters, pages = self._native.status()
        told = None if pages is None else figures_of(pages)
        return Status(state, error, revision, backend, device, notices, counters, told, compiling)

    @property
    def scene(self) -> Scene:
        """The scene as it is now."""
        return Scene(self._native.scene())

    def stop(self) -> None:
        """Stops the worker; the newest frame stays available. A second call does nothing."""
        self._native.stop()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _panic_on_purpose(self) -> None:
        self._native._panic_on_purpose()
