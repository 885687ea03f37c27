# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the import with real files: order of axes, the dialog, several files at once, and what a further import leaves alone.

numpy's indices are the oracle of the order of axes, matrices in the files that of places.
"""

import importlib
import json
import types

import bpy
import numpy as np
import pumice
import pytest
from mathutils import Matrix, Vector

from test_real_volumes import exr

# Sizes that all differ, and a label of its own in each voxel that has one: any other order of axes, and any mirror, shows.
DIMS = (5, 4, 3)


def some_labels():
    """array[x, y, z] with holes, so that the view from above sees different depths."""
    array = np.arange(1, 61, dtype=np.uint16).reshape(DIMS)
    array[np.random.default_rng(4).random(DIMS) < 0.45] = 0
    return array


def nrrd(path, array, directions, origin, unit):
    """Writes an array[x, y, z] with a matrix from centres of voxels to the world."""
    vectors = " ".join(f"({','.join(map(str, v))})" for v in directions)
    lines = ["NRRD0004", "type: uint16", "dimension: 3", "space: left-posterior-superior", f"sizes: {' '.join(map(str, array.shape))}"]
    lines += [f"space directions: {vectors}", f"space origin: ({','.join(map(str, origin))})", f'space units: "{unit}" "{unit}" "{unit}"']
    path.write_bytes(("\n".join([*lines, "endian: little", "encoding: raw"]) + "\n\n").encode() + array.astype("<u2").tobytes(order="F"))
    return path


def volumes():
    return [o for o in bpy.context.scene.objects if o.pumice.filepath]


def imported(*paths, **options):
    """The objects that an import of these files makes, in their order."""
    before = set(volumes())
    files = [{"name": path.name} for path in paths]
    assert bpy.ops.pumice.import_volume(directory=str(paths[0].parent), files=files, **options) == {"FINISHED"}
    bpy.context.view_layer.update()
    made = {o.pumice.source_path: o for o in volumes() if o not in before}
    assert len(made) == len(paths)
    return [made[str(path)] for path in paths]


def place_of(obj, index):
    return np.array(obj.matrix_world @ Vector(index))


def drawn_labels(folder):
    """The ids that a camera above sees, [x, y]: the picture has eight pixels a voxel, and those in the middle of each are taken."""
    scene = bpy.context.scene
    camera = scene.camera
    camera.data.type, camera.data.ortho_scale = "ORTHO", place_of(bpy.context.object, DIMS)[0] - place_of(bpy.context.object, (0, 0, 0))[0]
    camera.matrix_world = Matrix.Translation((0.0, 0.0, 50.0))
    camera.data.clip_end = 100.0
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 8 * DIMS[0], 8 * DIMS[1], 100
    scene.pumice.samples, scene.pumice.bounces, scene.pumice.backend = 1, 0, "CPU"
    bpy.context.view_layer.pumice.use_pass_label = True
    if bpy.app.version >= (5, 0, 0):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format, render.filepath = "OPEN_EXR_MULTILAYER", str(folder / "a.exr")
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    rows = exr(folder / "a.exr")["Label.X"].astype(int)
    ids = np.concatenate([[0], pumice.open(bpy.context.object.pumice.filepath).labels.ids.astype(int)])
    # Row 0 of the picture is at the top, where y is largest.
    return ids[rows[::-1][4::8, 4::8]].T


def seen_from_above(array):
    """The label with the largest z over each (x, y)."""
    return np.array([[next((int(v) for v in column[::-1] if v), 0) for column in sheet] for sheet in array])


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("ending", ["npy", "npz"])
def test_an_array_of_napari_is_drawn_as_numpy_indexes_it(blender, tmp_path, order, ending):
    array = some_labels()
    path = tmp_path / f"a.{ending}"
    stored = np.asarray(array.transpose(2, 1, 0), order=order)
    np.save(path, stored) if ending == "npy" else np.savez(path, labels=stored)
    (obj,) = imported(path, axes="zyx")
    assert tuple(obj.pumice.dims) == DIMS
    np.testing.assert_array_equal(pumice.open(obj.pumice.filepath).decode(), array)
    if (order, ending) != ("C", "npy"):
        return
    drawn = drawn_labels(tmp_path)
    np.testing.assert_array_equal(drawn, seen_from_above(array))
    # Controls: each mirror image, and the other end of z, would be convicted.
    assert not np.array_equal(drawn, seen_from_above(array[::-1])) and not np.array_equal(drawn, seen_from_above(array[:, ::-1]))
    assert not np.array_equal(drawn, seen_from_above(array[:, :, ::-1]))


def test_a_script_is_told_which_order_an_array_is_taken_in(blender, tmp_path, capfd):
    np.save(tmp_path / "a.npy", some_labels())
    (obj,) = imported(tmp_path / "a.npy")
    assert tuple(obj.pumice.dims) == DIMS
    assert "(5, 4, 3) is taken as xyz (give axes xyz or zyx)" in capfd.readouterr().out
    (again,) = imported(tmp_path / "a.npy", axes="xyz")
    assert "is taken as" not in capfd.readouterr().out
    np.testing.assert_array_equal(pumice.open(again.pumice.filepath).decode(), some_labels())


def test_files_that_say_their_axes_refuse_an_order_in_one_line(blender, tmp_path):
    path = nrrd(tmp_path / "a.nrrd", some_labels(), np.eye(3), (0, 0, 0), "nm")
    with pytest.raises(RuntimeError) as raised:
        bpy.ops.pumice.import_volume(filepath=str(path), axes="zyx")
    said = str(raised.value).strip()
    assert "NRRD files say which axis is which" in said and len(said.splitlines()) == 1 and "defect" not in said
    assert volumes() == [] and [p.name for p in tmp_path.iterdir()] == ["a.nrrd"]


def lit():
    """What an import may set up in a scene."""
    scene = bpy.context.scene
    spaces = [s for a in bpy.context.window.screen.areas for s in a.spaces if s.type == "VIEW_3D"]
    views = [(s.shading.type, s.shading.color_type, s.clip_start, s.clip_end, tuple(s.region_3d.view_location), s.region_3d.view_distance) for s in spaces]
    camera = scene.camera and (tuple(map(tuple, scene.camera.matrix_world)), scene.camera.data.clip_end)
    lights = sorted(o.name for o in scene.objects if o.type == "LIGHT")
    return scene.render.engine, views, camera, lights, scene.world and scene.world.name


def test_a_first_import_is_framed_lit_and_rendered_and_a_further_one_touches_nothing(blender, tmp_path):
    scene = blender.context.scene
    scene.world = None
    first = nrrd(tmp_path / "a.nrrd", some_labels(), np.eye(3), (0, 0, 0), "nm")
    second = nrrd(tmp_path / "b.nrrd", some_labels(), 1000 * np.eye(3), (9e4, 0, 0), "nm")
    empty = lit()
    imported(first)
    engine, views, camera, lights, world = lit()
    assert engine == "PUMICE" and views and all(v[0] == "RENDERED" for v in views)
    assert camera and lights == ["Pumice Sun"] and world
    # What a user changes stays as it is, whatever is imported next.
    scene.render.engine = "CYCLES"
    space = next(s for a in blender.context.window.screen.areas for s in a.spaces if s.type == "VIEW_3D")
    space.shading.type, space.region_3d.view_distance = "SOLID", 3.25
    blender.data.objects.remove(blender.data.objects["Pumice Sun"])
    before = lit()
    (obj,) = imported(second, placement="ALIGN")
    assert lit() == before != empty and obj == blender.context.view_layer.objects.active
    # In an empty scene, the options leave each of these to the user.
    for other in volumes():
        blender.data.objects.remove(other)
    imported(first, use_engine=False, use_light=False, use_camera=False)
    assert lit()[0] == "CYCLES" and lit()[1][0][0] == "SOLID" and lit()[2:] == before[2:]


def test_cube_and_light_of_the_startup_file_are_hidden_unless_they_were_touched(startup, tmp_path):
    path = nrrd(tmp_path / "a.nrrd", some_labels(), np.eye(3), (0, 0, 0), "nm")
    cube, light = startup.data.objects["Cube"], startup.data.objects["Light"]
    light.data.energy = 999.0
    imported(path)
    assert cube.hide_render and cube.hide_viewport and not light.hide_render
    startup.ops.wm.read_homefile(use_factory_startup=True)
    cube, light = startup.data.objects["Cube"], startup.data.objects["Light"]
    cube.location.x = 0.5
    imported(path)
    assert not cube.hide_render and light.hide_render and light.hide_viewport


TURNED = ((0, 0.02, 0), (-0.02, 0, 0), (0, 0, 0.04))


@pytest.mark.parametrize("placement", ["CENTER", "FILE", "ALIGN"])
def test_several_files_stand_where_their_matrices_say_with_one_scale(blender, tmp_path, placement):
    """The second file is in µm, turned, and beside the first, which is in nm."""
    array = some_labels()
    first = nrrd(tmp_path / "a.nrrd", array, np.diag((10, 10, 40)), (100, 200, 300), "nm")
    second = nrrd(tmp_path / "b.nrrd", array, TURNED, (0.5, 0.25, 0.1), "um")
    made = imported(first, second, placement=placement)
    # World of both in nm: corner of voxel (i, j, k) is that of its centre less half a voxel.
    matrices = [np.diag((10, 10, 40)), 1000 * np.array(TURNED).T]
    origins = [np.array((100, 200, 300)), 1000 * np.array((0.5, 0.25, 0.1))]
    corners = [(x, y, z) for x in (0, 5) for y in (0, 4) for z in (0, 3)]
    worlds = [np.array([matrix @ (np.array(c) - 0.5) + origin for c in corners]) for matrix, origin in zip(matrices, origins)]
    both = np.concatenate(worlds)
    scale = 10.0 / np.ptp(both, axis=0).max()
    middle = np.zeros(3) if placement == "FILE" else (both.min(axis=0) + both.max(axis=0)) / 2.0
    for obj, world in zip(made, worlds):
        got = np.array([place_of(obj, c) for c in corners])
        # Blender's matrices have single precision.
        np.testing.assert_allclose(got, scale * (world - middle), atol=1e-5)
    assert made[0].pumice.display_scale == pytest.approx(scale, rel=1e-6)
    assert made[1].pumice.display_scale == pytest.approx(1000 * scale, rel=1e-6)
    # A control: as if both were in the same unit, they would be apart.
    assert np.abs(worlds[1] / 1000 - worlds[1]).max() > 100
    from bpy_extras.object_utils import world_to_camera_view

    seen = [world_to_camera_view(bpy.context.scene, bpy.context.scene.camera, Vector(place_of(o, c))) for o in made for c in corners]
    assert all(0 < s.x < 1 and 0 < s.y < 1 for s in seen), "the camera frames both"


def test_of_several_files_all_or_none_are_imported_and_one_step_undoes_them(blender, tmp_path):
    good = nrrd(tmp_path / "a.nrrd", some_labels(), np.eye(3), (0, 0, 0), "nm")
    bad = tmp_path / "b.nrrd"
    bad.write_bytes(good.read_bytes()[:-1])
    with pytest.raises(RuntimeError, match="b.nrrd"):
        imported(good, bad)
    assert volumes() == []
    also = nrrd(tmp_path / "c.nrrd", some_labels(), np.eye(3), (0, 0, 0), "mm")
    blender.ops.ed.undo_push(message="before")
    imported(good, also)
    blender.ops.ed.undo_push(message="imported")
    blender.ops.ed.undo()
    assert volumes() == []
    blender.ops.ed.redo()
    assert len(volumes()) == 2


class Layout:
    """Records what a panel draws."""

    def __init__(self, log):
        self.log = log

    def label(self, text="", icon="NONE"):
        self.log.append(("label", text, icon))

    def prop(self, _owner, name, text=None):
        self.log.append(("prop", name, text))

    def prop_enum(self, _owner, name, value):
        self.log.append(("enum", name, value))

    def _part(self, **_):
        return Layout(self.log)

    box = column = row = split = _part


@pytest.fixture
def dialog(blender, extension):
    """A function that asks about files as the dialog does, and returns the dialog: its properties can be set, `drawn()` draws it."""
    load = lambda name: importlib.import_module(f"{extension.__name__}.{name}")  # noqa: E731
    asks, operator = load("import_dialog").ImportDialog, load("import_volume").PUMICE_OT_import_volume

    class Dialog:
        layer = time = channel = scale = -1
        dataset = label = roi = relabel = time_steps = ""
        use_sequence, _counted = False, None
        array, axes, use_spacing, spacing, _browsing, asked = "", "file", False, (1.0, 1.0, 1.0), False, False
        ask, paths, choice_of, _choice, _draw_facts, draw, wanted, files_of_series, _siblings = (
            vars(asks)[name]
            for name in ("ask", "paths", "choice_of", "_choice", "_draw_facts", "draw", "wanted", "files_of_series", "_siblings")
        )
        draw_options = operator.draw_options

        def __init__(self, *files):
            self.directory, self.filepath = str(files[0].parent), str(files[0])
            self.files = [types.SimpleNamespace(name=f.name) for f in files]
            self.ask()

        def drawn(self):
            self.layout = Layout([])
            self.draw(bpy.context)
            return self.layout.log

        def lines(self, warnings=False):
            """Labels of the box, without Blender's icons."""
            return [text for kind, text, icon in self.drawn() if kind == "label" and (icon != "NONE") == warnings]

        def asked_for(self):
            return {entry[1] for entry in self.drawn() if entry[0] in ("prop", "enum")} & {
                "layer", "time", "channel", "axes", "layer_menu", "time_menu", "channel_menu", "array_menu",
                "dataset_menu", "label_menu", "scale_menu", "time_steps", "use_sequence",
            }  # fmt: skip

    return Dialog


