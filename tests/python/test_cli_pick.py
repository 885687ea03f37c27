"""Tests `pumice pick` and the passes that it reads: ids, names and voxels are looked up in the arrays that the volumes were made of."""

import csv
import json

import numpy as np
import pytest
from command import run
from exr_planes import attributes_of, planes

# Ids that no 64-bit float holds, and one that a 32-bit float does not.
BIG = 2**63 + 5
NAMED = {3: 'PV 12 "β"', BIG: "", 16_777_217: "axon 漢"}


def write_volume(pumice, folder, name, ids, seed):
    """A volume of 12 × 10 × 8 voxels with blobs of these ids; the array in the order x, y, z."""
    rng = np.random.default_rng(seed)
    shape = (12, 10, 8)
    grid = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in shape), indexing="ij"), axis=-1)
    centres = rng.uniform(0.2, 0.8, (len(ids), 3)) * shape
    distances = np.linalg.norm(grid[..., None, :] - centres, axis=-1)
    array = np.where(distances.min(axis=-1) < 3.4, np.array(ids, np.uint64)[distances.argmin(axis=-1)], 0)
    np.save(folder / f"{name}.npy", array)
    with open(folder / "names.csv", "w", newline="") as table:
        csv.writer(table).writerows([("id", "name", "type"), *((i, name, "axon" if i < 99 else "") for i, name in NAMED.items())])
    out = folder / f"{name}.pumice"
    wishes = ["--axes", "xyz", "--spacing", "1,1,2", "--table", folder / "names.csv"]
    done = run(pumice, "compress", folder / f"{name}.npy", "-o", out, *wishes)
    assert done.code == 0, done
    return array


@pytest.fixture(scope="module")
def stage(pumice, tmp_path_factory):
    """(folder, arrays by instance id): a picture `two.exr` of two volumes, whose rows mean different labels, and `one.exr` of the first."""
    folder = tmp_path_factory.mktemp("pick")
    arrays = {
        7: write_volume(pumice, folder, "a", [3, 40, 98340797, BIG, 2**64 - 1], 1),
        2: write_volume(pumice, folder, "b", [16_777_217, BIG, 2**53 + 1], 2),
    }
    one = ["--size", "60x40", "--spp", "1", "--backend", "cpu", "--save-scene", folder / "one.json"]
    run(pumice, "render", folder / "a.pumice", "-o", folder / "one.exr", *one).fine()
    fields = json.loads((folder / "one.json").read_text())
    first = {**fields["instances"][0], "id": 7}
    place = list(first["world_from_index"])
    # Beside the first, turned by 90 degrees about z.
    second = {**first, "id": 2, "source": str(folder / "b.pumice"), "style": {}}
    second["world_from_index"] = [*place[3:6], *(-v for v in place[0:3]), *place[6:9], place[9] + 4.0, place[10] - 3.0, place[11]]
    fields["instances"] = [first, second]
    fields["camera"]["projection"]["perspective"]["fov_rad"] *= 1.5  # the camera frames the first alone
    (folder / "two.json").write_text(json.dumps(fields))
    run(pumice, "render", folder / "two.json", "-o", folder / "two.exr", "--spp", "1", "--backend", "cpu", "--size", "90x60").fine()
    return folder, arrays, {i["id"]: np.array(i["world_from_index"]).reshape(4, 3) for i in fields["instances"]}


def told(pumice, picture, *pixels):
    return json.loads(run(pumice, "pick", picture, *(f"{x},{y}" for x, y in pixels), "--json").fine())


def test_pixels_tell_the_ids_names_and_voxels_of_their_volumes(pumice, stage):
    folder, arrays, places = stage
    channels = planes(folder / "two.exr")
    rows, instances = channels["label.index"], channels["label.instance"]
    assert set(np.unique(instances)) == {0, 2, 7} and ((instances == 0) == (rows == 0)).all()
    ys, xs = np.mgrid[1:60:4, 1:90:3]
    pixels = list(zip(xs.ravel().tolist(), ys.ravel().tolist()))
    report = told(pumice, folder / "two.exr", *pixels)
    assert report["notices"] == [] and len(report["pixels"]) == len(pixels)
    seen, named = set(), 0
    for (x, y), found in zip(pixels, report["pixels"]):
        assert (found["x"], found["y"]) == (x, y)
        row, instance = int(rows[y, x]), int(instances[y, x])
        if not row:
            assert found["label"] is found["instance"] is found["voxel"] is found["position"] is None, found
            continue
        expected = int(np.unique(arrays[instance][arrays[instance] > 0])[row - 1])
        assert (found["label"], found["instance"]) == (expected, instance)
        assert found["name"] == NAMED.get(expected, "") and found["type"] == ("axon" if expected == 3 else "")
        voxel = tuple(found["voxel"])
        assert int(arrays[instance][voxel]) == expected, found
        # The surface is a face of that voxel. Positions are rounded to 2⁻²⁴ of some ten units, and a voxel is half a unit.
        matrix = places[instance]
        index = (np.array(found["position"]) - matrix[3]) @ np.linalg.inv(matrix[:3])
        outside = np.abs(index - np.array(voxel) - 0.5).max()
        assert abs(outside - 0.5) < 1e-4, (found, index)
        seen.add(expected)
        named += bool(found["name"])
    assert {BIG, 2**64 - 1, 2**53 + 1, 16_777_217} <= seen and named > 10, seen


