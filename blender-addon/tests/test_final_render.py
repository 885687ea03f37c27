# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests F12: values in Blender's passes, size and region of the picture, progress, cancelling and errors.

The compiled module is a mock whose pictures have a different value in each pixel. Other tests check real pictures.
"""

import importlib
import struct
import types

import numpy as np
import pytest

from stand_ins import Module, Volume


@pytest.fixture
def stage(blender, extension, monkeypatch, tmp_path):
    """A scene with one volume and a mock module, ready for F12."""
    load = lambda name: importlib.import_module(f"{extension.__name__}.{name}")  # noqa: E731
    module = Module()
    monkeypatch.setattr(load("native"), "pumice", module)
    monkeypatch.setattr(load("native"), "MISSING", None)
    load("registry")._entries.clear()
    path = tmp_path / "cells.pumice"
    path.write_bytes(b"stand-in")
    obj = load("volume_object").create(
        blender.context, Volume(), name="cells", filepath=str(path), source_path="", longest_side=10.0, placement="CENTER"
    )
    load("first_look").prepare(blender.context, obj)
    scene = blender.context.scene
    scene.render.engine = "PUMICE"
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 12, 8, 100
    # Tests read the result from a multilayer file, because Render Result has no pixels in background mode.
    render.filepath = str(tmp_path / "out.exr")
    if blender.app.version >= (5, 0, 0):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    render.image_settings.color_depth = "32"
    render.image_settings.exr_codec = "NONE"
    stage = types.SimpleNamespace(bpy=blender, scene=scene, module=module, obj=obj, path=path, load=load, seen={})
    original = load("render_result")._fill

    def fill(layer, name, pixels):
        original(layer, name, pixels)
        target = layer.passes[name]
        flat = np.empty(len(target.rect) * target.channels, dtype=np.float32)
        target.rect.foreach_get(flat)
        stage.seen[name] = flat.reshape(*np.asarray(pixels).shape[:2], target.channels)

    monkeypatch.setattr(load("render_result"), "_fill", fill)
    yield stage
    load("registry")._entries.clear()


def render(stage):
    stage.seen.clear()
    return stage.bpy.ops.render.render(write_still=True)


def test_the_passes_hold_the_picture_bottom_row_first(stage):
    layer = stage.bpy.context.view_layer
    layer.use_pass_z, layer.pumice.use_pass_label = True, True
    assert render(stage) == {"FINISHED"}
    at = np.arange(96, dtype=np.float32).reshape(8, 12)
    assert set(stage.seen) == {"Combined", "Depth", "Label"}
    combined = stage.seen["Combined"]
    assert np.array_equal(combined[::-1, :, 0], at) and np.array_equal(combined[::-1, :, 2], at * 3)
    assert (combined[..., 3] == 1.0).all()
    depth = stage.seen["Depth"][::-1, :, 0]
    assert depth[0, 0] == np.float32(1e10) and np.array_equal(depth.ravel()[1:], at.ravel()[1:] + 0.5)
    assert np.array_equal(stage.seen["Label"][::-1, :, 0], at + 7)


def test_every_pass_that_is_offered_arrives_under_cycles_name(stage, drawn, tmp_path):
    """All passes that a view layer can have are registered, filled and written, each with its own values."""
    layer = stage.bpy.context.view_layer
    passes = stage.load("passes")
    for one in passes.TABLE:
        setattr(one.owner(layer), one.chosen, True)
    assert render(stage) == {"FINISHED"}
    new = stage.bpy.app.version >= (5, 0, 0)
    there = {"Combined", "Depth", "Label", "Normal", "Position", "Denoising Albedo", "Denoising Normal", "Variance"}
    there.add("Shadow Catcher")
    there |= {"Diffuse Direct", "Environment"} if new else {"DiffDir", "Env"}
    there |= {f"Crypto{kind}{number:02}" for kind in ("Object", "Asset") for number in range(3)}
    assert set(stage.seen) == there, "the passes of the picture"
    asked = stage.module.renders[-1][0]["film"]["passes"]
    assert asked == sorted({one.ours for one in passes.TABLE})
    at = np.arange(96, dtype=np.float32).reshape(8, 12)
    written = channels(tmp_path / "out.exr")
    for place, name in [(0, "Denoising Albedo.G"), (1, "Denoising Normal.Y"), (1, "Normal.Y"), (2, "Variance.G"), (3, "Position.Y"), (6, "Shadow Catcher.G")]:
        assert np.array_equal(written[name], at * 2 + place), name
    # Passes that Cycles has too have the same names and channels, so that compositor nodes find them.
    layer.cycles.use_pass_shadow_catcher = True
    from cycles.engine import list_render_passes

    theirs = {name: (len(channels), kind) for name, channels, kind in list_render_passes(stage.scene, layer)}
    ours = {name: (count, kind) for name, count, _, kind in passes.registered(layer)}
    denoised = {"Noisy Image", "Noisy Shadow Catcher", "Denoising Depth"}  # passes of Cycles' own denoising
    assert set(theirs) - denoised <= set(ours), "all of these are Cycles' too"
    assert {name: ours[name] for name in theirs if name in ours} == {name: theirs[name] for name in theirs if name in ours}


def test_a_denoised_render_keeps_the_noisy_picture_under_cycles_name_and_says_what_it_is(stage, tmp_path):
    import OpenImageIO

    at = np.arange(96, dtype=np.float32).reshape(8, 12)
    said = lambda: OpenImageIO.ImageInput.open(str(tmp_path / "out.exr")).spec().getattribute("pumice/denoised")  # noqa: E731
    assert render(stage) == {"FINISHED"}
    assert "Noisy Image" not in stage.seen and said() is None, "the control: it is off in new scenes"
    stage.scene.pumice.use_denoise = True
    assert render(stage) == {"FINISHED"}
    assert np.array_equal(stage.seen["Combined"][::-1, :, 0], at)
    assert np.array_equal(stage.seen["Noisy Image"][::-1, :, 0], at + 0.25) and (stage.seen["Noisy Image"][..., 3] == 1.0).all()
    assert said() == "statistical, biased"
    from cycles.engine import list_render_passes

    cycles = stage.bpy.context.view_layer.cycles
    cycles.denoising_store_passes = True
    theirs = {name: (len(channels), kind) for name, channels, kind in list_render_passes(stage.scene, stage.bpy.context.view_layer)}
    ours = {name: (count, kind) for name, count, _, kind in stage.load("passes").registered(stage.bpy.context.view_layer, True)}
    assert ours["Noisy Image"] == theirs["Noisy Image"]


def test_mattes_arrive_in_layers_with_what_they_are(stage, tmp_path):
    """Cryptomatte passes arrive as layers, with their manifest in the file's attributes. A layer holds two levels."""
    import OpenImageIO

    layer = stage.bpy.context.view_layer
    layer.name = "Cells"
    layer.use_pass_cryptomatte_object, layer.pass_cryptomatte_depth = True, 3
    assert render(stage) == {"FINISHED"}
    assert stage.module.renders[-1][0]["film"]["cryptomatte_ranks"] == 4
    assert set(stage.seen) == {"Combined", "CryptoObject00", "CryptoObject01"}
    at = np.arange(96, dtype=np.float32).reshape(8, 12)
    written = channels(tmp_path / "out.exr")
    for number, channel, plus in [(0, "r", 0), (0, "a", 1 / 128), (1, "r", 2), (1, "g", 2 / 128)]:
        assert np.array_equal(written[f"CryptoObject{number:02}.{channel}"], at + np.float32(plus)), (number, channel)
    said = OpenImageIO.ImageInput.open(str(tmp_path / "out.exr")).spec()
    key = f"cryptomatte/{stage.module.cryptomatte_hash('Cells.CryptoObject'):08x}"[:19]
    told = {name: said.getattribute(f"{key}/{name}") for name in ("name", "hash", "conversion", "manifest")}
    assert told == {
        "name": "Cells.CryptoObject",
        "hash": "MurmurHash3_32",
        "conversion": "uint32_to_float32",
        "manifest": '{"17":"0123abcd"}',
    }
    assert not [a.name for a in said.extra_attribs if a.name.startswith("cryptomatte/") and not a.name.startswith(key)]
    # A pass that is switched off is absent.
    layer.use_pass_cryptomatte_object = False
    render(stage)
    said = OpenImageIO.ImageInput.open(str(tmp_path / "out.exr")).spec()
    assert not [a.name for a in said.extra_attribs if a.name.startswith("cryptomatte/")]


