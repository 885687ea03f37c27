# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests a viewport: the edits that it sends for each change, and its behaviour on failures. Blender's window and the session are mocks."""

import importlib
import types

import numpy as np
import pytest
from mathutils import Matrix, Vector

from stand_ins import Context, Engine, Module, Texture, Volume


@pytest.fixture
def stage(blender, extension, monkeypatch, tmp_path):
    """A scene with one volume, a sun and a camera, and a mock viewport that looks at it."""
    load = lambda name: importlib.import_module(f"{extension.__name__}.{name}")  # noqa: E731
    module = Module()
    monkeypatch.setattr(load("native"), "pumice", module)
    monkeypatch.setattr(load("native"), "MISSING", None)
    monkeypatch.setattr(load("picture_texture"), "PictureTexture", Texture)
    boxes = []
    monkeypatch.setattr(load("missing_boxes"), "draw", boxes.append)
    load("registry")._entries.clear()
    path = tmp_path / "cells.pumice"
    path.write_bytes(b"stand-in")
    obj = load("volume_object").create(
        blender.context, Volume(), name="cells", filepath=str(path), source_path="", longest_side=10.0, placement="CENTER"
    )
    load("first_look").prepare(blender.context, obj)
    blender.context.view_layer.update()
    stage = types.SimpleNamespace(
        bpy=blender, module=module, obj=obj, boxes=boxes, path=path, engine=Engine(), load=load, viewport=load("viewport")
    )
    stage.context = Context(blender)
    stage.sun = next(o for o in blender.context.scene.objects if o.type == "LIGHT")

    def update(engine=None):
        blender.context.view_layer.update()
        of = stage.viewport.of(engine or stage.engine)
        of.sync(stage.context, blender.context.evaluated_depsgraph_get())
        return of

    def draw(engine=None):
        of = stage.viewport.of(engine or stage.engine)
        of.draw(stage.context, blender.context.evaluated_depsgraph_get())
        return of

    def settle():
        """Updates with the volume open: a session begins with it, however long the thread that opens it takes."""
        assert load("registry").request(str(path)).done.wait(10)
        return update()

    stage.update, stage.draw, stage.settle = update, draw, settle
    yield stage
    stage.viewport.close_all()
    load("registry")._entries.clear()


def edits_of(stage, change):
    """Kinds of the edits that the viewport sends after a change of Blender's data."""
    shown = stage.settle()
    stage.draw()
    before = len(shown.session.edits)
    change(stage)
    stage.update()
    stage.draw()
    assert stage.viewport.of(stage.engine).session is shown.session, "a change does not restart the session"
    return [e["edit"] for e in shown.session.edits[before:]]


def shader(stage):
    return stage.obj.active_material.node_tree.nodes["Principled BSDF"].inputs


def background(stage):
    nodes = stage.bpy.context.scene.world.node_tree.nodes
    return next(n for n in nodes if n.bl_idname == "ShaderNodeBackground").inputs


def hide_label(stage):
    table = stage.load("label_table")
    table.set_visible(stage.obj.pumice.table, [True, False, True])
    stage.obj.update_tag()


def color_label(stage):
    stage.load("label_table").set_color(stage.obj.pumice.table, [1], (0.1, 0.2, 0.3))
    stage.obj.update_tag()


def set_(target, name, value):
    return lambda stage: setattr(target(stage), name, value)


