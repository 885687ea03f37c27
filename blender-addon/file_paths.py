# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the files of a volume object are: paths as Blender has them, relative (`//`) to the .blend file or to the library of a linked object.

    1. the path itself                          silent
    2. the path of its data-block               said   `tracked_file`: a packer, *Find Missing Files* or an append has changed it
    3. where the file was at the last save      said   an object that was appended keeps a path relative to the file that it came from
    4. beside the library, beside the .blend    said   both were moved into one folder

The URL of a source on a server stays as it is.

Saving makes the paths of local objects relative, if Blender's preference *Relative Paths* is on and both files share more than the root of a
drive, so that a folder can be moved as a whole. Blender itself remaps only its own paths when a file is saved elsewhere.
"""

import os
import re

import bpy

from . import native, tracked_file

# Properties of `object.pumice` that are paths of files.
NAMES = ("filepath", "source_path")


def absolute(obj, name="filepath"):
    """The path that a property of a volume object means, whether or not there is a file; an empty one stays empty."""
    path = getattr(obj.pumice, name)
    if not path or native.is_on_server(path):
        return path
    return os.path.abspath(bpy.path.abspath(path, library=_library(obj)))


def find(obj, name="filepath"):
    """(absolute path of a file of a volume object, None or a line that says that it was found elsewhere)."""
    given = absolute(obj, name)
    if not given or native.is_on_server(given) or os.path.exists(given):
        return given, None
    file_name = re.split(r"[\\/]", getattr(obj.pumice, name))[-1]
    library = _library(obj)
    blends = [bpy.path.abspath(library.filepath, library=library.parent)] if library is not None else []
    beside = [os.path.join(os.path.dirname(os.path.abspath(blend)), file_name) for blend in (*blends, bpy.data.filepath) if blend]
    tracked = [tracked_file.path(obj)] if name == "filepath" else []
    for place in (*tracked, getattr(obj.pumice, f"last_{name}"), *beside):
        if place and os.path.exists(place):
            return place, f"{obj.name}: {given} is missing; {place} is taken instead"
    return given, None


def local_volumes():
    """The volume objects of the file whose paths it stores itself."""
    return [obj for obj in bpy.data.objects if obj.pumice.filepath and obj.library is None and obj.override_library is None]


def _library(obj):
    """The library that an object's paths are relative to; a library override has those of the object that it overrides."""
    override = obj.override_library
    owner = override.reference if override is not None and override.reference is not None else obj
    return owner.library


def _rebase(folder):
    """Writes the paths of all local volumes as a .blend file in `folder` stores them, and those of their data-blocks."""
    opened = _folder(bpy.data.filepath)
    for obj in local_volumes():
        for name in NAMES:
            path = getattr(obj.pumice, name)
            found = find(obj, name)[0]
            if not path:
                continue
            if os.path.exists(found):
                _set(obj, f"last_{name}", found)
            if name == "filepath":
                tracked_file.follow(obj, _stored(path, found, opened) if opened else found)
            _set(obj, name, _stored(path, found, folder))


def _stored(path, found, folder):
    """How a .blend file in `folder` stores a path that is now `path` and means the file `found`."""
    if not path.startswith("//") and not (bpy.context.preferences.filepaths.use_relative_paths and _share_a_folder(found, folder)):
        return path
    try:
        return bpy.path.relpath(found, start=folder)
    except ValueError:  # another drive
        return found


def _share_a_folder(path, folder):
    try:
        shared = os.path.commonpath([path, os.path.abspath(folder)])
    except ValueError:  # another drive
        return False
    return os.path.dirname(shared) != shared


def _set(obj, name, value):
    if getattr(obj.pumice, name) != value:
        setattr(obj.pumice, name, value)


def _folder(blend):
    return os.path.dirname(os.path.abspath(blend)) if blend else None


@bpy.app.handlers.persistent
def _before_save(path, *_):
    for obj in bpy.data.objects:
        if obj.library is None and not obj.pumice.filepath:
            tracked_file.drop(obj)
    _rebase(_folder(path))
    tracked_file.keep_linked()


@bpy.app.handlers.persistent
def _after_save(path, *_):
    # A copy was saved, or nothing: the paths belong to the file that is open.
    if _folder(path) != _folder(bpy.data.filepath):
        _rebase_from(_folder(path), _folder(bpy.data.filepath))


def _rebase_from(written, opened):
    """Makes paths that are relative to one folder relative to another again; None makes them absolute."""
    for obj in local_volumes():
        for name in NAMES:
            path = getattr(obj.pumice, name)
            if path.startswith("//"):
                meant = os.path.abspath(bpy.path.abspath(path, start=written))
                _set(obj, name, bpy.path.relpath(meant, start=opened) if opened else meant)


HANDLERS = (
    (bpy.app.handlers.save_pre, _before_save),
    (bpy.app.handlers.save_post, _after_save),
    (bpy.app.handlers.save_post_fail, _after_save),
)


def register():
    for handlers, call in HANDLERS:
        handlers.append(call)


def unregister():
    for handlers, call in HANDLERS:
        handlers.remove(call)