def store(folder, array):
    """Writes an array[x, y, z] as a Neuroglancer volume of two levels, the second every other voxel along x, with a chunk each."""
    folder.mkdir()
    scales = []
    for key, part, resolution in [("fine", array, [4, 4, 40]), ("coarse", array[::2], [8, 4, 40])]:
        chunk = {"chunk_sizes": [[64, 64, 64]], "encoding": "raw"}
        scales.append({"key": key, "size": part.shape, "resolution": resolution, "voxel_offset": [0, 0, 0]} | chunk)
        (folder / key).mkdir()
        (folder / key / "_".join(f"0-{n}" for n in part.shape)).write_bytes(part.astype("<u2").tobytes(order="F"))
    (folder / "info").write_text(json.dumps({"type": "segmentation", "data_type": "uint16", "num_channels": 1, "scales": scales}))
    return folder


def test_a_store_is_imported_by_its_folder_and_by_the_file_that_describes_it(dialog, tmp_path):
    folder = store(tmp_path / "a.precomputed", some_labels())
    shown = dialog(folder)
    assert shown.asked_for() == {"scale_menu"} and shown.scale == 0 and shown.lines()[0] == "5 × 4 × 3 voxels of u16, each 4 × 4 × 40 nm"
    shown.scale = 1
    assert shown.lines()[0].startswith("3 × 4 × 3 voxels")
    shown.roi = "0:2,1:,:"
    assert shown.lines()[0].startswith("2 × 3 × 3 voxels")
    shown.roi = "0:9,:,:"
    assert "outside the volume" in " ".join(shown.lines(warnings=True))
    (whole,) = imported(folder, scale=0)
    assert np.array_equal(pumice.open(whole.pumice.filepath).decode(), some_labels())
    part = some_labels()[::2][0:2, :, 1:]
    joined = part.max()
    (tmp_path / "pairs.csv").write_text(f"{joined},7\n")
    assert bpy.ops.pumice.import_volume(
        filepath=str(folder / "info"), scale=1, roi="0:2,:,1:", relabel=str(tmp_path / "pairs.csv")
    ) == {"FINISHED"}  # fmt: skip
    obj = bpy.context.view_layer.objects.active
    assert obj.pumice.source_path == str(folder)
    assert np.array_equal(pumice.open(obj.pumice.filepath).decode(), np.where(part == joined, 7, part))
    # Other pairs are another volume, and so is a changed chunk.
    cache = importlib.import_module(dialog.draw_options.__module__.rsplit(".", 1)[0] + ".cache")
    choice = {"relabel": str(tmp_path / "pairs.csv")}
    names = [cache.file_name(str(folder), choice)]
    (tmp_path / "pairs.csv").write_text(f"{joined},77\n")
    names.append(cache.file_name(str(folder), choice))
    (folder / "fine" / "0-5_0-4_0-3").write_bytes(b"")
    names.append(cache.file_name(str(folder), choice))
    assert len(set(names)) == 3


