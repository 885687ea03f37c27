"""
The module.
"""

from _typeshed import Incomplete, SupportsGetItem, SupportsLenAndGetItem
from os import PathLike
from typing import Any, SupportsFloat, SupportsIndex, final

@final
class Array:
    """
    Numbers in C order that cannot be changed: `numpy.asarray` shows them without a copy.
    """

@final
class Frame:
    """
    A picture at one moment. As a buffer: (height, width, 4) floats, scene-linear RGBA, row 0 at the bottom.
    """
    @property
    def coarse(self, /) -> bool:
        """
        Whether it has fewer pixels than the film: what comes first after an edit.
        """
    @property
    def converged(self, /) -> bool:
        """
        Whether it is the last of its revision.
        """
    @property
    def cpu_seconds(self, /) -> float:
        """
        CPU seconds of the process in that time, all threads.
        """
    @property
    def error_estimate(self, /) -> float:
        """
        Estimated relative error, infinite until it can be known.
        """
    @property
    def filtered(self, /) -> bool:
        """
        Whether its noise was filtered away: it is no mean of samples.
        """
    @property
    def height(self, /) -> int:
        """
        Pixels down.
        """
    @property
    def revision(self, /) -> int:
        """
        Revision of the scene that it shows.
        """
    @property
    def seconds(self, /) -> float:
        """
        Wall seconds since the worker began this revision.
        """
    @property
    def serial(self, /) -> int:
        """
        Rises by one from frame to frame; the first is 1.
        """
    @property
    def spp(self, /) -> int:
        """
        Samples in every pixel.
        """
    @property
    def width(self, /) -> int:
        """
        Pixels across.
        """

@final
class Job:
    """
    Progress and cancel of one long call, for other threads than the one that made it.
    """
    def __new__(cls, /) -> Job: ...
    def cancel(self, /) -> None:
        """
        Asks the call to end soon; it then raises `Cancelled`.
        """
    @property
    def cancelled(self, /) -> bool:
        """
        Whether it was asked to.
        """
    @property
    def fraction(self, /) -> float | None:
        """
        Done share of the stage under way, 0 to 1; `None` while it is not known.
        """

@final
class Mesh:
    """
    A triangle mesh, checked; it never changes.
    """
    def __new__(cls, /, positions: Any, triangles: Any, materials: Any, normals: Any | None, of_triangles: bool) -> Mesh:
        """
        Corners (n, 3) as 64 bit floats, triangles (m, 3) and materials (m,) as 32 bit numbers without a sign; no materials: all 0.
        Normals as 32 bit floats, of corners (n, 3) or `of_triangles` (m, 3, 3); none: all is flat.
        """
    def content_hash(self, /) -> str:
        """
        Hash of all its numbers, 32 hexadecimal digits.
        """
    def counts(self, /) -> tuple[int, int, int]:
        """
        (corners, triangles, bytes in memory).
        """
    def is_smooth(self, /) -> bool:
        """
        Whether some triangle is shaded smooth.
        """

@final
class Picture:
    """
    A finished picture. Row 0 is the top.
    """
    def albedo(self, /) -> Array | None:
        """
        Base colour of the first surface.
        """
    def alpha(self, /) -> Array | None:
        """
        Part of the samples that met a surface, of a transparent film: (height, width).
        """
    def color(self, /) -> Array:
        """
        Scene-linear Rec. 709 radiance: (height, width, 3).
        """
    def depth(self, /) -> Array | None:
        """
        Distance along the view axis to the first surface, infinite where there is none: (height, width).
        """
    def figures(self, /) -> str:
        """
        Seconds, samples, error, curve, what was needed and left out, as JSON text.
        """
    def label(self, /) -> Array | None:
        """
        Place of its label in the label table + 1, 0 where there is none: (height, width).
        """
    def light(self, /) -> list[tuple[str, Array]]:
        """
        Passes of light, by name.
        """
    def mattes(self, /) -> list[tuple[str, Array, dict[str, int]]]:
        """
        Cryptomatte, by name: (height, width, ranks, 2) of ids and coverages, and what hash each name in the picture has.
        """
    def normal(self, /) -> Array | None:
        """
        Normal of the first surface.
        """
    def position(self, /) -> Array | None:
        """
        Where the first surface is in the world.
        """
    def samples(self, /) -> Array | None:
        """
        Samples of each pixel: (height, width).
        """
    def save(self, /, path: str | PathLike[str], passes: SupportsGetItem[int, str]) -> None:
        """
        Writes an EXR or a PNG, whole or not at all.
        """
    def variance(self, /) -> Array | None:
        """
        Variance of the colour, each channel; `None` below one sample for each independent part.
        """

