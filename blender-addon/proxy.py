# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The proxy: the mesh of a volume object, a coarse surface of the labels that are shown, for whatever draws only meshes.

    attribute     type, domain           what
    label         INT, FACE              row of the label table
    Label Color   FLOAT_COLOR, CORNER    linear color of the label: the active color attribute, which Solid mode and the material read
    (material index)                     the label's group, a material slot

Where no label is shown the mesh is the volume's box in lines, so that the object can still be seen and selected; it has no face to render.

The mesh says itself what it was made of, in two stamps: so it is known to be out of date after undo, duplicating and opening a file too.
"""

import hashlib

import numpy as np

from . import label_table, proxy_material, time_settings, volume_place
from .reports import Refused

# Custom properties of the mesh: what its surface, and its colors and groups, were made of.
SHAPE_STAMP, COLOR_STAMP = "pumice_proxy", "pumice_proxy_colors"
LABEL = "label"
# Pairs of corners of a box that differ in one bit: x is bit 0, y bit 1, z bit 2.
BOX_EDGES = [(corner, corner | bit) for corner in range(8) for bit in (1, 2, 4) if not corner & bit]


class Wanted:
    """What the proxy of a volume object is to be made of, read from Blender at once; does not use Blender afterwards.

    `timed` is the object whose values say which time step is shown: the evaluated one, where they may be animated and Blender has not written
    them to the object itself."""

    def __init__(self, obj, timed=None, frame=None):
        settings, table = obj.pumice, obj.pumice.table
        self.name = obj.name
        timed, frame = timed or obj, time_settings.now() if frame is None else frame
        self.most_faces = settings.proxy_faces
        self.ids, self.visible = label_table.ids(table), label_table.visible(table)
        self.time_step = time_settings.nearest(timed, frame)
        if self.time_step is not None and time_settings.shown(timed, frame) is None:
            self.visible[:] = False
        slots = max(1, len(obj.material_slots))
        self.slots = np.minimum(label_table.slots(table), slots - 1)
        self.colors = label_table.colors(table)
        time = () if self.time_step is None else (self.time_step,)
        self.still_stamp = _stamp(self.visible, settings.content_hash, self.most_faces)
        self.shape_stamp = _stamp(self.visible, settings.content_hash, self.most_faces, *time)
        self.color_stamp = _stamp(self.slots, self.colors, self.shape_stamp)

    def has_shape(self, mesh):
        """Whether the mesh is the surface that is wanted."""
        return mesh.get(SHAPE_STAMP) == self.shape_stamp

    def has_colors(self, mesh):
        """Whether the mesh has the colors and groups that are wanted, too."""
        return mesh.get(COLOR_STAMP) == self.color_stamp

    def labels(self):
        """The labels that are shown, as the registry takes them."""
        return None if self.visible.all() else (self.ids, self.visible)

    def surface(self, volume, job=None):
        """The coarse surface of an open volume; runs without the interpreter's lock. Raises Refused where the volume has other labels."""
        label_table.require_rows(self.ids, volume.labels, self.name)
        return volume.coarse_surface(self.visible, most_faces=self.most_faces, job=job)


def write(obj, wanted, surface, object_from_index=None):
    """Replaces the mesh of an object by a coarse surface, with its colors and groups. Takes 0.04 s for 50,000 faces.

    What was applied to the former mesh stays applied, or `object_from_index` is instead: from voxels to the object's space, (4, 4).
    """
    mesh, count = obj.data, len(surface.quads)
    if object_from_index is None:
        found = volume_place.fit(mesh)
        if found is None:
            raise Refused(f"{obj.name}: {volume_place.LOST}")
        object_from_index = found.object_from_index
    vertices = surface.vertices if count else _corners(obj.pumice.dims)
    mesh.clear_geometry()
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(vertices, dtype=np.float32).ravel())
    if count:
        mesh.loops.add(4 * count)
        mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(surface.quads).view(np.int32).ravel())
        mesh.polygons.add(count)
        mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * count, 4, dtype=np.int32))
    else:
        mesh.edges.add(len(BOX_EDGES))
        mesh.edges.foreach_set("vertices", np.array(BOX_EDGES, dtype=np.int32).ravel())
    mesh.update(calc_edges=bool(count))
    mesh.shade_smooth()
    volume_place.mark(mesh)
    volume_place.move(mesh, object_from_index)
    mesh.attributes.new(LABEL, "INT", "FACE").data.foreach_set("value", surface.labels.astype(np.int32))
    mesh[SHAPE_STAMP] = wanted.shape_stamp
    write_colors(obj, wanted)


def write_colors(obj, wanted):
    """Gives the faces of a proxy the colors and groups of their labels."""
    mesh = obj.data
    labels = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.attributes[LABEL].data.foreach_get("value", labels)
    layer = mesh.color_attributes.get(proxy_material.LABEL_COLOR)
    if layer is None:
        layer = mesh.color_attributes.new(proxy_material.LABEL_COLOR, "FLOAT_COLOR", "CORNER")
        mesh.color_attributes.active_color = layer
        mesh.color_attributes.render_color_index = 0
    if len(labels):
        layer.data.foreach_set("color", np.repeat(wanted.colors[labels], 4, axis=0).ravel())
        mesh.polygons.foreach_set("material_index", wanted.slots[labels].astype(np.int32))
    mesh[COLOR_STAMP] = wanted.color_stamp
    mesh.update()


def box(mesh, dims):
    """Makes a new mesh the box of a volume of these dims, until its surface is written."""
    mesh.from_pydata(_corners(dims).tolist(), BOX_EDGES, [])
    volume_place.mark(mesh)


def _corners(dims):
    return np.array([[dims[axis] * (corner >> axis & 1) for axis in range(3)] for corner in range(8)], dtype=np.float64)


def _stamp(*parts):
    """A short text that differs where any of the arrays, texts or numbers differs."""
    digest = hashlib.blake2b(digest_size=12)
    for part in parts:
        digest.update(np.ascontiguousarray(part) if isinstance(part, np.ndarray) else f"|{part}|".encode())
    return digest.hexdigest()
