"""Tests columns of labels: they give the picture that single materials give, and bad columns are refused by name."""

import numpy as np
import pumice
import pytest

from test_session import wait

GHOST = {"alpha": 0.5, "roughness": 0.3}
RED = {"base_color": [0.8, 0.1, 0.1]}


@pytest.fixture
def scene(volume):
    return pumice.figure(volume, size=(48, 32))


@pytest.fixture
def columns(volume):
    """Groups and colours that differ from label to label, and half of the labels."""
    count = len(volume.labels)
    colors = np.random.default_rng(3).uniform(0, 1, (count, 3)).astype(np.float32)
    return np.arange(count) % 2, colors, np.arange(count) % 3 > 0


@pytest.fixture
def listed(scene, volume, columns):
    """The scene with the same look as single materials, and a list of the labels that are drawn."""
    group, colors, visible = columns
    fields = scene.to_dict()
    ids = volume.labels.ids.tolist()
    materials = {str(i): RED if g else {**GHOST, "base_color": c} for i, g, c in zip(ids, group, colors.astype(float).tolist())}
    show = {"only": [i for i, v in zip(ids, visible) if v]}
    fields["instances"][0]["style"] = {"show": show, "auto_color": False, "materials": materials}
    return pumice.Scene.from_dict(fields)


def groups(volume, columns, **over):
    group, colors, _ = columns
    given = dict(ids=volume.labels.ids, groups=group, colors=colors, materials=[GHOST, RED]) | over
    return pumice.LabelGroups(**given, colored=[True, False])


def test_columns_give_the_picture_of_single_materials(scene, listed, volume, columns):
    visible = (volume.labels.ids, columns[2])
    made = scene.with_labels(1, visible=visible, groups=groups(volume, columns))
    expected = pumice.render(listed, volume, spp=8, backend="cpu").color
    np.testing.assert_array_equal(pumice.render(made, volume, spp=8, backend="cpu").color, expected)
    with pumice.Session(scene, volume, spp=8, backend="cpu") as session:
        wait(session)
        revision = session.set_labels(1, visible=visible, groups=groups(volume, columns))
        frame = wait(session, lambda f: f.converged and f.revision == revision)
        np.testing.assert_array_equal(np.asarray(frame)[::-1, :, :3], expected)
        assert session.scene == made
    # Negative control: the colour of one label that is drawn.
    other = columns[1].copy()
    other[np.flatnonzero(columns[2] & (columns[0] == 0))[0]] = 0.0
    changed = scene.with_labels(1, visible=visible, groups=groups(volume, columns, colors=other))
    assert not np.array_equal(pumice.render(changed, volume, spp=8, backend="cpu").color, expected)


