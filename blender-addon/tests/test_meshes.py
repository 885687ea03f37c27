# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests ordinary objects as meshes and cuts: their triangles, places and materials, and what each change makes the extension read again.

The oracles are Blender's own data: areas and bounds of evaluated meshes, material slots, the display of empties.
"""

import importlib

import numpy as np
import pytest
from mathutils import Matrix, Vector

from stand_ins import Module


@pytest.fixture
def stage(blender, extension, drawn, monkeypatch):
    """A function that reads the scene, with the cache that a viewport has."""
    load = lambda name: importlib.import_module(f"{extension.__name__}.{name}")  # noqa: E731
    monkeypatch.setattr(load("native"), "pumice", Module())
    reader = load("scene_reader")
    kept = reader.Kept()

    found = []

    def on_update(_scene, depsgraph):
        found[:] = [reader.read(depsgraph, {}, {}, kept)]

    def read():
        """Reads during an update of the dependency graph, as a viewport does, because only then it knows what has changed."""
        found.clear()
        blender.app.handlers.depsgraph_update_post.append(on_update)
        try:
            blender.context.view_layer.update()
        finally:
            blender.app.handlers.depsgraph_update_post.remove(on_update)
        return found[0] if found else reader.read(blender.context.evaluated_depsgraph_get(), {}, {}, kept)

    read.kept, read.load = kept, load
    return read


def added(bpy, data, name="thing", **fields):
    obj = bpy.data.objects.new(name, data)
    for field, value in fields.items():
        setattr(obj, field, value)
    bpy.context.collection.objects.link(obj)
    return obj


def quad(bpy, name="quad"):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0), (0, 0, 3)], [], [(0, 1, 2, 3), (0, 1, 4)])
    mesh.shade_flat()
    return mesh


def in_world(placed):
    """Corners of all triangles in the world (m, 3, 3), by the definition of the matrix in docs/scene.md."""
    columns = np.array(placed.world_from_mesh).reshape(4, 3)
    corners = np.asarray(placed.geometry.positions, dtype=float) @ columns[:3] + columns[3]
    return corners[np.asarray(placed.geometry.triangles)]


def area(triangles):
    return np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1).sum() / 2


def test_a_mesh_is_its_evaluated_triangles_with_their_materials(blender, stage):
    mesh = quad(blender)
    for color in ((0.8, 0.1, 0.1, 1.0), (0.1, 0.8, 0.1, 1.0)):
        made = blender.data.materials.new("dress")
        if blender.app.version < (5, 0, 0):
            made.use_nodes = True
        made.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = color
        mesh.materials.append(made)
    mesh.polygons[1].material_index = 1
    added(blender, mesh, location=(1.0, 2.0, 3.0), scale=(-1.0, 2.0, 1.0))
    parts, left_out = stage()
    assert left_out == []
    placed = next(iter(parts.meshes.values()))
    triangles = in_world(placed)
    # The quad is 2 × 1, scaled to 2 × 2; the triangle stands on a side of length 2 and is 3 high.
    assert area(triangles[:2]) == pytest.approx(4.0) and area(triangles[2:]) == pytest.approx(3.0)
    assert triangles.min(axis=(0, 1)) == pytest.approx([-1.0, 2.0, 3.0]) and triangles[..., 2].max() == pytest.approx(6.0)
    assert list(placed.geometry.materials) == [0, 0, 1]
    assert [m["base_color"][:2] for m in placed.materials] == [pytest.approx([0.8, 0.1]), pytest.approx([0.1, 0.8])]
    assert placed.shadow_catcher is False


def test_a_shadow_catcher_is_one(blender, stage):
    obj = added(blender, quad(blender), is_shadow_catcher=True)
    light = added(blender, blender.data.lights.new("lamp", "POINT"), "lamp")
    parts, left_out = stage()
    (placed,) = parts.meshes.values()
    assert placed.shadow_catcher is True and placed.mesh(3)["shadow_catcher"] is True and left_out == []
    # A light whose shadow-catcher mark is off: Cycles does not use it for catchers, while Pumice treats it as any other light.
    light.is_shadow_catcher, obj.is_shadow_catcher = False, False
    parts, left_out = stage()
    assert next(iter(parts.meshes.values())).shadow_catcher is False
    assert left_out == ["Light lamp: it lights shadow catchers as other lights do"]


def test_modifiers_curves_and_texts_are_what_blender_shows(blender, stage):
    cube = added(blender, quad(blender, "thick"), "thick")
    cube.modifiers.new("thick", "SOLIDIFY").thickness = 0.5
    cube.modifiers.new("many", "ARRAY").count = 3
    curve = blender.data.curves.new("ring", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.1
    spline = curve.splines.new("POLY")
    spline.points.add(3)
    for point, co in zip(spline.points, ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 1))):
        point.co = (*co, 1.0)
    added(blender, curve, "ring")
    added(blender, blender.data.curves.new("words", "FONT"), "words").data.body = "um"
    parts, left_out = stage()
    assert left_out == [] and sorted(m.name for m in parts.meshes.values()) == ["ring", "thick", "words"], "each once"
    depsgraph = blender.context.evaluated_depsgraph_get()
    for placed in parts.meshes.values():
        evaluated = blender.data.objects[placed.name].evaluated_get(depsgraph)
        shape = evaluated.to_mesh()
        shape.calc_loop_triangles()
        expected = sum(t.area for t in shape.loop_triangles)
        evaluated.to_mesh_clear()
        assert area(in_world(placed)) == pytest.approx(expected, rel=1e-4), placed.name
    assert area(in_world(next(m for m in parts.meshes.values() if m.name == "thick"))) > 3 * 5.0


def test_objects_that_share_a_mesh_share_its_triangles(blender, stage):
    mesh = quad(blender)
    for step in range(3):
        added(blender, mesh, f"copy {step}", location=(step, 0, 0))
    collection = blender.data.collections.new("group")
    collection.objects.link(added(blender, quad(blender, "other"), "inside"))
    for step in range(2):
        added(blender, None, f"instance {step}", instance_type="COLLECTION", instance_collection=collection, location=(0, step, 0))
    parts, _ = stage()
    assert len(parts.meshes) == 6 and stage.kept.geometries.reads == 2
    assert len({id(m.geometry) for m in parts.meshes.values()}) == 2
    assert len({tuple(m.world_from_mesh) for m in parts.meshes.values()}) == 4, "three stand at the origin"


def changes(bpy, stage, change, depsgraph=None):
    """(edits, meshes sent again, geometries read) due to a change."""
    before, _ = stage()
    reads = stage.kept.geometries.reads
    change()
    after, _ = stage()
    found = stage.load("sync.edits").between(before, after, before.numbers())
    return [e["edit"] for e in found.edits], found.added_meshes, stage.kept.geometries.reads - reads


def test_only_what_changed_is_read_and_sent(blender, stage):
    mesh = quad(blender)
    obj, other = added(blender, mesh, "one"), added(blender, quad(blender, "still"), "two")
    mesh.materials.append(blender.data.materials.new("dress"))
    camera = added(blender, blender.data.cameras.new("eye"), "eye")

    def move_corner():
        mesh.vertices[2].co.x = 5.0
        mesh.update()

    def recolor():
        mesh.materials[0].pumice.colors_by_label = True  # of labels alone
        mesh.materials[0].node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.1

    assert changes(blender, stage, lambda: None) == ([], [], 0)
    assert changes(blender, stage, lambda: setattr(camera, "location", (1, 2, 3))) == ([], [], 0)
    assert changes(blender, stage, lambda: setattr(obj, "location", (1, 2, 3))) == (["place_mesh"], [], 0)
    assert changes(blender, stage, recolor) == (["mesh_materials"], [], 0)
    edits, sent, reads = changes(blender, stage, move_corner)
    assert (edits, len(sent), reads) == ([], 1, 1)
    thick = other.modifiers.new("thick", "SOLIDIFY")
    edits, again, reads = changes(blender, stage, lambda: setattr(thick, "thickness", 0.3))
    assert (edits, len(again), reads) == ([], 1, 1)
    assert changes(blender, stage, lambda: setattr(other, "location", (0, 1, 0))) == (["place_mesh"], [], 0)
    assert changes(blender, stage, lambda: setattr(obj, "is_shadow_catcher", True))[:2] == ([], sent)
    assert changes(blender, stage, lambda: setattr(other, "hide_viewport", True)) == (["remove_mesh"], [], 0)
    edits, sent, reads = changes(blender, stage, lambda: setattr(other, "hide_viewport", False))
    assert (edits, len(sent)) == ([], 1)


def test_a_curve_is_read_again_when_it_bends(blender, stage):
    curve = blender.data.curves.new("ring", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.1
    spline = curve.splines.new("POLY")
    spline.points.add(1)
    spline.points[1].co = (1, 0, 0, 1)
    obj = added(blender, curve, "ring")
    assert changes(blender, stage, lambda: setattr(obj, "location", (1, 2, 3))) == (["place_mesh"], [], 0)
    edits, sent, reads = changes(blender, stage, lambda: setattr(curve, "bevel_depth", 0.3))
    assert (edits, len(sent), reads) == ([], 1, 1)


def test_what_geometry_nodes_scatter_is_drawn(blender, stage):
    """Instances on points of a mesh without an object: the mesh is read once, and drawn at each place."""
    tree = blender.data.node_groups.new("scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes = {n: tree.nodes.new(n) for n in ("NodeGroupOutput", "GeometryNodeMeshLine", "GeometryNodeMeshCube", "GeometryNodeInstanceOnPoints")}
    line, cube, scatter, out = (
        nodes[n] for n in ("GeometryNodeMeshLine", "GeometryNodeMeshCube", "GeometryNodeInstanceOnPoints", "NodeGroupOutput")
    )
    line.inputs["Count"].default_value = 5
    tree.links.new(line.outputs[0], scatter.inputs["Points"])
    tree.links.new(cube.outputs["Mesh"], scatter.inputs["Instance"])
    tree.links.new(scatter.outputs[0], out.inputs[0])
    obj = added(blender, quad(blender), "field")
    obj.modifiers.new("scatter", "NODES").node_group = tree
    parts, left_out = stage()
    assert left_out == [] and len(parts.meshes) == 5
    assert stage.kept.geometries.reads == 2, "the cube is read, and the empty rest of the object's own mesh"
    assert all(area(in_world(m)) == pytest.approx(6.0) for m in parts.meshes.values())
    assert len({tuple(m.world_from_mesh) for m in parts.meshes.values()}) == 5
    stage()
    assert stage.kept.geometries.reads == 2


def test_a_thousand_copies_are_read_once_and_a_camera_reads_none(blender, stage):
    mesh = quad(blender)
    for step in range(1000):
        added(blender, mesh, f"copy {step}", location=(step, 0, 0))
    camera = added(blender, blender.data.cameras.new("eye"), "eye")
    stage()
    assert stage.kept.geometries.reads == 1
    camera.location = (3.0, 2.0, 1.0)
    stage()
    assert stage.kept.geometries.reads == 1


def test_what_is_not_drawn_of_an_object_is_named(blender, stage):
    obj = added(blender, quad(blender), "odd", is_holdout=True, visible_glossy=False)
    added(blender, quad(blender, "flat"), "flat", scale=(1.0, 1.0, 0.0))
    added(blender, blender.data.meshes.new("nothing"), "nothing")
    added(blender, blender.data.volumes.new("smoke"), "smoke")
    added(blender, blender.data.pointclouds.new("dust"), "dust")
    blender.context.view_layer.objects.active = obj
    for kind in ("PATH", "OBJECT"):
        particles = obj.modifiers.new(kind, "PARTICLE_SYSTEM").particle_system.settings
        particles.type, particles.render_type, particles.count = "HAIR", kind, 2
        assert any("particle hair" in line for line in stage()[1]), "of the first system"
    parts, left_out = stage()
    assert [m.name for m in parts.meshes.values()] == [obj.name]
    assert left_out == [
        "Object odd: its particle hair is not drawn",
        "Object odd: Holdout is not drawn",
        "Object odd: it is seen by glossy rays all the same",
        "Object flat: scaled to nothing; it is left out",
        "Not drawn: dust, smoke",
    ]
    said = stage.load("panels").not_drawn(blender.context.scene, blender.context.view_layer)
    assert set(left_out) - set(said) == {left_out[3]}, "the panel does not read matrices"


def test_what_a_view_layer_or_cycles_switches_off_is_named(blender, extension):
    scene, layer = blender.context.scene, blender.context.view_layer
    assert extension.scene_reader.render_warnings(scene, layer) == []
    layer.use_solid, layer.use_sky, scene.cycles.film_exposure = False, False, 2.0
    assert extension.scene_reader.render_warnings(scene, layer) == [
        f"View layer {layer.name}: Surfaces is off, and drawn all the same",
        f"View layer {layer.name}: Environment is off, and drawn all the same",
        "Film Exposure of Cycles, 2, is not drawn",
    ]
    layer.use_solid, layer.use_sky, scene.cycles.film_exposure = True, True, 1.0
    scene.cycles.caustics_reflective, scene.cycles.use_fast_gi = False, True
    fast = "Fast GI Approximation of Cycles is not drawn: light bounces as often as Bounces says"
    assert extension.scene_reader.render_warnings(scene, layer) == ["Reflective caustics are off in Cycles, and drawn all the same", fast]
    scene.cycles.caustics_refractive, scene.cycles.use_fast_gi = False, False
    both = "Reflective and refractive caustics are off in Cycles, and drawn all the same"
    assert extension.scene_reader.render_warnings(scene, layer) == [both]


def test_smooth_shading_is_named_where_it_is_not_drawn(blender, stage, drawn, monkeypatch):
    monkeypatch.setattr(drawn, "SMOOTH_MESHES", False)
    mesh = quad(blender)
    added(blender, mesh, "round")
    assert stage()[1] == []
    mesh.shade_smooth()
    mesh.update()
    assert stage()[1] == ["Object round: smooth shading is drawn flat"]
    plane = blender.data.meshes.new("plane")
    plane.from_pydata([(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)], [], [(0, 1, 2), (0, 2, 3)])
    plane.shade_smooth()
    added(blender, plane, "even")
    assert len(stage()[1]) == 1, "smooth shading of a plane is flat shading"


def test_smooth_shading_is_blenders_normals(blender, stage, drawn, tmp_path):
    """With smooth shading, sharp edges and custom normals, the corners of triangles have Blender's normals."""
    assert drawn.SMOOTH_MESHES
    mesh = quad(blender)
    added(blender, mesh, "round")
    of = lambda parts: next(iter(parts.meshes.values())).geometry  # noqa: E731
    assert of(stage()[0]).normals is None
    mesh.shade_smooth()
    mesh.update()
    parts, left_out = stage()
    assert left_out == []
    smooth = of(parts)
    # Both faces meet at corners 0 and 1 with equal angles, and stand at a right angle, so the normals there are halfway between.
    both = np.array([0, -1, 1]) / np.sqrt(2)
    expected = {2: (0, 0, 1), 3: (0, 0, 1), 4: (0, -1, 0), 0: both}
    for triangle, normals in zip(smooth.triangles, smooth.normals, strict=True):
        for corner, normal in zip(triangle, normals, strict=True):
            if int(corner) in expected:
                np.testing.assert_allclose(normal, expected[int(corner)], atol=1e-4)
    edge = next(e for e in mesh.edges if set(e.vertices) == {0, 1})
    edge.use_edge_sharp = True
    mesh.update()
    sharp = of(stage()[0])
    assert sharp is not smooth and sharp.normals is None, "with a sharp edge both faces are flat"

    # With custom normals, the PLY file has one vertex per pair of corner and normal.
    edge.use_edge_sharp = False
    own = np.array([[0.1 * i, 0.2, 1.0] for i in range(7)], dtype=np.float32)
    own /= np.linalg.norm(own, axis=1)[:, None]
    mesh.normals_split_custom_set(own.tolist())
    mesh.update()
    geometry = of(stage()[0])
    loops = np.array([loop for t in mesh.loop_triangles for loop in t.loops])
    np.testing.assert_allclose(geometry.normals.reshape(-1, 3), own[loops], atol=1e-3)
    module = stage.load("mesh_file")
    arrays = module.Arrays(geometry.positions, geometry.triangles, geometry.materials, geometry.normals)
    module.write(tmp_path / "a.ply", arrays)
    raw = (tmp_path / "a.ply").read_bytes()
    header, _, body = raw.partition(b"end_header\n")
    assert b"element vertex 7\n" in header and header.index(b"property float z") < header.index(b"property float nx")
    rows = np.frombuffer(body[: 7 * 24], dtype="<f4").reshape(7, 6)
    faces = np.frombuffer(body[7 * 24 :], dtype=[("count", "u1"), ("corners", "<u4", 3), ("material", "<u4")])
    np.testing.assert_array_equal(rows[faces["corners"]][..., 3:], geometry.normals)
    np.testing.assert_array_equal(rows[faces["corners"]][..., :3], geometry.positions[geometry.triangles])