def test_a_pass_that_the_picture_lacks_is_a_warning(stage, drawn, capfd):
    stage.bpy.context.view_layer.use_pass_glossy_direct = True
    assert render(stage) == {"FINISHED"}
    assert "it is left empty" in capfd.readouterr().out and "Combined" in stage.seen


def test_coverage_is_the_alpha_of_combined(stage, drawn):
    at = np.arange(96, dtype=np.float32).reshape(8, 12)
    stage.module.alpha = at / 96
    stage.scene.render.film_transparent = True
    render(stage)
    assert stage.module.renders[-1][0]["film"]["transparent"] is True
    assert np.array_equal(stage.seen["Combined"][::-1, :, 3], at / 96)


def test_passes_that_nobody_wants_are_not_there(stage):
    render(stage)
    assert set(stage.seen) == {"Combined"}


def channels(path):
    """All channels of all parts of an OpenEXR file by the last two parts of their names, read by OpenImageIO; row 0 is the top."""
    import OpenImageIO

    found, part = {}, 0
    file = OpenImageIO.ImageInput.open(str(path))
    while file.seek_subimage(part, 0):
        pixels = file.read_image(part, 0, 0, file.spec().nchannels, "float")
        for at, name in enumerate(file.spec().channelnames):
            layers = f"{file.spec().getattribute('name') or ''}.{name}".split(".")
            found[".".join(layers[-2:])] = pixels[..., at]
        part += 1
    return found


