# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Import > Neuroglancer State: the layers of a link or a JSON file become volumes that look as the state says, seen by its camera.

    state ──► its layers: files and URLs (`pumice.state_layers`) ──► compressed forms, as for an import of each (a thread, ESC)
          ──► the scene of the state (`pumice.open_state`) ──► objects, colors, material, camera, sun, world

What the state means is the compiled module's to say: here its scene is only taken over into Blender's data.
"""

import json
import math
import os
import warnings

import bpy
import numpy as np
from bpy.props import BoolProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ImportHelper
from mathutils import Matrix, Vector

from . import cache, figure_settings, first_look, import_dialog, label_table, native, online_access, opening, proxy_update, registry, time_settings, viewport, volume_object
from .background import InBackground, Work
from .sync import dressing, matrix, nodes

NAME = "Neuroglancer"


def is_link(text):
    """Whether a text is a link to Neuroglancer."""
    return text.startswith(("https://", "http://")) and "#!" in text


class PUMICE_OT_import_state(InBackground, bpy.types.Operator, ImportHelper):
    """Import the segmentation layers that a state of Neuroglancer shows, with its segments, colors and camera. Takes time and disk space to
    compress each layer once"""

    bl_idname = "pumice.import_state"
    bl_label = "Import Neuroglancer State"
    bl_options = {"UNDO"}

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json;*.txt", options={"HIDDEN"})
    filepath: StringProperty(
        name="State", description="File with the JSON of the state or a link, or the link itself", subtype="FILE_PATH", options={"SKIP_SAVE", "HIDDEN"}
    )
    roi: StringProperty(
        name="Region",
        description="Read only these voxels of layers that are not compressed, X0:X1,Y0:Y1,Z0:Z1, such as 0:512,100:200,:; empty reads all",
        default="",
        options={"SKIP_SAVE"},
    )
    scale: IntProperty(
        name="Level",
        description="Level of detail to read of layers that are not compressed, 0 the finest; -1 if they have one",
        min=-1,
        default=-1,
        options={"SKIP_SAVE"},
    )
    use_engine: BoolProperty(
        name="Render with Pumice",
        description="Set the scene's render engine to Pumice, and the viewports to Rendered, if these are the first volumes of the scene",
        default=True,
    )
    use_light: BoolProperty(
        name="Light", description="Add the sun and the world of a figure, if these are the first volumes of the scene", default=True
    )
    use_camera: BoolProperty(
        name="Camera", description="Look through a camera that sees what the state shows, if these are the first volumes of the scene", default=True
    )

    _browsing = False

    def invoke(self, context, _event):
        self._interactive = True
        if not self.filepath:
            self._browsing = True
            context.window_manager.fileselect_add(self)
            return {"RUNNING_MODAL"}
        try:
            self._layers = self._sources()
        except Exception as error:
            return self.refused(error)
        return context.window_manager.invoke_props_dialog(
            self, width=import_dialog.DIALOG_PIXELS, title="Neuroglancer State", confirm_text="Import", translate=False
        )

    def execute(self, context):
        if self._browsing:
            self._browsing = False
            import_dialog.open_later(context, bpy.ops.pumice.import_state, filepath=self.filepath)
            return {"CANCELLED"}
        return super().execute(context)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        if self._browsing:
            layout.label(text="A dialog follows with the layers of the state")
            return
        column = layout.box().column(align=True)
        for name, source in self._layers.items():
            column.label(text=f"{name}: {source}")
        column = layout.column(heading="Part")
        column.prop(self, "roi")
        column.prop(self, "scale")
        import_dialog.draw_scene_options(self, context, layout)

    def begin(self, context):
        state, layers = self._state(), self._sources()
        folder, memory = import_dialog.volumes_folder(), registry.page_memory()
        wanted = [opening.Wanted(source, self._choice(source), folder, memory=memory) for source in layers.values()]
        size = figure_settings.written_pixels(context.scene.render)

        def call(job, tell):
            opened = opening.open_all(wanted, job, tell)
            tell("Opening the state")
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                files = {name: one.filepath for name, one in zip(layers, opened)}
                scene, _ = native.require().open_state(state, layer_files=files, size=size, job=job)
            odd = [str(line.message) for line in said if issubclass(line.category, native.require().PumiceWarning)]
            return dict(zip(layers, opened)), scene.to_dict(), [line for one in opened for line in one.warnings] + odd

        return Work("Reading", call, tells=True, asks_server=opening.asks_server(wanted))

    def finish(self, context, result):
        opened, scene, lines = result
        is_first = not any(o.pumice.filepath for o in context.scene.objects)
        for line in lines:
            self.report({"WARNING"}, line.replace("(give --", "(give "))
        # An instance a layer, in the same order.
        made = [_volume(context, name, one, instance) for (name, one), instance in zip(opened.items(), scene["instances"], strict=True)]
        for other in context.selected_objects:
            other.select_set(False)
        for obj in made:
            obj.select_set(True)
        context.view_layer.objects.active = made[0]
        if is_first:
            if self.use_engine:
                context.scene.render.engine = "PUMICE"
            if self.use_light:
                _light(context, scene)
            first_look.prepare(context, *made, frame_camera=False, light=False, rendered=self.use_engine)
            if self.use_camera:
                _camera(context, scene, made)
        viewport.redraw_all()
        for obj in made:
            shown = int(label_table.visible(obj.pumice.table).sum())
            self.report({"INFO"}, f"{obj.name}: {shown} of {obj.pumice.labels} labels shown")

    # Inside

    def _state(self):
        """The link, or the path of the file."""
        given = self.filepath.strip()
        return given if is_link(given) else os.path.abspath(bpy.path.abspath(given))

    def _sources(self):
        layers = native.require().state_layers(self._state())
        online_access.check(layers.values())
        return layers

    def _choice(self, source):
        if cache.is_compressed(source):
            return {}
        choice = {"roi": self.roi} if self.roi else {}
        return choice | ({"scale": self.scale} if self.scale >= 0 else {})


def _volume(context, name, opened, instance):
    """A volume object for a layer, with place, shown labels, colors and material of `instance`, its entry in the scene."""
    registry.adopt(opened.filepath, opened.volume)
    place, volume, style = np.array(matrix.from_twelve(instance["world_from_index"])), opened.volume, instance["style"]
    obj = volume_object.create_at(
        context,
        volume,
        place,
        name=name,
        filepath=opened.filepath,
        source_path=opened.source,
        # Of the longest axis, where the state stretches some of them.
        scale=max(np.linalg.norm(place[:3, :3], axis=0) / np.linalg.norm(np.array(volume.world_from_index)[:3, :3], axis=0)),
    )
    obj["pumice_choice"] = json.dumps(opened.choice)
    time_settings.describe(obj, volume, opened.playback)
    table, [group] = obj.pumice.table, style["groups"]
    rows = volume.labels.rows_of(group["labels"])
    label_table.set_color(table, rows, np.array(group["colors"], dtype=np.float32))
    label_table.set_visible(table, volume.labels.isin(style["show"]["only"]))
    material = obj.material_slots[0].material
    dressing.dress(material, group["material"])
    volume_object.color_by_label(material)
    proxy_update.refresh(obj, volume)
    return obj


def _light(context, scene):
    """The suns and the world of a scene."""
    for sun in scene["suns"]:
        light = bpy.data.lights.new(NAME, "SUN")
        light.energy, light.color, light.angle = sun["strength"], sun["color"], sun["angle_rad"]
        obj = bpy.data.objects.new(NAME, light)
        obj.matrix_world = (-Vector(sun["direction"])).to_track_quat("Z", "Y").to_matrix().to_4x4()
        context.collection.objects.link(obj)
    made = bpy.data.worlds.new(NAME)
    tree = nodes.ensure(made)
    tree.nodes.clear()
    background, output = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    background.inputs["Color"].default_value = (*scene["world"]["environment"]["constant"]["radiance"], 1.0)
    background.inputs["Strength"].default_value = 1.0
    context.scene.world = made
    # Blender's figure has one color behind everything: that of the state, or the middle of the one that a figure has.
    behind, figure = scene["film"]["background"], context.scene.pumice_figure
    if behind is not None:
        figure.backdrop = label_table.linear_from_srgb(np.array(behind))
    else:
        figure.backdrop = np.mean(scene["world"]["backdrop"], axis=0)
    figure.use_backdrop = True
    context.scene.view_settings.view_transform = "Standard"


def _camera(context, scene, made):
    """A camera that sees what that of a scene sees, through which the viewports look."""
    said = scene["camera"]
    data = bpy.data.cameras.new(NAME)
    [(kind, values)] = said["projection"].items()
    data.sensor_fit = said["fit"].upper()
    if kind == "perspective":
        data.lens = 0.5 * data.sensor_height / math.tan(values["fov_rad"] / 2.0)
    else:
        data.type, data.ortho_scale = "ORTHO", values["scale"]
    obj = bpy.data.objects.new(NAME, data)
    obj.matrix_world = Matrix(matrix.from_twelve(said["world_from_camera"]))
    context.collection.objects.link(obj)
    context.scene.camera = obj
    corners = np.array([tuple(corner) for one in made for corner in volume_object.bounds(one)])
    centre = Vector((corners.min(axis=0) + corners.max(axis=0)) / 2.0)
    radius = float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0))) / 2.0
    data.clip_start, data.clip_end = first_look.clip_range((obj.matrix_world.translation - centre).length, radius)
    first_look.look_through_camera(context)


def _menu_entry(self, _context):
    self.layout.operator(PUMICE_OT_import_state.bl_idname, text="Neuroglancer State (Pumice)")


def register():
    bpy.utils.register_class(PUMICE_OT_import_state)
    bpy.types.TOPBAR_MT_file_import.append(_menu_entry)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(_menu_entry)
    bpy.utils.unregister_class(PUMICE_OT_import_state)
