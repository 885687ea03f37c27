"""
The compiled part of the package `pumice`.
"""

from _typeshed import Incomplete, SupportsGetItem, SupportsLenAndGetItem
from os import PathLike
from pathlib import Path
from typing import Any, SupportsFloat, SupportsIndex, final
from typing_extensions import Buffer

@final
class AnnotationTable:
    """
    Names, types, colours and numbers of labels by id.
    """
    def __new__(cls, /, ids: SupportsGetItem[int, SupportsIndex], names: SupportsGetItem[int, str], types: SupportsGetItem[int, str], colors: SupportsGetItem[int, SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None], columns: SupportsGetItem[int, tuple[str, SupportsGetItem[int, SupportsFloat | SupportsIndex]]]) -> AnnotationTable:
        """
        A table of these rows, which are sorted by id.
        """
    def colors(self, /) -> Array:
        """
        sRGB colours, NaN where a row has none.
        """
    def columns(self, /) -> list[tuple[str, Array]]:
        """
        Columns of numbers by name.
        """
    def ids(self, /) -> Array:
        """
        Ids, in rising order.
        """
    def names(self, /) -> list[str]:
        """
        Names, empty where a row has none.
        """
    def query(self, /, line: str) -> Array:
        """
        Whether a query line holds, for each row.
        """
    def save(self, /, path: str | PathLike[str], format: str | None) -> list[str]:
        """
        Writes a file in the format of this name, or in that of the file's name; returns what the format does not hold, a line each.
        """
    def types(self, /) -> list[str]:
        """
        Types, empty where a row has none.
        """

@final
class Array:
    """
    A read-only array of numbers in C order. `numpy.asarray` shows it without a copy.
    """

@final
class Frame:
    """
    The picture at one moment. As a buffer: (height, width, 4) floats, scene-linear RGBA, row 0 at the bottom.
    """
    @property
    def coarse(self, /) -> bool:
        """
        Whether only some of the film's pixels have a sample, as in the first frames after an edit: it has fewer pixels than the film, or is
        enlarged from one that has.
        """
    @property
    def converged(self, /) -> bool:
        """
        Whether it is the last frame of its revision.
        """
    @property
    def cpu_seconds(self, /) -> float:
        """
        CPU seconds of the process since then, all threads.
        """
    @property
    def error_estimate(self, /) -> float:
        """
        Estimated relative error; infinite until there is an estimate.
        """
    @property
    def filtered(self, /) -> bool:
        """
        Whether it was denoised: its pixels are then not means of samples.
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
        Number of the frame, counted from 1.
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
    Progress and cancellation of one long call, for use from other threads.
    """
    def __new__(cls, /) -> Job:
        """
        A job for one call.
        """
    def cancel(self, /) -> None:
        """
        Cancels the call, which soon raises `Cancelled`.
        """
    @property
    def cancelled(self, /) -> bool:
        """
        Whether `cancel` was called.
        """
    @property
    def fraction(self, /) -> float | None:
        """
        Completed share of the call, 0 to 1, or of its current stage where a call has stages whose times it cannot tell; `None` while it is not known.
        """

@final
class LabelGroups:
    """
    The groups of a volume's labels.
    """
    def __new__(cls, /, ids: Buffer, groups: Buffer, colors: Buffer, materials: str, colored: SupportsGetItem[int, bool]) -> LabelGroups:
        """
        Label `ids[i]`, in rising order, belongs to group `groups[i]` and has the linear colour `colors[4 i..4 i + 3]`. `materials` is a JSON
        list of a material for each group, and `colored` says whether colours of labels replace its base colour.
        """
    def with_colors(self, /, ids: Buffer, colors: Buffer) -> LabelGroups:
        """
        The same groups, in which label `ids[i]`, in rising order, has the linear colour `colors[4 i..4 i + 3]`.
        """