def test_groups_with_other_colors_are_those_of_the_changed_columns(scene, volume, columns):
    """Of one label, of some in both groups, of all; a group without colours keeps its material's."""
    made, rng, count = groups(volume, columns), np.random.default_rng(5), len(volume.labels)
    for rows in (np.array([count - 1]), np.sort(rng.choice(count, count // 3, replace=False)), np.arange(count)):
        other = columns[1].copy()
        other[rows] = rng.uniform(0, 1, (len(rows), 3))
        changed = scene.with_labels(1, groups=made.with_colors(volume.labels.ids[rows], other[rows]))
        assert changed == scene.with_labels(1, groups=groups(volume, columns, colors=other))
        # Negative control: one label that has a colour keeps the one that it had.
        last = rows[columns[0][rows] == 0][-1:]
        other[last] = columns[1][last]
        assert not len(last) or changed != scene.with_labels(1, groups=groups(volume, columns, colors=other))
    assert scene.with_labels(1, groups=made) == scene.with_labels(1, groups=groups(volume, columns)), "the first groups stay"


def test_bad_columns_of_colors_are_refused_by_name():
    made = pumice.LabelGroups([4, 5], [0, 0], np.zeros((2, 3)), [{}])
    with pytest.raises(pumice.InputError, match=r"ids\[1\]: label 6 is in no group"):
        made.with_colors([5, 6], np.zeros((2, 3)))
    with pytest.raises(pumice.InputError, match="ids: expected rising ids"):
        made.with_colors([5, 4], np.zeros((2, 3)))
    with pytest.raises(pumice.InputError, match="colors: expected one value for each of 1 labels, got 2"):
        made.with_colors([5], np.zeros((2, 4)))
    with pytest.raises(pumice.InputError, match=r"colors: expected an array \(n, 3\) or \(n, 4\), got \(3,\)"):
        made.with_colors([5], np.zeros(3))
    with pytest.raises(pumice.InputError, match=r"colors\[0\]: expected 0 to 1"):
        made.with_colors([5], [[0.0, float("nan"), 0.0]])


def test_a_scene_with_groups_comes_back_from_its_text(scene, volume, columns, tmp_path):
    made = scene.with_labels(1, groups=groups(volume, columns))
    assert pumice.Scene.from_json(made.to_json()) == made != scene
    made.save(tmp_path / "scene.json")
    loaded = pumice.Scene.load(tmp_path / "scene.json").to_dict()["instances"][0]["style"]["groups"]
    assert [one["labels"] for one in loaded] == [volume.labels.ids[columns[0] == g].tolist() for g in (0, 1)]
    np.testing.assert_array_equal(np.float32(loaded[0]["colors"]), columns[1][columns[0] == 0])
    assert loaded[1]["colors"] == [] and loaded[0]["material"]["alpha"] == 0.5


def test_the_material_of_a_group_is_replaced_alone(scene, volume, columns):
    made = scene.with_labels(1, groups=groups(volume, columns))
    with pumice.Session(made, volume, spp=4, backend="cpu") as session:
        wait(session)
        session.edit({"edit": "group_material", "id": 1, "group": 1, "material": GHOST})
        assert session.scene == scene.with_labels(1, groups=groups(volume, columns, materials=[GHOST, GHOST]))
        with pytest.raises(pumice.InputError, match="group_material.group: instance 1 has no group 2; it has 2"):
            session.edit({"edit": "group_material", "id": 1, "group": 2, "material": GHOST})


BAD = {
    "ids that fall": ({"ids": [5, 4]}, "ids: expected rising ids"),
    "an id that is negative": ({"ids": [-1, 4]}, "ids: expected 0 to 18446744073709551615, got -1"),
    "an id that is no whole number": ({"ids": [0.5, 4]}, "ids: expected a whole number, got 0.5"),
    "a short column": ({"groups": [0]}, "groups: expected one value for each of 2 labels, got 1"),
    "a colour above 1": ({"colors": [[0, 0, 0], [0, 1.5, 0]]}, r"colors\[1\]: expected 0 to 1"),
    "a colour that is no number": ({"colors": [[0, 0, 0], [0, float("nan"), 0]]}, r"colors\[1\]: expected 0 to 1"),
    "two numbers a colour": ({"colors": [[0, 0], [0, 0]]}, r"colors: expected an array \(n, 3\) or \(n, 4\), got \(2, 2\)"),
    "a field that materials lack": ({"materials": [{"gloss": 1}]}, "materials: unknown field `gloss`"),
    "a number that JSON lacks": ({"materials": [{"alpha": float("inf")}]}, "materials: Out of range float"),
    "a flag too many": ({"colored": [True, False]}, "colored: expected one value for each of 1 materials, got 2"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_columns_are_refused_by_name(name):
    over, problem = BAD[name]
    good = dict(ids=[4, 5], groups=[0, 0], colors=[[0, 0, 0], [1, 1, 1]], materials=[{}], colored=[True])
    pumice.LabelGroups(**good)
    with pytest.raises(pumice.InputError, match=problem):
        pumice.LabelGroups(**{**good, **over})


def test_what_does_not_fit_the_scene_is_refused(scene, volume):
    ids = volume.labels.ids
    with pytest.raises(pumice.InputError, match="the scene has no instance 9"):
        scene.with_labels(9, visible=(ids, np.ones(len(ids))))
    with pytest.raises(pumice.InputError, match=f"visible: expected one flag for each of {len(ids)} labels, got 1"):
        scene.with_labels(1, visible=(ids, [True]))
    unknown = pumice.LabelGroups([1], [0], [[0, 0, 0]], [{"alpha": 2.0}])
    with pytest.raises(pumice.InputError, match=r"instances\[0\].style.groups\[0\].material.alpha: expected 0 to 1, got 2"):
        scene.with_labels(1, groups=unknown)
