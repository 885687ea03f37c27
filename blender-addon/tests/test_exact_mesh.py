# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests Make Exact Mesh: faces, corners, labels and materials against the dense array, a second run, limits, what is refused."""

import json

import numpy as np
import pytest

from test_real_volumes import imported


@pytest.fixture
def dense():
    """30 × 20 × 25 voxels: seven blocks with large ids, some of which touch, and single voxels."""
    rng = np.random.default_rng(3)
    out = np.zeros((30, 20, 25), dtype=np.uint64)
    for number in range(7):
        low = rng.integers(0, (22, 13, 17))
        out[tuple(slice(a, a + n) for a, n in zip(low, rng.integers(2, 8, 3)))] = (1 << 40) + 11 * number
    out[tuple(rng.integers(0, (30, 20, 25), (40, 3)).T)] = 5
    return out


@pytest.fixture
def volume(blender, dense, tmp_path):
    """The imported volume: its voxels sheared and mirrored, its object rotated."""
    import pumice

    matrix = np.array([[-2.0, 0.3, 0, 10], [0, 1.5, 0.2, 20], [0, 0, 3.0, 30], [0, 0, 0, 1]])
    pumice.compress(dense, world_from_index=matrix, unit="nm").save(tmp_path / "blocks.pumice")
    obj = imported(blender, tmp_path / "blocks.pumice")
    obj.rotation_euler = (0.1, 0.2, 0.3)
    blender.context.view_layer.update()
    return obj


def made(blender, volume, **wishes):
    for obj in blender.context.selected_objects:
        obj.select_set(False)
    blender.context.view_layer.objects.active = volume
    volume.hide_set(False)
    volume.select_set(True)
    assert blender.ops.pumice.make_exact_mesh(**wishes) == {"FINISHED"}
    (found,) = (o for o in blender.data.objects if "pumice_volume" in o)
    return found


def rows(mesh):
    """Sorted rows of the faces: label row, middle in half voxels, normal in Blender's own sense."""
    labels = np.empty(len(mesh.polygons), np.int32)
    mesh.attributes["label"].data.foreach_get("value", labels)
    corners = np.array([[mesh.vertices[v].co[:] for v in polygon.vertices] for polygon in mesh.polygons])
    normals = np.array([polygon.normal[:] for polygon in mesh.polygons]).round().astype(int)
    return in_order(np.column_stack([labels, (corners[:, 0] + corners[:, 2]).round().astype(int), normals]))


def expected(dense, shown):
    """The same of an array, found by comparing each voxel with its six neighbours."""
    ids = np.unique(dense[dense > 0])
    kept = np.pad(np.where(np.isin(dense, shown), dense, 0), 1)
    out = []
    for axis in range(3):
        for step in (-1, 1):
            at = np.argwhere((kept != 0) & (np.roll(kept, -step, axis) == 0))
            normal = np.zeros(3, dtype=int)
            normal[axis] = step
            labels = np.searchsorted(ids, kept[tuple(at.T)])
            out.append(np.column_stack([labels, 2 * (at - 1) + 1 + normal, np.broadcast_to(normal, at.shape)]))
    return in_order(np.concatenate(out))


def in_order(found):
    return found[np.lexsort(found.T[::-1])]


def base_color(material):
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    return np.array(shader.inputs["Base Color"].default_value[:3])


def test_faces_are_those_of_the_array(blender, volume, dense, extension):
    import pumice

    place = np.array(volume.matrix_world)
    mesh_object = made(blender, volume)
    mesh, ids = mesh_object.data, np.unique(dense[dense > 0])
    np.testing.assert_array_equal(rows(mesh), expected(dense, ids))
    assert np.allclose(np.array(mesh_object.matrix_world), place, atol=1e-7) and volume.hide_render and volume.hide_get()
    assert not any(polygon.use_smooth for polygon in mesh.polygons)
    # Corners are shared: no position twice.
    positions = np.array([v.co[:] for v in mesh.vertices])
    assert len(np.unique(positions, axis=0)) == len(positions)
    assert [label for label, _, _ in json.loads(mesh_object["labels"])] == ids.tolist()
    # A slot for each color, and each label has its own.
    colors = pumice.open(volume.pumice.filepath).labels.auto_colors()
    labels, slots = np.empty(len(mesh.polygons), np.int32), np.empty(len(mesh.polygons), np.int32)
    mesh.attributes["label"].data.foreach_get("value", labels)
    mesh.polygons.foreach_get("material_index", slots)
    assert len(mesh.materials) == len(np.unique(colors, axis=0)) > 1
    for label, slot in set(zip(labels.tolist(), slots.tolist())):
        assert np.allclose(base_color(mesh.materials[slot]), colors[label], atol=1e-6)
    # Negative control: an array that lacks a voxel has other faces.
    lacking = dense.copy()
    lacking[tuple(np.argwhere(dense > 0)[100])] = 0
    assert rows(mesh).shape != expected(lacking, ids).shape or (rows(mesh) != expected(lacking, ids)).any()


def test_hidden_labels_and_a_second_run(blender, volume, dense, extension):
    label_table = extension.exact_mesh.label_table
    first = made(blender, volume, hide_volume=False)
    assert not volume.hide_render
    ids, meshes, materials = np.unique(dense[dense > 0]), len(blender.data.meshes), len(blender.data.materials)
    table = volume.pumice.table
    shown = np.ones(len(ids), dtype=bool)
    shown[[1, 4]] = False
    label_table.set_visible(table, shown)
    label_table.set_color(table, [2], (0.1, 0.2, 0.3))
    second = made(blender, volume)
    # The same object has another mesh, and nothing of the first is left.
    assert second == first and len(blender.data.meshes) == meshes and len(blender.data.materials) <= materials + 1
    np.testing.assert_array_equal(rows(second.data), expected(dense, ids[shown]))
    labels = np.empty(len(second.data.polygons), np.int32)
    second.data.attributes["label"].data.foreach_get("value", labels)
    (slot,) = {second.data.polygons[i].material_index for i in np.flatnonzero(labels == 2).tolist()}
    assert np.allclose(base_color(second.data.materials[slot]), (0.1, 0.2, 0.3), atol=1e-6)
    # One material for all labels is the volume's own.
    volume.active_material.pumice.colors_by_label = False
    assert list(made(blender, volume).data.materials) == [volume.active_material]