def test_the_file_has_the_passes_by_name_and_value(stage, tmp_path):
    layer = stage.bpy.context.view_layer
    layer.use_pass_z, layer.pumice.use_pass_label = True, True
    render(stage)
    written = channels(tmp_path / "out.exr")
    at = np.arange(96, dtype=np.float32).reshape(8, 12)
    assert np.array_equal(written["Combined.G"], at * 2) and (written["Combined.A"] == 1.0).all()
    assert np.array_equal(written["Depth.Z"].ravel()[1:], at.ravel()[1:] + 0.5)
    assert np.array_equal(written["Label.X"], at + 7)


def test_percentage_and_region_make_the_film(stage):
    stage.scene.render.resolution_x, stage.scene.render.resolution_y = 101, 60
    stage.scene.render.resolution_percentage = 50
    render(stage)
    film = stage.module.renders[-1][0]["film"]
    assert (film["width"], film["height"]) == (50, 30)
    whole = stage.module.renders[-1][0]["camera"]

    border = stage.scene.render
    border.use_border, border.border_min_x, border.border_max_x = True, 0.5, 1.0
    border.border_min_y, border.border_max_y = 0.0, 0.25
    for crop in (True, False):
        border.use_crop_to_border = crop
        assert render(stage) == {"FINISHED"}
        scene = stage.module.renders[-1][0]
        assert (scene["film"]["width"], scene["film"]["height"]) == (25, 7)
        assert scene["camera"]["shift"][0] > whole["shift"][0] and scene["camera"]["shift"][1] < whole["shift"][1]
        assert set(stage.seen) == {"Combined"}


