"""Other programs: files that they read, and whether they draw what Pumice draws."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _native, arguments
from ._native import Job
from .arguments import Path
from .checked import checked
from .errors import InputError
from .scene import MOST_PIXELS

# As of the command: 80 million faces of a `.usdc`.
DEFAULT_LIMIT_BYTES = 4 << 30


class ExportAs(NamedTuple):
    """How to export, with its numbers checked, as the compiled part takes it."""

    forms: list[str]
    plain: bool
    for_blender: bool
    labels: list[int] | None
    region: tuple[int, int, int, int, int, int] | None
    limit_bytes: int


class VerifyAs(NamedTuple):
    """How to compare with Cycles, with its numbers checked, as the compiled part takes it."""

    blender: str
    page: str | None
    control: str | None
    spp: int
    seconds: float | None
    size: tuple[int, int] | None
    lod: int | None
    backend: str
    maps: bool


@checked
def export(
    path: Path,
    out: Path,
    *,
    form: str | Sequence[str] = "voxels",
    plain: bool = False,
    for_blender: bool = False,
    labels: Iterable[int] | None = None,
    region: Iterable[int] | None = None,
    limit_bytes: int = DEFAULT_LIMIT_BYTES,
    job: Job | None = None,
) -> dict[str, Any]:
    """Writes a scene file, a `.pumice` file or a label volume for other programs; the ending of `out` chooses the format.

    `form`: `voxels` (the exact surface), `smooth` (a smoothed one, which is not exact), `cells4`, `boxes`, `instances`, or several. `plain`
    writes a square for each face, instead of merging them. `for_blender` writes a stage that Blender's importer reads right, and other
    programs wrong. `labels` are the ids to write instead of those that a scene shows. `region`: x0, y0, z0, x1, y1, z1, the voxels of each
    volume from the first corner up to, and without, the second; surfaces are closed at its border, cells and boxes that it overlaps are
    written whole. A file that would be larger than `limit_bytes` is refused before it is written. Returns the report of
    `pumice export --json`: `forms`, `faces`, `boxes`, `bytes`, `left_out`, `seconds`.
    """
    forms = [form] if isinstance(form, str) else list(form)
    ids = None if labels is None else arguments.ids("labels", labels)
    limit = arguments.whole("limit_bytes", limit_bytes, 1, arguments.MOST_64)
    export_as = ExportAs(forms, plain, for_blender, ids, None if region is None else arguments.region(region), limit)
    text = _native.export(arguments.path("path", path), arguments.path("out", out), export_as, job)
    report: dict[str, Any] = json.loads(text)
    return report


@checked
def verify_render(
    path: Path,
    *,
    blender: Path,
    page: Path | None = None,
    control: Path | None = None,
    spp: int = 1024,
    seconds: float | None = None,
    size: tuple[int, int] | None = None,
    lod: int | None = None,
    backend: str = "auto",
    maps: bool = False,
    job: Job | None = None,
) -> dict[str, Any]:
    """Compares our picture of a scene file (or volume) with that of Cycles, until a verdict is reached.

    `blender`: a Python that has Blender as the module `bpy`, or the program Blender. `page`: an `.html` file with verdict, pictures and
    maps. `control`: another scene for Cycles, to see that a difference is noticed. `spp`: samples per pixel of each picture, 256 or more; with
    fewer than 1024 the patterns of Cycles' own sampling tables show.
    `seconds`: no picture is begun after this time. `size`: width and height; by default at most 40,000 pixels. `lod`: 1, 4 or 16, the
    level of detail that both draw; by default the finest that memory allows. `backend`: what draws Pumice's picture, as `render` takes it.

    Returns the report of `pumice verify-render --json`, of which `sentence` is the verdict in words and `agreement["verdict"]` is `agrees`,
    `differs` or `cannot_tell`.

    With `maps` the report also has `maps`, the images of the page by name: float32 (height, width, 3), scene-linear, row 0 at the top.
    `pumice` and `cycles` are the mean pictures, `difference` is the first less the second, with its sign. `difference_color`,
    `tile_difference_color`, `tile_t_color` and `flip_color` are the page's maps, as colours.
    """
    verify_as = VerifyAs(
        blender=arguments.path("blender", blender),
        page=None if page is None else arguments.path("page", page),
        control=None if control is None else arguments.path("control", control),
        spp=arguments.whole("spp", spp, 1, arguments.MOST_32),
        seconds=None if seconds is None else arguments.positive("seconds", seconds),
        size=None if size is None else (arguments.whole("size", size[0], 1, MOST_PIXELS), arguments.whole("size", size[1], 1, MOST_PIXELS)),
        lod=None if lod is None else arguments.whole("lod", lod, 1, 16),
        backend=backend,
        maps=maps,
    )
    text, images = _native.verify_render(arguments.path("path", path), verify_as, job)
    report: dict[str, Any] = json.loads(text)
    if maps:
        report["maps"] = {name: np.asarray(image) for name, image in images}
    return report


@checked
def agreement(ours: npt.ArrayLike, theirs: npt.ArrayLike, *, covered: npt.ArrayLike | None = None) -> dict[str, Any]:
    """Whether two renderers converge to the same picture: the test of `verify_render`, for pictures of any two programs.

    `ours` and `theirs` are pictures (n, height, width, 3), scene-linear, each with a seed of its own; eight or more of each are needed to
    tell anything. `covered` (height, width) marks pixels that show a surface, all by default: the picture's mean is taken over them.
    Returns `verdict` (`agrees`, `differs` or `cannot_tell`), `sentence`, and the statistics of `agreement` in the report of
    `verify_render`. `equality` has those of the stricter test for exactly equal pictures, and `agrees`, whether they pass it
    (`ReferencePicture.judge` explains them). One call is wrong in at most 1 of 100 cases; calling it again and again with more pictures,
    until it answers, is wrong more often.
    """
    sets = [np.ascontiguousarray(pictures, dtype=np.float32) for pictures in (ours, theirs)]
    if any(pictures.ndim != 4 or pictures.shape[3] != 3 for pictures in sets) or sets[0].shape[1:] != sets[1].shape[1:]:
        shapes = " and ".join(str(pictures.shape) for pictures in sets)
        raise InputError(f"agreement: expected two arrays of shape (n, height, width, 3), got {shapes}")
    size = sets[0].shape[1:3]
    shown = np.ones(size, dtype=np.uint8) if covered is None else np.ascontiguousarray(np.asarray(covered) != 0, dtype=np.uint8)
    if shown.shape != size:
        raise InputError(f"agreement: covered: expected the shape {size}, got {shown.shape}")
    report: dict[str, Any] = json.loads(_native.agreement(sets[0], sets[1], shown))
    return report