def test_cuts_are_what_their_objects_show(blender, stage):
    turned = Matrix.LocRotScale(Vector((1, 2, 3)), Matrix.Rotation(0.7, 3, "X").to_quaternion(), Vector((1.5, 2.0, -0.5)))
    empty = added(blender, None, "box", empty_display_type="CUBE", empty_display_size=0.7, matrix_world=turned)
    empty.pumice.cut = "BOX"
    plane = added(blender, quad(blender), "plane", matrix_world=turned)
    plane.pumice.cut = "PLANE"
    mesh = added(blender, quad(blender, "bounds"), "bounds")
    mesh.pumice.cut = "BOX"
    parts, left_out = stage()
    assert left_out == [] and parts.meshes == {} and len(parts.cuts) == 3, "an object that cuts is not drawn"
    boxes = [np.array(c.shape["box"]["world_from_box"]).reshape(4, 3) for c in parts.cuts if "box" in c.shape]
    world = np.array(turned)
    shown = world[:3, :3] @ np.array([[0.7, -0.7, 0.7]]).T + world[:3, 3:]
    corners = sorted(map(tuple, (np.array([x, y, z]) @ b[:3] + b[3] for b in boxes for x in (-1, 1) for y in (-1, 1) for z in (-1, 1))))
    assert np.abs(np.array(corners) - shown.T).sum(axis=1).min() == pytest.approx(0.0, abs=1e-5)
    assert np.abs(np.array(corners) - [2.0, 1.0, 3.0]).sum(axis=1).min() == pytest.approx(0.0, abs=1e-5)
    cut = next(c.shape["plane"] for c in parts.cuts if "plane" in c.shape)
    normal, z = np.array(cut["normal"]), world[:3, 2]
    assert cut["point"] == pytest.approx(list(world[:3, 3]))
    assert normal @ z > 0 and abs(normal @ world[:3, 0]) < 1e-5 and abs(normal @ world[:3, 1]) < 1e-5

    plane.scale = (0.0, 1.0, 1.0)
    mesh.scale = (1.0, 0.0, 1.0)
    parts, left_out = stage()
    assert len(parts.cuts) == 1 and all("cuts nothing" in line for line in left_out) and len(left_out) == 2
    empty.hide_viewport = True
    assert stage()[0].cuts == []