def test_what_reading_the_voxels_finds_is_a_warning(blender, tmp_path, capfd):
    folder = store(tmp_path / "a.precomputed", some_labels())
    (folder / "fine" / "0-5_0-4_0-3").unlink()
    imported(folder, scale=0)
    assert "Warning: " in (said := capfd.readouterr().out) and "are taken as 0" in said
    assert "Pumice" not in capfd.readouterr().err


def test_a_damaged_compressed_form_says_what_it_is(blender, tmp_path):
    np.save(tmp_path / "cells.npy", some_labels())
    imported(tmp_path / "cells.npy", axes="xyz")
    (kept,) = tmp_path.glob("cells-*.pumice")
    kept.write_bytes(kept.read_bytes()[:-100])
    for obj in volumes():
        bpy.data.objects.remove(obj)
    importlib.import_module(next(name for name in __import__("sys").modules if name.endswith(".pumice.registry"))).forget_unused()
    with pytest.raises(RuntimeError, match=f"{kept.name}.*it is the compressed form of .*cells.npy: delete it, and it is made anew"):
        imported(tmp_path / "cells.npy", axes="xyz")
    kept.unlink()
    (obj,) = imported(tmp_path / "cells.npy", axes="xyz")
    np.testing.assert_array_equal(pumice.open(obj.pumice.filepath).decode(), some_labels())


