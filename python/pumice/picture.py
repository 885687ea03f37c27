"""Renders scenes to pictures, and gives their pixels, passes and figures."""

from __future__ import annotations

import dataclasses
import json
import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native, arguments, mesh
from .arguments import Path
from .checked import checked
from .errors import InputError, PumiceWarning
from .mesh import Mesh
from .page_memory import PageFigures, limit_of
from .scene import Scene
from .sources import warn_of_missing
from .volume import Job, Volume

Floats = npt.NDArray[np.float32]
PASSES = ("depth", "position", "normal", "label", "instance", "albedo", "variance", "samples")
Volumes = Volume | Sequence[Volume] | Mapping[str, Volume]


@dataclasses.dataclass(frozen=True)
class CurvePoint:
    """One point of the curve of error against run time of a render."""

    spp: int
    seconds: float
    cpu_seconds: float
    error_estimate: float | None


@dataclasses.dataclass(frozen=True)
class PickedPixel:
    """What lies under a pixel of a picture. `instance` and `label` are ids, `name` and `type` are empty where the label has none; all four are
    None where there is no label. `position` (world) and `depth` (along the view axis) are also those of meshes, and None where there is
    nothing or the picture lacks the pass. `voxel` is None unless the volume was given."""

    instance: int | None
    label: int | None
    name: str | None
    type: str | None
    position: tuple[float, float, float] | None
    depth: float | None
    voxel: tuple[int, int, int] | None


