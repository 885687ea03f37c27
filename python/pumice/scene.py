"""Scenes: volumes, meshes, camera, lights and settings. The fields are those of the scene file (docs/scene.md)."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, Self

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
# Most scenes of a turntable: each is an object.
MOST_TURNS = 100_000


class Scene:
    """A validated, immutable scene, from its JSON form `text`. To change it, edit the result of `to_dict` and build a new scene from it."""

    @checked
    def __init__(self, text: str | _native.Scene) -> None:
        if not isinstance(text, str | _native.Scene):
            raise InputError(f"text: expected the JSON form of a scene, got {type(text).__name__}")
        self._native = _native.Scene.parse(text) if isinstance(text, str) else text

    @classmethod
    @checked
    def from_dict(cls, fields: dict[str, Any]) -> Self:
        """Builds a scene from its `fields` (docs/scene.md); InputError names the field at fault. Numbers and arrays may be numpy's."""
        return cls(arguments.json_text("scene", fields))

    @classmethod
    @checked
    def from_json(cls, text: str) -> Self:
        """Builds a scene from its JSON form `text`; InputError names the field at fault, or line and column."""
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
        """The scene with other labels drawn of the `instance` with this id, and other groups of its labels.

        `visible`: the ids of all labels of the volume, as `volume.labels.ids` has them, and for each whether it is drawn; a label that is not
        among them may become either. `groups`: `LabelGroups`. Without them all stays as it is."""
        return type(self)(self._native.with_labels(instance, flags(visible), None if groups is None else groups._native))

    def turntable(self, count: int) -> list[Self]:
        """The scene from around the vertical axis: `count` scenes, the first is this one, each a `count`th of a turn further, counter-clockwise
        seen from above. Only the camera moves. A `Renderer` draws them with what they have in common built once."""
        return [type(self)(scene) for scene in _native.turntable(self._native, arguments.whole("count", count, 1, MOST_TURNS))]

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
    labels: str | Iterable[int | str] | None = None,
    query: str | None = None,
    pick: int | None = None,
    color: Mapping[int | str, str] | None = None,
    material: str | Mapping[int | str, str] | None = None,
    background: str | None = None,
    floor: bool = False,
    cut: str | Iterable[str] = (),
    smooth: bool = False,
    focus: int | float | str | None = None,
    aperture: float | str | None = None,
    view: tuple[float, float] | None = None,
    distance: float | None = None,
    frame: Literal["labels", "volume"] = "labels",
    turntable: int | None = None,
    legend: int | None = None,
    dpi: float | None = None,
    view_deg: tuple[float, float] | None = None,
) -> Scene:
    """Composes a scene that shows a volume: places, frames and lights it, and gives labels colours that differ between neighbours.

    The keywords are the flags of `pumice render` and mean the same (docs/artists.md). Labels are named by *selectors*: an id, or a query line
    such as `"type:axon voxels>1000"`; one that matches no label is an InputError.

    `size`: pixels across and down.
    `labels`, `query`: what is shown; without them all labels. `pick`: the number of long labels to choose, of those that `query` matches.
    `color`: `{17: "#e0a030", "type:axon": "orange"}`, colours of CSS, as on a screen. `material`: `plastic`, `metal`, `ghost` or `glass` for all, or a
    dict of them by selector; the selector `*` is all. Later entries count. A selector that matches only labels that are not shown is an
    InputError.
    `background`: `white`, `black`, `transparent` or a colour, exactly that in a PNG. `floor`: a floor that shows only shadows.
    `cut`: `"x=0.5"` removes what lies beyond half of the extent along x, `"-x=0.5"` the other half. `smooth`: voxels without flat faces.
    `focus`: a selector, or a distance as a float; `aperture`: `"f/2.8"`, or a radius in world units, of which a figure's diagonal has 10.
    `view`: the direction of the camera in degrees, around the vertical axis and above the horizon (24, 24 by default); `view_deg` is its older name.
    `distance`: of the camera from the middle. `frame`: `volume` keeps camera and scale whatever labels are shown.
    `turntable`: frames what is shown for that many pictures of `Scene.turntable`. `legend`, `dpi`: leave room for the legend that `render` draws
    with the same two keywords over a picture of this `size`; without effect with `distance` or `frame="volume"`. `source` is the volume's file in the scene; without it the
    file that the volume was opened from or last saved to, with the keywords of `open`, or `memory` if there is none.
    """
    pixels = [arguments.whole("size", n, 1, MOST_PIXELS) for n in _two("size", size)]
    if labels is not None and (pick is not None or query is not None):
        raise InputError("labels: give labels, or pick and query, not both")
    if view is not None and view_deg is not None:
        raise InputError("view_deg: it is the older name of view; give one of them")
    ids, flags = _labels(labels)
    for name, value in (("query", query), ("background", background)):
        flags += [(name, _text(name, value))] if value is not None else []
    if pick is not None:
        flags.append(("pick", str(arguments.whole("pick", pick, 1, arguments.MOST_32))))
    if turntable is not None:
        flags.append(("turntable", str(arguments.whole("turntable", turntable, 1, arguments.MOST_32))))
    flags += [("color", f"{_selector('color', key)}={_text('color', value)}") for key, value in _items("color", color)]
    if isinstance(material, str):
        flags.append(("material", material))
    else:
        flags += [("material", f"{_selector('material', key)}={_text('material', value)}") for key, value in _items("material", material)]
    flags += [("cut", _text("cut", value)) for value in _listed("cut", cut)]
    flags += [(name, "") for name, given in (("floor", floor), ("smooth", smooth)) if given]
    if focus is not None:
        flags.append(("focus", repr(float(focus)) if isinstance(focus, float) else _selector("focus", focus)))
    if aperture is not None:
        flags.append(("aperture", aperture if isinstance(aperture, str) else _number("aperture", aperture)))
    seen_from = view if view is not None else view_deg
    if seen_from is not None:
        flags.append(("view", ",".join(_number("view", angle) for angle in _two("view", seen_from))))
    if distance is not None:
        flags.append(("distance", _number("distance", distance)))
    flags.append(("frame", _text("frame", frame)))
    if legend is not None:
        flags.append(("legend", str(arguments.whole("legend", legend, 1, arguments.MOST_32))))
    if dpi is not None:
        flags.append(("dpi", repr(arguments.positive("dpi", dpi))))
    known = volume._source if source is None else (arguments.path("source", source), None)
    file, read_as = known or ("memory", None)
    native = _native.figure(volume._native, file, (pixels[0], pixels[1]), ids, flags)
    return Scene(native if read_as is None else native.with_reading(read_as))