def empty(blender, name, **place):
    obj = blender.data.objects.new(name, None)
    blender.context.scene.collection.objects.link(obj)
    for field, value in place.items():
        setattr(obj, field, value)
    return obj


def held(blender, volume, how):
    """Places the volume by something other than its own matrix."""
    other = empty(blender, "other", location=(3.0, 0.5, 0.0), rotation_euler=(0.2, 0.0, 1.0))
    if how == "limit":
        limit = volume.constraints.new("LIMIT_LOCATION")
        limit.use_min_x, limit.min_x = True, 6.0
    elif how == "track":
        volume.constraints.new("TRACK_TO").target = other
        volume.constraints.new("COPY_LOCATION").target = other
    elif how == "bone":
        rig = blender.data.objects.new("rig", blender.data.armatures.new("rig"))
        blender.context.scene.collection.objects.link(rig)
        blender.context.view_layer.objects.active = rig
        blender.ops.object.mode_set(mode="EDIT")
        bone = rig.data.edit_bones.new("bone")
        bone.head, bone.tail = (0.0, 0.0, 1.0), (1.0, 0.0, 2.0)
        blender.ops.object.mode_set(mode="OBJECT")
        volume.parent, volume.parent_type, volume.parent_bone = rig, "BONE", "bone"
    else:
        mesh = blender.data.meshes.new("corner")
        mesh.from_pydata([(2.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 2.0)], [], [(0, 1, 2)])
        corner = blender.data.objects.new("corner", mesh)
        blender.context.scene.collection.objects.link(corner)
        volume.parent, volume.parent_type, volume.parent_vertices = corner, "VERTEX", (1, 0, 0)


@pytest.mark.parametrize("how", ["limit", "track", "bone", "vertex"])
def test_it_stands_where_the_volume_does(blender, volume, how):
    own = np.array(volume.matrix_world)
    held(blender, volume, how)
    blender.context.view_layer.update()
    expected = np.array(volume.matrix_world)
    assert np.abs(expected - own).max() > 0.5, "control: it stands elsewhere than by its own matrix"
    for _ in range(2):
        found = made(blender, volume)
        blender.context.view_layer.update()
        np.testing.assert_allclose(np.array(found.matrix_world), expected, atol=1e-6)
        assert len(found.constraints) == len(volume.constraints)


def test_merged_faces_are_fewer_and_cover_the_same(blender, volume, dense):
    plain = sum(polygon.area for polygon in made(blender, volume).data.polygons)
    merged = made(blender, volume, merged=True).data
    assert len(merged.polygons) < len(expected(dense, np.unique(dense[dense > 0]))) / 2
    assert sum(polygon.area for polygon in merged.polygons) == pytest.approx(plain, rel=1e-6)


def test_labels_of_an_empty_slot_have_a_plain_material_of_their_color(blender, volume, extension):
    volume.active_material.pumice.colors_by_label = True
    blender.context.view_layer.objects.active = volume
    blender.ops.object.material_slot_add()
    volume.material_slots[-1].material = None
    label_table = extension.exact_mesh.label_table
    label_table.set_slots(volume.pumice.table, [2], len(volume.material_slots) - 1)
    mesh = made(blender, volume).data
    labels = np.empty(len(mesh.polygons), np.int32)
    mesh.attributes["label"].data.foreach_get("value", labels)
    (slot,) = {mesh.polygons[i].material_index for i in np.flatnonzero(labels == 2).tolist()}
    assert np.allclose(base_color(mesh.materials[slot]), label_table.colors(volume.pumice.table)[2, :3], atol=1e-6)


def test_many_colors_share_a_material(blender, volume, extension, monkeypatch):
    monkeypatch.setattr(extension.exact_mesh, "MOST_MATERIALS", 1)
    mesh = made(blender, volume).data
    (material,) = mesh.materials
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    (link,) = shader.inputs["Base Color"].links
    assert link.from_node.attribute_name == "base_color"
    colors = np.empty(4 * len(mesh.polygons), np.float32)
    mesh.attributes["base_color"].data.foreach_get("color", colors)
    assert len(np.unique(colors.reshape(-1, 4), axis=0)) > 1


def test_what_is_refused_is_one_line(blender, volume, extension):
    with pytest.raises(RuntimeError, match="faces of the surface, counted so far: .* more than the limit of 175; .* 570 bytes a face"):
        for obj in blender.context.selected_objects:
            obj.select_set(obj == volume)
        blender.ops.pumice.make_exact_mesh(memory_gb=1e-4)
    label_table = extension.exact_mesh.label_table
    label_table.set_visible(volume.pumice.table, np.zeros(len(volume.pumice.table.vertices), dtype=bool))
    with pytest.raises(RuntimeError, match="no label is shown"):
        blender.ops.pumice.make_exact_mesh()
    volume.select_set(False)
    blender.context.view_layer.objects.active = None
    with pytest.raises(RuntimeError, match="no volume is selected"):
        blender.ops.pumice.make_exact_mesh()
    assert not any("pumice_volume" in o for o in blender.data.objects)
