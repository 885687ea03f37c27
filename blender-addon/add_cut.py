# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""*Add › Pumice Cut*: an empty that cuts volumes open, at the middle of the active volume and of its size.

    Plane   removes what lies before the middle: its +Z points to the viewer
    Box     removes the corner of the volume that is nearest to the viewer

    eye ●               the plane's +Z ◄─┤               ┌──┬──┐
                             removed     │ kept          │  └──┤  the box takes the near corner
                                                         └─────┘
The viewer is the 3D viewport; without one, the scene's camera.
"""

import bpy
from bpy.props import EnumProperty
from mathutils import Matrix, Vector

from . import active_volume, volume_place
from .properties import is_volume
from .reports import Refused, log, one_line
from .sync import cuts

SHAPES = (
    ("PLANE", "Plane", "Remove one side of a plane", 0),
    ("BOX", "Box", "Remove the inside of a box", 1),
)
ORIENTATIONS = (
    ("VIEW", "View", "The plane faces the viewer; a box has the directions of the volume", 0),
    ("X", "X", "The plane is across the volume's x axis", 1),
    ("Y", "Y", "The plane is across the volume's y axis", 2),
    ("Z", "Z", "The plane is across the volume's z axis", 3),
)
VOLUMES = (
    ("ALL", "All", "Cut all volumes, also those that are added later", 0),
    ("ACTIVE", "Active", "Cut the active volume only", 1),
    ("SELECTED", "Selected", "Cut the selected volumes only", 2),
)
# From a scene without viewport and camera one looks as the import's camera does.
USUAL_DIRECTION = Vector((0.4, -0.8, 0.4))
# A box ends beyond the volume by this part of its size, so that no sliver of the last voxels stays.
BEYOND = 0.02


class PUMICE_OT_add_cut(bpy.types.Operator):
    """Add an object that cuts volumes open, at the middle of the active volume"""

    bl_idname = "pumice.add_cut"
    bl_label = "Add Cut"
    bl_options = {"REGISTER", "UNDO"}

    shape: EnumProperty(name="Shape", description="Part of space that is removed", items=SHAPES, default="PLANE")
    orientation: EnumProperty(name="Orientation", description="Direction of a plane", items=ORIENTATIONS, default="VIEW")
    volumes: EnumProperty(name="Volumes", description="Volumes that are cut", items=VOLUMES, default="ALL")

    @classmethod
    def poll(cls, context):
        return _active_volume(context) is not None or _needs(cls, active_volume.MAKE_ACTIVE)

    def execute(self, context):
        return _run_and_report(self, lambda: self._add(context))

    def _add(self, context):
        volume = _active_volume(context)
        context.view_layer.update()
        toward = _toward_viewer(context, volume)
        obj = bpy.data.objects.new(f"{volume.name} {'plane' if self.shape == 'PLANE' else 'box'}", None)
        if self.shape == "PLANE":
            obj.empty_display_type, obj.empty_display_size = "SINGLE_ARROW", max(axis.length for axis in _half_axes(volume))
            obj.matrix_world = plane_place(volume, self.orientation, toward)
        else:
            obj.empty_display_type, obj.empty_display_size = "CUBE", 1.0
            obj.matrix_world = box_place(volume, toward)
        obj.pumice.cut = self.shape
        if self.volumes != "ALL":
            obj.pumice.cut_volumes = _collection(obj, [volume] if self.volumes == "ACTIVE" else _selected_volumes(context))
        context.collection.objects.link(obj)
        for other in context.selected_objects:
            other.select_set(False)
        obj.select_set(True)
        context.view_layer.objects.active = obj


class PUMICE_OT_cut_volumes(bpy.types.Operator):
    """Choose which volumes the active object cuts"""

    bl_idname = "pumice.cut_volumes"
    bl_label = "Choose Volumes"
    bl_options = {"REGISTER", "UNDO"}

    volumes: EnumProperty(name="Volumes", description="Volumes that are cut", items=(VOLUMES[0], VOLUMES[2]), default="SELECTED")

    @classmethod
    def poll(cls, context):
        obj = context.object
        return (obj is not None and cuts.is_cut(obj)) or _needs(cls, "Make an object that cuts active first")

    def execute(self, context):
        return _run_and_report(self, lambda: self._choose(context))

    def _choose(self, context):
        obj = context.object
        # The former collection stays as it is: other objects may use it.
        obj.pumice.cut_volumes = None if self.volumes == "ALL" else _collection(obj, _selected_volumes(context))


class PUMICE_MT_add_cut(bpy.types.Menu):
    """Menu: the shapes of a cut."""

    bl_label = "Pumice Cut"

    def draw(self, _context):
        for shape, name, _, _ in SHAPES:
            self.layout.operator("pumice.add_cut", text=name).shape = shape


def plane_place(volume, orientation, toward):
    """The matrix of a plane through the middle of a volume, whose +Z points to the viewer's side."""
    if orientation == "VIEW":
        normal = toward.normalized()
    else:
        # Planes of voxels stay planes where the axes shear: their normal is across the two other axes.
        axes = _half_axes(volume)
        at = "XYZ".index(orientation)
        normal = axes[(at + 1) % 3].cross(axes[(at + 2) % 3]).normalized()
        normal = -normal if normal.dot(toward) < 0.0 else normal
    return Matrix.Translation(_middle(volume)) @ normal.to_track_quat("Z", "Y").to_matrix().to_4x4()


