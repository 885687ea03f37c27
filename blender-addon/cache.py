# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths at which the compressed form of a source file is kept.

    cortex.nrrd            →  cortex-3f9c…e1.pumice      beside the source, or in the extension's own folder where that cannot be written
    gs://bucket/cortex     →  cortex-80ab…42.pumice      in the extension's own folder

The sixteen digits are a hash of the source's name, size and time of change and of how it was read (layer, voxel size, …). A changed
source or another layer therefore has another file, and an existing file is always valid: it is never half written, because the
compressor renames it into place when it is complete. Of a store on a server, what describes it stands for its size and time, which asks the server:
a change of chunks alone is not seen.
"""

import hashlib
import json
import os
import tempfile

from . import native

# Of a compressed file.
FIRST_BYTES = b"\x89PUMICE\n"


def is_compressed(path):
    """Whether a file is already in the compressed form."""
    if native.is_on_server(path) or os.path.isdir(path):  # stores, slices
        return False
    with open(path, "rb") as file:
        return file.read(8) == FIRST_BYTES or os.path.splitext(path)[1].lower() == ".pumice"


def base_name(source):
    """The last part of a path or URL, without what Neuroglancer puts behind a bar."""
    if native.is_on_server(source):
        return source.split("|")[0].rstrip("/").rsplit("/", 1)[-1]
    return os.path.basename(os.path.normpath(source))


def time_steps(path):
    """Number of time steps of a compressed file, from its header (bytes 36 to 40); 1 where it has no time, or is damaged, which opening says."""
    with open(path, "rb") as file:
        header = file.read(40)
    return max(1, int.from_bytes(header[36:40], "little")) if len(header) == 40 and header[:8] == FIRST_BYTES else 1


def file_name(source, choice):
    """Name of the compressed form of `source` read with `choice` (a dict of plain values); its `files` are names of files beside `source`."""
    # A table of joined ids is read as the source is, and so are the files of a series.
    tables = [_state(choice["relabel"])] if os.path.isfile(choice.get("relabel", "")) else []
    tables += [_state(os.path.join(os.path.dirname(source), name)) for name in choice.get("files", ())]
    of_source = [source, _described(source, choice)] if native.is_on_server(source) else [os.path.basename(source), _state(source)]
    state = json.dumps([*of_source, choice, *tables], sort_keys=True)
    digest = hashlib.blake2b(state.encode(), digest_size=8).hexdigest()
    stem = base_name(source)
    for ending in (".nii.gz", ".seg.nrrd"):
        if stem.lower().endswith(ending):
            stem = stem[: -len(ending)]
            break
    else:
        stem = os.path.splitext(stem)[0]
    return f"{stem}-{digest}.pumice"


def candidates(source, choice, user_folder):
    """Paths at which the compressed form may be, the preferred one first."""
    name = file_name(source, choice)
    folders = [] if native.is_on_server(source) else [os.path.dirname(os.path.abspath(os.path.normpath(source)))]
    return [os.path.join(folder, name) for folder in (*folders, user_folder)]


def existing(paths):
    """The first of the paths that exists; None if none does."""
    return next((path for path in paths if os.path.isfile(path)), None)


def writable(paths):
    """The first of the paths whose folder is writable; raises OSError if none is."""
    problem = None
    for path in paths:
        try:
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with tempfile.TemporaryFile(dir=os.path.dirname(path)):
                return path
        except OSError as error:
            problem = error
    raise problem or OSError("no folder to write to")


def _described(source, choice):
    """What the server says of a store, read with `choice`."""
    reading = {name: value for name, value in choice.items() if name not in ("time_steps", "files")}
    return native.require().probe(source, **reading)


def _state(source):
    """Size and modification time of a file, or of every file in a folder."""
    if not os.path.isdir(source):
        status = os.stat(source)
        return [status.st_size, status.st_mtime_ns]
    with os.scandir(source) as entries:
        flat = sorted([e.name, e.stat().st_size, e.stat().st_mtime_ns] for e in entries if e.is_file())
    below = _state_below(source)
    return [flat, below] if below else flat


def _state_below(source):
    """A hash of name, size and modification time of every file in the folders of a store; empty where there are none. Links are not followed."""
    digest, count = hashlib.blake2b(digest_size=16), 0
    for folder, folders, files in os.walk(source):
        folders.sort()
        if folder == source:
            continue
        for name in sorted(files):
            status = os.lstat(os.path.join(folder, name))
            digest.update(f"{os.path.relpath(folder, source)}\0{name}\0{status.st_size}\0{status.st_mtime_ns}\0".encode(errors="surrogateescape"))
            count += 1
    return digest.hexdigest() if count else ""