class Picture:
    """A finished picture as read-only numpy arrays; row 0 is the top."""

    def __init__(self, native: _native.Picture) -> None:
        self._native = native
        told = json.loads(native.figures())
        self._figures: dict[str, Any] = told["figures"]
        self.explanation: list[str] = told["explanation"]
        self.color: Floats = np.asarray(native.color())
        self.alpha: Floats | None = _maybe(native.alpha())
        self.noisy: Floats | None = _maybe(native.noisy())
        """The mean of the samples, where `color` is denoised."""
        self.variance: Floats | None = _maybe(native.variance())
        self.depth: Floats | None = _maybe(native.depth())
        self.label: npt.NDArray[np.uint32] | None = _maybe(native.label())
        self.instance: npt.NDArray[np.uint32] | None = _maybe(native.instance())
        self.albedo: Floats | None = _maybe(native.albedo())
        self.normal: Floats | None = _maybe(native.normal())
        self.position: Floats | None = _maybe(native.position())
        self.samples: Floats | None = _maybe(native.samples())
        mattes = native.mattes()
        self._mattes: dict[str, Floats] = {name: np.asarray(array) for name, array, _ in mattes}
        self.manifests: dict[str, dict[str, int]] = {name: names for name, _, names in mattes}
        """For each Cryptomatte pass, the hash of each name in the picture; its id is the float with these bits."""
        self._light: dict[str, Floats] = {name: np.asarray(array) for name, array in native.light()}

    @property
    def passes(self) -> dict[str, npt.NDArray[Any]]:
        """Every pass that the picture has, by name: (height, width), or with colours (height, width, 3). `label` is uint32, 0 where
        there is none, else the row of the label table plus 1; `instance`, in scenes of several, is uint32 as well, the id of the label's
        instance; all others are float32. Passes of light and Cryptomatte are there
        where the scene's `film.passes` asked for them; Cryptomatte is (height, width, ranks, 2): ids, coverages."""
        named = {name: getattr(self, name) for name in PASSES}
        return {**{name: array for name, array in named.items() if array is not None}, **self._light, **self._mattes}

    @property
    def spp(self) -> int:
        """Samples in every pixel."""
        return int(self._figures["spp"])

    @property
    def error_estimate(self) -> float | None:
        """Estimated relative error, where known."""
        error = self._figures["error_estimate"]
        return None if error is None else float(error)

    @property
    def denoised(self) -> str | None:
        """The filter that the colors went through, as files name it; None where they are the mean of the samples. Denoised colors are biased:
        `error_estimate` and `variance` are those of `noisy`."""
        found = self._figures.get("denoised")
        return None if found is None else str(found)

    @property
    def backend(self) -> str:
        """Name of the backend that rendered it."""
        return str(self._figures["backend"])

    @property
    def device(self) -> str:
        """Name of the device that rendered it."""
        return str(self._figures["device"])

    @property
    def notices(self) -> list[str]:
        """Device failures after which rendering continued, one line each."""
        return list(self._figures["notices"])

    @property
    def pages(self) -> PageFigures | None:
        """What was in memory of volumes that were drawn from disk, with the loads of this picture; None where all was in memory."""
        found = self._figures.get("pages")
        return None if found is None else PageFigures(**found)

    @property
    def mean_spp(self) -> float:
        """Mean over pixels of the samples that each has: `spp`, or less where pixels came to rest (`settings.adaptive`). NaN of a picture
        that was opened from a file without the pass `samples`."""
        return _number(self._figures["mean_spp"])

    @property
    def seconds(self) -> float:
        """Wall seconds of rendering; NaN of a picture that was opened from a file."""
        return _number(self._figures["seconds"])

    @property
    def curve(self) -> list[CurvePoint]:
        """The estimated error against run time, as points."""
        return [
            CurvePoint(p["spp"], p["seconds"], p["cpu_seconds"], p["error_estimate"]) for p in self._figures["curve"]
        ]

    def ids(self) -> npt.NDArray[np.uint64]:
        """The id of the label of the first surface under the middle of each pixel, 0 where there is none: (height, width). Exact."""
        return np.asarray(self._native.label_ids())

    def instances(self) -> npt.NDArray[np.uint32]:
        """The id of the instance that this label belongs to, 0 where there is no label: (height, width)."""
        return np.asarray(self._native.instance_ids())

    @checked
    def pick(self, x: int, y: int, *, volume: Volume | None = None) -> PickedPixel:
        """What lies under the middle of the pixel in column `x` and row `y`, counted from 0 at the upper left. With the `volume` that is seen
        there, also the voxel that was hit; None at coarser levels of detail where no voxel of the label is at the surface."""
        height, width = self.color.shape[:2]
        column, row = arguments.whole("x", x, 0, width - 1), arguments.whole("y", y, 0, height - 1)
        told = json.loads(self._native.pick(column, row, None if volume is None else volume._native))
        position, voxel = (None if told[name] is None else tuple(told[name]) for name in ("position", "voxel"))
        return PickedPixel(told["instance"], told["label"], told["name"], told["type"], position, told["depth"], voxel)

    @checked
    def srgb(self, view_transform: str | None = None) -> npt.NDArray[np.uint8]:
        """The pixels as a PNG has them: (height, width, 3), or 4 with alpha, which is straight. `view_transform` is `standard`, `filmic`
        or `agx`, by default the one of the scene's film."""
        return np.asarray(self._native.display(view_transform))

    @checked
    def matte(self, *, ids: Iterable[int] | None = None, types: Iterable[str] | None = None) -> Floats:
        """The part of each pixel that the labels with these `ids`, or of these `types`, cover together, from 0 to 1: (height, width).

        Give one of the two. Needs the pass `cryptomatte_label` or `cryptomatte_type`. Ids that the picture does not show cover nothing.
        """
        if (ids is None) == (types is None):
            raise InputError("matte: expected either ids or types")
        if ids is not None:
            return np.asarray(self._native.matte("cryptomatte_label", [str(i) for i in arguments.ids("ids", ids)]))
        names = [types] if isinstance(types, str) else list(types or ())
        if odd := [name for name in names if not isinstance(name, str)]:
            raise InputError(f"types: expected names of types, got {odd[0]!r}")
        return np.asarray(self._native.matte("cryptomatte_type", names))

    @checked
    def save(self, path: Path, *, passes: str | Sequence[str] = "all", no_paths: bool = False) -> None:
        """Writes an `.exr` (scene-linear, with these passes; `film.half` of the scene makes colours half floats) or a `.png` (as
        `film.view_transform` shows it); the file appears complete or not at all. Both carry what is needed to render them again.

        Passes: `all`, `none`, `light` for all passes of light, `cryptomatte` for both of its kinds, or names as in `passes`; passes that
        the picture lacks are left out.

        The file holds the paths of volumes, meshes and sky relative to its own folder, or with `no_paths` none. A `PumiceWarning` says if
        there is no file for one of them, such as an array that was never saved: the picture cannot be rendered again then.
        """
        to = arguments.path("path", path)
        self._native.save(to, [passes] if isinstance(passes, str) else list(passes), bool(no_paths))
        warn_of_missing(to, os.getcwd(), self._native.paths())


@checked
def open_picture(path: Path) -> Picture:
    """Opens a picture from an `.exr`, of Pumice or of another program, with the passes that it has. What a file does not hold is NaN
    (`seconds`) or empty (`curve`, `device`)."""
    return Picture(_native.read_picture(arguments.path("path", path)))


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def _maybe(array: _native.Array | None) -> Any:
    return None if array is None else np.asarray(array)


