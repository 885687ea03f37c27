# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests animations with the real module: each frame is that of a fresh render, what did not change is kept, keyframes have their closed
form, a frame that fails ends the animation with its number, and memory does not grow.

The oracle of a frame is a still of it: a render job of its own, whose renderer has seen no other frame.
"""

import os
import time
import types
from pathlib import Path

import numpy as np
import pytest

from test_growing_render import Engine
from test_real_volumes import exr, imported, load, scene  # noqa: F401 (the fixture)


@pytest.fixture
def kept(extension, monkeypatch):
    """What is kept for each frame that is rendered, in order; an animation that keeps it has one object for all."""
    persistent, seen = load(extension, "persistent"), []
    original = persistent.of
    monkeypatch.setattr(persistent, "of", lambda *a: (seen.append(original(*a)), seen[-1])[1])
    return seen


def animated(bpy, scene, tmp_path, frames):  # noqa: F811
    """The pictures of an animation, by frame."""
    scene.frame_start, scene.frame_end = frames[0], frames[-1]
    scene.render.filepath = str(tmp_path / "anim_####.exr")
    assert bpy.ops.render.render(animation=True) == {"FINISHED"}
    return {frame: exr(tmp_path / f"anim_{frame:04}.exr") for frame in frames}


def still(bpy, scene, tmp_path, frame):  # noqa: F811
    """The picture of one frame, in a render job of its own."""
    scene.frame_set(frame)
    scene.render.filepath = str(tmp_path / "still.exr")
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    return exr(tmp_path / "still.exr")


def key(owner, path, values, frames=(1, 5)):
    """Sets keyframes."""
    for frame, value in zip(frames, values):
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)


def principled(obj):
    return next(n for n in obj.active_material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")


def mesh_object(bpy, name):
    """A large triangle in front of the volume's middle, with a modifier that can be animated."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(-4, -4, 0), (4, -4, 0), (0, 5, 1)], [], [(0, 1, 2)])
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def everything_moves(bpy, scene):  # noqa: F811
    """Keyframes of all kinds: camera, lens, material, cut, world, light, settings, visibility, and a mesh that changes its shape."""
    volume = next(o for o in scene.objects if o.pumice.filepath)
    key(scene.camera, "location", [scene.camera.location.copy(), scene.camera.location * 1.1])
    key(scene.camera.data, "lens", [50.0, 44.0])
    shader = principled(volume)
    key(shader.inputs["Alpha"], "default_value", [1.0, 0.3])
    key(shader.inputs["Roughness"], "default_value", [0.2, 0.9])
    key(shader.inputs["Emission Strength"], "default_value", [0.0, 0.5])
    # A group of every third label, which fades faster.
    group = volume.active_material.copy()
    volume.data.materials.append(group)
    slots = volume.pumice.table.attributes["slot"].data
    slots.foreach_set("value", [int(label % 3 == 0) for label in range(len(slots))])
    fading = next(n for n in group.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    key(fading.inputs["Alpha"], "default_value", [0.9, 0.0])
    cut = bpy.data.objects.new("cut", None)
    scene.collection.objects.link(cut)
    cut.pumice.cut = "PLANE"
    cut.rotation_euler = (0.0, 1.2, 0.0)
    key(cut, "location", [(3.0, 0.0, 0.0), (-1.0, 0.0, 0.0)])
    world = scene.world.node_tree.nodes["Background"].inputs["Strength"]
    key(world, "default_value", [0.2, 2.0])
    sun = next(o for o in scene.objects if o.type == "LIGHT")
    key(sun.data, "energy", [1.0, 5.0])
    key(scene.pumice, "filter_pixels", [1.0, 3.0])
    obj = mesh_object(bpy, "sail")
    solid = obj.modifiers.new("solid", "SOLIDIFY")
    key(solid, "thickness", [0.1, 2.0])
    hidden = mesh_object(bpy, "hidden")
    hidden.location = (1.0, 1.0, 2.0)
    # Whether it is shown changes at frame 3.
    key(hidden, "hide_render", [False, True], frames=(1, 3))
    interpolate(hidden, "CONSTANT")


def interpolate(owner, kind):
    """Sets how values between the keyframes of an owner are found; Blender 4.4 moved the curves."""
    action = owner.animation_data.action
    bags = [action] if hasattr(action, "fcurves") else [b for layer in action.layers for strip in layer.strips for b in strip.channelbags]
    for curve in [curve for bag in bags for curve in bag.fcurves]:
        for point in curve.keyframe_points:
            point.interpolation = kind


def test_each_frame_is_that_of_a_fresh_render(blender, scene, kept, tmp_path):  # noqa: F811
    scene.pumice.samples = 2
    blender.context.view_layer.use_pass_z = blender.context.view_layer.use_pass_normal = True
    everything_moves(blender, scene)
    frames = [1, 2, 3, 4]
    pictures = animated(blender, scene, tmp_path, frames)
    assert len(kept) == 4 and all(k is kept[0] for k in kept), "one renderer for all frames"
    meshes = kept[0]._meshes
    assert len({**meshes._former, **meshes._made}) <= 3, "two frames have a mesh that changes, and one that does not"
    former = None
    for frame in frames:
        fresh = still(blender, scene, tmp_path, frame)
        assert kept[-1] is not kept[0], "a still has a renderer of its own"
        assert fresh.keys() == pictures[frame].keys() and "Depth.Z" in fresh
        for name, pixels in fresh.items():
            assert np.array_equal(pixels, pictures[frame][name]), (frame, name)
        assert former is None or not np.array_equal(former["Combined.R"], fresh["Combined.R"]), "the frames differ"
        former = fresh


def by_part(path):
    """The channels of each part of an OpenEXR file, under their whole names."""
    import OpenImageIO

    found, part = {}, 0
    file = OpenImageIO.ImageInput.open(str(path))
    while file.seek_subimage(part, 0):
        spec = file.spec()
        names = [f"{spec.getattribute('name') or ''}:{name}" for name in spec.channelnames]
        pixels = file.read_image(part, 0, 0, spec.nchannels, "float")
        found.update({name: pixels[..., at] for at, name in enumerate(names)})
        part += 1
    return found


def test_view_layers_take_turns_with_one_renderer(blender, scene, kept, tmp_path):  # noqa: F811
    """A second layer without the mesh, and with other passes: each frame draws both, and each is that of a fresh render."""
    scene.pumice.samples = 2
    sail = mesh_object(blender, "sail")
    apart = blender.data.collections.new("apart")
    scene.collection.children.link(apart)
    scene.collection.objects.unlink(sail)
    apart.objects.link(sail)
    second = scene.view_layers.new("second")
    second.layer_collection.children["apart"].exclude = True
    second.use_pass_z = True
    key(scene.camera, "location", [scene.camera.location.copy(), scene.camera.location * 1.2])
    animated(blender, scene, tmp_path, [1, 2])
    assert len(kept) == 4 and all(k is kept[0] for k in kept)
    for frame in (1, 2):
        moving = by_part(tmp_path / f"anim_{frame:04}.exr")
        still(blender, scene, tmp_path, frame)
        fresh = by_part(tmp_path / "still.exr")
        assert fresh.keys() == moving.keys() and all(np.array_equal(fresh[name], moving[name]) for name in fresh)
        first, other = ([fresh[name] for name in sorted(fresh) if layer in name and "Combined" in name] for layer in ("ViewLayer", "second"))
        assert len(first) == 4 and not np.array_equal(first, other), "the layers differ"


@pytest.mark.parametrize("what", ["camera", "alpha", "cut", "visibility"])
def test_frames_build_only_what_changed(blender, scene, kept, tmp_path, what):  # noqa: F811
    """Three frames: a hierarchy for the volume and one for the mesh, and nothing twice but what moves."""
    scene.pumice.samples = 1
    volume = next(o for o in scene.objects if o.pumice.filepath)
    mesh_object(blender, "sail").location = (0.0, 0.0, -3.0)
    spare = mesh_object(blender, "spare")
    spare.hide_render = what != "visibility"
    if what == "camera":
        key(scene.camera, "location", [scene.camera.location.copy(), scene.camera.location * 1.2])
    elif what == "alpha":
        key(principled(volume).inputs["Alpha"], "default_value", [1.0, 0.2])
    elif what == "cut":
        cut = blender.data.objects.new("cut", None)
        scene.collection.objects.link(cut)
        cut.pumice.cut = "PLANE"
        key(cut, "location", [(1.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
    else:
        key(spare, "hide_render", [False, True], frames=(1, 2))
    animated(blender, scene, tmp_path, [1, 2, 3])
    rebuilt = kept[0].renderer.rebuilt
    # The spare mesh has the triangles of the other one and shares their hierarchy.
    assert rebuilt["acceleration"] == 2
    assert rebuilt["camera"] == (3 if what == "camera" else 1)
    # Tables of materials: of the volume and of each mesh; the volume's again with each alpha.
    assert rebuilt["materials"] == {"alpha": 4, "visibility": 3}.get(what, 2)


def test_what_is_kept_goes_when_the_render_job_ends_and_when_a_file_is_opened(blender, scene, extension, tmp_path):  # noqa: F811
    persistent = load(extension, "persistent")
    during = []
    watch = lambda *_: during.append(len(persistent._kept))  # noqa: E731
    blender.app.handlers.render_post.append(watch)
    try:
        animated(blender, scene, tmp_path, [1, 2])
    finally:
        blender.app.handlers.render_post.remove(watch)
    assert during == [1, 1] and persistent._kept == {}
    persistent.of(scene, "cpu")
    blender.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert persistent._kept == {}


def test_another_device_or_scene_has_a_renderer_of_its_own(blender, scene, extension):  # noqa: F811
    persistent = load(extension, "persistent")
    first = persistent.of(scene, "cpu")
    assert persistent.of(scene, "cpu") is first
    assert persistent.of(blender.data.scenes.new("other"), "cpu") is not first and persistent.of(scene, "cpu") is first
    assert persistent.of(scene, "auto") is not first
    persistent.drop()
    assert persistent.of(scene, "auto").backend == "auto"
    persistent.drop()


def test_meshes_of_an_earlier_frame_are_found_by_all_their_numbers(extension):
    """A mesh is kept where corners, triangles, materials and normals are equal, for one frame, and not otherwise."""
    meshes = load(extension, "persistent").Meshes()
    corners = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    triangles, slots = np.uint32([[0, 1, 2]]), np.uint32([0])
    normals = np.tile(np.float32([0, 0, 1]), (1, 3, 1))
    bent = np.tile(np.float32([0, 0.6, 0.8]), (1, 3, 1))
    moved = corners + np.float32(1e-6)
    variants = [
        ((corners, triangles, slots), {}),
        ((moved, triangles, slots), {}),
        ((corners, triangles[:, [1, 2, 0]], slots), {}),
        ((corners, triangles, slots + np.uint32(1)), {}),
        ((corners, triangles, slots), {"normals": normals}),
        ((corners, triangles, slots), {"normals": bent}),
    ]
    meshes.next_frame()
    first = [meshes(*arrays, **more) for arrays, more in variants]
    assert len({id(m) for m in first}) == len(variants)
    meshes.next_frame()
    assert [meshes(*(a.copy() for a in arrays), **more) for arrays, more in variants[:3]] == first[:3]
    meshes.next_frame()
    again = [meshes(*arrays, **more) for arrays, more in variants[:4]]
    assert all(a is b for a, b in zip(again[:3], first)) and again[3] is not first[3], "what a frame lacks is forgotten"


def block_of_labels(bpy, tmp_path):
    """A solid block that fills the view of an orthographic camera, of black labels under a sky of radiance 0.5."""
    path = tmp_path / "block.npy"
    np.save(path, np.ones((8, 8, 8), dtype=np.uint8))
    obj = imported(bpy, path)
    scene = bpy.context.scene
    for light in [o for o in scene.objects if o.type == "LIGHT"]:
        bpy.data.objects.remove(light)
    background = scene.world.node_tree.nodes["Background"]
    for link in list(scene.world.node_tree.links):
        if link.to_node == background:
            scene.world.node_tree.links.remove(link)
    background.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    background.inputs["Strength"].default_value = 0.5
    obj.active_material.pumice.colors_by_label = False
    shader = principled(obj)
    shader.inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    shader.inputs["Specular IOR Level"].default_value = 0.0
    shader.inputs["Roughness"].default_value = 1.0
    middle = sum((obj.matrix_world @ type(obj.location)(corner) for corner in obj.bound_box), type(obj.location)()) / 8
    camera = scene.camera
    camera.rotation_euler, camera.location = (0.0, 0.0, 0.0), middle + type(middle)((0.0, 0.0, 100.0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 0.5 * max(obj.dimensions)
    camera.data.clip_end = 1000.0
    return obj, shader


def test_a_keyframed_alpha_lets_through_what_its_closed_form_says(blender, tmp_path, scene):  # noqa: F811
    """A ray passes the block's two faces, each with probability 1 − a, and then meets a sky of radiance 0.5; black faces give nothing. Alpha
    goes from 0 to 1 in four steps."""
    blender.data.objects.remove(next(o for o in scene.objects if o.pumice.filepath))
    _, shader = block_of_labels(blender, tmp_path)
    key(shader.inputs["Alpha"], "default_value", [0.0, 1.0])
    interpolate(shader.id_data, "LINEAR")
    scene.pumice.samples = 16
    pictures = animated(blender, scene, tmp_path, [1, 2, 3, 4, 5])
    for frame, picture in pictures.items():
        alpha = (frame - 1) / 4
        through = (1.0 - alpha) ** 2
        green = picture["Combined.G"]
        # Four standard deviations of the mean of all samples, of which each is 0 or 0.5; roulette may scale one, never beyond twice.
        tolerance = 4.0 * 2.0 * 0.5 * np.sqrt(through * (1.0 - through) / (16 * green.size)) + 1e-6
        assert abs(green.mean() - 0.5 * through) <= tolerance, (alpha, green.mean())
    assert (pictures[1]["Combined.G"] == 0.5).all() and (pictures[5]["Combined.G"] == 0.0).all()


def test_a_keyframed_cut_is_where_the_same_cut_by_hand_is(blender, scene, tmp_path):  # noqa: F811
    scene.pumice.samples = 2
    cut = blender.data.objects.new("cut", None)
    scene.collection.objects.link(cut)
    cut.pumice.cut = "PLANE"
    key(cut, "location", [(-2.0, 0.0, -2.0), (2.0, 0.0, 2.0)])
    interpolate(cut, "LINEAR")
    middle = animated(blender, scene, tmp_path, [3])[3]
    cut.animation_data_clear()
    cut.location = (0.0, 0.0, 0.0)
    by_hand = still(blender, scene, tmp_path, 1)
    assert np.array_equal(middle["Combined.R"], by_hand["Combined.R"])
    cut.location = (0.0, 0.0, 0.5)
    assert not np.array_equal(middle["Combined.R"], still(blender, scene, tmp_path, 1)["Combined.R"])


def test_a_frame_that_fails_ends_the_animation_and_is_named(blender, scene, extension, tmp_path):  # noqa: F811
    volume = next(o for o in scene.objects if o.pumice.filepath)
    path, ended = Path(volume.pumice.filepath), []
    stay = path.with_suffix(".away")

    def lose(_scene, *_):
        if blender.context.scene.frame_current == 3 and path.exists():
            path.rename(stay)

    cancelled = lambda *_: ended.append("cancel")  # noqa: E731
    blender.app.handlers.render_cancel.append(cancelled)
    blender.app.handlers.render_pre.append(lose)
    try:
        with pytest.raises(RuntimeError) as raised:
            animated(blender, scene, tmp_path, [1, 2, 3, 4])
    finally:
        blender.app.handlers.render_pre.remove(lose)
        blender.app.handlers.render_cancel.remove(cancelled)
    said = str(raised.value)
    assert "Frame 3: " in said and str(path) in said and "Traceback" not in said
    assert sorted(p.name for p in tmp_path.glob("anim_*")) == ["anim_0001.exr", "anim_0002.exr"]
    assert ended == ["cancel"] and load(extension, "persistent")._kept == {}
    stay.rename(path)
    assert len(animated(blender, scene, tmp_path, [3, 4])) == 2, "the next render works"


@pytest.mark.parametrize("fault,said", [("camera", "no camera"), ("material", "Frame 2: materials: "), ("panorama", "Frame 2: .*panoramas are not drawn")])
def test_what_cannot_be_drawn_is_named_with_its_frame(blender, scene, tmp_path, fault, said):  # noqa: F811
    volume = next(o for o in scene.objects if o.pumice.filepath)
    if fault == "camera":
        scene.camera = None
    elif fault == "material":
        volume.active_material.pumice.colors_by_label = False
        shader = principled(volume)
        # Beyond single precision.
        shader.inputs["Emission Color"].default_value = (3e38, 3e38, 3e38, 1.0)
        shader.inputs["Emission Strength"].default_value = 1e6
    else:
        scene.camera.data.type = "PANO"
    # Without a camera Blender does not even ask the engine, and has a text of its own.
    with pytest.raises(RuntimeError, match=said) as raised:
        animated(blender, scene, tmp_path, [2, 3])
    assert "Frame 3" not in str(raised.value) and list(tmp_path.glob("anim_*")) == []


@pytest.fixture
def broken_off(extension, monkeypatch):
    """Makes the user press ESC at the look of this number; returns the setter."""
    final_render = load(extension, "final_render")
    original, looks = final_render.render, types.SimpleNamespace(left=None)

    def breaks():
        looks.left -= 1
        return looks.left < 0

    monkeypatch.setattr(final_render, "render", lambda engine, graph: original(Engine(engine, breaks), graph))
    monkeypatch.setattr(final_render, "is_watched", lambda: True)
    return lambda number: setattr(looks, "left", number)


def test_a_picture_that_grows_is_the_same_in_the_end(blender, scene, broken_off, extension, monkeypatch, tmp_path):  # noqa: F811
    render = scene.render
    render.resolution_x, render.resolution_y, scene.pumice.samples = 240, 160, 3
    growing, shown = load(extension, "render_result").Growing, []
    original = growing.show_frame
    monkeypatch.setattr(growing, "show_frame", lambda self, frame: (shown.append(frame.coarse), original(self, frame))[1])
    broken_off(1 << 30)
    grown = still(blender, scene, tmp_path, 1)
    assert shown, "it was shown while it grew"
    monkeypatch.setattr(load(extension, "final_render"), "is_watched", lambda: False)
    count = len(shown)
    plain = still(blender, scene, tmp_path, 1)
    assert len(shown) == count and all(np.array_equal(grown[name], plain[name]) for name in plain)


def test_passes_of_a_real_picture_arrive_while_it_grows(blender, scene, extension, monkeypatch, tmp_path):  # noqa: F811
    """A render of a million samples that ESC ends once passes were shown."""
    growing, final_render, shown = load(extension, "render_result").Growing, load(extension, "final_render"), []
    original, render, end = growing.show_passes, final_render.render, time.monotonic() + 60.0
    monkeypatch.setattr(growing, "show_passes", lambda self, picture: (shown.append(picture), original(self, picture))[1])
    monkeypatch.setattr(final_render, "is_watched", lambda: True)
    escape = lambda: bool(shown) or time.monotonic() > end  # noqa: E731
    monkeypatch.setattr(final_render, "render", lambda engine, graph: render(Engine(engine, escape), graph))
    scene.render.resolution_x, scene.render.resolution_y, scene.pumice.samples = 64, 48, 1 << 20
    blender.context.view_layer.use_pass_z = True
    written = still(blender, scene, tmp_path, 1)
    (so_far,) = shown
    depth = np.where(np.isfinite(so_far.depth), so_far.depth, np.float32(1e10))
    assert so_far.spp >= 1 and np.array_equal(written["Depth.Z"], depth), "where the first surface is, further samples do not change"
    # Control: without a pass there is nothing to show, so no picture so far is made.
    blender.context.view_layer.use_pass_z, scene.pumice.samples = False, 64
    still(blender, scene, tmp_path, 1)
    assert len(shown) == 1


@pytest.mark.full
def test_escape_at_any_moment_leaves_a_picture(blender, scene, broken_off, tmp_path):  # noqa: F811
    """Where rows have as many samples as a picture that was rendered to its end, they are the same; nothing is NaN."""
    render = scene.render
    render.resolution_x, render.resolution_y, scene.pumice.samples = 160, 120, 1 << 20
    blender.context.view_layer.pumice.use_pass_samples = True
    random = np.random.default_rng(5)
    for looks in [0, 1, 2, *random.integers(3, 60, 12)]:
        broken_off(int(looks))
        left = still(blender, scene, tmp_path, 1)
        assert all(np.isfinite(pixels).all() for pixels in left.values())
        samples = left["Debug Sample Count.X"]
        n = int(samples[60, 0])
        if n in range(1, 40):
            broken_off(1 << 30)
            scene.pumice.samples = n
            whole = still(blender, scene, tmp_path, 1)
            scene.pumice.samples = 1 << 20
            same = samples[:, 0] == n
            assert np.array_equal(left["Combined.G"][same], whole["Combined.G"][same])


def resident_bytes():
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.full
def test_memory_does_not_grow_over_thirty_frames(blender, scene, extension, tmp_path):  # noqa: F811
    """A picture of 480 × 270 with its passes is 10 MB, and a mesh of 80,000 triangles 4 MB. If one of them stayed for each frame, thirty frames
    would take 120 MB; the allocator's own wobble is below 30 MB."""
    render = scene.render
    render.resolution_x, render.resolution_y, scene.pumice.samples = 480, 270, 1
    blender.context.view_layer.use_pass_z = True
    blender.ops.mesh.primitive_grid_add(x_subdivisions=200, y_subdivisions=200, size=0.1)
    solid = blender.context.object.modifiers.new("solid", "SOLIDIFY")
    key(solid, "thickness", [0.01, 2.0], frames=(1, 40))
    key(scene.camera, "location", [scene.camera.location.copy(), scene.camera.location * 1.3], frames=(1, 40))
    sizes = []
    measure = lambda *_: sizes.append(resident_bytes())  # noqa: E731
    blender.app.handlers.render_post.append(measure)
    try:
        animated(blender, scene, tmp_path, list(range(1, 39)))
    finally:
        blender.app.handlers.render_post.remove(measure)
    assert len(sizes) == 38
    assert max(sizes[-5:]) - max(sizes[3:8]) < 30 << 20, [size >> 20 for size in sizes]
