# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the proxy mesh of a volume as data: it has the labels that are shown, their colors and groups, and follows the label table."""

import importlib

import numpy as np
import pytest
from mathutils import Matrix

from stand_ins import Volume


@pytest.fixture
def modules(extension):
    names = ("volume_object", "proxy", "proxy_material", "proxy_update", "label_table", "registry", "reports")
    return {n: importlib.import_module(f"{extension.__name__}.{n}") for n in names}


@pytest.fixture
def made(blender, modules):
    """A volume object with three labels, each a cube, and its proxy; no file."""
    volume = Volume()
    obj = modules["volume_object"].create(
        blender.context, volume, name="cells", filepath=__file__, source_path="", longest_side=10.0, placement="CENTER"
    )
    modules["registry"].adopt(__file__, volume)
    modules["proxy_update"].refresh(obj, volume)
    blender.context.view_layer.objects.active = obj
    return obj


def column(mesh, name, field, width=1):
    """The values of an attribute."""
    data = mesh.attributes[name].data
    values = np.empty(len(data) * width, dtype=np.float32)
    data.foreach_get(field, values)
    return values.reshape(-1, width)


def labels_of(mesh):
    return column(mesh, "label", "value").ravel().astype(int).tolist()


def slots_of(mesh):
    return [polygon.material_index for polygon in mesh.polygons]


def test_faces_have_the_label_the_color_and_the_group_of_the_table(made, modules):
    mesh, table = made.data, made.pumice.table
    assert not mesh.validate(), "Blender finds nothing to repair"
    assert labels_of(mesh) == [0] * 6 + [1] * 6 + [2] * 6
    expected = np.repeat(modules["label_table"].colors(table), 24, axis=0)
    assert np.array_equal(column(mesh, "Label Color", "color", 4), expected)
    assert mesh.color_attributes.active_color.name == "Label Color" and mesh.color_attributes.render_color_index == 0
    # Each face looks away from the middle of its cube.
    middles = np.array([[8, 8, 8], [24, 24, 24], [56, 56, 24]])
    for polygon, label in zip(mesh.polygons, labels_of(mesh)):
        assert np.dot(polygon.normal, np.array(polygon.center) - middles[label]) == pytest.approx(8.0)


def test_a_hidden_label_has_no_face_and_none_shown_is_a_box_of_lines(made, modules):
    table, refresh = made.pumice.table, modules["proxy_update"].refresh
    modules["label_table"].set_visible(table, [True, False, True])
    refresh(made, Volume())
    assert set(labels_of(made.data)) == {0, 2}
    modules["label_table"].set_visible(table, [False] * 3)
    refresh(made, Volume())
    corners = np.array([v.co[:] for v in made.data.vertices])
    assert not made.data.polygons and np.ptp(corners, axis=0).tolist() == [64.0, 64.0, 32.0]
    ends = sorted(sorted(corners[vertex].tolist() for vertex in edge.vertices) for edge in made.data.edges)
    whole = [[[0, y, z], [64, y, z]] for y in (0, 64) for z in (0, 32)] + [[[x, 0, z], [x, 64, z]] for x in (0, 64) for z in (0, 32)]
    assert ends == sorted(whole + [[[x, y, 0], [x, y, 32]] for x in (0, 64) for y in (0, 64)])
    modules["label_table"].set_visible(table, [True] * 3)
    refresh(made, Volume())
    assert len(made.data.polygons) == 18


class Counting(Volume):
    """A volume that counts the surfaces that were made of it."""

    made = 0

    def coarse_surface(self, *arguments, **options):
        self.made += 1
        return super().coarse_surface(*arguments, **options)


