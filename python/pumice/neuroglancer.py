"""States of Neuroglancer: what a link to it shows, as a scene."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from . import _native, arguments
from .arguments import Path
from .checked import checked
from .scene import MOST_PIXELS, Scene
from .volume import Volume, warn


@checked
def open_state(
    state: Path | Mapping[str, Any],
    *,
    layer_files: Mapping[str, Path] | None = None,
    size: tuple[int, int] = (960, 540),
    job: _native.Job | None = None,
) -> tuple[Scene, list[Volume]]:
    """Opens a state of Neuroglancer as a scene and its volumes: `pumice.render(scene, volumes)` draws it (docs/neuroglancer.md).

    `state`: a link with `#!`, the path of a file with a link or JSON, or the fields of the JSON as a dict. Relative URLs of its layers count from the
    file's folder.
    `layer_files`: paths of copies by the names of layers, for those that lie on a server.
    `size`: pixels across and down.

    A `PumiceWarning` says what is left out. A layer that lies on a server and has no copy, or of which no segment is in its volume, is an InputError.
    """
    text, path = _given(state)
    copies = [(str(name), arguments.path("layer_files", file)) for name, file in (layer_files or {}).items()]
    width, height = (arguments.whole("size", pixels, 1, MOST_PIXELS) for pixels in size)
    scene, natives, odd = _native.open_state(text, path, copies, (width, height), job)
    warn(odd)
    sources = scene.sources()
    return Scene(scene), [Volume(native, (source, arguments.ReadAs())) for native, source in zip(natives, sources, strict=True)]


@checked
def state_layers(state: Path | Mapping[str, Any]) -> dict[str, str]:
    """The layers of a state of Neuroglancer that `open_state` draws: the path or the URL of each one's volume, by name. No volume is opened.

    `state` is as for `open_state`. `layer_files` of `open_state` takes such a dict, with a `.pumice` file in place of each URL.
    """
    return dict(_native.state_layers(*_given(state)))


def _given(state: Path | Mapping[str, Any]) -> tuple[str | None, str]:
    """A state as the compiled part takes it: (JSON or a link, empty) or (None, the path of a file)."""
    if isinstance(state, Mapping):
        return arguments.json_text("state", dict(state)), ""
    if isinstance(state, str) and state.startswith(("https://", "http://")):
        return state, ""
    return None, os.path.abspath(arguments.path("state", state))