def test_a_mesh_is_drawn_where_it_stands(blender, extension):
    """With the compiled module and its own flags: from above, the quad covers its rectangle at its height, and the triangle that stands
    on it is seen edge-on, so it is invisible."""
    import pumice

    added(blender, quad(blender), "floor", location=(0.5, 0.0, 1.0))
    eye = blender.data.cameras.new("eye")
    eye.type, eye.ortho_scale = "ORTHO", 8.0
    camera = added(blender, eye, "eye", location=(0.0, 0.0, 5.0))
    reader = extension.scene_reader
    blender.context.view_layer.update()
    film = {"width": 16, "height": 16, "filter": {"box": {"width": 1.0}}}
    parts, left_out = reader.read(blender.context.evaluated_depsgraph_get(), reader.lens.read(camera), film, reader.Kept())
    assert left_out == []
    scene = pumice.Scene.from_dict(parts.scene())
    depth = pumice.render(scene, [], meshes=parts.geometries(), spp=1, backend="cpu").depth
    x, y = np.meshgrid((np.arange(16) + 0.5) / 2 - 4, 4 - (np.arange(16) + 0.5) / 2)
    inside = (x > 0.5) & (x < 2.5) & (y > 0.0) & (y < 1.0)
    assert inside.sum() == 8 and np.array_equal(np.isfinite(depth), inside)
    assert depth[inside] == pytest.approx(4.0, abs=1e-5)


def test_the_module_takes_what_is_read(blender, extension, drawn):
    """The compiled module accepts a scene with meshes and cuts, and has the same number of triangles."""
    import pumice

    added(blender, quad(blender), "floor")
    box = added(blender, None, "box", empty_display_type="CUBE")
    box.pumice.cut = "BOX"
    camera = added(blender, blender.data.cameras.new("eye"), "eye")
    reader = extension.scene_reader
    blender.context.view_layer.update()
    film = {"width": 4, "height": 4, "filter": {"box": {"width": 1.0}}}
    parts, _ = reader.read(blender.context.evaluated_depsgraph_get(), reader.lens.read(camera), film, reader.Kept())
    scene = pumice.Scene.from_dict(parts.scene()).to_dict()
    assert len(scene["meshes"]) == len(scene["cuts"]) == 1
    assert [g.triangles for g in parts.geometries()] == [3]
