"""Tests `pumice render --explain` and `pumice bench needs`, which measure what leaving out unneeded parts saves."""

import csv
import json

from command import run


def test_explain_measures_what_is_left_out(pumice, data, tmp_path):
    picture = tmp_path / "o.png"
    args = ["--pick", 3, "--size", "48x32", "--spp", 1, "--backend", "cpu", "--explain", "--json", tmp_path / "o.json"]
    said = run(pumice, "render", data / "platynereis_nuclei.tif", "-o", picture, *args).fine()
    assert "left out: boxes of 30 labels of instance 1 (not shown)" in said
    savings = json.loads((tmp_path / "o.json").read_text())["savings"]
    hidden = savings["savings"][0]
    assert hidden["part"] == "hidden_labels" and savings["savings"][-1]["part"] is None
    saved = sum(after - before for before, after in hidden["bytes"].values())
    assert saved > 0 and f"saved by leaving out boxes of labels that are not shown: {saved} bytes; " in said
    for saving in savings["savings"]:
        assert saving["beside"]["apart"] == 0, "both ways give the same picture"
        low, median, high = (saving["sample_ms"]["saved"][k] for k in ("low", "median", "high"))
        assert low <= median <= high
    # Parts for which the CPU backend has nothing to leave out are reported too.
    assert savings["always_there"] and "saved by leaving out cuts: nothing (" in said
    # Without --explain nothing is measured or printed.
    said = run(pumice, "render", data / "platynereis_nuclei.tif", "-o", picture, *args[:-3], "--json", tmp_path / "o.json").fine()
    assert "saved" not in said and "savings" not in json.loads((tmp_path / "o.json").read_text())


def test_labels_that_are_not_shown_are_not_read(pumice, data, tmp_path):
    """Reading only the shown labels gives the same picture as reading the whole volume and takes less memory; `--explain` reports both."""
    for level in ("fast", "default"):
        volume = tmp_path / f"{level}.pumice"
        run(pumice, "compress", data / "platynereis_nuclei.tif", "-o", volume, "--level", level).fine()
        args = ["--size", "48x32", "--spp", 2, "--backend", "cpu"]
        scene, picture, report = tmp_path / "s.json", tmp_path / "a.exr", tmp_path / "a.json"
        some = ["--labels", "3,7,12"]
        said = run(pumice, "render", volume, "-o", picture, *args, *some, "--save-scene", scene, "--explain", "--json", report).fine()
        part = json.loads(report.read_text())
        (opening,) = part["savings"]["opening"]
        assert opening["labels"] == [3, 33] and opening["file"] == f"{level}.pumice"
        assert f"saved by reading 3 of 33 labels of {level}.pumice: {opening['bytes'][1] - opening['bytes'][0]} of {opening['bytes'][1]} bytes; " in said
        assert sum(part["volume_bytes"].values()) == opening["bytes"][0] < opening["bytes"][1] / 2
        assert len(part["opening_seconds"]) == 2
        # A TIFF, which is compressed as a whole, gives the same picture, and so do the saved scene and `--again`.
        whole, again = tmp_path / "w.exr", tmp_path / "b.exr"
        run(pumice, "render", data / "platynereis_nuclei.tif", "-o", whole, *args, *some, "--json", report).fine()
        assert sum(json.loads(report.read_text())["volume_bytes"].values()) == opening["bytes"][1]
        for made in ([scene, *args], ["--again", picture]):
            run(pumice, "render", *made, "-o", again).fine()
            for other in (again, whole):
                said = run(pumice, "compare", picture, other, "--json", "-").fine()
                assert json.loads(said)["rel_mse"] == 0
        # `--labels` reads other labels than the scene's.
        run(pumice, "render", scene, "-o", again, *args, "--labels", "5").fine()
        line = run(pumice, "render", volume, "-o", again, *args, "--labels", "5,77").refused()
        assert "no label 77" in line


def test_bench_needs_writes_both_tables(pumice, data, tmp_path):
    out = tmp_path / "out"
    args = ["--backend", "cpu", "--show", 2, "--rounds", 2, "--side", 32, "--out", out]
    said = run(pumice, "bench", "needs", data / "platynereis_nuclei.tif", *args).fine()
    assert str(out / "needs.md") in said
    rows = list(csv.DictReader((out / "needs.csv").open()))
    scenes = {row["scene"] for row in rows}
    assert scenes == {"all 33 labels, matte, under an even sky", "2 of 33 labels, matte, under an even sky"}
    hidden = [r for r in rows if r["left_out"] == "boxes of labels that are not shown"]
    assert [r["scene"] for r in hidden] == ["2 of 33 labels, matte, under an even sky"]
    assert int(hidden[0]["bytes_with"]) > int(hidden[0]["bytes_without"])
    page = (out / "needs.md").read_text()
    assert page.count("| all of it together |") == 2
    openings = list(csv.DictReader((out / "needs-opening.csv").open()))
    assert [row["level"] for row in openings] == ["default", "fast"]
    for row in openings:
        assert (row["labels_shown"], row["labels"]) == ("2", "33") and int(row["bytes_shown"]) < int(row["bytes"])
        assert f"| {row['level']} | {row['bytes']} | {row['bytes_shown']} | " in page
    for bad in (["--rounds", 1], ["--show", 0], ["--side", 3], ["--backend", "abacus"]):
        done = run(pumice, "bench", "needs", data / "platynereis_nuclei.tif", *args[:-2], "--out", tmp_path / "no", *bad)
        assert done.code == 2 and not (tmp_path / "no").exists(), done
    line = run(pumice, "bench", "needs", tmp_path / "none.nrrd", "--out", out).refused()
    assert "none.nrrd" in line