def _labels(labels: str | Iterable[int | str] | None) -> tuple[list[int] | None, list[tuple[str, str]]]:
    """Labels by id where nothing else is named, or else as flags."""
    if labels is None:
        return None, []
    listed = _listed("labels", labels)
    if not any(isinstance(label, str) for label in listed):
        return arguments.ids("labels", listed), []
    return None, [("labels", _selector("labels", label)) for label in listed]


def _listed(name: str, values: Any) -> list[Any]:
    """The values of a list; a text is one value."""
    try:
        return [values] if isinstance(values, str) else list(values)
    except TypeError:
        raise InputError(f"{name}: expected a list, got {values!r}") from None


def _items(name: str, by_selector: Any) -> list[tuple[Any, Any]]:
    """The items of a dict by selector."""
    if by_selector is None:
        return []
    if not isinstance(by_selector, Mapping):
        raise InputError(f"{name}: expected a dict by selector, got {by_selector!r}")
    return list(by_selector.items())


def _two(name: str, values: Any) -> list[Any]:
    """Two values."""
    listed = _listed(name, values)
    if len(listed) != 2:
        raise InputError(f"{name}: expected two numbers, got {values!r}")
    return listed


def _selector(name: str, key: Any) -> str:
    """A selector as the command reads it: an id or a query line."""
    return key if isinstance(key, str) else str(arguments.whole(name, key, 0, arguments.MOST_64))


def _text(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise InputError(f"{name}: expected a text, got {value!r}")
    return value


def _number(name: str, value: Any) -> str:
    """A number as the command reads it, exactly."""
    try:
        return repr(float(value))
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected a number, got {value!r}") from None
