# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests picking: the label film against the Label pass of F12, what operators select, one undo step, what is refused."""

import random
import types

import numpy as np
import pytest
from mathutils import Matrix

from pick_scene import FIRST_IDS, SECOND_IDS, VIEWS, knife, made, passes, seen
from stand_ins import Context, Engine
from test_real_volumes import load


@pytest.fixture
def stage(blender, extension, tmp_path):
    """The scene of `pick_scene`, with a label of the second volume hidden."""
    first, duplicate, second = made(blender, tmp_path)
    label_table = load(extension, "label_table")
    label_table.set_visible(second.pumice.table, [True, True, False, True, True])
    second.update_tag()
    blender.context.view_layer.update()
    stage = types.SimpleNamespace(bpy=blender, folder=tmp_path, objects=(first, duplicate, second), table=label_table)
    stage.film, stage.pick, stage.extension = load(extension, "label_film"), load(extension, "label_pick"), extension

    def chosen():
        """Ids of the selected labels of the first and of the second volume."""
        return tuple(
            [label for label, flag in zip(ids, label_table.selected(obj.pumice.table)) if flag]
            for ids, obj in ((FIRST_IDS, first), (SECOND_IDS, second))
        )

    stage.chosen = chosen
    return stage


def film_as_objects(stage, film):
    """(index into `stage.objects`, -1 without a label; row + 1) of each pixel of a film."""
    places = {obj.session_uid: place for place, obj in enumerate(stage.objects)}
    owner = np.full(film.pixels.shape[:2], -1)
    for number, uid in film.uids.items():
        owner[film.pixels[..., 0] == number] = places[uid]
    return owner, film.pixels[..., 1].astype(np.int64)


def compare(stage, view, with_knife):
    """Compares the camera's film with F12's Label pass and with the nearest of three pictures."""
    VIEWS[view](stage.bpy)
    if with_knife:
        knife(stage.bpy)
    film = stage.film.of_camera(stage.bpy.context)
    owner, label = film_as_objects(stage, film)
    expected, _ = passes(stage.bpy, stage.folder)
    assert np.array_equal(label, expected)
    for of in (owner, label):  # the comparison is no empty one, and it would notice rows from the bottom
        assert len(np.unique(of)) >= 4 and not np.array_equal(of[::-1], of)
    assert 3 not in label[owner == 2], "the hidden label is not seen"
    assert np.array_equal(owner, seen(stage.bpy, stage.folder, stage.objects))
    stage.bpy.data.objects.remove(stage.bpy.data.objects["screen"])
    stage.bpy.context.view_layer.update()
    without = stage.film.of_camera(stage.bpy.context).pixels[..., 1]
    assert (without != label).any() and (label[without != label] == 0).all(), "a mesh hides labels, and has none"


def test_the_film_is_the_label_pass_of_f12_and_knows_the_object(stage):
    compare(stage, "perspective", with_knife=False)


@pytest.mark.parametrize("view", VIEWS)
def test_the_film_is_the_label_pass_of_f12_in_every_view_with_cuts(stage, view):
    compare(stage, view, with_knife=True)


def test_a_film_of_another_camera_does_not_agree(stage):
    film = stage.film.of_camera(stage.bpy.context)
    VIEWS["shifted"](stage.bpy)
    expected, _ = passes(stage.bpy, stage.folder)
    assert not np.array_equal(film.pixels[..., 1], expected)


def agree(stage, count, seed):
    """Picks random pixels, and compares what is selected and active with the Label pass of F12 and the nearest of three pictures."""
    label, _ = passes(stage.bpy, stage.folder)
    owner, rng, hits = seen(stage.bpy, stage.folder, stage.objects), random.Random(seed), set()
    for _ in range(count):
        x, y = rng.randrange(label.shape[1]), rng.randrange(label.shape[0])
        for obj in stage.objects:
            obj.select_set(False)
        assert stage.bpy.ops.pumice.labels_pick(x=x, y=y) == {"FINISHED"}
        place, row = owner[y, x], label[y, x] - 1
        expected = ([], []) if row < 0 else ([], [SECOND_IDS[row]]) if place == 2 else ([FIRST_IDS[row]], [])
        assert stage.chosen() == expected, (x, y)
        if row >= 0:
            assert stage.bpy.context.object == stage.objects[place], (x, y)
            assert stage.objects[place].select_get(), "the active object is selected too, even if it was active before"
            hits.add((place, row))
    assert len(hits) >= 5 and {place for place, _ in hits} == {0, 1, 2}, hits


def test_a_pick_selects_what_the_label_pass_shows(stage):
    agree(stage, 60, 1)


