"""Every function that takes ids of labels takes each of them exactly, in any form, and refuses what is no id.

    ids     2**53 and 2**53 + 1, which are one number as float64; 2**63, which int64 lacks; 2**64 - 1
    forms   lists of Python's and numpy's integers, also mixed, and arrays of each type

numpy makes float64 of `[2**64 - 1, 1]`, and of int64 and uint64 together, which rounds such ids. The oracle is the same call with one id after
the other as Python's int, and what is known of the volume: label i of IDS has i + 1 voxels.
"""

import inspect
import json

import numpy as np
import pumice
import pytest

IDS = [1, 2**53, 2**53 + 1, 2**63, 2**64 - 1]
CHOSEN = [1, 2**53 + 1, 2**64 - 1]

FORMS = {
    "Python's integers": lambda ids: list(ids),
    "a tuple": tuple,
    "numpy's scalars": lambda ids: [np.uint64(i) for i in ids],
    "mixed scalars": lambda ids: [np.int64(i) if i < 2**63 else np.uint64(i) for i in ids],
    "mixed with Python's": lambda ids: [np.uint64(i) if i % 2 else int(i) for i in ids],
    "an array of uint64": lambda ids: np.array(ids, np.uint64),
    "an array of objects": lambda ids: np.array(ids, object),
    "every other of an array": lambda ids: np.repeat(np.array(ids, np.uint64), 2)[::2],
    "the other byte order": lambda ids: np.array(ids, ">u8"),
}
# What is no id, in each place, with a word of the line that refuses it.
NO_IDS = {
    "below zero": ([-1], "-1"),
    "an array below zero": (np.array([-1]), "-1"),
    "a float": ([1.0], "1.0"),
    "an array of floats": (np.array([1.0]), "float64"),
    "int64 and uint64 together": (np.concatenate([np.array([1]), np.array([2**64 - 1], np.uint64)]), "rounds ids"),
    "beyond 64 bits": ([2**64], str(2**64)),
    "objects beyond 64 bits": (np.array([2**64], object), str(2**64)),
    "a text": (["1"], "'1'"),
    "a truth": ([True], "True"),
    "an array of truths": (np.array([True, False]), "bool"),
    "two axes": (np.ones((1, 1), int), "(1, 1)"),
}


@pytest.fixture(scope="module")
def volume():
    array = np.zeros((len(IDS), len(IDS), 1), np.uint64)
    for i, label in enumerate(IDS):
        array[i, : i + 1] = label
    return pumice.compress(array, spacing=(1, 1, 1))


@pytest.fixture(scope="module")
def calls(volume, tmp_path_factory):
    """By name, a function of a list of ids and what it gives, as something that can be compared."""
    folder = tmp_path_factory.mktemp("ids")
    volume.save(folder / "v.pumice")
    scene = pumice.figure(volume, size=(16, 9))
    fields = scene.to_dict()
    fields["film"]["passes"] = ["cryptomatte_label"]
    picture = pumice.render(pumice.Scene.from_dict(fields), volume, spp=1, backend="cpu")
    session = pumice.Session(scene, volume, spp=1, backend="cpu")
    ramp = np.linspace(0, 1, 3 * len(IDS)).reshape(-1, 3)

    def style(scene):
        return json.dumps(scene.to_dict()["instances"][0]["style"])

    def groups(ids):
        return pumice.LabelGroups(ids, range(len(ids)), ramp[: len(ids)], [{}] * len(ids))

    def recolored(ids):
        return groups(IDS).with_colors(ids, 1.0 - ramp[: len(ids)])

    def edited(ids):
        session.edit({"edit": "show", "id": 1, "show": {"only": ids}})
        return style(session.scene)

    def set_labels(ids):
        session.set_labels(1, visible=(ids, [True] * len(ids)), groups=groups(ids))
        return style(session.scene)

    def exported(ids):
        pumice.export(folder / "v.pumice", folder / "o.ply", labels=ids)
        return (folder / "o.ply").read_bytes()

    def only(ids):
        changed = scene.to_dict()
        changed["instances"][0]["style"]["show"] = {"only": ids}
        return style(pumice.Scene.from_dict(changed))

    of = volume.labels
    made = {
        "LabelTable.rows_of": lambda ids: of.rows_of(ids).tolist(),
        "LabelTable.isin": lambda ids: of.isin(ids).tolist(),
        "open": lambda ids: pumice.open(folder / "v.pumice", labels=ids).decode().tobytes(),
        "Volume.with_labels": lambda ids: pumice.open(folder / "v.pumice", labels=[]).with_labels(ids).decode().tobytes(),
        "Volume.faces": lambda ids: volume.faces(ids).labels.tobytes(),
        "surface": lambda ids: pumice.surface(volume, ids).labels.tobytes(),
        "count_faces": lambda ids: pumice.count_faces(volume, ids),
        "export": exported,
        "AnnotationTable": lambda ids: pumice.AnnotationTable(ids, names=["a"] * len(ids)).ids.tolist(),
        "query_labels": lambda ids: pumice.query_labels(f"{2**53 + 1} {2**64 - 1}", ids).tolist(),
        "LabelGroups": lambda ids: style(scene.with_labels(1, groups=groups(ids))),
        "LabelGroups.with_colors": lambda ids: style(scene.with_labels(1, groups=recolored(ids))),
        "Scene.with_labels": lambda ids: style(scene.with_labels(1, visible=(ids, [i != 1 for i in range(len(ids))]))),
        "Scene.from_dict": only,
        "Session.edit": edited,
        "Session.set_labels": set_labels,
        "Picture.matte": lambda ids: picture.matte(ids=ids).tobytes(),
        "figure": lambda ids: style(pumice.figure(volume, labels=ids)),
    }
    with session:
        yield made


