# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The dialog of the import: what the headers of the files say, and menus for what they leave open.

The operator opens the file browser, or the dialog at once if files were dropped or a URL is given. After the browser a second call of the operator opens the dialog,
because one call cannot have both. Only headers are read for it, once for each set of answers.

Scripts set the properties themselves and see no dialog.
"""

import os
import textwrap

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatVectorProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from . import cache, file_facts, file_series, native, online_access, opening, registry, time_settings
from .reports import Refused
from .time_steps import Playback

AXES = (
    ("file", "As the File Says", "Arrays of NumPy, and plain ones of Zarr and HDF5, do not say which axis is which, nor do some TIFF files; a warning tells what is assumed", 0),
    ("xyz", "X, Y, Z", "An array a[x, y, z], as of nibabel and pynrrd. The wrong order mirrors the volume", 1),
    ("zyx", "Z, Y, X", "An array a[z, y, x], as of tifffile, scikit-image and napari. The wrong order mirrors the volume. Pages of a TIFF file are slices", 2),
    *(
        (name, ", ".join(name.upper()), "What the pages of a TIFF file are, slowest first: Z slices, T time steps, C channels", 3 + number)
        for number, name in enumerate(
            ("tyx", "cyx", "tzyx", "ztyx", "czyx", "zcyx", "tcyx", "ctyx", "tczyx", "tzcyx", "ctzyx", "cztyx", "ztcyx", "zctyx")
        )
    ),
)
NAMES = {
    "dataset": "Data Set",
    "label": "Label Image",
    "scale": "Level",
    "layer": "Layer",
    "time": "Time Step",
    "channel": "Channel",
    "array": "Array",
}
# Choices whose answer is a text; those of the others are numbers.
TEXTS = ("array", "dataset", "label")
# The dialog in pixels at a scale of 1, and the letters that fit into one of its lines.
DIALOG_PIXELS = 460
LINE_LETTERS = 70

# The headers that the open dialog shows; menus of properties find them here, because their callbacks do not get the operator.
_facts = file_facts.Facts([])


def _menu(keyword):
    """A menu for a choice; it sets the property of this keyword, which scripts set themselves."""

    def at(properties):
        values = [item[0] for item in _facts.menu(keyword)]
        chosen = file_facts.ALL if keyword == "time" and properties.time_steps else str(getattr(properties, keyword))
        return values.index(chosen) if chosen in values else 0

    def choose(properties, number):
        value = _facts.menu(keyword)[number][0]
        if keyword == "time":
            properties.time_steps = value if value == file_facts.ALL else ""
        if value != file_facts.ALL:
            setattr(properties, keyword, value if keyword in TEXTS else int(value))

    return EnumProperty(
        name=NAMES[keyword],
        description="Which of the volumes in the file is read",
        items=lambda properties, context: _facts.menu(keyword),
        get=at,
        set=choose,
        options={"SKIP_SAVE", "HIDDEN"},
    )


def _store_of(path):
    """The folder of a store whose description was chosen, since the file browser chooses files; any other path as it is."""
    folder, name = os.path.split(path)
    return folder if name in file_facts.DESCRIPTIONS and os.path.isfile(path) else path


class ImportDialog(ImportHelper):
    """Files, how they are read, and the dialog that asks for it. The operator says what else it asks by `draw_options(context, layout)`."""

    # Without SKIP_SAVE the file of the last import would look like one that was dropped.
    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE", "HIDDEN"})
    directory: StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE", "HIDDEN"})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"SKIP_SAVE", "HIDDEN"})

    use_spacing: BoolProperty(
        name="Own Voxel Size", description="Set the size of a voxel, for files that state none or a wrong one", default=False
    )
    spacing: FloatVectorProperty(
        name="Voxel Size", description="Size of a voxel along x, y and z", size=3, min=0.0, default=(1.0, 1.0, 1.0)
    )
    layer: IntProperty(
        name="Layer", description="Layer to read, if the file has several; -1 if it has one", min=-1, default=-1, options={"SKIP_SAVE"}
    )
    time: IntProperty(
        name="Time Step", description="Time step to read, if the file has several; -1 if it has one", min=-1, default=-1, options={"SKIP_SAVE"}
    )
    time_steps: StringProperty(
        name="Time Steps",
        description=(
            "Time steps to read as one volume that follows the scene's frame, if the file has several: all, or the first and the last, counted from 0, "
            "such as 0-19; empty reads one"
        ),
        default="",
        options={"SKIP_SAVE"},
    )
    use_sequence: BoolProperty(
        name="As Time Series",
        description=(
            "Read the files as the time steps of one volume that follows the scene's frame, in the order of the numbers in their names; of one file, "
            "those whose names differ from it in the last number"
        ),
        default=False,
        options={"SKIP_SAVE"},
    )
    channel: IntProperty(
        name="Channel", description="Channel to read, if the file has several; -1 if it has one", min=-1, default=-1, options={"SKIP_SAVE"}
    )
    array: StringProperty(
        name="Array", description="Array to read, if the file has several; empty if it has one", default="", options={"SKIP_SAVE"}
    )
    dataset: StringProperty(
        name="Data Set", description="Data set to read, if the file or folder has several; empty if it has one", default="", options={"SKIP_SAVE"}
    )
    label: StringProperty(
        name="Label Image", description="Label image to read, if the picture has several; empty if it has one", default="", options={"SKIP_SAVE"}
    )
    scale: IntProperty(
        name="Level", description="Level of detail to read, if the volume has several, 0 the finest; -1 if it has one", min=-1, default=-1, options={"SKIP_SAVE"}
    )
    roi: StringProperty(
        name="Region",
        description="Read only these voxels, X0:X1,Y0:Y1,Z0:Z1, such as 0:512,100:200,: for large volumes; empty reads all",
        default="",
        options={"SKIP_SAVE"},
    )
    relabel: StringProperty(
        name="Join Ids",
        description="Table of pairs supervoxel, segment, CSV, TSV or .npy: what has the first id gets the second while the volume is read",
        subtype="FILE_PATH",
        default="",
        options={"SKIP_SAVE"},
    )
    axes: EnumProperty(name="Axes", description="Order of the axes of an array whose file does not say it, or what the pages of a TIFF file are", items=AXES, default="file", options={"SKIP_SAVE"})
    layer_menu: _menu("layer")
    time_menu: _menu("time")
    channel_menu: _menu("channel")
    array_menu: _menu("array")
    dataset_menu: _menu("dataset")
    label_menu: _menu("label")
    scale_menu: _menu("scale")

    _browsing = False
    _counted = None
    asked = False

    def invoke(self, context, event):
        # A script that calls the operator waits for it; a user does not.
        self._interactive = True
        if not self.properties.is_property_set("filepath") and not self.files:
            self._browsing = True
            context.window_manager.fileselect_add(self)
            return {"RUNNING_MODAL"}
        try:
            online_access.check(self.paths())
            self.ask()
        except Exception as error:
            return self.refused(error)
        names = [cache.base_name(path) for path in _facts.paths]
        title = names[0] if len(names) == 1 else f"Import {len(names)} Volumes"
        manager = context.window_manager
        return manager.invoke_props_dialog(self, width=DIALOG_PIXELS, title=title, confirm_text="Import", translate=False)

    def ask(self):
        """Reads the headers, and sets what they leave open to the first answer where it is not set."""
        global _facts
        kept = {}

        def is_kept(path, choice):
            # Asked at each drawing, and the files of a store are counted for it.
            key = path, self.use_sequence, repr(sorted(choice.items()))
            if key not in kept:
                if self.use_sequence:
                    choice = choice | {"files": [os.path.basename(file) for file in self.files_of_series()]}
                kept[key] = cache.existing(cache.candidates(path, choice, volumes_folder())) is not None
            return kept[key]

        _facts = file_facts.Facts(self.paths(), is_kept)
        self.asked = True
        time = _facts.open_choice("time")
        if time is not None and self.time < 0 and not self.time_steps and time.get("is_series"):
            # A compressed series was made to be one; a file of another program may have slices that were saved as time steps.
            self.time_steps = file_facts.ALL
        for keyword in ("layer", "time", "channel", "scale"):
            if getattr(self, keyword) < 0 and _facts.open_choice(keyword) is not None:
                setattr(self, keyword, 0)
        for keyword in TEXTS:
            if not getattr(self, keyword) and _facts.menu(keyword):
                setattr(self, keyword, _facts.menu(keyword)[0][0])
        axes = _facts.open_choice("axes")
        if self.axes == "file" and axes is not None:
            self.axes = axes["assumed"]

    def execute(self, context):
        return self._open_dialog(context) if self._browsing else super().execute(context)

    def choice_of(self, path):
        """How a file is read: keywords of `pumice.compress`. In the dialog a file gets only the answers to what it leaves open."""
        choice = self._choice()
        if min(choice.get("spacing", (1.0,))) <= 0.0:
            raise Refused("Voxel Size: expected three lengths above 0")
        return _facts.answers_for(path, choice) if self.asked else choice

    def wanted(self, scene):
        """What is opened: `opening.Wanted` for each volume."""
        played, frame = Playback(start=scene.frame_start, duration=0), time_settings.now(scene)
        chosen = [(path, self.choice_of(path)) for path in self.paths()]
        if self.use_sequence:
            files = self.files_of_series()
            chosen = [(files[0], self.choice_of(files[0]) | {"files": [os.path.basename(file) for file in files]})]
        memory = registry.page_memory()
        return [opening.Wanted(path, choice, volumes_folder(), played, frame, memory) for path, choice in chosen]

    def files_of_series(self):
        """The files that `use_sequence` makes one volume of, in the order of their numbers. Raises Refused where there is only one."""
        paths = self.paths()
        files = file_series.ordered(paths) if len(paths) > 1 else file_series.siblings(paths[0])
        if len(files) < 2:
            raise Refused(f"{paths[0]}: As Time Series: no other file differs from it in the last number of its name")
        if len({os.path.dirname(file) for file in files}) > 1:
            raise Refused("As Time Series: the files are in different folders")
        return files

    def check(self, _context):
        """Whether the dialog is drawn again after a change: an answer may change what the file says."""
        return True

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        if self._browsing:
            layout.label(text="A dialog follows with what the files say")
            return
        self._draw_facts(layout)
        if len(_facts.paths) > 1 or self._siblings() > 1:
            count = len(_facts.paths) if len(_facts.paths) > 1 else self._siblings()
            layout.prop(self, "use_sequence", text=f"As Time Series of {count} Files")
        column = layout.column(heading="Voxel Size")
        column.prop(self, "use_spacing", text="")
        if self.use_spacing:
            column.prop(self, "spacing", text="Size")
        column = layout.column(heading="Part")
        column.prop(self, "roi")
        column.prop(self, "relabel")
        self.draw_options(context, layout)

    # Inside

    def _draw_facts(self, layout):
        column = layout.box().column(align=True)
        for text, is_warning in _facts.lines(self._choice()):
            # Blender does not wrap labels.
            for place, line in enumerate(textwrap.wrap(text, LINE_LETTERS)):
                column.label(text=line, icon="ERROR" if is_warning and place == 0 else "BLANK1" if is_warning else "NONE")
        for keyword in NAMES:
            choice = _facts.open_choice(keyword)
            if choice is not None:
                fits = keyword in TEXTS or choice["count"] <= file_facts.MOST_IN_MENU
                layout.prop(self, f"{keyword}_menu" if fits else keyword, text=NAMES[keyword])
                if keyword == "time" and (self.time_steps or not fits):
                    layout.prop(self, "time_steps")
        if _facts.open_choice("axes") is not None:
            # Buttons have no place for a name in a split layout.
            split = layout.split(factor=0.4)
            name = split.row()
            name.alignment = "RIGHT"
            name.label(text="Axes")
            row = split.row(align=True)
            row.use_property_split = False
            for order in _facts.open_choice("axes")["values"]:
                row.prop_enum(self, "axes", order["value"])

    def _open_dialog(self, context):
        """Opens the dialog for the files of the file browser, once the browser is closed."""
        self._browsing = False
        open_later(context, bpy.ops.pumice.import_volume, filepath=self.filepath, directory=self.directory, files=[{"name": f.name} for f in self.files])
        return {"CANCELLED"}

    def paths(self):
        """Absolute paths of the files, or the URL."""
        if native.is_on_server(self.filepath.strip()):
            return [self.filepath.strip()]
        names = [f.name for f in self.files if f.name]
        paths = [os.path.join(self.directory, n) for n in names] if self.directory and names else [self.filepath]
        return [_store_of(os.path.abspath(bpy.path.abspath(p))) for p in paths]

    def _choice(self):
        choice = {n: getattr(self, n) for n in ("layer", "time", "channel", "scale") if getattr(self, n) >= 0}
        choice |= {n: getattr(self, n) for n in (*TEXTS, "roi", file_facts.TIME_STEPS) if getattr(self, n)}
        if file_facts.TIME_STEPS in choice:
            choice.pop("time", None)
        if self.relabel:
            choice["relabel"] = os.path.abspath(bpy.path.abspath(self.relabel))
        if self.axes != "file":
            choice["axes"] = self.axes
        if self.use_spacing:
            choice["spacing"] = tuple(self.spacing)
        return choice

    def _siblings(self):
        """Number of files whose names differ from that of the only file in one number; asked once, since the dialog is drawn often."""
        if self._counted is None:
            self._counted = len(file_series.siblings(_facts.paths[0]))
        return self._counted


def open_later(context, operator, **chosen):
    """Opens the dialog of an operator for files or a URL, once the operator that asked for them has ended."""
    where = {"window": context.window, "area": context.area, "region": context.region}

    def show():
        if where["window"] in list(bpy.context.window_manager.windows):
            with bpy.context.temp_override(**{name: value for name, value in where.items() if value is not None}):
                operator("INVOKE_DEFAULT", **chosen)

    bpy.app.timers.register(show, first_interval=0.0)


def draw_scene_options(operator, context, layout):
    """Draws what an import does to its scene, or that a scene with a volume stays as it is."""
    if any(o.pumice.filepath for o in context.scene.objects):
        layout.label(text="Engine, light, camera and viewports stay as they are")
        return
    column = layout.column(heading="Scene")
    column.prop(operator, "use_engine")
    column.prop(operator, "use_light")
    column.prop(operator, "use_camera")


def volumes_folder():
    """The extension's own folder for compressed volumes."""
    return bpy.utils.extension_path_user(__package__, path="volumes", create=False)
