"""Tests that a scene or a picture made in Python can be drawn again, or that it is said when it is saved that it cannot."""

import json
import warnings

import numpy as np
import pumice
import pytest
from PIL import Image

LABELS = np.zeros((6, 5, 4), np.uint8)
LABELS[1:3, 0:4, 1:4], LABELS[4:6, 2:5, 0:2] = 3, 9
SMALL = {"size": (16, 12)}


def told(call, *args, **more):
    """The texts of the `PumiceWarning`s of a call."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call(*args, **more)
    assert all(w.category is pumice.PumiceWarning and w.filename == __file__ for w in caught)
    return [str(w.message) for w in caught]


def source_of(scene):
    return scene.to_dict()["instances"][0]["source"]


def test_a_figure_names_the_file_that_the_volume_is_from(tmp_path):
    np.save(tmp_path / "a.npy", LABELS)
    with pytest.warns(pumice.PumiceWarning):
        volumes = [pumice.open(tmp_path / "a.npy", axes="zyx"), pumice.compress(tmp_path / "a.npy", axes="zyx")]
    for volume in volumes:
        scene = pumice.figure(volume, **SMALL)
        assert source_of(scene) == str(tmp_path / "a.npy")
        assert scene.to_dict()["instances"][0]["reading"] == {"axes": "zyx"}
        assert told(scene.save, tmp_path / "s.json") == []
        # The scene alone draws what the volume in memory draws; without its reading it does not.
        there = pumice.render(pumice.Scene.load(tmp_path / "s.json"), spp=1, backend="cpu")
        here = pumice.render(scene, volume, spp=1, backend="cpu")
        np.testing.assert_array_equal(there.color, here.color)
        fields = scene.to_dict()
        del fields["instances"][0]["reading"]
        other = pumice.render(pumice.Scene.from_dict(fields), spp=1, backend="cpu")
        assert not np.array_equal(other.color, here.color)


def test_an_array_is_named_once_it_is_saved_and_missed_before(tmp_path):
    volume = pumice.compress(LABELS)
    scene = pumice.figure(volume, **SMALL)
    (line,) = told(scene.save, tmp_path / "s.json")
    assert "instances[0].source (memory)" in line and "cannot be drawn again" in line and str(tmp_path / "s.json") in line
    picture = pumice.render(scene, volume, spp=1, backend="cpu")
    (line,) = told(picture.save, tmp_path / "p.png")
    assert "instances[0].source (memory)" in line
    volume.save(tmp_path / "v.pumice")
    scene = pumice.figure(volume, **SMALL)
    assert source_of(scene) == str(tmp_path / "v.pumice") and told(scene.save, tmp_path / "s.json") == []
    picture = pumice.render(scene, volume, spp=1, backend="cpu")
    assert told(picture.save, tmp_path / "p.png") == []
    assert json.loads(Image.open(tmp_path / "p.png").text["pumice"])["scene"]["instances"][0]["source"] == "v.pumice"
    assert source_of(pumice.figure(volume, source="other.pumice", **SMALL)) == "other.pumice"
    # A table is not in the file, so neither is what it says.
    np.save(tmp_path / "a.npy", LABELS)
    with pytest.warns(pumice.PumiceWarning):
        typed = pumice.compress(tmp_path / "a.npy", types={3: "axon"})
    assert source_of(pumice.figure(typed, **SMALL)) == "memory"


def test_a_picture_tells_no_paths_if_it_shall_not(tmp_path):
    volume = pumice.compress(LABELS)
    volume.save(tmp_path / "secret.pumice")
    picture = pumice.render(pumice.figure(volume, **SMALL), volume, spp=1, backend="cpu")
    for name in ("a.png", "a.exr"):
        picture.save(tmp_path / name)
        assert b"secret" in (tmp_path / name).read_bytes(), "the control"
        picture.save(tmp_path / name, no_paths=True)
        assert b"secret" not in (tmp_path / name).read_bytes()


def test_meshes_of_arrays_are_written_beside_the_scene(tmp_path):
    volume = pumice.compress(LABELS)
    volume.save(tmp_path / "v.pumice")
    fields = pumice.figure(volume, **SMALL).to_dict()
    corners = np.array([[-9, -9, -3], [9, -9, -3], [9, 9, -3.1], [-9, 9, -3]])
    floor = pumice.Mesh(corners, [[0, 1, 2], [0, 2, 3]], [1, 0], normals=[[0.1, 0, 1], [0, 0.2, 1], [0, 0, 1], [0.3, 0, 1]])
    place = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]
    fields["meshes"] = [{"id": 7, "source": "floor", "world_from_mesh": place, "materials": [{}, {"base_color": [0.9, 0.1, 0.1]}]}]
    scene = pumice.Scene.from_dict(fields)
    (line,) = told(scene.save, tmp_path / "s.json")
    assert "meshes[0].source (floor)" in line and "instances" not in line
    assert told(scene.save, tmp_path / "s.json", meshes=[floor]) == []
    saved = json.loads((tmp_path / "s.json").read_text())
    assert saved["meshes"][0]["source"] == "s.mesh-7.ply"
    header = (tmp_path / "s.mesh-7.ply").read_bytes().split(b"end_header\n")
    points = np.frombuffer(header[1], dtype=[("p", "<f8", 3), ("n", "<f4", 3)], count=4)
    np.testing.assert_array_equal(points["p"], corners)
    with pytest.raises(pumice.InputError, match="meshes: expected one for each of the scene's 1 meshes, got 2"):
        scene.save(tmp_path / "t.json", meshes=[floor, floor])
    assert not (tmp_path / "t.json").exists()


def test_an_index_that_leaves_nothing_to_choose_is_named_as_a_keyword(tmp_path):
    np.save(tmp_path / "v.npy", LABELS)
    for keyword in ("layer", "time", "channel"):
        for call in (pumice.open, pumice.probe, pumice.compress):
            for index in (0, 1):
                with pytest.raises(pumice.InputError, match=rf"v.npy: {keyword} {index} cannot be chosen: the number of .* is 1"):
                    call(tmp_path / "v.npy", axes="xyz", **{keyword: index})
    # A scene that records a 0 is drawn as before.
    volume = pumice.open(tmp_path / "v.npy", axes="xyz")
    fields = pumice.figure(volume, size=(8, 8)).to_dict()
    plain = pumice.render(pumice.Scene.from_dict(fields), spp=1, backend="cpu").color
    fields["instances"][0]["reading"] |= {"layer": 0, "channel": 0}
    assert (pumice.render(pumice.Scene.from_dict(fields), spp=1, backend="cpu").color == plain).all()
    fields["instances"][0]["reading"]["layer"] = 1
    with pytest.raises(pumice.InputError, match="layer"):
        pumice.render(pumice.Scene.from_dict(fields), spp=1, backend="cpu")


def test_an_option_that_a_file_does_not_take_is_named_as_a_keyword(tmp_path):
    pumice.compress(LABELS).save(tmp_path / "v.pumice")
    for keyword, value in {"layer": 0, "time": 0, "channel": 1, "array": "a", "spacing": (1, 2, 3), "axes": "xyz"}.items():
        for call in (pumice.open, pumice.probe, lambda path, **more: pumice.open(path, labels=[3], **more)):
            with pytest.raises(pumice.InputError, match=rf"v.pumice: {keyword}\b.* cannot be chosen"):
                call(tmp_path / "v.pumice", **{keyword: value})