@pytest.mark.full
@pytest.mark.parametrize("view", VIEWS)
def test_a_thousand_picks_select_what_the_label_pass_shows(stage, view):
    VIEWS[view](stage.bpy)
    knife(stage.bpy)
    agree(stage, 1000, 2)


def places(stage):
    """{(index of the object, row): a pixel that sees it}, and a pixel that sees nothing."""
    owner, label = film_as_objects(stage, stage.film.of_camera(stage.bpy.context))
    pixels = {}
    for y, x in np.argwhere(label > 0):
        pixels.setdefault((int(owner[y, x]), int(label[y, x]) - 1), (int(x), int(y)))
    y, x = np.argwhere(label == 0)[0]
    return pixels, (int(x), int(y))


def test_picks_in_several_volumes_select_as_blender_selects_objects(stage):
    pick = lambda at, **more: stage.bpy.ops.pumice.labels_pick(x=at[0], y=at[1], **more)  # noqa: E731
    pixels, nothing = places(stage)
    rows = lambda place: sorted(row for owner, row in pixels if owner == place)  # noqa: E731
    a, b = rows(0)[:2]
    other = rows(2)[0]
    pick(pixels[0, a])
    assert stage.chosen() == ([FIRST_IDS[a]], []) and stage.bpy.context.object == stage.objects[0]
    pick(pixels[0, b], extend=True)
    assert stage.chosen() == (sorted([FIRST_IDS[a], FIRST_IDS[b]]), [])
    pick(pixels[0, b], extend=True)
    assert len(stage.chosen()[0]) == 2, "extend alone takes nothing out, as in labels_select"
    pick(pixels[0, b], extend=True, toggle=True)
    assert stage.chosen() == ([FIRST_IDS[a]], [])
    pick(pixels[2, other], extend=True)
    assert stage.chosen() == ([FIRST_IDS[a]], [SECOND_IDS[other]]) and stage.bpy.context.object == stage.objects[2]
    pick(nothing, extend=True)
    assert stage.chosen() == ([FIRST_IDS[a]], [SECOND_IDS[other]]), "nothing is added"
    pick(pixels[2, other])
    assert stage.chosen() == ([], [SECOND_IDS[other]]), "what is selected in other volumes is deselected"
    pick(pixels[1, rows(1)[0]])
    assert stage.chosen() == ([FIRST_IDS[rows(1)[0]]], []) and stage.bpy.context.object == stage.objects[1], "a linked duplicate"
    pick(nothing)
    assert stage.chosen() == ([], [])


def test_a_pick_in_a_duplicate_leaves_the_original_alone(stage):
    """A duplicate with a mesh of its own (Shift D) shares the table until it is changed."""
    copy = stage.objects[1]
    copy.data = copy.data.copy()
    pixels, _ = places(stage)
    row = next(row for owner, row in pixels if owner == 1)
    stage.bpy.ops.pumice.labels_pick(x=pixels[1, row][0], y=pixels[1, row][1])
    assert copy.pumice.table != stage.objects[0].pumice.table and stage.chosen() == ([], [])
    assert np.flatnonzero(stage.table.selected(copy.pumice.table)).tolist() == [row]


def test_a_box_selects_all_labels_that_are_seen_in_it(stage):
    owner, label = film_as_objects(stage, stage.film.of_camera(stage.bpy.context))
    rng = random.Random(3)
    height, width = label.shape
    most = 0
    seen_at = np.argwhere(label > 0).tolist()
    for turn in range(80):
        # Mostly small boxes at a label, whose edges decide.
        y0, x0 = (low - rng.randrange(6) for low in (rng.choice(seen_at) if turn % 4 else (rng.randrange(height), rng.randrange(width))))
        x1, y1 = (low + (rng.randrange(6) if turn % 4 else rng.randrange(50)) for low in (x0, y0))
        wanted = (set(), set())
        for y in range(max(0, y0), min(height, y1)):
            for x in range(max(0, x0), min(width, x1)):
                if label[y, x]:
                    ids, place = (SECOND_IDS, 1) if owner[y, x] == 2 else (FIRST_IDS, 0)
                    wanted[place].add(ids[label[y, x] - 1])
        stage.bpy.ops.pumice.labels_select_box(x0=x0, y0=y0, x1=x1, y1=y1)
        assert stage.chosen() == tuple(sorted(ids) for ids in wanted), (x0, y0, x1, y1)
        most = max(most, len(wanted[0]) + len(wanted[1]))
    assert most >= 5
    before = stage.chosen()
    stage.bpy.ops.pumice.labels_select_box(x0=0, y0=0, x1=0, y1=0, extend=True)
    assert stage.chosen() == before