@final
class Session:
    """
    A live, progressively refined picture.
    """
    def __new__(cls, /, scene: str, volumes: SupportsGetItem[int, Volume], meshes: SupportsGetItem[int, Mesh], *, backend: str, spp: SupportsIndex | None, seconds: SupportsFloat | SupportsIndex | None, error: SupportsFloat | SupportsIndex | None, denoise: bool) -> Session: ...
    def _panic_on_purpose(self, /) -> None:
        """
        Makes the worker panic, for tests of those who must survive it.
        """
    def add(self, /, instance: str, volume: Volume) -> int:
        """
        Adds an instance in JSON with its volume, or replaces the one with the same id; the new revision.
        """
    def add_mesh(self, /, mesh: str, data: Mesh) -> int:
        """
        Adds a mesh in JSON with its triangles, or replaces the one with the same id; the new revision.
        """
    def edit(self, /, edits: str) -> int:
        """
        Applies a list of edits in JSON, all or none; the new revision.
        """
    def latest(self, /, after: SupportsIndex) -> Frame | None:
        """
        The newest frame, where its serial is above `after`; never waits.
        """
    def pick(self, /, x: SupportsIndex, y: SupportsIndex) -> tuple[int, int, str, list[int], float] | None:
        """
        (instance id, label id, name, voxel, depth) under the middle of a pixel, counted from the upper left.
        """
    def scene(self, /) -> str:
        """
        The scene as it is now, in JSON.
        """
    def status(self, /) -> tuple[str, str | None, int, str, str, list[str], dict[str, int]]:
        """
        (state, error, revision, backend, device, notices, counters).
        """
    def stop(self, /) -> None:
        """
        Ends the worker and waits for it, at most a slice.
        """

@final
class Volume:
    """
    A volume in its compressed form; it never changes.
    """
    def auto_colors(self, /, visible: SupportsGetItem[int, bool] | None) -> Array:
        """
        Linear Rec. 709 colours that `auto_color` gives to the labels, those that are `visible` unlike their neighbours.
        """
    def bounds(self, /) -> tuple[Array, Array, Array]:
        """
        Lowest and highest voxel of each label, and its number of boxes.
        """
    def box_arrays(self, /) -> tuple[Array, Array, Array]:
        """
        Origins and extents in voxels, and labels, of all boxes.
        """
    def contacts(self, /) -> Array:
        """
        Pairs of labels that touch, by their places in the table.
        """
    def content_hash(self, /) -> str:
        """
        Hash of labels and voxels: a walk over all boxes.
        """
    def decode_block(self, /, origin: SupportsLenAndGetItem[SupportsIndex], dims: SupportsLenAndGetItem[SupportsIndex], job: Job | None = None) -> Array:
        """
        Original ids of a block, x fastest: shape (z, y, x).
        """
    def difference(self, /, source: str | PathLike[str] | Incomplete, *, layer: SupportsIndex | None = None, time: SupportsIndex | None = None, channel: SupportsIndex | None = None, array: str | None = None, job: Job | None = None) -> str | None:
        """
        Compares with a file, or with blocks; `None` where every voxel and id is the same, else what is not.
        """
    def faces(self, /, visible: SupportsGetItem[int, bool], *, all_interfaces: bool, shared_corners: bool, job: Job | None = None) -> tuple[Array, Array, Array]:
        """
        Voxel faces of the labels that are `visible`, by row of the table: vertices, quads, label of each quad.
        """
    def facts(self, /) -> str:
        """
        What there is to say about the whole at once, as JSON text.
        """
    def ids(self, /) -> Array:
        """
        Original ids, rising.
        """
    def label_at(self, /, x: SupportsIndex, y: SupportsIndex, z: SupportsIndex) -> int:
        """
        Original id of the label at a voxel; 0 is background. The first query builds the index.
        """
    def mapped_bytes(self, /) -> int:
        """
        Bytes in memory by part, as they are now: queries build an index.
        """
    def notes(self, /) -> tuple[list[str], Array]:
        """
        Names, empty where the file gives none, and sRGB colours, NaN where it gives none.
        """
    def resident_parts(self, /) -> dict[str, int]: ...
    def save(self, /, path: str | PathLike[str], level: str = "default", job: Job | None = None) -> None:
        """
        Writes a `.pumice` file, whole or not at all.
        """
    def types(self, /) -> Array:
        """
        Type of each label: its place in `type_names`, or −1.
        """
    def voxels(self, /) -> Array:
        """
        Voxels of each label.
        """