@final
class Mesh:
    """
    A validated, immutable triangle mesh.
    """
    def __new__(cls, /, positions: Any, triangles: Any, materials: Any, normals: Any | None, of_triangles: bool) -> Mesh:
        """
        Corners (n, 3) as 64-bit floats, triangles (m, 3) and materials (m,) as unsigned 32-bit integers; without materials all are 0.
        Normals as 32-bit floats, of corners (n, 3) or, with `of_triangles`, (m, 3, 3); without normals all is flat.
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
    @staticmethod
    def open(path: str | PathLike[str]) -> Mesh:
        """
        Reads a PLY file, as a scene's meshes are read.
        """
    def save(self, /, path: str | PathLike[str]) -> None:
        """
        Writes a PLY file, which appears complete or not at all.
        """

@final
class PageMemory:
    """
    At most so many bytes of volumes that are drawn from disk.
    """
    def __new__(cls, /, limit_bytes: SupportsIndex) -> PageMemory:
        """
        An empty memory with this limit.
        """
    def figures(self, /) -> str:
        """
        What is in memory and was, as JSON text.
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
        Share of the samples that hit a surface, for a transparent film: (height, width).
        """
    def color(self, /) -> Array:
        """
        Scene-linear Rec. 709 radiance: (height, width, 3).
        """
    def depth(self, /) -> Array | None:
        """
        Distance along the view axis to the first surface, infinite where there is none: (height, width).
        """
    def display(self, /, view: str | None) -> Array:
        """
        The bytes that a PNG has, shown by a view transform or that of the scene: (height, width, 3), or 4 with alpha.
        """
    def figures(self, /) -> str:
        """
        Seconds, samples, error, curve, what the scene needed and what was left out, as JSON text.
        """
    def instance(self, /) -> Array | None:
        """
        Id of the instance of that label, 0 where there is none, in a scene of several: (height, width).
        """
    def instance_ids(self, /) -> Array:
        """
        Id of the instance of each pixel's label, 0 where there is none: (height, width).
        """
    def label(self, /) -> Array | None:
        """
        Row of the label of the first surface in the label table + 1, 0 where there is none: (height, width).
        """
    def label_ids(self, /) -> Array:
        """
        Id of the label of each pixel, 0 where there is none: (height, width).
        """
    def light(self, /) -> list[tuple[str, Array]]:
        """
        Passes of light, by name.
        """
    def matte(self, /, kind: str, names: SupportsGetItem[int, str]) -> Array:
        """
        The part of each pixel that some names of a Cryptomatte pass cover together: (height, width).
        """
    def mattes(self, /) -> list[tuple[str, Array, dict[str, int]]]:
        """
        Cryptomatte passes, by name: (height, width, ranks, 2) of ids and coverages, and the hash of each name in the picture.
        """
    def noisy(self, /) -> Array | None:
        """
        The mean of the samples, where the colour is denoised.
        """
    def normal(self, /) -> Array | None:
        """
        Normal of the first surface.
        """
    def paths(self, /) -> list[tuple[str, Path]]:
        """
        The files that the picture names, each with its field in the scene.
        """
    def pick(self, /, x: SupportsIndex, y: SupportsIndex, volume: Volume | None) -> str:
        """
        What lies under a pixel, as JSON text; its voxel with the volume that is seen there.
        """
    def position(self, /) -> Array | None:
        """
        World position of the first surface.
        """
    def samples(self, /) -> Array | None:
        """
        Samples of each pixel: (height, width).
        """
    def save(self, /, path: str | PathLike[str], passes: SupportsGetItem[int, str], no_paths: bool) -> None:
        """
        Writes an EXR or a PNG, which appears complete or not at all; with `no_paths` it does not tell where its sources are.
        """
    def variance(self, /) -> Array | None:
        """
        Variance of the mean of the samples, per channel; `None` with less than one sample for each of four classes.
        """

@final
class ReferencePicture:
    """
    The mean picture of many seeds, with its noise. Arrays are of 64-bit floats.
    """
    def arrays(self, /) -> tuple[Array, Array, Array, Array, int]:
        """
        mean, variance, tile_variance and total_variance in the shapes of `stored`, and seeds.
        """
    def judge(self, /, pictures: Any) -> str:
        """
        Tests pictures (n, height, width, 3) of 32-bit floats against this. Returns whether they agree, and the statistics, as JSON text.
        """
    @staticmethod
    def of(pictures: Any) -> ReferencePicture:
        """
        The reference of pictures (n, height, width, 3) of 32-bit floats.
        """
    @staticmethod
    def stored(mean: Any, variance: Any, tile_variance: Any, total_variance: Any, seeds: SupportsIndex) -> ReferencePicture:
        """
        The reference of `seeds` pictures that these arrays of 64-bit floats store: mean and variance (height, width, 3), tile_variance
        (rows, columns, 3), total_variance (3).
        """

@final
class Renderer:
    """
    A renderer that is kept from one picture to the next.
    """
    def __new__(cls, /, backend: str) -> Renderer:
        """
        A renderer on the backend of this name.
        """
    def latest(self, /, after: SupportsIndex) -> Frame | None:
        """
        The newest frame of the picture that is rendered now, if its serial is above `after`; never waits.
        """
    def rebuilt(self, /) -> dict[str, int]:
        """
        How often each kind of data was built, by name; waits for a picture that is being rendered.
        """
    def render(self, /, scene: Scene, volumes: SupportsGetItem[int, Volume], meshes: SupportsGetItem[int, Mesh], limits: tuple[SupportsIndex | None, SupportsFloat | SupportsIndex | None, SupportsFloat | SupportsIndex | None], watching: tuple[bool, bool, bool], *, denoise: str | None, job: Job | None, on_progress: Any | None) -> Picture:
        """
        Renders a scene until the first limit is reached. `watching`: whether frames are published, whether pictures so far are
        made with all passes, and whether a cancelled render returns its picture so far.
        """
    def take_so_far(self, /) -> Picture | None:
        """
        The newest picture so far with all its passes, of what is rendered now, if it was not taken before; never waits.
        """

@final
class Scene:
    """
    A validated scene.
    """
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...
    @staticmethod
    def load(path: str | PathLike[str]) -> Scene:
        """
        Reads a scene file; its paths become absolute.
        """
    @staticmethod
    def parse(text: str) -> Scene:
        """
        Reads the JSON form and checks every field.
        """
    def paths(self, /) -> list[tuple[str, Path]]:
        """
        All files that the scene names, each with its field.
        """
    def rests(self, /) -> bool:
        """
        Whether the settings end a render by themselves, when all pixels rest.
        """
    def save(self, /, path: str | PathLike[str]) -> None:
        """
        Writes a scene file, which appears complete or not at all.
        """
    def size(self, /) -> tuple[int, int]:
        """
        Pixels across and down.
        """
    def sources(self, /) -> list[Path]:
        """
        The path of each instance's volume.
        """
    def to_json(self, /) -> str:
        """
        The JSON form, with every default written out.
        """
    def with_labels(self, /, id: SupportsIndex, visible: tuple[Buffer, Buffer] | None, groups: LabelGroups | None) -> Scene:
        """
        The scene with other labels drawn of an instance, and with other groups of its labels.
        """
    def with_reading(self, /, read_as: tuple[SupportsIndex | None, SupportsIndex | None, SupportsIndex | None, str | None, SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None, str | None, tuple[SupportsLenAndGetItem[SupportsIndex], str, bool, SupportsIndex] | None, tuple[str | None, str | None, str | None, str | None, str | None, str | PathLike[str] | None]]) -> Scene:
        """
        The scene with the file of its first instance read in this way.
        """

@final
class Session:
    """
    A live, progressively refined picture.
    """
    def __new__(cls, /, scene: Scene, volumes: SupportsGetItem[int, Volume] | None, meshes: SupportsGetItem[int, Mesh], how: tuple[str, SupportsIndex | None, SupportsFloat | SupportsIndex | None, SupportsFloat | SupportsIndex | None], *, denoise: bool, memory_limit: SupportsIndex | None, job: Job | None) -> Session:
        """
        Starts the worker. `volumes[i]` belongs to the scene's instance i; without volumes its sources are opened, and with a limit drawn from
        disk. `meshes[i]` belongs to its mesh i. `how`: a `pumice.arguments.RenderAs`.
        """
    def _panic_on_purpose(self, /) -> None:
        """
        Makes the worker panic, for tests that clients survive it.
        """
    def add(self, /, instance: str, volume: Volume) -> int:
        """
        Adds an instance in JSON with its volume, or replaces the one with the same id; returns the new revision.
        """
    def add_mesh(self, /, mesh: str, data: Mesh) -> int:
        """
        Adds a mesh in JSON with its triangles, or replaces the one with the same id; returns the new revision.
        """
    def edit(self, /, edits: str) -> int:
        """
        Applies a list of edits in JSON, all or none; returns the new revision.
        """
    def label_film(self, /) -> tuple[int, Array, Array] | None:
        """
        The revision of which the label film was made, its pixels and its depth: (height, width, 2) of the id of the instance or mesh and the
        row in the label table + 1, 0 where there is none, and (height, width) of world units along the view axis, infinite where there is
        nothing; row 0 at the top. `None` while the worker makes it; never waits.
        """
    def latest(self, /, after: SupportsIndex) -> Frame | None:
        """
        The newest frame if its serial is above `after`, else `None`; never waits.
        """
    def pick(self, /, x: SupportsIndex, y: SupportsIndex) -> tuple[int, int, str, list[int], float] | None:
        """
        (instance id, label id, name, voxel, depth) under the centre of a pixel, counted from the upper left.
        """
    def scene(self, /) -> Scene:
        """
        The scene as it is now.
        """
    def set_labels(self, /, id: SupportsIndex, visible: tuple[Buffer, Buffer] | None, groups: LabelGroups | None) -> int:
        """
        Sets which labels of an instance are drawn, and the groups of its labels; returns the new revision.
        """
    def status(self, /) -> tuple[str, str | None, int, str, str, str | None, list[str], dict[str, int], str | None]:
        """
        (state, error, revision, backend, device, backend that compiles, notices, counters, pages as JSON text).
        """
    def stop(self, /) -> None:
        """
        Stops the worker and waits until it ends its current slice.
        """

@final
class Volume:
    """
    An immutable volume in its compressed form.
    """
    def auto_colors(self, /, visible: SupportsGetItem[int, bool] | None, known: Buffer | None = None) -> Array:
        """
        Linear Rec. 709 colours that `auto_color` gives to the labels; those that are `visible` differ from their neighbours. With `known`,
        three numbers a label, labels keep their colour, and those of NaN get the palette's colour that is farthest from their neighbours'.
        """
    def bounds(self, /) -> tuple[Array, Array, Array]:
        """
        Lowest and highest voxel of each label, and its number of boxes.
        """
    def box_arrays(self, /) -> tuple[Array, Array, Array]:
        """
        Origins and extents in voxels, and labels, of all boxes.
        """
    def coarse_surface(self, /, visible: SupportsGetItem[int, bool], *, most_faces: SupportsIndex, job: Job | None = None) -> tuple[Array, Array, Array, list[int]]:
        """
        A coarse surface of the labels that are `visible`, by row of the table: vertices, quads, label of each quad, voxels of a cell.
        """
    def columns(self, /) -> list[tuple[str, Array]]:
        """
        Columns of numbers that a table gave to the labels, by name.
        """
    def contacts(self, /) -> Array:
        """
        Pairs of labels that touch, by row of the label table.
        """
    def content_hash(self, /) -> str:
        """
        Hash of labels and voxels; computing it takes a walk over all boxes.
        """
    def decode_block(self, /, origin: SupportsLenAndGetItem[SupportsIndex], dims: SupportsLenAndGetItem[SupportsIndex], job: Job | None = None) -> Array:
        """
        Original ids of a block, x fastest: shape (z, y, x).
        """
    def difference(self, /, source: str | PathLike[str] | Incomplete, *, read_as: tuple[SupportsIndex | None, SupportsIndex | None, SupportsIndex | None, str | None, SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None, str | None, tuple[SupportsLenAndGetItem[SupportsIndex], str, bool, SupportsIndex] | None, tuple[str | None, str | None, str | None, str | None, str | None, str | PathLike[str] | None]], job: Job | None = None) -> str | None:
        """
        Compares with a file, or with blocks; `None` if every voxel and id is the same, else the first difference.
        """
    def faces(self, /, visible: SupportsGetItem[int, bool], *, all_interfaces: bool, shared_corners: bool, job: Job | None = None) -> tuple[Array, Array, Array]:
        """
        Voxel faces of the labels that are `visible`, by row of the table: vertices, quads, label of each quad.
        """
    def facts(self, /) -> str:
        """
        Facts about the whole volume, as JSON text.
        """
    def ids(self, /) -> Array:
        """
        Original ids, in rising order.
        """
    def label_at(self, /, x: SupportsIndex, y: SupportsIndex, z: SupportsIndex) -> int:
        """
        Original id of the label at a voxel; 0 is background. The first query builds the index.
        """
    def mapped_bytes(self, /) -> int:
        """
        Bytes of the volume that are pages of its file and not memory of this process.
        """
    def notes(self, /) -> tuple[list[str], Array]:
        """
        Names, empty where the file gives none, and sRGB colours, NaN where the file gives none.
        """
    def query(self, /, line: str) -> Array:
        """
        Whether a query line holds for each label. Bounds are found if the line compares them.
        """
    def resident_parts(self, /) -> dict[str, int]:
        """
        Current bytes in memory by part; queries add an index.
        """
    def save(self, /, path: str | PathLike[str], level: str = "default", job: Job | None = None) -> None:
        """
        Writes a `.pumice` file, which appears complete or not at all.
        """
    def types(self, /) -> Array:
        """
        Type of each label: its index in `type_names`, or −1.
        """
    def voxels(self, /) -> Array:
        """
        Number of voxels of each label.
        """
    def with_labels(self, /, path: str | PathLike[str], labels: SupportsGetItem[int, SupportsIndex], *, read_as: tuple[SupportsIndex | None, SupportsIndex | None, SupportsIndex | None, str | None, SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None, str | None, tuple[SupportsLenAndGetItem[SupportsIndex], str, bool, SupportsIndex] | None, tuple[str | None, str | None, str | None, str | None, str | None, str | PathLike[str] | None]], job: Job | None = None) -> Volume:
        """
        The volume with these labels of its file added, which is `path`, read in the same way.
        """
    def write(self, /, path: str | PathLike[str], *, write_as: tuple[str | None, str | None, bool, str | None, bool, SupportsIndex | None], job: Job | None = None) -> list[str]:
        """
        Writes the labels in a format of other programs; returns what the format does not hold, a line each.
        """

def _end_calls() -> None:
    """
    Cancels every call in progress and waits for them to return. No new call can begin afterwards.
    """

def _panic_on_purpose() -> None:
    """
    Panics, to test that a panic becomes an exception.
    """

def agreement(ours: Any, theirs: Any, covered: Any) -> str:
    """
    Judges pictures (n, height, width, 3) of 32-bit floats against others of the same size; `covered` (height, width) has a byte for each
    pixel, 0 where it shows no surface. Returns the verdict and its statistics as JSON text.
    """

def chunk_count(dims: SupportsLenAndGetItem[SupportsIndex]) -> int:
    """
    Number of chunks of a volume of `dims` voxels.
    """

def chunk_regions(dims: SupportsLenAndGetItem[SupportsIndex], chunks: str) -> list[list[list[int]]]:
    """
    First voxel of these chunks along x, y and z, and the one after the last, chunk after chunk.
    """

def compress(source: str | PathLike[str] | Incomplete, *, given: str | AnnotationTable | PathLike[str] | None = None, memory_limit: SupportsIndex | None = None, threads: SupportsIndex = 0, read_as: tuple[SupportsIndex | None, SupportsIndex | None, SupportsIndex | None, str | None, SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None, str | None, tuple[SupportsLenAndGetItem[SupportsIndex], str, bool, SupportsIndex] | None, tuple[str | None, str | None, str | None, str | None, str | None, str | PathLike[str] | None]], job: Job | None = None) -> tuple[Volume, list[str]]:
    """
    Compresses a file, or blocks, and gives the labels what the caller says of them; also returns the reader's warnings, and what of the table
    does not fit.
    """

def compress_file(source: str | PathLike[str] | Incomplete, out: str | PathLike[str], *, level: str = "default", given: str | AnnotationTable | PathLike[str] | None = None, memory_limit: SupportsIndex | None = None, threads: SupportsIndex = 0, read_as: tuple[SupportsIndex | None, SupportsIndex | None, SupportsIndex | None, str | None, SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None, str | None, tuple[SupportsLenAndGetItem[SupportsIndex], str, bool, SupportsIndex] | None, tuple[str | None, str | None, str | None, str | None, str | None, str | PathLike[str] | None]], job: Job | None = None) -> tuple[str, list[str]]:
    """
    Compresses a file, or blocks, into a `.pumice` file, which never is in memory as a whole; returns what was written as JSON text, and the
    warnings of the reader with what of the table does not fit.
    """

def compress_part(frames: SupportsGetItem[int, str | PathLike[str]] | SupportsGetItem[int, Incomplete], out: str | PathLike[str], *, chunks: str, time_steps: str | None = None, source_name: str, fingerprint: str, memory_limit: SupportsIndex | None = None, threads: SupportsIndex = 0, read_as: tuple[SupportsIndex | None, SupportsIndex | None, SupportsIndex | None, str | None, SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None, str | None, tuple[SupportsLenAndGetItem[SupportsIndex], str, bool, SupportsIndex] | None, tuple[str | None, str | None, str | None, str | None, str | None, str | PathLike[str] | None]], job: Job | None = None) -> list[str]:
    """
    Compresses some chunks of a file or of a series of files, or of the blocks of one or several frames that are of these chunks alone, into a part;
    returns the reader's warnings. `source_name` and `fingerprint` tell blocks from those of other sources; files say that themselves.
    """

def compress_series(frames: SupportsGetItem[int, str | PathLike[str]] | SupportsGetItem[int, Incomplete], out: str | PathLike[str], *, time_steps: str | None = None, level: str = "default", given: str | AnnotationTable | PathLike[str] | None = None, memory_limit: SupportsIndex | None = None, threads: SupportsIndex = 0, resume: bool = False, restart: bool = False, read_as: tuple[SupportsIndex | None, SupportsIndex | None, SupportsIndex | None, str | None, SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None, str | None, tuple[SupportsLenAndGetItem[SupportsIndex], str, bool, SupportsIndex] | None, tuple[str | None, str | None, str | None, str | None, str | None, str | PathLike[str] | None]], job: Job | None = None) -> tuple[str, list[str]]:
    """
    Compresses a time series into one file; returns what was written as JSON text, and the warnings of the reader with what of the table does not
    fit. With `resume` or `restart` finished chunks are kept in a folder, as by the command.
    """

def count_faces(volume: Volume, visible: SupportsGetItem[int, bool], *, lod: SupportsIndex, merged: bool, limit: SupportsIndex, job: Job | None = None) -> int:
    """
    Number of faces of the surface of the labels that are `visible`, by row of the table; an error where there are more than `limit`.
    """

def cryptomatte_hash(name: str) -> int:
    """
    The hash of a name in Cryptomatte: MurmurHash3_x86_32 of its UTF-8.
    """

def devices() -> str:
    """
    The backends and devices that can render here, as JSON text.
    """

def distinct_colors(count: SupportsIndex, color_blind_safe: bool) -> Array:
    """
    A sequence of colours, linear Rec. 709, each as far as possible from those before it.
    """

def export(path: str | PathLike[str], out: str | PathLike[str], export_as: Incomplete, job: Job | None = None) -> str:
    """
    Writes a volume or a scene file for other programs; returns what was written, as JSON text.
    """

def figure(volume: Volume, source: str | PathLike[str], size: SupportsLenAndGetItem[SupportsIndex], labels: SupportsGetItem[int, SupportsIndex] | None, flags: SupportsGetItem[int, tuple[str, str]]) -> Scene:
    """
    Composes a scene that shows a volume: places, frames, colours and lights it. `labels` are ids; `flags` are those of `pumice render`, without
    their dashes, each with its text.
    """

def is_on_server(path: str | PathLike[str]) -> bool:
    """
    Whether a path is the URL of a store on a server.
    """

def merge(parts: SupportsGetItem[int, str | PathLike[str]], out: str | PathLike[str], *, level: str = "default", given: str | AnnotationTable | PathLike[str] | None = None, memory_limit: SupportsIndex | None = None, threads: SupportsIndex = 0, job: Job | None = None) -> tuple[str, list[str]]:
    """
    Joins parts to the volume's file; returns what was written as JSON text, and what of the table does not fit.
    """

def merge_into_part(parts: SupportsGetItem[int, str | PathLike[str]], out: str | PathLike[str], *, memory_limit: SupportsIndex | None = None, threads: SupportsIndex = 0, job: Job | None = None) -> None:
    """
    Joins parts to one part.
    """

def one_line(text: str) -> str:
    """
    A text as it is shown: on one line of bounded length, with control characters as escapes.
    """

def open(path: str | PathLike[str], *, labels: SupportsGetItem[int, SupportsIndex] | None = None, mapped: bool = False, memory: PageMemory | None = None, read_as: tuple[SupportsIndex | None, SupportsIndex | None, SupportsIndex | None, str | None, SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None, str | None, tuple[SupportsLenAndGetItem[SupportsIndex], str, bool, SupportsIndex] | None, tuple[str | None, str | None, str | None, str | None, str | None, str | PathLike[str] | None]], job: Job | None = None) -> tuple[Volume, list[str]]:
    """
    Opens a `.pumice` file, or compresses a label volume of another format in memory; also returns the reader's warnings. If `labels` are
    given, only these are read from a `.pumice` file; with a `memory` it is drawn from disk.
    """

def open_state(text: str | None, path: str | PathLike[str], layer_files: SupportsGetItem[int, tuple[str, str | PathLike[str]]], size: SupportsLenAndGetItem[SupportsIndex], job: Job | None = None) -> tuple[Scene, list[Volume], list[str]]:
    """
    A state of Neuroglancer as a scene, its volumes, and what is left out of it, one line each. It is `text`, JSON or a link, or the content of the file
    `path`, from whose folder relative URLs count, as those of a text do from the working folder. `layer_files` has copies of layers.
    """

def probe(path: str | PathLike[str], *, query: str | None = None, read_as: tuple[SupportsIndex | None, SupportsIndex | None, SupportsIndex | None, str | None, SupportsLenAndGetItem[SupportsFloat | SupportsIndex] | None, str | None, tuple[SupportsLenAndGetItem[SupportsIndex], str, bool, SupportsIndex] | None, tuple[str | None, str | None, str | None, str | None, str | None, str | PathLike[str] | None]], job: Job | None = None) -> str:
    """
    A summary of a file, from its header alone, as JSON text; with a query, also what a process holds that shows only the labels that match.
    """

def query_labels(line: str, ids: SupportsGetItem[int, SupportsIndex], names: SupportsGetItem[int, str], types: SupportsGetItem[int, str], columns: SupportsGetItem[int, tuple[str, SupportsGetItem[int, SupportsIndex] | SupportsGetItem[int, SupportsFloat | SupportsIndex]]]) -> Array:
    """
    Whether a query line holds, for each row of a table. Names and types are empty, or as many as there are ids.
    """

def read_label_table(path: str | PathLike[str]) -> tuple[AnnotationTable, str, list[str]]:
    """
    Reads a table of labels; returns it, the name of its format, and what its reader left out, a line each.
    """

def read_picture(path: str | PathLike[str]) -> Picture:
    """
    Reads a picture from an OpenEXR file.
    """

def render(scene: Scene, volumes: SupportsGetItem[int, Volume] | None, meshes: SupportsGetItem[int, Mesh], how: tuple[str, SupportsIndex | None, SupportsFloat | SupportsIndex | None, SupportsFloat | SupportsIndex | None], annotate: Incomplete, *, denoise: str | None, memory_limit: SupportsIndex | None, job: Job | None, on_progress: Any | None) -> Picture:
    """
    Renders a scene until the first limit is reached. `volumes[i]` belongs to its instance i; without volumes its sources are opened.
    `meshes[i]` belongs to its mesh i.
    """

def state_layers(text: str | None, path: str | PathLike[str]) -> list[tuple[str, str]]:
    """
    The layers that a state shows, by name, and the path or URL of each one's volume. `text` and `path` as for [`open_state`].
    """

def surface(volume: Volume, visible: SupportsGetItem[int, bool], *, lod: SupportsIndex, merged: bool, shared_corners: bool, job: Job | None = None) -> tuple[Array, Array, Array]:
    """
    The surface of the labels that are `visible`, by row of the table: vertices, quads, label of each quad.
    """

def turntable(scene: Scene, count: SupportsIndex) -> list[Scene]:
    """
    The scenes of a turntable: each is seen from a `count`th of a turn further around the vertical axis.
    """

def verify_render(path: str | PathLike[str], verify_as: Incomplete, job: Job | None = None) -> tuple[str, list[tuple[str, Array]]]:
    """
    Compares our picture of a scene file with that of Cycles; returns the report as JSON text, and if `maps` the pictures and maps by name,
    each (height, width, 3). While it runs, the job's fraction is the share of the pictures of the next look.
    """

def volume_info(dims: SupportsLenAndGetItem[SupportsIndex], label_type: str, world_from_index: SupportsLenAndGetItem[SupportsFloat | SupportsIndex], unit: str, names: SupportsGetItem[int, tuple[SupportsIndex, str]]) -> str:
    """
    The JSON form of a volume's description, built from its parts: `world_from_index` is twelve numbers in column-major order.
    """

def __getattr__(name: str) -> Incomplete: ...
