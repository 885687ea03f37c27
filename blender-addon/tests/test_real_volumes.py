# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the extension with the real module and real volumes, as a user works: import, F12, export, a live viewport.

F12 pictures must equal those of `pumice render` of the exported scene to the last bit, read by OpenImageIO.
"""

import importlib
import json
import subprocess
import time

import numpy as np
import pumice
import pytest

from stand_ins import Context, Engine, Texture

SPP = 4
SIZE = (48, 32)


def load(extension, name):
    return importlib.import_module(f"{extension.__name__}.{name}")


def imported(bpy, path, **options):
    assert bpy.ops.pumice.import_volume(filepath=str(path), **options) == {"FINISHED"}
    return bpy.context.view_layer.objects.active


def exr(path):
    """Channels of all parts of an OpenEXR file by name."""
    import OpenImageIO

    found, part = {}, 0
    file = OpenImageIO.ImageInput.open(str(path))
    assert file is not None, OpenImageIO.geterror()
    while file.seek_subimage(part, 0):
        pixels = file.read_image(part, 0, 0, file.spec().nchannels, "float")
        for at, name in enumerate(file.spec().channelnames):
            layers = f"{file.spec().getattribute('name') or ''}.{name}".split(".")
            found[".".join(layers[-2:])] = pixels[..., at]
        part += 1
    return found


@pytest.fixture
def scene(blender, nuclei):
    """A small, quick scene with the nuclei."""
    imported(blender, nuclei)
    scene = blender.context.scene
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *SIZE, 100
    scene.pumice.samples, scene.pumice.bounces, scene.pumice.seed, scene.pumice.backend = SPP, 3, 7, "CPU"
    if blender.app.version >= (5, 0, 0):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    render.image_settings.color_depth = "32"
    render.image_settings.exr_codec = "NONE"
    return scene


@pytest.mark.parametrize(
    "name,options,labels",
    [
        ("connectomics_32x32x40nm.nrrd", {}, 2511),
        ("torchio_t1_seg_gif_PIR.nii.gz", {}, 158),
        ("slicer_Segmentation.seg.nrrd", {}, 7),
        ("slicer_SegmentationOverlapping.seg.nrrd", {"layer": 0}, None),
        ("platynereis_nuclei.tif", {"use_spacing": True, "spacing": (0.4, 0.4, 1.0)}, 33),
    ],
)
def test_every_shipped_volume_is_imported(blender, extension, data, tmp_path, name, options, labels):
    source = tmp_path / name
    source.write_bytes((data / name).read_bytes())
    obj = imported(blender, source, **options)
    table = obj.pumice.table
    read = load(extension, "label_table")
    volume = pumice.open(obj.pumice.filepath)
    assert np.array_equal(read.ids(table), volume.labels.ids) and len(table.vertices) == obj.pumice.labels
    assert labels in (None, obj.pumice.labels)
    assert 1_000 <= len(obj.data.polygons) <= 50_000
    size = np.array([obj.matrix_world.to_3x3() @ v.co for v in obj.data.vertices])
    assert 5.0 < np.ptp(size, axis=0).max() < 10.001, "the longest side of the volume is ten units"
    if options.get("use_spacing"):
        assert list(obj.pumice.spacing) == pytest.approx(options["spacing"])
    assert [p.suffix for p in tmp_path.iterdir() if p != source] == [".pumice"]


def test_f12_and_the_command_draw_the_same_bits(scene, blender, pumice_command, tmp_path):
    layer = blender.context.view_layer
    layer.use_pass_z, layer.pumice.use_pass_label = True, True
    scene.render.filepath = str(tmp_path / "blender.exr")
    blender.ops.render.render(write_still=True)
    assert blender.ops.pumice.export_scene(filepath=str(tmp_path / "scene.json")) == {"FINISHED"}
    command = [pumice_command, "render", "scene.json", "-o", "command.exr", "--spp", str(SPP), "--backend", "cpu"]
    subprocess.run([*command, "--passes", "depth,label"], cwd=tmp_path, check=True, capture_output=True)

    ours, theirs = exr(tmp_path / "blender.exr"), exr(tmp_path / "command.exr")
    color = [theirs[k] for k in (next(n for n in theirs if n.endswith(c) and "abel" not in n) for c in ".R .G .B".split())]
    assert ours["Combined.R"].shape == SIZE[::-1] and np.ptp(ours["Combined.R"]) > 0.1
    for channel, expected in zip("RGB", color):
        assert np.array_equal(ours[f"Combined.{channel}"].view(np.uint32), expected.view(np.uint32))
    picture = pumice.render(
        pumice.Scene.from_dict(json.loads((tmp_path / "scene.json").read_text())),
        [pumice.open(blender.context.object.pumice.filepath)],
        spp=SPP,
        backend="cpu",
    )
    assert np.array_equal(ours["Label.X"], picture.label.astype(np.float32))
    hit = np.isfinite(picture.depth)
    assert hit.any() and not hit.all()
    assert np.array_equal(ours["Depth.Z"][hit], picture.depth[hit]) and (ours["Depth.Z"][~hit] == np.float32(1e10)).all()

    # Negative control: another seed gives another picture.
    scene.pumice.seed = 8
    blender.ops.render.render(write_still=True)
    assert not np.array_equal(exr(tmp_path / "blender.exr")["Combined.R"], color[0])


def test_the_same_frame_twice_is_the_same_and_a_region_is_part_of_it(scene, blender, tmp_path):
    scene.render.filepath = str(tmp_path / "a.exr")
    labels = []
    blender.context.view_layer.pumice.use_pass_label = True
    for _ in range(2):
        blender.ops.render.render(write_still=True)
        labels.append(exr(tmp_path / "a.exr"))
    assert all(np.array_equal(labels[0][k], labels[1][k]) for k in labels[0])
    scene.render.use_border = scene.render.use_crop_to_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.25, 0.75
    scene.render.border_min_y, scene.render.border_max_y = 0.25, 0.75
    blender.ops.render.render(write_still=True)
    part, whole = exr(tmp_path / "a.exr")["Label.X"], labels[0]["Label.X"][8:24, 12:36]
    assert part.shape == whole.shape
    # A pixel has the label of the sample nearest its centre. Samples differ, so pixels at edges may differ.
    assert (part == whole).mean() > 0.8 and (part[4:-4, 4:-4] != 0).any()


def replace_drawing(extension, monkeypatch):
    """Replaces what of a viewport needs a window: the drawing."""
    monkeypatch.setattr(load(extension, "picture_texture"), "PictureTexture", Texture)
    monkeypatch.setattr(load(extension, "missing_boxes"), "draw", lambda ends: None)


def viewport_of(blender, extension, monkeypatch, engine):
    replace_drawing(extension, monkeypatch)
    blender.context.view_layer.update()
    context = Context(blender, SIZE)
    view = load(extension, "viewport").of(engine)
    return context, view


def settle(blender, view, context):
    """Updates, draws and polls a viewport as Blender does, until the picture is done."""
    end = time.monotonic() + 120
    while True:
        view.sync(context, blender.context.evaluated_depsgraph_get())
        view.draw(context, blender.context.evaluated_depsgraph_get())
        view.poll()
        # A volume that is open and waits for its update (`_waited`) is not drawn yet.
        waits = view.waiting or view._waited
        done = view.session is not None and not waits and view.frame is not None and view.frame.converged
        # A finished frame of an earlier revision does not count.
        if done and view.frame.revision == view.session.status.revision:
            return view.frame
        assert view.session is None or view.session.status.state != "failed", view.session.status.error
        assert time.monotonic() < end, f"the viewport does not converge: {view.notes}"
        time.sleep(0.01)


def test_the_viewport_converges_to_the_picture_of_f12(scene, blender, extension, monkeypatch, tmp_path):
    scene.pumice.viewport_samples = scene.pumice.samples = 64
    context, view = viewport_of(blender, extension, monkeypatch, Engine())
    frame = settle(blender, view, context)
    live = np.array(np.asarray(frame), dtype=np.float32).reshape(SIZE[1], SIZE[0], 4)[::-1]
    scene.render.filepath = str(tmp_path / "a.exr")
    blender.ops.render.render(write_still=True)
    final = exr(tmp_path / "a.exr")
    final = np.stack([final[f"Combined.{c}"] for c in "RGBA"], axis=2)
    assert live.shape == final.shape and (live[..., 3] == 1.0).all()
    # Both pictures have the error that the session states, so the mean squares add up. The factor 3 is there because the stated error is
    # itself an estimate from 64 samples.
    stated = frame.error_estimate
    difference = np.sqrt(((live - final)[..., :3] ** 2).mean() / (final[..., :3] ** 2).mean())
    assert difference <= 3.0 * np.sqrt(2.0) * stated, (difference, stated)
    # Negative control: the picture of another scene differs by more than the error.
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 1.5
    blender.ops.render.render(write_still=True)
    other = exr(tmp_path / "a.exr")
    other = np.stack([other[f"Combined.{c}"] for c in "RGB"], axis=2)
    assert np.sqrt(((live[..., :3] - other) ** 2).mean() / (other**2).mean()) > 3.0 * np.sqrt(2.0) * stated


def counters(view):
    return {k: v for k, v in view.session.status.counters.items() if k.startswith(("edits.", "rebuilt."))}


def grown(before, after):
    return {k: v - before.get(k, 0) for k, v in after.items() if v != before.get(k, 0)}


def test_a_camera_move_sends_a_camera_and_a_colour_edit_a_colour(scene, blender, extension, monkeypatch):
    scene.pumice.viewport_samples = 2
    context, view = viewport_of(blender, extension, monkeypatch, Engine())
    settle(blender, view, context)

    before = counters(view)
    scene.camera.location.x += 0.5
    blender.context.view_layer.update()
    context.look(scene.camera)
    view.draw(context, blender.context.evaluated_depsgraph_get())
    settle(blender, view, context)
    assert grown(before, counters(view)) == {"edits.camera": 1, "rebuilt.camera": 1}

    before = counters(view)
    material = blender.context.object.active_material.node_tree.nodes["Principled BSDF"]
    material.inputs["Roughness"].default_value = 0.9
    settle(blender, view, context)
    assert grown(before, counters(view)) == {"edits.group_material": 1, "rebuilt.materials": 1}

    before = counters(view)
    table = load(extension, "label_table")
    table.set_color(blender.context.object.pumice.table, [4], (1.0, 0.0, 0.0))
    settle(blender, view, context)
    assert grown(before, counters(view)) == {"edits.groups": 1, "rebuilt.materials": 1}

    before = counters(view)
    settle(blender, view, context)
    assert grown(before, counters(view)) == {}, "nothing changed, nothing is sent"


def test_two_viewports_and_f12_at_once(scene, blender, extension, monkeypatch, tmp_path):
    scene.pumice.viewport_samples = 100_000
    context, first = viewport_of(blender, extension, monkeypatch, Engine(1))
    second = load(extension, "viewport").of(Engine(2))
    for view in (first, second):
        view.sync(context, blender.context.evaluated_depsgraph_get())
    scene.render.filepath = str(tmp_path / "a.exr")
    blender.ops.render.render(write_still=True)
    assert np.ptp(exr(tmp_path / "a.exr")["Combined.R"]) > 0.1
    for view in (first, second):
        end = time.monotonic() + 60
        while view.frame is None:
            assert time.monotonic() < end
            view.draw(context, blender.context.evaluated_depsgraph_get())
            time.sleep(0.01)
        assert view.session.status.state == "rendering"


def test_an_object_deleted_while_it_is_drawn_leaves_an_empty_picture(scene, blender, extension, monkeypatch):
    scene.pumice.viewport_samples = 8
    context, view = viewport_of(blender, extension, monkeypatch, Engine())
    settle(blender, view, context)
    assert np.ptp(np.asarray(view.frame)[..., 0]) > 0.05
    blender.data.objects.remove(blender.context.object)
    frame = settle(blender, view, context)
    assert np.ptp(np.asarray(frame)[..., 0]) < 1e-3, "sky alone"


def test_a_panic_in_the_worker_is_told_and_survived(scene, blender, extension, monkeypatch):
    scene.pumice.viewport_samples = 100_000
    engine = Engine()
    context, view = viewport_of(blender, extension, monkeypatch, engine)
    view.sync(context, blender.context.evaluated_depsgraph_get())
    view.session._panic_on_purpose()
    end = time.monotonic() + 60
    while view.session.status.state != "failed":
        assert time.monotonic() < end
        time.sleep(0.01)
    view.draw(context, blender.context.evaluated_depsgraph_get())
    assert engine.line.startswith("stopped: ") and "\n" not in engine.line
    scene.pumice.viewport_samples = 2
    assert settle(blender, view, context).converged, "a new session draws"


def test_a_panic_in_a_final_render_is_a_report(scene, blender, monkeypatch, tmp_path):
    scene.render.filepath = str(tmp_path / "a.exr")
    with monkeypatch.context() as broken:
        broken.setattr(pumice.Renderer, "render", lambda *_, **__: pumice._native._panic_on_purpose())
        with pytest.raises(RuntimeError, match="a panic on purpose"):
            blender.ops.render.render(write_still=True)
    assert blender.ops.render.render(write_still=True) == {"FINISHED"}


def test_cancel_in_the_middle_leaves_no_file(blender, extension, data, tmp_path):
    """Uses the largest shipped volume, which takes seconds, so that there is time to cancel."""
    source = tmp_path / "cortex.nrrd"
    source.write_bytes((data / "connectomics_32x32x40nm.nrrd").read_bytes())
    opening = load(extension, "opening")
    wanted = [opening.Wanted(str(source), {}, str(tmp_path / "user"))]
    work = load(extension, "background").Work("Reading", lambda job, tell: opening.open_all(wanted, job, tell), tells=True)
    work.job.cancel()
    work.thread.join(30)
    assert not work.thread.is_alive() and isinstance(work.error, pumice.Cancelled), work.error
    assert [p.name for p in tmp_path.rglob("*")] == ["cortex.nrrd"]


def test_what_is_no_volume_is_one_line(blender, tmp_path):
    path = tmp_path / "letter.nrrd"
    path.write_bytes(b"NRRD0004\ntype: block\n\nhello")
    with pytest.raises(RuntimeError) as raised:
        blender.ops.pumice.import_volume(filepath=str(path))
    said = str(raised.value).strip()
    assert "letter.nrrd" in said and "defect" not in said and len(said.splitlines()) == 1