def test_the_table_in_the_file_lists_what_is_seen_and_no_more(stage):
    folder, arrays, _ = stage
    attributes, _ = attributes_of((folder / "two.exr").read_bytes())
    tables = {t["instance"]: t for t in json.loads(attributes["pumiceLabels"])}
    channels = planes(folder / "two.exr")
    for instance, array in arrays.items():
        rows = np.unique(channels["label.index"][channels["label.instance"] == instance])
        assert tables[instance]["rows"] == rows.tolist()
        assert tables[instance]["ids"] == [int(i) for i in np.unique(array[array > 0])[rows - 1]]
    assert "label.instance" not in planes(folder / "one.exr"), "one instance needs no channel"


def test_text_says_in_a_line_what_json_says(pumice, stage):
    folder, *_ = stage
    rows = planes(folder / "one.exr")["label.index"]
    y, x = np.argwhere(rows > 0)[len(np.argwhere(rows > 0)) // 2].tolist()
    (found,) = told(pumice, folder / "one.exr", (x, y))["pixels"]
    lines = run(pumice, "pick", folder / "one.exr", f"{x},{y}", "0,0").fine().splitlines()
    assert lines[0].startswith(f"{x},{y}: label {found['label']}") and ", instance 1, voxel " in lines[0]
    assert ",".join(map(str, found["voxel"])) in lines[0] and lines[1] == "0,0: no label"


def test_without_its_volume_a_picture_tells_all_but_the_voxel(pumice, stage, tmp_path):
    folder, *_ = stage
    rows = planes(folder / "one.exr")["label.index"]
    y, x = np.argwhere(rows > 0)[0].tolist()
    whole = told(pumice, folder / "one.exr", (x, y))["pixels"][0]
    kept = folder / "kept.pumice"
    (folder / "a.pumice").rename(kept)
    try:
        gone = told(pumice, folder / "one.exr", (x, y))
        (folder / "a.pumice").write_bytes((folder / "b.pumice").read_bytes())
        changed = told(pumice, folder / "one.exr", (x, y))
    finally:
        kept.replace(folder / "a.pumice")
    for report, why in ((gone, "No such file"), (changed, "hash")):
        assert report["pixels"] == [{**whole, "voxel": None}] and whole["voxel"] is not None
        assert len(report["notices"]) == 1 and why in report["notices"][0]


def test_at_coarse_levels_of_detail_a_voxel_is_told_only_where_the_label_has_one(pumice, stage, tmp_path):
    folder, arrays, _ = stage
    run(pumice, "render", folder / "one.json", "-o", tmp_path / "a.exr", "--spp", "1", "--backend", "cpu", "--lod", "16").fine()
    rows = planes(tmp_path / "a.exr")["label.index"]
    report = told(pumice, tmp_path / "a.exr", *[(int(x), int(y)) for y, x in np.argwhere(rows > 0)[::23]])
    voxels = [(found["voxel"], found["label"]) for found in report["pixels"]]
    told_ones = [(tuple(voxel), label) for voxel, label in voxels if voxel is not None]
    assert report["notices"] == [] and 0 < len(told_ones) < len(voxels)
    assert all(int(arrays[7][voxel]) == label for voxel, label in told_ones)


def test_what_cannot_be_told_is_refused_in_one_line(pumice, stage, tmp_path):
    folder, *_ = stage
    picture, shape = folder / "one.exr", ["--spp", "1", "--backend", "cpu", "--size", "9x6"]
    run(pumice, "render", folder / "one.json", "-o", tmp_path / "a.png", *shape).fine()
    run(pumice, "render", folder / "one.json", "-o", tmp_path / "depth.exr", *shape, "--passes", "depth").fine()
    for arguments, said in [
        ((picture, "60,0"), "pixel 60,0: expected x below 60 and y below 40"),
        ((picture, "0,40"), "pixel 0,40"),
        ((picture, "1"), "expected a pixel X,Y"),
        ((picture, "-1,3"), "-1"),
        ((picture, "nan,3"), "expected a pixel X,Y"),
        ((picture,), "X,Y"),
        ((tmp_path / "a.png", "0,0"), "expected an OpenEXR picture, got a PNG"),
        ((tmp_path / "depth.exr", "0,0"), "has no label pass"),
        ((tmp_path / "none.exr", "0,0"), "No such file"),
        (("/dev/null", "0,0"), "expected an ordinary file, got a device"),
        ((folder / "names.csv", "0,0"), "expected an OpenEXR file, got another kind of file"),
        ((tmp_path, "0,0"), str(tmp_path)),
    ]:
        line = run(pumice, "pick", *arguments).refused()
        assert said in line, line


def test_passes_by_name_have_the_instances_with_the_labels(pumice, stage, tmp_path):
    folder, *_ = stage
    small = ["--spp", "1", "--backend", "cpu", "--size", "30x20"]
    run(pumice, "render", folder / "two.json", "-o", tmp_path / "a.exr", *small, "--passes", "label").fine()
    assert {"label.index", "label.instance"} <= set(planes(tmp_path / "a.exr"))
    run(pumice, "render", folder / "two.json", "-o", tmp_path / "b.exr", *small, "--passes", "depth").fine()
    assert not {"label.index", "label.instance"} & set(planes(tmp_path / "b.exr"))
    run(pumice, "render", "--again", tmp_path / "a.exr", "-o", tmp_path / "c.exr", "--passes", "label").fine()
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "c.exr").read_bytes()