def test_a_region_is_as_large_as_blender_makes_it(stage, tmp_path):
    """Blender computes the size of a region in single precision; the file that it writes gives the true size."""
    import OpenImageIO

    render_settings = stage.scene.render
    render_settings.resolution_x = render_settings.resolution_y = 100
    render_settings.use_border = render_settings.use_crop_to_border = True
    random = np.random.default_rng(1)
    spans = [sorted(random.uniform(0, 1, 2)) for _ in range(12)] + [[0.1, 0.7], [0.3, 0.6], [0.29, 0.57]]
    for low, high in spans:
        render_settings.border_min_x, render_settings.border_max_x = low, high
        render_settings.border_min_y, render_settings.border_max_y = low, high
        assert render(stage) == {"FINISHED"}
        film = stage.module.renders[-1][0]["film"]
        spec = OpenImageIO.ImageInput.open(str(tmp_path / "out.exr")).spec()
        assert (film["width"], film["height"]) == (spec.width, spec.height), (low, high)


def test_an_animated_material_is_drawn_as_it_is_in_the_frame(stage):
    shader = stage.obj.active_material.node_tree.nodes["Principled BSDF"].inputs["Roughness"]
    for frame, value in ((1, 0.0), (11, 1.0)):
        shader.default_value = value
        shader.keyframe_insert("default_value", frame=frame)
    stage.scene.frame_set(1)
    stage.scene.frame_start, stage.scene.frame_end = 6, 6
    stage.bpy.ops.render.render(animation=True)
    drawn = stage.module.renders[-1][0]["instances"][0]["style"]["material"]["roughness"]
    assert drawn == pytest.approx(0.5)


def test_export_refuses_where_it_could_not_be_the_same_picture(stage, tmp_path):
    path = tmp_path / "scene.json"
    saved = []
    stage.module.Scene.save = lambda self, path: saved.append(self.value)
    assert stage.bpy.ops.pumice.export_scene(filepath=str(path)) == {"FINISHED"}
    render(stage)
    assert saved[-1] == stage.module.renders[-1][0], "the exported scene is the rendered one"
    stage.obj.hide_viewport = True
    with pytest.raises(RuntimeError, match="cells is hidden in the viewport and not in renders"):
        stage.bpy.ops.pumice.export_scene(filepath=str(path))
    stage.obj.hide_viewport, stage.obj.hide_render = False, True
    assert stage.bpy.ops.pumice.export_scene(filepath=str(path)) == {"FINISHED"}
    assert saved[-1]["instances"] == []


def test_the_command_of_an_exported_scene_has_all_limits(stage, extension, tmp_path):
    wishes, command = stage.scene.pumice, extension.export_scene.command
    wishes.samples, wishes.use_error, wishes.use_time, wishes.use_denoise = 7, False, False, False
    assert command(wishes, "/tmp/a.json") == "pumice render /tmp/a.json --spp 7 -o picture.exr"
    wishes.use_error, wishes.error_percent = True, 2.5
    wishes.use_time, wishes.time_seconds = True, 30.0
    wishes.use_denoise, wishes.denoiser = True, "STATISTICAL"
    expected = "pumice render '/tmp/a b.json' --spp 7 --error 2.5% --time 30 --denoise -o picture.exr"
    assert command(wishes, "/tmp/a b.json") == expected
    wishes.denoiser = "OIDN"
    assert "--denoise=oidn " in command(wishes, "a.json")


def test_a_scene_whose_volume_is_missing_is_not_exported(stage, tmp_path):
    stage.path.unlink()
    with pytest.raises(RuntimeError, match="cells.pumice: the volume's file is missing"):
        stage.bpy.ops.pumice.export_scene(filepath=str(tmp_path / "scene.json"))
    assert not (tmp_path / "scene.json").exists()


