# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the Memory Limit of the preferences with the real module: import, F12, viewport and picking draw from disk, with the pixels of a volume in
memory; what cannot is one line."""

import gc
import re
import shutil
import time

import bpy
import numpy as np
import pumice
import pytest

import measure_memory
from stand_ins import Engine
from test_real_volumes import exr, imported, load, settle, viewport_of

SIZE = (48, 32)
SPP = 9
# MiB of the least limit that is tried; what suffices depends on the number of threads.
TOO_SMALL = 1


@pytest.fixture(scope="module")
def bodies(tmp_path_factory):
    """A file with the noise of 200 labels, in 48 pages of 64³ voxels."""
    path = tmp_path_factory.mktemp("bodies") / "bodies.pumice"
    pumice.compress(noise((256, 256, 192), 0.03, 200)).save(path)
    return path


@pytest.fixture(scope="module")
def enough(bodies):
    """MiB that suffice for the volume, as the refusal of fewer says, with those of another session beside."""
    scene = pumice.figure(pumice.open(bodies), size=SIZE)
    with pytest.raises(pumice.InputError, match="are needed") as raised:
        pumice.render(scene, memory_limit=TOO_SMALL << 20, spp=1)
    least = int(re.search(r"(\d+) are needed", str(raised.value))[1])
    return 2 * -(-least // (1 << 20))


def noise(shape, density, labels):
    """Voxels of that share, each with one of so many labels."""
    rng = np.random.default_rng(5)
    chosen = rng.integers(1, labels + 1, shape).astype(np.uint16)
    chosen[rng.random(shape, dtype=np.float32) > density] = 0
    return chosen


@pytest.fixture
def limit(blender, extension):
    """A function that sets the preference in MiB, which is 0 again after the test."""
    import addon_utils

    addon_utils.enable(extension.__name__, default_set=True, persistent=True)
    kept = bpy.context.preferences.addons[extension.__name__].preferences

    def set_limit(mib):
        kept.memory_limit = mib
        return kept

    yield set_limit
    kept.memory_limit, kept.backend = 0, "auto"
    load(extension, "viewport").close_all()
    load(extension, "registry")._entries.clear()


def staged(path, **options):
    """The scene with an imported volume, to be rendered in a moment."""
    obj, scene = imported(bpy, path, **options), bpy.context.scene
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *SIZE, 100
    scene.pumice.samples, scene.pumice.viewport_samples, scene.pumice.bounces, scene.pumice.seed = SPP, SPP, 3, 7
    scene.pumice.backend = "CPU"
    if bpy.app.version >= (5, 0, 0):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    render.image_settings.color_depth = "32"
    bpy.context.view_layer.pumice.use_pass_label = True
    return scene, obj


def f12(scene, path):
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    channels = exr(path)
    return np.stack([channels[name] for name in ("Combined.R", "Combined.G", "Combined.B", "Label.X")], axis=2)


def open_volume(extension):
    [entry] = load(extension, "registry")._entries.values()
    return entry.volume


def open_memory(extension):
    """The memory that all open volumes share."""
    [memory] = {entry.volume.memory for entry in load(extension, "registry")._entries.values()}
    return memory


def hide_some(extension, obj):
    tables = load(extension, "label_table")
    table = obj.pumice.table
    tables.set_visible(table, tables.ids(table) % 3 > 0)
    obj.update_tag()


def test_f12_within_a_limit_has_the_same_pixels(limit, extension, bodies, enough, tmp_path):
    scene, obj = staged(bodies)
    assert open_volume(extension).memory is None
    whole = f12(scene, tmp_path / "a.exr")
    hide_some(extension, obj)
    fewer = f12(scene, tmp_path / "a.exr")
    assert np.ptp(whole[..., 0]) > 0.05 and not np.array_equal(whole, fewer)

    # The file is opened again, from disk.
    limit(enough)
    within = f12(scene, tmp_path / "a.exr")
    assert np.array_equal(within.view(np.uint32), fewer.view(np.uint32))
    volume = open_volume(extension)
    assert volume.memory.limit == enough << 20
    first = volume.memory.figures
    assert first.loads > 8 and 0 < first.most_bytes <= enough << 20, first
    load(extension, "label_table").set_visible(obj.pumice.table, [True] * 200)
    obj.update_tag()
    assert np.array_equal(f12(scene, tmp_path / "a.exr").view(np.uint32), whole.view(np.uint32))
    assert open_volume(extension) is volume and volume.memory.figures.loads > first.loads
    # Without a limit again nothing is drawn from disk.
    limit(0)
    assert np.array_equal(f12(scene, tmp_path / "a.exr").view(np.uint32), whole.view(np.uint32))
    assert open_volume(extension).memory is None and volume.memory.figures.loads > first.loads


def test_an_import_within_a_limit_makes_the_same_object(limit, extension, bodies, enough, tmp_path, monkeypatch):
    def facts(obj):
        tables = load(extension, "label_table")
        table, mesh = obj.pumice.table, obj.data
        settings = obj.pumice
        return (
            [tables.ids(table).tolist(), tables.colors(table).tolist(), settings.content_hash, settings.labels, tuple(settings.dims)],
            (len(mesh.vertices), len(mesh.polygons)),
        )

    expected = facts(imported(bpy, bodies))
    limit(enough)
    paged = imported(bpy, bodies, use_engine=False)
    assert facts(paged) == expected and len(paged.data.polygons) > 1000
    assert {entry.memory is None for entry in load(extension, "registry")._entries.values()} == {False}
    # A file in another format is compressed onto the disk, never in memory, and then opened like one that was there.
    monkeypatch.delattr(pumice, "compress")
    array = np.zeros((70, 40, 30), np.uint8)
    array[5:60, 5:30, 5:20] = 7
    np.save(tmp_path / "block.npy", array)
    obj = imported(bpy, tmp_path / "block.npy", axes="xyz")
    assert obj.pumice.labels == 1 and obj.pumice.filepath.endswith(".pumice")
    assert np.array_equal(pumice.open(obj.pumice.filepath).decode(), array)


@pytest.mark.turn(0, 2)
def test_the_viewport_obeys_the_limit_and_follows_edits(limit, extension, bodies, enough, monkeypatch):
    limit(enough)
    scene, obj = staged(bodies)
    engine = Engine()
    context, view = viewport_of(bpy, extension, monkeypatch, engine)
    pictures = []

    def check():
        frame = settle(bpy, view, context)
        drawn = np.array(np.asarray(frame)[::-1, :, :3])
        same = pumice.render(view.session.scene, [pumice.open(bodies)], spp=SPP, backend="cpu").color
        assert np.array_equal(drawn.view(np.uint32), same.view(np.uint32))
        pictures.append(drawn)

    check()
    session = view.session
    assert session.status.pages.limit_bytes == enough << 20 and session.status.pages.loads > 8
    hide_some(extension, obj)
    check()
    obj.active_material.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.9
    check()
    scene.camera.location.x += 0.5
    bpy.context.view_layer.update()
    context.look(scene.camera)
    check()
    assert all(not np.array_equal(a, b) for a, b in zip(pictures, pictures[1:])) and view.session is session
    # Labels under the pixels, for picking and outlines.
    film = load(extension, "label_film").of_viewport(view, 30.0)
    picked = [film.at(x, y) for x in range(0, SIZE[0], 4) for y in range(0, SIZE[1], 4)]
    assert sum(found is not None for found in picked) > 20
    # Another limit opens the volume again, and the former memory is given up.
    former = open_volume(extension).memory
    limit(enough + 1)
    check()
    assert np.array_equal(pictures[-1], pictures[-2]) and view.session.status.pages.limit_bytes == (enough + 1) << 20
    gc.collect()
    assert former.figures.pages == 0, former.figures


def test_labels_of_the_cameras_picture_are_found(limit, extension, bodies, enough):
    scene, _ = staged(bodies)
    film = load(extension, "label_film")
    film._forget()
    expected = film.of_camera(bpy.context).pixels.copy()
    limit(enough)
    film._forget()
    assert np.array_equal(film.of_camera(bpy.context).pixels, expected) and (expected[..., 1] > 0).any()
    assert open_volume(extension).memory.figures.loads > 0


def test_what_cannot_is_one_line(limit, extension, bodies, enough, monkeypatch, tmp_path):
    limit(enough)
    scene, obj = staged(bodies)
    scene.pumice.smooth_voxels = True
    way_out = "set Memory Limit in the extension's preferences to 0"
    with pytest.raises(RuntimeError, match="memory limit: smooth shading of voxels") as raised:
        f12(scene, tmp_path / "a.exr")
    assert way_out in str(raised.value) and "defect" not in str(raised.value)
    engine = Engine()
    context, view = viewport_of(bpy, extension, monkeypatch, engine)

    def line_of(text):
        for _ in range(2000):
            view.sync(context, bpy.context.evaluated_depsgraph_get())
            view.draw(context, bpy.context.evaluated_depsgraph_get())
            view.poll()
            if text in engine.line:
                return engine.line
            time.sleep(0.005)
        raise AssertionError(engine.line)

    said = line_of("memory limit: smooth shading")
    assert way_out in said and "\n" not in said and said.startswith("not shown")
    scene.pumice.smooth_voxels = False
    settle(bpy, view, context)
    assert "memory limit" not in engine.line

    # Light of labels; levels of detail by distance are drawn.
    shader = obj.active_material.node_tree.nodes["Principled BSDF"].inputs
    shader["Emission Color"].default_value, shader["Emission Strength"].default_value = (1, 1, 1, 1), 2.0
    assert way_out in line_of("emits light")
    shader["Emission Strength"].default_value = 0.0
    settle(bpy, view, context)
    scene.pumice.lod = "DISTANCE"
    settle(bpy, view, context)
    assert "memory limit" not in engine.line
    scene.pumice.lod = "VOXELS"
    settle(bpy, view, context)

    # A limit that is too small says which is not.
    view.close()
    limit(TOO_SMALL)
    context, view = viewport_of(bpy, extension, monkeypatch, engine)
    said = line_of("1048576 bytes are too few")
    limit(int(said.split("preferences to ")[1].split(" MiB")[0]))
    settle(bpy, view, context)
    with pytest.raises(RuntimeError, match="exact mesh needs whole volumes"):
        bpy.ops.pumice.make_exact_mesh()


def test_bad_values_are_refused(limit):
    preferences = limit(0)
    for value in ("many", 1.5, None, 1 << 40):
        with pytest.raises((TypeError, ValueError, OverflowError)):
            preferences.memory_limit = value
    # (Blender takes a number below the least one for that.)
    preferences.memory_limit = -5
    assert preferences.memory_limit == 0


@pytest.mark.full
def test_a_limit_bounds_what_blender_takes(extension, tmp_path):
    """Peaks of two processes that import and render the same volume, of five chunks, one of which is in memory while pages are made. Noise does not
    compress. The system decides what a process holds beyond what it asked for, so half of the volume's bytes is what is claimed."""
    pumice.compress(noise((128, 128, 5120), 0.1, 200)).save(tmp_path / "noise.pumice", level="fast")
    bytes_of_all = pumice.open(tmp_path / "noise.pumice").bytes_resident
    whole, within = (measure_memory.measured(tmp_path / "noise.pumice", mib, threads=2) for mib in (0, 16))
    assert whole["pixels"] == within["pixels"] and within["pages"]["loads"] > 100 and whole["pages"] is None
    grown = [one["peak"] - one["alone"] for one in (whole, within)]
    print(grown, bytes_of_all, whole, within)
    assert bytes_of_all > 40e6 and grown[0] - grown[1] > bytes_of_all / 2, (grown, bytes_of_all)