CHANGES = {
    "nothing": (lambda s: None, []),
    "orbit": (lambda s: setattr(s.context.region_data, "view_matrix", Matrix.Translation((0, 0.1, -30))), ["camera"]),
    "wider": (lambda s: setattr(s.context.region, "width", 128), ["film"]),
    "roughness": (lambda s: setattr(shader(s)["Roughness"], "default_value", 0.9), ["group_material"]),
    "base colour": (lambda s: setattr(shader(s)["Base Color"], "default_value", (0.5, 0.1, 0.1, 1)), ["group_material"]),
    "colours by label": (lambda s: setattr(s.obj.active_material.pumice, "colors_by_label", False), ["groups"]),
    "move": (lambda s: setattr(s.obj, "location", (1, 2, 3)), ["place"]),
    "sky": (lambda s: setattr(background(s)["Strength"], "default_value", 0.5), ["world"]),
    "sun": (lambda s: setattr(s.sun.data, "energy", 5.0), ["suns"]),
    "sun turned": (lambda s: setattr(s.sun, "rotation_euler", (1, 1, 0)), ["suns"]),
    "bounces": (lambda s: setattr(s.bpy.context.scene.pumice, "bounces", 3), ["settings"]),
    "filter": (lambda s: setattr(s.bpy.context.scene.pumice, "filter_pixels", 1.0), ["film"]),
    "hidden": (lambda s: setattr(s.obj, "hide_viewport", True), ["remove"]),
    "a label hidden": (hide_label, ["visible"]),
    "a label coloured": (color_label, ["groups"]),
    "renamed": (lambda s: setattr(s.obj, "name", "other"), []),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_sends_its_own_edit_and_no_other(stage, name):
    change, kinds = CHANGES[name]
    assert edits_of(stage, change) == kinds


def furnished(stage):
    """Adds a lamp, a floor with a material, and an empty that cuts."""
    bpy = stage.bpy
    mesh = bpy.data.meshes.new("floor")
    mesh.from_pydata([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [], [(0, 1, 2, 3)])
    dress = bpy.data.materials.new("floor")
    stage.load("sync.nodes").ensure(dress)
    mesh.materials.append(dress)
    lamp = bpy.data.lights.new("lamp", "AREA")
    for name, data in (("floor", mesh), ("lamp", lamp), ("knife", None)):
        obj = bpy.data.objects.new(name, data)
        bpy.context.collection.objects.link(obj)
        setattr(stage, name, obj)
    stage.knife.pumice.cut = "BOX"
    return stage


def corner_moved(stage):
    stage.floor.data.vertices[0].co.z = 1.0
    stage.floor.data.update()


def orbit(stage):
    stage.context.region_data.view_matrix = Matrix.Translation((0, 0.1, -30))


FURNISHED = {
    "nothing": (lambda s: None, []),
    "orbit": (orbit, ["camera"]),
    "lamp": (lambda s: setattr(s.lamp.data, "size", 3.0), ["lights"]),
    "lamp moved": (lambda s: setattr(s.lamp, "location", (1, 2, 3)), ["lights"]),
    "floor moved": (lambda s: setattr(s.floor, "location", (1, 2, 3)), ["place_mesh"]),
    "floor's colour": (
        lambda s: setattr(s.floor.active_material.node_tree.nodes["Principled BSDF"].inputs["Metallic"], "default_value", 1.0),
        ["mesh_materials"],
    ),
    "floor's shape": (corner_moved, ["add_mesh"]),
    "floor hidden": (lambda s: setattr(s.floor, "hide_viewport", True), ["remove_mesh"]),
    "knife moved": (lambda s: setattr(s.knife, "location", (1, 2, 3)), ["cuts"]),
    "depth of field": (lambda s: setattr(s.bpy.context.scene.camera.data.dof, "use_dof", True), []),
    "threshold": (lambda s: setattr(s.bpy.context.scene.pumice, "use_adaptive", True), ["settings"]),
    "transparent": (lambda s: setattr(s.bpy.context.scene.render, "film_transparent", True), ["film"]),
}


@pytest.mark.parametrize("name", FURNISHED)
def test_a_change_of_what_stands_beside_volumes_sends_its_own_edit(stage, drawn, name):
    furnished(stage)
    change, kinds = FURNISHED[name]
    assert edits_of(stage, change) == kinds
    shown = stage.viewport.of(stage.engine)
    assert shown.kept.geometries.reads == 1 + (name == "floor's shape"), "triangles are read where they changed"


def test_through_a_camera_a_viewport_has_its_depth_of_field(stage, drawn):
    camera = stage.bpy.context.scene.camera
    stage.context.region_data.view_perspective = "CAMERA"
    dof = camera.data.dof
    dof.focus_object = stage.obj
    dof.aperture_fstop = 0.5

    def focus(stage):
        dof.use_dof = True

    assert edits_of(stage, focus) == ["camera"]
    aperture = stage.viewport.of(stage.engine).sent.camera["aperture"]
    assert aperture["radius"] == pytest.approx(camera.data.lens * 1e-3)
    from bpy_extras.object_utils import world_to_camera_view

    seen = world_to_camera_view(stage.bpy.context.scene, camera, stage.obj.matrix_world.translation)
    assert aperture["focus_distance"] == pytest.approx(seen.z, rel=1e-4)
    stage.context.region_data.view_perspective = "PERSP"
    stage.update()
    assert "aperture" not in stage.viewport.of(stage.engine).sent.camera


def test_the_viewport_is_filtered_where_that_is_wished_and_says_so(stage):
    first = stage.update().session
    assert not first.denoise
    stage.bpy.context.scene.pumice.use_viewport_denoise = True
    shown = stage.update()
    assert shown.session is not first and shown.session.denoise
    for filtered in (True, False):
        shown.session.show(1 + (not filtered), filtered=filtered)
        shown.poll()
        assert ("denoised, biased" in stage.load("overlay").line(shown.session.status, shown.session.frame, [])) == filtered


def test_the_columns_of_labels_are_sent(stage):
    assert edits_of(stage, color_label) == ["groups"]
    sent = stage.viewport.of(stage.engine).session.edits[-1]["groups"]
    assert sent.ids.tolist() == [3, 17, 98340797 + 2**33]
    assert np.allclose(sent.colors[1], [0.1, 0.2, 0.3, 1.0]) and np.allclose(sent.colors[2, :3], [0.7, 0.8, 0.9])
    assert edits_of(stage, hide_label) == ["visible"]
    ids, visible = stage.viewport.of(stage.engine).session.edits[-1]["visible"]
    assert ids.tolist() == sent.ids.tolist() and visible.tolist() == [True, False, True]


def test_the_session_begins_with_what_is_open_and_gets_the_rest_later(stage):
    stage.module.may_open.clear()
    shown = stage.update()
    first = shown.session
    stage.module.may_open.set()
    assert first.scene["instances"] == [] and "opening cells.pumice" in " ".join(shown.notes)
    for entry in list(shown.waiting.values()):
        assert entry.done.wait(10)
    shown.poll()
    assert stage.engine.updates == 1, "an opened volume asks for an update"
    stage.update()
    assert [e["edit"] for e in first.edits] == ["add", "visible", "groups"] and first.volumes[0].path == str(stage.path)


def test_the_scene_is_the_one_that_blender_shows(stage):
    shown = stage.settle()
    scene = shown.sent.scene(shown.numbers)
    light_travels = stage.sun.matrix_world.to_3x3() @ Vector((0, 0, -1))
    assert scene["suns"][0]["direction"] == pytest.approx(list(light_travels), abs=1e-6)
    assert scene["suns"][0]["strength"] == pytest.approx(stage.sun.data.energy)
    assert scene["world"]["environment"]["constant"]["radiance"] == pytest.approx([0.46, 0.49, 0.53])
    one = scene["instances"][0]
    columns = np.array(one["world_from_index"]).reshape(4, 3)
    assert np.allclose(columns.T, np.array(stage.obj.matrix_world)[:3])
    (ids, visible), groups = shown.session.labels[1]
    assert ids.tolist() == groups.ids.tolist() == [3, 17, 98340797 + 2**33] and visible.all()
    assert groups.materials[0]["roughness"] == pytest.approx(0.45) and groups.colored == [True] and not groups.groups.any()
    assert np.allclose(groups.colors[:, :3], stage.load("label_table").colors(stage.obj.pumice.table)[:, :3])


def test_frames_are_drawn_once_they_come_and_never_waited_for(stage):
    shown = stage.settle()
    stage.draw()
    assert shown.texture.drawn == [] and "preparing" in stage.engine.line
    shown.session.show(1, error_estimate=0.0213, spp=64, seconds=3.44)
    before = stage.engine.redraws
    assert shown.poll() == pytest.approx(1 / 60) and stage.engine.redraws == before + 1
    stage.draw()
    assert [f.serial for f, *_ in shown.texture.drawn] == [1]
    assert stage.engine.line == "cpu · 64 samples · error 2.1 % · 3.4 s"
    assert shown.poll() == pytest.approx(1 / 60) and stage.engine.redraws == before + 1, "no new frame, no redraw"


def test_a_converged_view_rests_and_a_change_wakes_it(stage):
    shown = stage.settle()
    shown.session.show(1)
    shown.poll()
    shown.session.status.state = "converged"
    assert shown.poll() == pytest.approx(0.5) and not shown.active
    redraws = stage.engine.redraws
    assert shown.poll() == pytest.approx(0.5) and stage.engine.redraws == redraws, "a finished picture is not redrawn"
    stage.draw()
    assert stage.engine.line.endswith("done")
    shown.session.status.state = "rendering"
    stage.obj.location.x += 1.0
    stage.update()
    assert shown.active and shown.poll() == pytest.approx(1 / 60)


def test_a_freed_engine_ends_its_session(stage):
    shown = stage.settle()
    session = shown.session
    stage.engine.freed = True
    assert shown.poll() is None
    assert session.status.state == "stopped" and stage.viewport._viewports == {}
    assert not stage.bpy.app.timers.is_registered(shown._tick)


def test_a_new_engine_at_the_address_of_a_freed_one_starts_afresh(stage):
    first = stage.settle()
    old_session = first.session
    again = Engine(stage.engine.address)
    second = stage.update(again)
    assert second is not first and old_session.status.state == "stopped"
    assert second.session is not old_session and second.session.status.state == "rendering"


def test_two_viewports_have_a_session_each_and_share_the_volume(stage):
    first = stage.settle()
    second = stage.update(Engine(1234))
    assert first.session is not second.session
    assert first.session.volumes[0] is second.session.volumes[0]
    stage.viewport.of(stage.engine).close()
    assert second.session.status.state == "rendering"


def test_a_missing_file_is_said_and_the_rest_is_drawn(stage):
    stage.path.unlink()
    shown = stage.update()
    stage.draw()
    assert "missing" in stage.engine.line and str(stage.path) in stage.engine.line
    assert shown.session.scene["instances"] == []
    assert len(stage.boxes[-1]) == 24, "the volume's box is drawn instead"


def test_the_box_of_a_missing_volume_is_where_the_camera_sees_it(stage):
    stage.path.unlink()
    stage.update()
    stage.draw()
    from bpy_extras.object_utils import world_to_camera_view

    scene = stage.bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 96, 64
    corners = [stage.obj.matrix_world @ Vector((64 * (i & 1), 64 * (i >> 1 & 1), 32 * (i >> 2))) for i in range(8)]
    seen = [world_to_camera_view(scene, scene.camera, c) for c in corners]
    expected = sorted((round(96 * s.x, 1), round(64 * s.y, 1)) for s in seen for _ in range(3))
    assert np.allclose(sorted((round(x, 1), round(y, 1)) for x, y in stage.boxes[-1]), expected, atol=0.11)


def test_the_part_of_a_box_behind_the_eye_is_cut_off(stage):
    identity = [[float(r == c) for c in range(4)] for r in range(4)]
    # A perspective matrix with w = -z that looks along -z from the middle of the box.
    window = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, -0.2], [0, 0, -1, 0]]
    moved = [row[:3] + [-5.0] for row in identity[:3]] + [identity[3]]
    ends = stage.load("missing_boxes").lines((10, 10, 10), moved, window, (100, 100))
    assert len(ends) == 2 * 8, "four edges are entirely behind the camera, four are clipped"
    assert {(round(x), round(y)) for x, y in ends} >= {(0, 0), (100, 0), (0, 100), (100, 100)}