def test_colors_and_groups_are_written_without_a_new_surface(blender, made, modules):
    table, volume, refresh = made.pumice.table, Counting(), modules["proxy_update"].refresh
    refresh(made, volume)
    assert volume.made == 0, "nothing has changed"
    modules["label_table"].set_color(table, [1], (0.25, 0.5, 0.75))
    made.data.materials.append(blender.data.materials.new("second"))
    modules["label_table"].set_slots(table, [2], 1)
    refresh(made, volume)
    assert volume.made == 0
    colors = column(made.data, "Label Color", "color", 4)
    assert (colors[24:48] == (0.25, 0.5, 0.75, 1.0)).all() and not (colors[:24] == colors[24]).all()
    assert slots_of(made.data) == [0] * 12 + [1] * 6
    # A slot that the object lacks is its last, as in Pumice's picture.
    modules["label_table"].set_slots(table, [0], 9)
    refresh(made, volume)
    assert slots_of(made.data) == [1] * 6 + [0] * 6 + [1] * 6
    made.pumice.proxy_faces = 1000
    refresh(made, volume)
    assert volume.made == 1


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_what_was_applied_to_a_proxy_stays_applied_to_the_next(made, modules, mirror):
    before = np.array([v.co[:] for v in made.data.vertices])
    frame = Matrix.Translation((5.0, 6.0, 7.0)) @ Matrix.Diagonal((2.0 * mirror, 3.0, 4.0, 1.0))
    made.data.transform(frame)
    assert modules["proxy"].Wanted(made).has_shape(made.data), "what Blender moves is not made anew"
    del made.data[modules["proxy"].SHAPE_STAMP]
    modules["proxy_update"].refresh(made, Volume())
    after = np.array([v.co[:] for v in made.data.vertices])
    assert np.allclose(after, before * (2.0 * mirror, 3.0, 4.0) + (5.0, 6.0, 7.0))
    middle = np.array(frame @ Matrix.Translation((8.0, 8.0, 8.0)))[:3, 3]
    for polygon in list(made.data.polygons)[:6]:
        assert np.dot(polygon.normal, np.array(polygon.center) - middle) > 0.0, "faces still look outward"


def test_the_material_reads_label_colors_only_where_it_has_colors_by_label(made, modules):
    material = made.active_material
    shader = material.node_tree.nodes["Principled BSDF"]
    link = shader.inputs["Base Color"].links[0]
    assert link.from_node.layer_name == "Label Color"
    nodes = len(material.node_tree.nodes)
    material.pumice.colors_by_label = False
    modules["proxy_update"].refresh(made, Volume())
    assert not shader.inputs["Base Color"].is_linked and len(material.node_tree.nodes) == nodes - 1
    # What the user has linked stays.
    own = material.node_tree.nodes.new("ShaderNodeRGB")
    material.node_tree.links.new(own.outputs[0], shader.inputs["Base Color"])
    material.pumice.colors_by_label = True
    modules["proxy_update"].refresh(made, Volume())
    assert shader.inputs["Base Color"].links[0].from_node == own


def ticks(update, most=200):
    """Calls the timer as Blender does, until it ends; returns how often."""
    import time

    for count in range(1, most):
        if update._tick() is None:
            return count
        time.sleep(0.01)
    raise AssertionError("the timer does not end")


def test_the_timer_makes_in_a_thread_what_has_changed(made, modules):
    update, table = modules["proxy_update"], made.pumice.table
    assert ticks(update) == 1, "nothing to do"
    modules["label_table"].set_visible(table, [False, True, False])
    assert update._tick() == update.SECONDS and set(labels_of(made.data)) == {0, 1, 2}, "the thread is at work"
    # A change meanwhile: what is made then is not the old one.
    modules["label_table"].set_visible(table, [True, False, False])
    ticks(update)
    assert set(labels_of(made.data)) == {0}
    modules["label_table"].set_color(table, [0], (0.5, 0.5, 0.5))
    assert ticks(update) == 1, "colors are written at once"
    assert (column(made.data, "Label Color", "color", 4)[:, 0] == 0.5).all()


def test_a_volume_with_other_labels_is_refused_by_the_name_of_the_object(made, modules):
    wanted = modules["proxy"].Wanted(made)
    other = Volume()
    assert len(wanted.surface(other).quads) > 0
    other.labels = type(other.labels)([5, 6])
    with pytest.raises(modules["reports"].Refused, match="^cells: the volume has changed since it was imported"):
        wanted.surface(other)


def test_a_missing_volume_leaves_the_proxy_as_it_is(made, modules, blender):
    made.pumice.filepath = "/nowhere/cells.pumice"
    modules["label_table"].set_visible(made.pumice.table, [False, True, False])
    ticks(modules["proxy_update"])
    assert len(made.data.polygons) == 18
    with pytest.raises(RuntimeError, match="the volume's file is missing"):
        blender.ops.pumice.update_proxy()


def test_the_operator_asks_for_a_volume(blender):
    assert not blender.ops.pumice.update_proxy.poll()