# The keys of `calls`, which needs a volume, and so is a fixture. JSON has floats and truths: its fields refuse them in their own words.
OF_JSON = ["Scene.from_dict", "Session.edit"]
NAMES = [
    *["LabelTable.rows_of", "LabelTable.isin", "open", "Volume.with_labels", "Volume.faces", "surface", "count_faces", "export", "AnnotationTable", "query_labels"],
    *["LabelGroups", "LabelGroups.with_colors", "Scene.with_labels", "Session.set_labels", "Picture.matte", "figure", *OF_JSON],
]
# Those that take one id, or ids as keys.
ONE = ["LabelTable.index_of", "compress", "compress_file", "compress_part", "compress_series", "merge", "figure"]


def test_no_function_that_takes_ids_is_missing(calls):
    """A function takes ids if it has an argument of such a name."""
    assert sorted(calls) == sorted(NAMES)
    takes = {"ids", "labels", "label", "visible", "groups", "edits", "names", "types"}
    # `visible` of these has a flag for each row; `names` and `types` of tables belong to rows, and of `matte` to the matte's.
    rows = {"LabelTable.auto_colors", "Volume.coarse_surface"}
    found = set()
    for name in pumice.__all__:
        public = getattr(pumice, name)
        members = {name: public}
        if inspect.isclass(public):
            members |= {f"{name}.{m}": v for m, v in vars(public).items() if not m.startswith("_")}
        for path, member in members.items():
            function = member.__func__ if isinstance(member, classmethod) else member
            dataclass = hasattr(public, "__dataclass_fields__")
            if callable(function) and not dataclass and not path.startswith("LabelFilm"):
                try:
                    parameters = set(inspect.signature(function).parameters)
                except ValueError:
                    continue
                if parameters & takes:
                    found.add(path)
    assert found - rows <= {*NAMES, *ONE}, found - rows - {*NAMES, *ONE}
    assert len(found) > 10


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", NAMES)
def test_ids_are_taken_exactly_in_every_form(calls, name, form):
    function = calls[name]
    expected = function(CHOSEN)
    assert function(FORMS[form](CHOSEN)) == expected
    # Control: the neighbour, which is the same number as a float, is another label.
    assert function(FORMS[form]([1, 2**53, 2**64 - 1])) != expected or name == "count_faces"
    if name == "count_faces":
        assert function(FORMS[form]([2**53])) < function(FORMS[form]([2**53 + 1]))


@pytest.mark.parametrize("name", NAMES)
def test_signed_arrays_are_taken(calls, name):
    few = [1, 2**53, 2**53 + 1]
    assert calls[name](np.array(few)) == calls[name](few)
    assert calls[name](np.array([1], np.int8)) == calls[name]([1])