def test_folders_of_stores_can_be_dropped(blender, extension):
    endings = importlib.import_module(f"{extension.__name__}.import_volume").PUMICE_FH_volume.bl_file_extensions.split(";")
    assert {".zarr", ".n5", ".precomputed", ".h5", ".nrrd"} <= set(endings)


def test_the_dialog_says_what_the_header_says_and_asks_what_it_leaves_open(dialog, tmp_path):
    np.savez(tmp_path / "a.npz", cells=np.ones((50, 40, 30), np.uint32), nuclei=np.ones((20, 10), np.uint8), factor=np.ones(3))
    shown = dialog(tmp_path / "a.npz")
    assert (shown.array, shown.axes) == ("cells", "xyz") and shown.asked_for() == {"array_menu", "axes"}
    facts = shown.lines()
    assert facts[0] == "50 × 40 × 30 voxels of u32, each 1 × 1 × 1 (no unit)" and facts[1] == "NPZ, raw; 0.24 MB of voxels"
    assert facts[2].startswith("Compressing takes about 50.4 MB")
    assert shown.lines(warnings=True) == ["NumPy arrays have no spacing; 1 is assumed along each axis"]
    # The answers are read with the header again.
    shown.axes = "zyx"
    assert shown.lines()[0].startswith("30 × 40 × 50 voxels")
    shown.array = "nuclei"
    assert shown.lines()[0].startswith("10 × 20 × 1 voxels of u8")
    shown.use_spacing, shown.spacing = True, (2.0, 3.0, 4.5)
    assert "each 2 × 3 × 4.5" in shown.lines()[0] and shown.lines(warnings=True) == []