@checked
def render(
    scene: Scene,
    volumes: Volumes | None = None,
    *,
    meshes: Sequence[Mesh] = (),
    spp: int | None = None,
    seconds: float | None = None,
    error: float | None = None,
    backend: str = "auto",
    width_mm: float | None = None,
    dpi: float | None = None,
    scale_bar: str | None = None,
    scale_bar_corner: str = "lower_right",
    legend: int | None = None,
    denoise: bool | str = False,
    memory_limit: int | None = None,
    job: Job | None = None,
    on_progress: Callable[[CurvePoint], None] | None = None,
) -> Picture:
    """Renders `scene` until the first limit is reached, or until all pixels rest, if the scene has `settings.adaptive`; InputError without either.

    `spp`: samples per pixel, from 1. `seconds`: wall seconds. `error`: estimated relative error, such as 0.03.
    `volumes`: one for each instance in the scene's order, or by the instance's source; without them the sources are opened.
    `meshes`: one for each of the scene's meshes, in their order.
    `backend`: `auto`, `cpu`, or one of Vulkan's, alone or with its device: `vulkan-rt`, `vulkan-query:1`, `vulkan-compute:radeon`
    (see `devices`). If a device fails, `auto` continues with the next backend and issues a `PumiceWarning`.
    `width_mm`: width on paper, which sets the pixels across at `dpi` (default 300); the height follows from the shape of the scene's film.
    `dpi`: pixels per inch that files of the picture state. `scale_bar`: a bar, such as `10um` or `auto`, in a perspective view with its plane:
    `10um@center`, `auto@focus`, `10um@12.5`. `scale_bar_corner`: `lower_right`, `lower_left`, `upper_right` or `upper_left`. `legend`: names and colours of at most so many shown labels, most
    voxels first, in the upper left corner, beside which `figure(…, legend=…)` frames what it shows. Both are in `save` and `srgb` and not in
    `color` and the passes. `denoise`: True or `statistical` averages pixels of one label that a statistical test cannot tell apart; `oidn` is Intel's
    Open Image Denoise, from the library that the environment variable `PUMICE_OIDN` names or the system finds, `oidn:LIBRARY` from that path. The picture
    is then smoother, and biased; `noisy` is the mean of its samples. `memory_limit`: bytes that the volumes may hold while they are drawn, from temporary files then, without `volumes`;
    on a graphics processor, the pages there. The picture is the same. `on_progress` is called with each new point of the curve, a `CurvePoint`; what it raises ends the render.
    """
    require_end(scene, spp, seconds, error)
    annotate = arguments.annotate_as(width_mm, dpi, scale_bar, scale_bar_corner, legend)
    how = arguments.render_as(backend, spp, seconds, error)
    memory_limit = limit_without(volumes, memory_limit)
    native = _native.render(
        scene._native,
        None if volumes is None else in_order(scene, volumes),
        mesh.natives(meshes),
        how,
        annotate,
        denoise=arguments.denoiser(denoise),
        memory_limit=memory_limit,
        job=job,
        on_progress=told_points(on_progress),
    )
    return finished(native)


def require_end(scene: Scene, spp: int | None, seconds: float | None, error: float | None) -> None:
    """Raises InputError for a render without a limit."""
    if spp is None and seconds is None and error is None and not scene._native.rests():
        raise InputError("render: give spp, seconds or error, or settings.adaptive in the scene, or it would never end")


def limit_without(volumes: Volumes | None, memory_limit: int | None) -> int | None:
    """A limit in bytes for the sources of a scene, which goes without volumes."""
    if memory_limit is None:
        return None
    if volumes is not None:
        raise InputError("memory_limit: these volumes are open; leave them out, and the scene's sources are drawn from disk, or open them with memory=")
    return limit_of("memory_limit", memory_limit)


def told_points(on_progress: Callable[[CurvePoint], None] | None) -> Callable[..., None] | None:
    """A function that calls `on_progress` with a point, as the compiled part calls it with numbers."""
    if on_progress is None:
        return None
    call = on_progress
    return lambda *point: call(CurvePoint(*point))


def finished(native: _native.Picture) -> Picture:
    """The picture of a render, with a warning for each device that failed; called by the function that the user called."""
    picture = Picture(native)
    for line in picture.notices:
        warnings.warn(line, PumiceWarning, stacklevel=4)
    return picture


@checked
def cryptomatte_hash(name: str) -> int:
    """The hash of a `name` in Cryptomatte, a 32-bit number: of a label's id as a text, or of a type."""
    return int(_native.cryptomatte_hash(name))


def in_order(scene: Scene, volumes: Volumes) -> list[_native.Volume]:
    """The volume of each instance of the scene."""
    if isinstance(volumes, Volume):
        volumes = [volumes]
    if isinstance(volumes, Mapping):
        chosen = []
        for i, path in enumerate(scene._native.sources()):
            source = arguments.path("path", path)
            if source not in volumes:
                raise InputError(f"instances[{i}].source: no volume was given for {source}")
            chosen.append(volumes[source])
        volumes = chosen
    return [volume._native for volume in volumes]


def devices() -> list[dict[str, Any]]:
    """The devices that can render here, which one `auto` takes, and why: a dict for each Vulkan device and backend, and one for the CPU.

    Keys: `backend`, `device`, `kind`, `usable`, `chosen`, `reason`; for Vulkan also `number` (as in `vulkan-rt:0`) and `driver`.
    """
    return list(json.loads(_native.devices()))