def test_a_volume_that_changed_on_disk_is_said(stage):
    stage.settle()
    stage.obj.pumice.content_hash = "f" * 32
    stage.update()
    stage.draw()
    assert "has changed since it was imported" in stage.engine.line


def test_a_file_that_another_object_reloaded_is_shown_in_place_of_the_former(stage):
    """The object still has the hash of the former voxels, as an unlinked duplicate of the one that was reloaded does."""
    shown = stage.settle()
    before = len(shown.session.edits)
    reloaded = Volume(str(stage.path))
    reloaded.content_hash = "1" * 32
    stage.load("registry").adopt(str(stage.path), reloaded)
    for _ in range(2):
        stage.update()
        assert [e["edit"] for e in shown.session.edits[before:]] == ["remove", "add", "visible", "groups"], "once, not at each update"
    assert shown.session.volumes[-1] is reloaded and "has changed since it was imported" in " ".join(shown.notes)


def test_a_deleted_object_leaves(stage):
    kinds = edits_of(stage, lambda s: s.bpy.data.objects.remove(s.obj))
    assert kinds == ["remove"]


def test_undo_brings_back_what_was(stage):
    shown = stage.settle()
    stage.bpy.ops.ed.undo_push(message="before")
    stage.obj.location.x = 4.0
    stage.bpy.ops.ed.undo_push(message="moved")
    stage.update()
    assert shown.session.edits[-1]["edit"] == "place" and shown.session.edits[-1]["world_from_index"][9] > 0
    before = shown.sent.placed
    stage.bpy.ops.ed.undo()
    stage.context = Context(stage.bpy)
    stage.update()
    edits = [e["edit"] for e in shown.session.edits]
    assert edits[-1] == "place" and shown.sent.placed.keys() == before.keys(), "the same object, not a new one"