def box_place(volume, toward):
    """The matrix of a box, the cube [−1, 1]³, from the middle of a volume to the corner that is nearest to the viewer."""
    place, middle = Matrix.Identity(4), _middle(volume)
    for column, axis in enumerate(_half_axes(volume)):
        half = axis * ((1.0 + BEYOND) / 2.0 * (-1.0 if axis.dot(toward) < 0.0 else 1.0))
        middle = middle + half
        for row in range(3):
            place[row][column] = half[row]
    place.translation = middle
    # An empty has location, rotation and scale, which hold no shear: the box then keeps its sizes, at right angles.
    return Matrix.LocRotScale(*place.decompose())


def _half_axes(volume):
    """Half of a volume's extent along each of its axes, as vectors of the scene."""
    linear = volume_place.known(volume).to_3x3()
    return [linear.col[axis] * (volume.pumice.dims[axis] / 2.0) for axis in range(3)]


def _middle(volume):
    return volume_place.known(volume) @ (Vector(volume.pumice.dims) / 2.0)


def _toward_viewer(context, volume):
    """The direction from a volume to who looks at it."""
    view = getattr(context, "region_data", None)
    if view is not None:
        return view.view_matrix.to_3x3().row[2].copy()
    camera = context.scene.camera
    if camera is not None:
        away = camera.matrix_world.translation - _middle(volume)
        return camera.matrix_world.to_3x3().col[2].copy() if camera.data.type == "ORTHO" or away.length < 1e-6 else away
    return USUAL_DIRECTION


def _active_volume(context):
    obj = context.object
    return obj if obj is not None and is_volume(obj) else None


def _selected_volumes(context):
    found = [obj for obj in context.selected_objects if is_volume(obj)]
    if not found:
        raise Refused("No volume is selected; select those that are to be cut")
    return found


def _collection(obj, volumes):
    """A new collection of volumes, outside the scene as those of light linking."""
    made = bpy.data.collections.new(f"{obj.name} volumes")
    for volume in volumes:
        made.objects.link(volume)
    return made


def _needs(cls, what):
    cls.poll_message_set(what)
    return False


def _run_and_report(operator, act):
    try:
        act()
    except Exception as error:
        log(error)
        operator.report({"ERROR"}, one_line(error))
        return {"CANCELLED"}
    return {"FINISHED"}


def _menu(self, _context):
    self.layout.menu("PUMICE_MT_add_cut", icon="MOD_BOOLEAN")


CLASSES = (PUMICE_OT_add_cut, PUMICE_OT_cut_volumes, PUMICE_MT_add_cut)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.VIEW3D_MT_add.append(_menu)


def unregister():
    bpy.types.VIEW3D_MT_add.remove(_menu)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