def test_the_list_scrolls_to_the_picked_label(stage, tmp_path):
    import pumice

    search = stage.bpy.context.window_manager.pumice_labels
    refresh = load(stage.extension, "label_search").refresh
    pumice.compress(np.arange(1, 1001, dtype=np.uint32).reshape(10, 10, 10)).save(tmp_path / "many.pumice")
    stage.bpy.ops.pumice.import_volume(filepath=str(tmp_path / "many.pumice"))
    hits = lambda: [hit.row for hit in search.hits]  # noqa: E731
    for row, first in ((0, 0), (99, 0), (650, 550), (999, 800)):
        refresh(stage.bpy.context, row)
        assert hits() == list(range(first, first + 200)) and hits()[search.active] == row
    search.query = "id<=500"
    assert search.active == 0
    refresh(stage.bpy.context, 650)
    assert (hits()[0], search.active, search.count, len(hits())) == (650, 0, 500, 200), "the search does not find it"
    stage.bpy.data.objects.remove(stage.bpy.context.object)
    pixels, _ = places(stage)
    at, search.query = pixels[0, 1], ""
    stage.bpy.ops.pumice.labels_pick(x=at[0], y=at[1])
    assert hits() == [0, 1, 2] and search.active == 1, "of the volume that was picked"


def test_a_pick_is_one_undo_step(stage):
    bpy, name = stage.bpy, stage.objects[0].name
    (owner, row), at = next(item for item in places(stage)[0].items() if item[0][0] == 0)
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.pumice.labels_pick(x=at[0], y=at[1])
    bpy.ops.ed.undo_push(message="pick")
    chosen = lambda: np.flatnonzero(stage.table.selected(bpy.data.objects[name].pumice.table)).tolist()  # noqa: E731
    assert chosen() == [row]
    bpy.ops.ed.undo()
    assert chosen() == []
    bpy.ops.ed.redo()
    assert chosen() == [row]
    for operator in (stage.pick.PUMICE_OT_labels_pick, load(stage.extension, "label_box").PUMICE_OT_labels_select_box):
        assert {"REGISTER", "UNDO"} <= set(operator.bl_options)


def test_the_camera_film_is_drawn_again_only_after_a_change(stage, monkeypatch):
    drawn, draw = [], stage.film._drawn
    monkeypatch.setattr(stage.film, "_drawn", lambda *of: drawn.append(1) or draw(*of))
    of = lambda: stage.film.of_camera(stage.bpy.context)  # noqa: E731
    assert of() is of() and len(drawn) == 1, "the mesh counts as the same one, too"
    stage.bpy.context.view_layer.objects.active = stage.objects[0]
    stage.bpy.ops.pumice.labels_select(ids="3")
    of()
    assert len(drawn) == 1, "a selection changes nothing in the picture"
    stage.bpy.ops.pumice.labels_hide()
    assert 1 not in of().pixels[of().pixels[..., 0] == 1][:, 1] and len(drawn) == 2
    stage.bpy.data.objects["screen"].data.vertices[0].co.x -= 1.0
    stage.bpy.data.objects["screen"].data.update()
    stage.bpy.context.view_layer.update()
    of()
    assert len(drawn) == 3