def test_a_failure_in_the_worker_is_told_and_the_next_change_begins_anew(stage):
    shown = stage.settle()
    failed = shown.session
    failed.status.state, failed.status.error = "failed", "a defect of Pumice: index out of bounds"
    stage.draw()
    assert "stopped: a defect of Pumice" in stage.engine.line
    stage.update()
    assert shown.session is failed, "the same scene would fail again"
    stage.obj.location.x += 1.0
    stage.update()
    assert shown.session is not failed and shown.session.status.state == "rendering"


def test_a_scene_that_is_refused_is_told_and_the_former_stays(stage, monkeypatch):
    shown = stage.settle()
    sent = shown.sent

    def refuse(*_):
        raise stage.module.InputError("instances[0].world_from_index: its axes lie in a plane")

    monkeypatch.setattr(shown.session, "edit", refuse)
    stage.obj.scale.x = 0.0
    stage.update()
    stage.draw()
    assert "its axes lie in a plane" in stage.engine.line and shown.sent is sent


def test_loading_a_file_ends_every_session(stage):
    shown = stage.settle()
    session = shown.session
    stage.bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert session.status.state == "stopped" and stage.viewport._viewports == {}


def test_disabling_the_extension_ends_every_session(stage, extension):
    session = stage.settle().session
    extension.unregister()
    try:
        assert session.status.state == "stopped"
    finally:
        extension.register()