def _end_calls() -> None:
    """
    Cancels every call under way, and waits for them to return. From then on none begins.
    """

def _panic_on_purpose() -> None:
    """
    Panics, to prove that a panic is an exception.
    """

def compress(source: str | PathLike[str] | Incomplete, *, types: str | None = None, memory_limit: SupportsIndex | None = None, threads: SupportsIndex = 0, layer: SupportsIndex | None = None, time: SupportsIndex | None = None, channel: SupportsIndex | None = None, array: str | None = None, spacing: SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None = None, job: Job | None = None) -> tuple[Volume, list[str]]:
    """
    Compresses a file, or blocks; with what the reader found odd.
    """

def cryptomatte_hash(name: str) -> int:
    """
    The hash by which Cryptomatte knows a name: MurmurHash3_x86_32 of its UTF-8.
    """

def devices() -> str:
    """
    What can render here, as JSON text.
    """

def figure(volume: Volume, source: str | PathLike[str], size: SupportsLenAndGetItem[SupportsIndex], labels: SupportsGetItem[int, SupportsIndex] | None, pick: SupportsIndex | None, view_deg: SupportsLenAndGetItem[SupportsFloat | SupportsIndex]) -> str:
    """
    A scene that shows a volume: placed, framed, lit.
    """

def open(path: str | PathLike[str], *, labels: SupportsGetItem[int, SupportsIndex] | None = None, mapped: bool = False, layer: SupportsIndex | None = None, time: SupportsIndex | None = None, channel: SupportsIndex | None = None, array: str | None = None, spacing: SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None = None, job: Job | None = None) -> tuple[Volume, list[str]]:
    """
    Opens a `.pumice` file, or compresses a label volume of another format in memory; with what the reader found odd. Of a `.pumice`
    file these labels alone, where they are given.
    """

def probe(path: str | PathLike[str], *, layer: SupportsIndex | None = None, time: SupportsIndex | None = None, channel: SupportsIndex | None = None, array: str | None = None, spacing: SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None = None, job: Job | None = None) -> str:
    """
    What a file holds, from its header alone, as JSON text.
    """

def render(scene: str, volumes: SupportsGetItem[int, Volume] | None, meshes: SupportsGetItem[int, Mesh], *, spp: SupportsIndex | None, seconds: SupportsFloat | SupportsIndex | None, error: SupportsFloat | SupportsIndex | None, backend: str, job: Job | None, on_progress: Any | None) -> Picture:
    """
    Renders a scene until the first of its limits. `volumes[i]` belongs to its instance i; without them its sources are opened.
    `meshes[i]` belongs to its mesh i.
    """

def scene_checked(text: str) -> str:
    """
    The scene in full, with every default written out, after a check of every field.
    """

def scene_load(path: str | PathLike[str]) -> str:
    """
    Reads a scene file; its paths become absolute.
    """

def scene_save(text: str, path: str | PathLike[str]) -> None:
    """
    Writes a scene file, whole or not at all.
    """

def volume_info(dims: SupportsLenAndGetItem[SupportsIndex], label_type: str, world_from_index: SupportsLenAndGetItem[SupportsFloat | SupportsIndex], unit: str, names: SupportsGetItem[int, tuple[SupportsIndex, str]]) -> str:
    """
    The JSON form of a volume's description, made from its parts: `world_from_index` is twelve numbers, columns first.
    """

def __getattr__(name: str) -> Incomplete: ...