def test_a_time_series_within_a_limit_has_the_same_pixels(limit, extension, enough, tmp_path):
    """Each time step has labels and noise of its own, so a picture of another step is convicted."""
    steps = [np.roll(noise((128, 128, 96), 0.03 + 0.02 * step, 50), 40 * step, 0) for step in range(3)]
    pumice.compress_series(steps, tmp_path / "series.pumice")
    scene, obj = staged(tmp_path / "series.pumice", time_steps="all")
    assert obj.pumice_time.time_steps == 3

    def pictures():
        made = []
        for frame in (1, 3, 2):
            scene.frame_set(frame)
            made.append(f12(scene, tmp_path / "a.exr"))
        return made

    whole = pictures()
    assert len({picture.tobytes() for picture in whole}) == 3
    limit(enough)
    within = pictures()
    assert all(np.array_equal(a.view(np.uint32), b.view(np.uint32)) for a, b in zip(within, whole, strict=True))
    figures = open_memory(extension).figures
    assert figures.loads > 8 and 0 < figures.most_bytes <= enough << 20, figures
    hide_some(extension, obj)
    fewer = pictures()
    limit(0)
    assert all(np.array_equal(a.view(np.uint32), b.view(np.uint32)) for a, b in zip(pictures(), fewer, strict=True))
    assert not np.array_equal(fewer[0], whole[0])


@pytest.mark.turn(1, 2)
def test_reload_within_a_limit_shows_what_the_file_has_now(limit, extension, bodies, enough, tmp_path):
    path = tmp_path / "bodies.pumice"
    shutil.copyfile(bodies, path)
    limit(enough)
    scene, obj = staged(path)
    before = f12(scene, tmp_path / "a.exr")
    # Other voxels, and labels that are new.
    pumice.compress(noise((256, 256, 192), 0.05, 220)).save(path)
    assert bpy.ops.pumice.reload() == {"FINISHED"}
    after = f12(scene, tmp_path / "a.exr")
    assert open_volume(extension).memory.figures.loads > 8 and obj.pumice.labels == 220
    load(extension, "registry")._entries.clear()
    limit(0)
    assert np.array_equal(f12(scene, tmp_path / "a.exr").view(np.uint32), after.view(np.uint32))
    assert open_volume(extension).memory is None and not np.array_equal(before, after)
