"""Pumice: compresses label volumes losslessly and path traces the compressed form.

    volume = pumice.open("cells.nrrd")                  # or pumice.compress(array, spacing=(16, 16, 40), unit="nm")
    scene = pumice.figure(volume, pick=30)
    picture = pumice.render(scene, volume, error=0.03)
    picture.save("cells.png")

Lengths of volumes are in the file's unit, those of scenes in world units; colours are scene-linear Rec. 709 unless said otherwise.

`path` is a text or an `os.PathLike`. `job`, a `Job`, lets another thread cancel a call, which then raises `Cancelled`, and read how far it is. Ids of
labels are whole numbers from 0 to 2**64 - 1: of Python, of numpy, or an array of integers. What is wrong with an argument or a file is an
`InputError` of one line.
"""

import atexit
import threading

from ._native import Job, __version__
from .bridge import agreement, export, verify_render
from .ending import end_calls
from .errors import Cancelled, InputError, InternalError, PumiceError, PumiceWarning
from .label_table import AnnotationTable, query_labels, read_label_table
from .labels import LabelGroups
from .mesh import Mesh
from .neuroglancer import open_state, state_layers
from .page_memory import PageFigures, PageMemory
from .parts import chunk_count, compress_file, compress_part, merge, merge_into_part
from .picture import CurvePoint, PickedPixel, Picture, cryptomatte_hash, devices, open_picture, render
from .reference_picture import ReferencePicture
from .renderer import Renderer
from .scene import Scene, figure
from .series import compress_series
from .session import Frame, LabelFilm, Pick, Session, Status
from .surface import count_faces, surface
from .volume import CoarseSurface, Faces, LabelTable, Volume, compress, distinct_colors, is_on_server, open, probe

# At exit, calls in other threads are ended before the interpreter is, because it would end their threads by force. What `atexit` has comes after
# the end of all threads that are not daemons, where a picture without a limit would keep the interpreter for ever; what `threading` has comes
# before it (`concurrent.futures` ends its threads so).
getattr(threading, "_register_atexit", atexit.register)(end_calls)

__all__ = [
    "AnnotationTable",
    "Cancelled",
    "CoarseSurface",
    "CurvePoint",
    "Faces",
    "Frame",
    "InputError",
    "InternalError",
    "Job",
    "LabelFilm",
    "LabelGroups",
    "LabelTable",
    "Mesh",
    "PageFigures",
    "PageMemory",
    "Pick",
    "PickedPixel",
    "Picture",
    "PumiceError",
    "PumiceWarning",
    "ReferencePicture",
    "Renderer",
    "Scene",
    "Session",
    "Status",
    "Volume",
    "__version__",
    "agreement",
    "chunk_count",
    "compress",
    "compress_file",
    "compress_part",
    "compress_series",
    "count_faces",
    "cryptomatte_hash",
    "devices",
    "distinct_colors",
    "export",
    "figure",
    "is_on_server",
    "merge",
    "merge_into_part",
    "open",
    "open_picture",
    "open_state",
    "probe",
    "query_labels",
    "read_label_table",
    "render",
    "state_layers",
    "surface",
    "verify_render",
]