def test_the_dialog_knows_directions_units_and_what_was_compressed_before(dialog, tmp_path, data):
    path = nrrd(tmp_path / "a.nrrd", some_labels(), ((0, 2, 0), (0, 0, -2), (-2.5, 0, 0)), (0, 0, 0), "um")
    shown = dialog(path)
    assert shown.lines()[:2] == ["5 × 4 × 3 voxels of u16, each 2 × 2 × 2.5 µm", "PIR: x, y and z run to posterior, inferior, right"]
    assert shown.asked_for() == set() and "Compressed before: opens at once" not in shown.lines()
    imported(path)
    assert "Compressed before: opens at once" in dialog(path).lines()
    assert "Engine, light, camera and viewports stay as they are" in dialog(path).lines()
    # A compressed volume is not read for the dialog, and asks nothing.
    (own,) = tmp_path.glob("a-*.pumice")
    assert dialog(own).lines()[0] == "compressed volume of 0.1 MB, opened as it is" and dialog(own).asked_for() == set()
    layers = dialog(data / "slicer_SegmentationOverlapping.seg.nrrd")
    assert layers.asked_for() == {"layer_menu"} and layers.layer == 0


def test_what_cannot_be_read_is_a_warning_in_the_dialog(dialog, tmp_path):
    path = tmp_path / "a.nrrd"
    path.write_bytes(b"NRRD0004\ntype: block\n\n")
    (line, *_) = dialog(path).lines(warnings=True)
    assert line.startswith("type:") or "block" in line
    assert "No such file" in " ".join(dialog(tmp_path / "none.nrrd").lines(warnings=True))