def only_as_instance(stage, obj):
    """Moves an object to a collection of which the scene has an instance alone; returns the empty that makes it."""
    collection = stage.bpy.data.collections.new("apart")
    collection.objects.link(obj)
    for other in list(obj.users_collection):
        if other != collection:
            other.objects.unlink(obj)
    empty = stage.bpy.data.objects.new("instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    stage.bpy.context.scene.collection.objects.link(empty)
    stage.bpy.context.view_layer.update()
    return empty


def test_instances_of_a_collection_are_in_the_film_as_in_f12(stage):
    empty = only_as_instance(stage, stage.objects[2])
    expected, _ = passes(stage.bpy, stage.folder)
    film = stage.film.of_camera(stage.bpy.context)
    assert np.array_equal(film.pixels[..., 1], expected) and stage.objects[2].session_uid in film.uids.values()
    empty.hide_render = True
    hidden, _ = passes(stage.bpy, stage.folder)
    assert np.array_equal(stage.film.of_camera(stage.bpy.context).pixels[..., 1], hidden) and not np.array_equal(hidden, expected)


def test_what_cannot_be_picked_is_refused_in_one_line(stage):
    pick = stage.bpy.ops.pumice.labels_pick
    with pytest.raises(RuntimeError, match="0 to 59 across and 0 to 43 down, got 60, 3"):
        pick(x=60, y=3)
    with pytest.raises(RuntimeError, match="got 2, 44"):
        pick(x=2, y=44)
    at = next(at for (owner, _), at in places(stage)[0].items() if owner == 2)
    only_as_instance(stage, stage.objects[2])
    with pytest.raises(RuntimeError, match="is not in view layer .*, only instances of it are"):
        pick(x=at[0], y=at[1])
    assert stage.chosen() == ([], [])
    stage.bpy.context.scene.camera = None
    with pytest.raises(RuntimeError, match="has no camera"):
        pick(x=1, y=1)


def test_a_dragged_rectangle_holds_the_pixels_under_both_of_its_corners(extension):
    of = load(extension, "label_box").rectangle
    # Twice as many pixels in the region as in the film; rows of the film are counted from the top.
    assert of((10, 20), (31, 51), (200, 100), (100, 50)) == (5, 24, 16, 40)
    assert of((31, 20), (10, 51), (200, 100), (100, 50)) == (5, 24, 16, 40), "from any corner"
    assert of((7, 7), (7, 7), (200, 100), (100, 50)) == (3, 46, 4, 47)
    assert of((-9, 120), (400, -3), (200, 100), (100, 50)) == (0, 0, 100, 50), "dragged out of the region"


@pytest.mark.parametrize("film_size", [(96, 64), (48, 32), (31, 77), (1, 1)])
def test_every_pixel_of_a_region_leads_to_the_pixel_of_the_film_that_covers_it(extension, film_size):
    """The picture is stretched over the region: a pixel of the film covers a rectangle, which holds the middle of the region's pixel."""
    of, (width, height), region = load(extension, "label_film").film_from_region, film_size, (96, 64)
    for x in range(region[0]):
        for y in range(region[1]):
            across, down = of(x, y, region, film_size)
            assert across * region[0] <= (x + 0.5) * width <= (across + 1) * region[0]
            up = height - 1 - down
            assert up * region[1] <= (y + 0.5) * height <= (up + 1) * region[1]
    assert of(0, 0, region, film_size) == (0, height - 1) and of(95, 63, region, film_size) == (width - 1, 0)
    assert of(-5, 70, region, film_size) == (0, 0), "beside the region the nearest pixel counts"


def test_a_viewports_film_is_that_of_its_picture_and_follows_it(stage, monkeypatch):
    """With the real module and a mock window: same film as F12's where the view is the same, another after an orbit, the same after colors."""
    bpy, viewport = stage.bpy, load(stage.extension, "viewport")
    monkeypatch.setattr(load(stage.extension, "picture_texture").PictureTexture, "draw", lambda *_: None)
    monkeypatch.setattr(load(stage.extension, "missing_boxes"), "draw", lambda *_: None)
    bpy.context.scene.pumice.viewport_samples = 1
    context, engine = Context(bpy, size=(60, 44)), Engine()
    depsgraph = lambda: bpy.context.evaluated_depsgraph_get()  # noqa: E731
    shown = viewport.of(engine)

    def film():
        shown.sync(context, depsgraph())
        shown.draw(context, depsgraph())
        found = stage.film.of_viewport(shown, 60.0)
        assert found is not None, shown.notes
        return found

    assert viewport.of_region(context.region) is None and viewport.of_region(None) is None, "it was not drawn yet"
    first = film()
    assert viewport.of_region(context.region) is shown and viewport.of_region(None) is None and viewport.last_drawn() is shown
    expected, _ = passes(bpy, stage.folder)
    # The viewport's camera is in single precision, F12's in double: some pixels at edges differ, of 2,640.
    assert (first.pixels[..., 1] != expected).sum() <= 13
    stage.table.set_color(stage.objects[0].pumice.table, [0], (0.9, 0.1, 0.1))
    stage.objects[0].update_tag()
    bpy.context.view_layer.update()
    assert np.shares_memory(film().pixels, first.pixels), "colors do not change what is seen"
    context.region_data.view_matrix = context.region_data.view_matrix @ Matrix.Rotation(0.1, 4, "Z")
    assert not np.array_equal(film().pixels, first.pixels)
    assert not shown.awaits_labels
    # Hovering reads the film alone.
    said = load(stage.extension, "pick_tool").said_of
    pixels = film().pixels
    monkeypatch.setattr(shown.session, "pick", lambda *_: pytest.fail("the worker is asked"), raising=False)
    y, x = next((y, x) for y, x in np.argwhere(pixels[..., 1] == 1) if film().uids[int(pixels[y, x, 0])] == stage.objects[0].session_uid)
    assert said(shown, x, 43 - y, (60, 44)) == "Label 3 · Axon one · axon · 384 voxels"
    y, x = np.argwhere(pixels[..., 1] == 0)[0]
    assert said(shown, x, 43 - y, (60, 44)) is None and said(shown, 60, 3, (60, 44)) is None