@pytest.mark.parametrize("what", NO_IDS)
@pytest.mark.parametrize("name", [name for name in NAMES if name not in OF_JSON])
def test_what_is_no_id_is_refused_in_one_line(calls, name, what):
    value, word = NO_IDS[what]
    if (name, what) == ("figure", "a text"):
        assert calls[name](value) == calls[name]([1]), "a text is a selector there"
        return
    with pytest.raises(pumice.InputError) as told:
        calls[name](value)
    text = str(told.value)
    # `figure` takes arrays number by number, since numbers and selectors may be mixed.
    assert "\n" not in text and "got" in text and (word in text or name == "figure"), text


@pytest.mark.parametrize("name", OF_JSON)
def test_what_json_refuses(calls, name):
    for value in ([-1], [1.5], np.array([1.5]), [2**64], ["1"], [True], np.ones((1, 1), int), np.array([object()])):
        with pytest.raises(pumice.InputError) as told:
            calls[name](value)
        assert "\n" not in str(told.value)


@pytest.mark.parametrize("label", IDS)
@pytest.mark.parametrize("form", [int, np.uint64, lambda i: np.array(i, np.uint64)[()]])
def test_one_id_and_ids_as_keys(volume, label, form):
    one = form(label)
    row = IDS.index(label)
    assert volume.labels.index_of(one) == row and volume.labels.rows_of([one]).tolist() == [row]
    assert volume.labels.isin([one]).tolist() == [i == label for i in IDS]
    array = volume.decode()
    named = pumice.compress(array, names={one: "me"}, types={one: "mine"}).labels
    assert (named.names.index("me"), named.types.index("mine")) == (row, row) and named.names.count("") == len(IDS) - 1
    looks = pumice.figure(volume, color={one: "#f00"}, material={one: "glass"}).to_dict()["instances"][0]["style"]
    (group,) = looks["groups"]
    assert group["labels"] == [label] and group["colors"] == [[1, 0, 0]]
    fields = pumice.figure(volume).to_dict()
    fields["instances"][0]["style"]["materials"] = {one: {"base_color": np.array([1.0, 0.0, 0.5])}}
    materials = pumice.Scene.from_dict(fields).to_dict()["instances"][0]["style"]["materials"]
    assert list(materials) == [str(label)] and materials[str(label)]["base_color"] == [1, 0, 0.5]
    assert volume.labels.ids[row] == label and one in {i: 0 for i in volume.labels.ids.tolist()}


@pytest.mark.parametrize("key", [1.0, np.float64(1), -1, 2**64])
def test_keys_that_are_no_ids_are_refused(volume, key, tmp_path):
    array = volume.decode()
    for call in (
        lambda: volume.labels.index_of(key),
        lambda: pumice.compress(array, names={key: "a"}),
        lambda: pumice.compress(array, types={key: "a"}),
        lambda: pumice.compress_file(array, tmp_path / "a.pumice", names={key: "a"}),
        lambda: pumice.compress_file(array, tmp_path / "a.pumice", types={key: "a"}),
        lambda: pumice.compress_part(array, tmp_path / "a.part", 0, names={key: "a"}),
        lambda: pumice.merge([], tmp_path / "a.pumice", types={key: "a"}),
        lambda: pumice.compress_series([array], tmp_path / "a.pumice", names={key: "a"}),
        lambda: pumice.compress_series([array], tmp_path / "a.pumice", types={key: "a"}),
        lambda: pumice.figure(volume, color={key: "#fff"}),
        lambda: pumice.figure(volume, material={key: "glass"}),
    ):
        with pytest.raises(pumice.InputError, match="expected"):
            call()


def test_an_id_that_the_volume_lacks_is_named(volume):
    for wanted in ([2], [1, 2**53 + 2], [2**64 - 2], [0]):
        with pytest.raises(pumice.InputError, match=f"the volume has no label {wanted[-1]}$"):
            volume.labels.rows_of(wanted)
    assert volume.labels.isin([2, 2**53 + 2]).tolist() == [False] * len(IDS)
    assert volume.labels.rows_of([]).tolist() == [] and volume.labels.isin([]).tolist() == [False] * len(IDS)
    assert pumice.compress(np.zeros((2, 2, 2), np.uint8)).labels.isin([1]).tolist() == []
    # numpy's own search compares floats, and finds the row before.
    assert np.searchsorted(volume.labels.ids, [2**53 + 1]).tolist() != volume.labels.rows_of([2**53 + 1]).tolist()