def test_each_of_several_files_gets_the_answers_to_what_it_leaves_open(dialog, tmp_path):
    np.save(tmp_path / "a.npy", some_labels().transpose(2, 1, 0))
    path = nrrd(tmp_path / "b.nrrd", some_labels(), np.eye(3), (0, 0, 0), "nm")
    shown = dialog(tmp_path / "a.npy", path)
    shown.axes = "zyx"
    assert shown.choice_of(str(tmp_path / "a.npy")) == {"axes": "zyx"} and shown.choice_of(str(path)) == {}
    assert [line.split(" voxels")[0] for line in shown.lines()[:2]] == ["a.npy: 5 × 4 × 3", "b.nrrd: 5 × 4 × 3"]
    # A control: a script that gives both files the order is refused.
    with pytest.raises(RuntimeError, match="NRRD files say"):
        imported(tmp_path / "a.npy", path, axes="zyx")
    many = [nrrd(tmp_path / f"{i}.nrrd", some_labels(), np.eye(3), (0, 0, 0), "nm") for i in range(11)]
    assert "and 3 more files" in dialog(*many).lines()


def test_a_menu_has_a_line_for_each_volume_in_the_file(blender, extension, data, tmp_path):
    facts = importlib.import_module(f"{extension.__name__}.file_facts")
    layers = facts.Facts([str(data / "slicer_SegmentationOverlapping.seg.nrrd")])
    assert [(v, number) for v, _, _, number in layers.menu("layer")] == [("0", 0), ("1", 1)]
    assert layers.menu("layer")[1][1] == "1: overlapping sphere" and layers.menu("layer") is layers.menu("layer")
    assert layers.menu("time") == [] and layers.open_choice("axes") is None


def test_a_menu_sets_what_a_script_sets(dialog, data, tmp_path):
    imported(nrrd(tmp_path / "a.nrrd", some_labels(), np.eye(3), (0, 0, 0), "nm"))
    properties = bpy.context.window_manager.operator_properties_last("pumice.import_volume")
    dialog(data / "slicer_SegmentationOverlapping.seg.nrrd")
    properties.layer_menu = "1"
    assert properties.layer == 1
    properties.layer = 0
    assert properties.layer_menu == "0"
    np.savez(tmp_path / "a.npz", cells=some_labels(), other=np.ones((2, 2, 2), np.uint8))
    dialog(tmp_path / "a.npz")
    properties.array_menu = "other"
    assert properties.array == "other"


def test_lengths_without_a_unit_are_taken_in_that_of_the_others_and_it_is_said(blender, tmp_path, capfd):
    told = "Some of the files state no unit"
    first = nrrd(tmp_path / "a.nrrd", some_labels(), np.eye(3), (0, 0, 0), "nm")
    second = nrrd(tmp_path / "b.nrrd", some_labels(), np.eye(3), (9, 0, 0), "um")
    unknown = nrrd(tmp_path / "c.nrrd", some_labels(), np.eye(3), (9, 0, 0), "")
    imported(first, second)
    assert told not in capfd.readouterr().out
    made = imported(first, unknown)
    assert told in capfd.readouterr().out
    assert made[0].pumice.display_scale == made[1].pumice.display_scale
    np.testing.assert_allclose(place_of(made[1], (0, 0, 0)) - place_of(made[0], (0, 0, 0)), (9 * made[0].pumice.display_scale, 0, 0), atol=1e-5)


def test_the_answers_of_the_dialog_are_what_a_script_gives(dialog, tmp_path):
    np.savez(tmp_path / "a.npz", cells=some_labels(), other=np.ones((2, 2, 2), np.uint8))
    with pytest.raises(RuntimeError, match="choose one with array="):
        imported(tmp_path / "a.npz")
    answers = dialog(tmp_path / "a.npz").choice_of(str(tmp_path / "a.npz"))
    assert answers == {"array": "cells", "axes": "xyz"}
    (obj,) = imported(tmp_path / "a.npz", **answers)
    np.testing.assert_array_equal(pumice.open(obj.pumice.filepath).decode(), some_labels())


def test_pick_and_table_apply_to_the_import(blender, extension, data, tmp_path):
    source = tmp_path / "a.nrrd"
    source.write_bytes((data / "slicer_Segmentation.seg.nrrd").read_bytes())
    ids = pumice.open(source).labels.ids
    (tmp_path / "t.csv").write_text("id,name\n" + "".join(f"{i},cell {i}\n" for i in ids))
    (obj,) = imported(source, pick=2, table=str(tmp_path / "t.csv"))
    table = importlib.import_module(f"{extension.__name__}.label_table")
    assert table.visible(obj.pumice.table).sum() == 2 and table.names(obj.pumice.table) == [f"cell {i}" for i in ids]
