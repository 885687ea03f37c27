"""Scenes: volumes, meshes, camera, lights and settings. The fields are those of the scene file (docs/scene.md)."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from typing import Any, Self

from . import _native, arguments
from .arguments import Path
from .checked import checked
from .errors import InputError
from .labels import LabelFlags, LabelGroups, flags
from .mesh import Mesh
from .sources import warn_of_missing
from .volume import Volume


# Most pixels along a side, the same limit as in scenes.
MOST_PIXELS = 65536


class Scene:
    """A validated, immutable scene. To change it, edit the result of `to_dict` and build a new scene from it."""

    @checked
    def __init__(self, text: str | _native.Scene) -> None:
        self._native = _native.Scene.parse(text) if isinstance(text, str) else text

    @classmethod
    @checked
    def from_dict(cls, fields: dict[str, Any]) -> Self:
        """Builds a scene from its fields; InputError names the field at fault."""
        try:
            return cls(json.dumps(fields, allow_nan=False))
        except (TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"scene: {error}") from error

    @classmethod
    @checked
    def from_json(cls, text: str) -> Self:
        """Builds a scene from its JSON form."""
        return cls(text)

    @classmethod
    @checked
    def load(cls, path: Path) -> Self:
        """Reads a scene file; relative paths in it become absolute."""
        return cls(_native.Scene.load(arguments.path("path", path)))

    @checked
    def save(self, path: Path, *, meshes: Sequence[Mesh] = ()) -> None:
        """Writes a scene file, which appears complete or not at all. A `PumiceWarning` says if files that it names are not there, such as
        that of an array that was never saved: the file cannot be drawn then.

        `meshes`: one for each of the scene's meshes, as for `render`; they are written beside the file as `NAME.mesh-ID.ply`, and the file
        names these instead of what the scene names."""
        to = arguments.path("path", path)
        folder, name = os.path.split(os.path.abspath(to))
        saved = self._native
        if meshes:
            fields = self.to_dict()
            if len(meshes) != len(fields["meshes"]):
                raise InputError(f"meshes: expected one for each of the scene's {len(fields['meshes'])} meshes, got {len(meshes)}")
            for place, mesh in zip(fields["meshes"], meshes, strict=True):
                place["source"] = os.path.join(folder, f"{os.path.splitext(name)[0]}.mesh-{place['id']}.ply")
                mesh.save(place["source"])
            saved = _native.Scene.parse(json.dumps(fields, allow_nan=False))
        saved.save(to)
        warn_of_missing(to, folder, saved.paths())

    def to_dict(self) -> dict[str, Any]:
        """A copy of the fields, with every default written out."""
        fields: dict[str, Any] = json.loads(self.to_json())
        return fields

    def to_json(self) -> str:
        """The JSON form; reading it back gives every number exactly."""
        return self._native.to_json()

    @checked
    def with_labels(
        self, instance: int, *, visible: LabelFlags | None = None, groups: LabelGroups | None = None
    ) -> Self:
        """The scene with other labels drawn of the instance with this id, and other groups of its labels."""
        return type(self)(self._native.with_labels(instance, flags(visible), None if groups is None else groups._native))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self._native == other._native

    def __hash__(self) -> int:
        return hash(self.to_json())

    def __repr__(self) -> str:
        width, height = self._native.size()
        return f"<pumice.Scene {width}×{height}, {len(self._native.sources())} instances>"


@checked
def figure(
    volume: Volume,
    *,
    source: Path | None = None,
    size: tuple[int, int] = (960, 540),
    labels: Iterable[int] | None = None,
    pick: int | None = None,
    view_deg: tuple[float, float] = (24.0, 24.0),
) -> Scene:
    """Composes a scene that shows a volume: places, frames and lights it, and gives labels colours that differ between neighbours.

    `labels` are the ids to show, or `pick` is the number of long labels to choose; without either all are shown. `view_deg` is the
    direction of the camera: around the vertical axis and above the horizon. `source` is the volume's file in the scene; without it the file
    that the volume was opened from or last saved to, with the keywords of `open`, or `memory` if there is none.
    """
    ids = None if labels is None else arguments.ids("labels", labels)
    if len(size) != 2 or len(view_deg) != 2:
        raise InputError(f"size, view_deg: expected two numbers each, got {size!r}, {view_deg!r}")
    pixels = [arguments.whole("size", n, 1, MOST_PIXELS) for n in size]
    if pick is not None:
        pick = arguments.whole("pick", pick, 1, arguments.MOST_32)
    known = volume._source if source is None else (arguments.path("source", source), None)
    file, read_as = known or ("memory", None)
    native = _native.figure(volume._native, file, (pixels[0], pixels[1]), ids, pick, view_deg)
    return Scene(native if read_as is None else native.with_reading(read_as))