def test_what_is_not_drawn_of_a_frame_is_named(stage):
    """Of a volume's visibility, of collections, of the view layer's passes, of a sheared camera; nothing where all is drawn."""
    frame = lambda: stage.load("final_render").parts_of_frame(stage.bpy.context.evaluated_depsgraph_get(), as_rendered=True)[1]  # noqa: E731
    assert frame() == []
    layer, obj, camera = stage.bpy.context.view_layer, stage.obj, stage.scene.camera
    obj.is_holdout, obj.is_shadow_catcher, obj.visible_camera, obj.visible_shadow = True, True, False, False
    collection = stage.bpy.data.collections.new("apart")
    stage.scene.collection.children.link(collection)
    layer.layer_collection.children["apart"].indirect_only = True
    layer.use_pass_mist, layer.use_pass_vector, layer.use_pass_z = True, True, True
    parent = stage.bpy.data.objects.new("parent", None)
    stage.scene.collection.objects.link(parent)
    parent.scale = (1.0, 2.0, 1.0)
    camera.rotation_euler = (0.9, 0.3, 0.5)
    camera.parent = parent
    layer.update()
    said = frame()
    assert set(said) == {
        f"Object {obj.name}: Shadow Catcher is drawn as an ordinary object",
        f"Object {obj.name}: Holdout is not drawn",
        f"Object {obj.name}: it is seen by camera and shadow rays all the same",
        "Collection apart: Indirect Only is not drawn",
        f"View layer {layer.name}: no pass Mist or Vector",
        f"Camera {camera.name}: its shear is not drawn; its axes are at right angles",
    }
    panel = stage.load("panels").not_drawn(stage.scene, layer)
    assert set(said) <= set(panel), set(said) - set(panel)
    axes = np.array(stage.load("scene_reader").lens.read(camera)["world_from_camera"]).reshape(4, 3)[:3]
    assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-6)
    # The view axis is the camera's own.
    along = np.array(camera.matrix_world.col[2][:3])
    assert np.allclose(axes[2], along / np.linalg.norm(along), atol=1e-6)


def ply(path):
    """(corners, triangles, material indices) of a PLY file of the extension."""
    data = path.read_bytes()
    head, body = data.split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    count, faces = (int(next(x for x in lines if x.startswith(f"element {kind} ")).split()[2]) for kind in ("vertex", "face"))
    corners = np.array(struct.unpack_from(f"<{3 * count}f", body)).reshape(-1, 3)
    read = [struct.unpack_from("<B4I", body, 12 * count + 17 * i) for i in range(faces)]
    assert len(body) == 12 * count + 17 * faces and all(face[0] == 3 for face in read)
    return corners, np.array([face[1:4] for face in read]), [face[4] for face in read]


def test_an_exported_scene_has_its_meshes_beside_it(stage, drawn, tmp_path):
    mesh = stage.bpy.data.meshes.new("floor")
    mesh.from_pydata([(0, 0, 0.25), (2, 0, 0.25), (2, 1, 0.25), (0, 1, 0.25)], [], [(0, 1, 2, 3)])
    mesh.materials.append(None)
    for step in range(2):
        obj = stage.bpy.data.objects.new("floor/1", mesh)
        obj.location.x = step
        stage.scene.collection.objects.link(obj)
    saved = []
    stage.module.Scene.save = lambda self, path: saved.append(self.value)
    assert stage.bpy.ops.pumice.export_scene(filepath=str(tmp_path / "a.json")) == {"FINISHED"}
    meshes = saved[-1]["meshes"]
    assert [m["source"] for m in meshes] == ["a-1-floor_1.ply"] * 2 and [m["world_from_mesh"][9] for m in meshes] == [0.0, 1.0]
    corners, triangles, materials = ply(tmp_path / "a-1-floor_1.ply")
    assert np.array_equal(corners, [(0, 0, 0.25), (2, 0, 0.25), (2, 1, 0.25), (0, 1, 0.25)])
    assert {frozenset(t) for t in triangles.tolist()} in ({frozenset(s) for s in pair} for pair in (((0, 1, 2), (0, 2, 3)), ((0, 1, 3), (1, 2, 3))))
    assert materials == [0, 0]
    assert sorted(p.name for p in tmp_path.iterdir() if "ply" in p.name) == ["a-1-floor_1.ply"]


