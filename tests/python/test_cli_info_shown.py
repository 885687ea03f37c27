"""Tests `pumice info FILE --query QUERY`: what a process holds that reads and traces only some labels."""

import json

import pytest
from command import run


@pytest.fixture(scope="module")
def volume(pumice, data, tmp_path_factory):
    file = tmp_path_factory.mktemp("shown") / "nuclei.pumice"
    run(pumice, "compress", data / "platynereis_nuclei.tif", "-o", file, "--level", "fast").fine()
    return file


def shown(pumice, volume, query):
    return json.loads(run(pumice, "info", volume, "--query", query, "--json").fine())


def test_the_parts_of_shown_labels_add_up_and_are_fewer_bytes_than_all(pumice, volume):
    whole = json.loads(run(pumice, "info", volume, "--json").fine())
    assert "shown" not in whole
    few = shown(pumice, volume, "26 27")["shown"]
    assert few["labels"] == 2 and 0 < few["boxes"] < whole["boxes"]
    assert few["bytes_resident"] == sum(few["resident_parts"].values())
    assert few["bytes_resident"] - few["bytes_volume"] == sum(few["resident_parts"][p] for p in ("bricks", "acceleration"))
    assert 0 < few["resident_parts"]["bricks"] < whole["resident_parts"]["bricks"]
    # Control: all labels, chosen by a query, are those of the whole file, and rays need the same. (Chosen labels are copied to lists of
    # their own, which may be a little longer.)
    every = shown(pumice, volume, "*")
    assert every["resident_parts"] == whole["resident_parts"]
    for part in ("bricks", "acceleration"):
        assert every["shown"]["resident_parts"][part] == whole["resident_parts"][part]
    assert [every["shown"][name] for name in ("labels", "boxes")] == [whole[name] for name in ("labels", "boxes")]


def test_the_text_tells_of_shown_labels(pumice, volume):
    line = next(x for x in run(pumice, "info", volume, "--query", "26 27").fine().splitlines() if x.startswith("shown"))
    assert str(shown(pumice, volume, "26 27")["shown"]["bytes_resident"]) in line and "of 2 labels" in line


def test_what_cannot_be_shown_is_refused(pumice, volume, data):
    line = run(pumice, "info", data / "platynereis_nuclei.tif", "--query", "26").refused()
    assert "is not a .pumice file, and only those can be opened" in line
    assert "no label of the volume matches" in run(pumice, "info", volume, "--query", "voxels>1e12").refused()
    assert "expected a column of numbers" in run(pumice, "info", volume, "--query", "size>3").refused()
