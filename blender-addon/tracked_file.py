# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The data-block by which Blender, packers of assets and render farms find the file of a volume object.

They follow the paths of Blender's own data-blocks, and see none in an extension's properties. So a volume object points to a data-block of Blender's
kind *Volume* that has the path of the `.pumice` file too. No object shows this data-block, so nothing opens the file for it.

    object.pumice.tracked_file ──► Volume      goes with the object: saved, copied, appended and linked with it, not saved without it
    scene.pumice.linked_files ──► Volume …     those of linked objects: Blender Asset Tracer enters a library for what the file itself points to

`file_paths` brings both up to date whenever the file is saved. A path that a packer or *Find Missing Files* has written there is one of the places
where `file_paths.find` looks.

Tried and left out: a path property with Blender 5's PATH_SUPPORTS_BLEND_RELATIVE (nothing visits it), a Cache File (Blender opens the file), an Image
(each menu of images lists it).
"""

import os

import bpy


def path(obj):
    """The path that the data-block of a volume object means now; empty without one."""
    block = obj.pumice.tracked_file
    if block is None or not block.filepath:
        return ""
    return os.path.abspath(bpy.path.abspath(block.filepath, library=block.library))


def follow(obj, stored):
    """Gives the data-block of a local volume object a path, as the file that is open stores it. Blender adapts it when it saves elsewhere."""
    block = obj.pumice.tracked_file
    if block is None or not _may_be_written(block, stored):
        block = obj.pumice.tracked_file = bpy.data.volumes.new(f"{obj.name} file")
    if block.filepath != stored:
        block.filepath = stored


def drop(obj):
    """Takes the data-block from an object that shows no volume any more."""
    if obj.pumice.tracked_file is not None:
        obj.pumice.tracked_file = None


def keep_linked():
    """Makes the first scene point to the data-blocks of all linked volume objects."""
    linked = (obj.pumice.tracked_file for obj in bpy.data.objects if obj.library is not None and obj.pumice.filepath)
    wanted = sorted({block for block in linked if block is not None}, key=lambda block: (block.library is not None and block.library.filepath, block.name))
    for scene in bpy.data.scenes:
        if scene.library is None:
            _point(scene.pumice.linked_files, wanted)
            wanted = []


def _may_be_written(block, stored):
    """Whether a data-block may have this path. *Pack Resources* puts the file's bytes into the data-block, where nothing reads them."""
    if block.library is not None or block.packed_file is not None:
        return False
    return block.filepath == stored or block.users == 1


def _point(files, wanted):
    if [one.block for one in files] != wanted:
        files.clear()
        for block in wanted:
            files.add().block = block