def test_the_wishes_reach_the_render(stage):
    wishes = stage.scene.pumice
    wishes.samples, wishes.use_error, wishes.error_percent, wishes.use_time, wishes.time_seconds = 5, True, 3.0, True, 9.0
    wishes.mode, wishes.lod, wishes.lod_pixels, wishes.seed, wishes.bounces = "ONE_BOUNCE", "DISTANCE", 2.0, 11, 4
    wishes.filter_pixels, wishes.backend = 1.0, "CPU"
    wishes.use_adaptive, wishes.adaptive_threshold, wishes.adaptive_min_samples = True, 0.25, 12
    render(stage)
    assert "smooth_voxels" not in stage.module.renders[-1][0]["settings"], "smooth voxels are off by default"
    wishes.smooth_voxels = True
    render(stage)
    scene, _, limits = stage.module.renders[-1]
    assert scene["settings"]["smooth_voxels"] is True
    assert limits == {"spp": 5, "error": pytest.approx(0.03), "seconds": pytest.approx(9.0), "backend": "cpu"}
    settings = scene["settings"]
    assert settings["mode"] == "one_bounce" and settings["lod"] == {"distance": {"pixels": 2.0}}
    assert settings["adaptive"] == {"threshold": 0.25, "min_spp": 12}
    assert (settings["seed"], settings["bounces"], settings["russian_roulette"]) == (11, 4, True)
    assert scene["film"]["filter"] == {"blackman_harris": {"width": 2.0}}


def test_what_hides_leaves_and_what_is_excluded_leaves(stage):
    stage.obj.hide_render = True
    render(stage)
    assert stage.module.renders[-1][0]["instances"] == []


def failure(stage):
    """The error text of a failing F12, which Blender raises from the engine's error report."""
    with pytest.raises(RuntimeError) as raised:
        render(stage)
    return str(raised.value)


def test_errors_of_the_user_are_one_line(stage):
    stage.scene.render.use_multiview = True
    assert "Stereoscopy is not drawn" in failure(stage)
    stage.scene.render.use_multiview = False
    stage.path.unlink()
    said = failure(stage)
    assert "missing" in said and str(stage.path) in said and "Traceback" not in said


def test_a_panic_in_the_module_is_a_report(stage):
    def panic(job, on_progress):
        raise stage.module.InternalError("a defect of Pumice: index out of bounds: the len is 3 but the index is 7")

    stage.module.during_render = panic
    assert "index out of bounds" in failure(stage)
    stage.module.during_render = lambda job, on_progress: None
    assert render(stage) == {"FINISHED"}, "the next render works"


def test_a_defect_of_the_extension_is_a_report_too(stage, monkeypatch):
    def broken(*_):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(stage.load("scene_reader"), "settings", broken)
    assert "Pumice has a defect: ZeroDivisionError" in failure(stage)


def test_what_is_left_out_is_said(stage, monkeypatch):
    said = []
    final_render = stage.load("final_render")
    original = final_render.parts_of_frame
    monkeypatch.setattr(final_render, "parts_of_frame", lambda *a, **k: (lambda r: (said.extend(r[1]), r)[1])(original(*a, **k)))
    stage.scene.render.film_transparent = True
    monkeypatch.setattr(stage.load("sync.drawn"), "TRANSPARENT", False)
    light = stage.bpy.data.objects.new("lamp", stage.bpy.data.lights.new("lamp", "POINT"))
    light.data.use_custom_distance = True
    stage.scene.collection.objects.link(light)
    stage.bpy.context.view_layer.material_override = stage.bpy.data.materials.new("clay")
    render(stage)
    assert "View layer ViewLayer: Material Override is not drawn" in said
    assert any("lamp: Custom Distance has no effect" in line for line in said)
    assert any("transparent film" in line for line in said)


def test_what_a_device_could_not_do_is_a_warning(stage, capfd):
    assert render(stage) == {"FINISHED"}
    line = "vulkan-rt on Radeon: out of GPU memory; going on with cpu"
    assert line not in capfd.readouterr().out
    stage.module.notices = [line]
    assert render(stage) == {"FINISHED"}
    assert f"Warning: {line}" in capfd.readouterr().out, "Blender prints its reports"
