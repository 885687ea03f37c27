"""Scenes and pictures say how their volumes were read, so that they draw the same voxels again without the flags."""

import json

import h5py
import nibabel
import nrrd
import numpy as np
import pytest
import tifffile
import zarr
from command import run
from exr_planes import planes

# No two choices of these give the same picture: labels along each axis differ, and so do the two halves.
FIRST = np.zeros((5, 6, 7), np.uint16)
FIRST[0:2, 1:3, 2:7], FIRST[3:5, 0:6, 0:2], FIRST[2, 5, 6] = 3, 5, 7
TWO = np.stack([FIRST, FIRST[::-1, ::-1]])
SMALL = ["--size", "24x16", "--spp", "1", "--backend", "cpu"]
KINDS = {
    "axes.npy": (["--axes", "zyx"], {"axes": "zyx"}),
    "both.npz": (["--array", "second", "--axes", "xyz", "--spacing", "1,2,3"], {"array": "second", "axes": "xyz", "spacing": [1, 2, 3]}),
    "layers.nrrd": (["--layer", "1"], {"layer": 1}),
    "channels.tif": (["--channel", "1"], {"channel": 1}),
    "times.nii": (["--time-step", "1"], {"time": 1}),
    "a.raw": (
        ["--raw-dims", "7,6,5", "--raw-type", "u16", "--raw-big-endian", "--raw-offset", "3"],
        {"raw": {"dims": [7, 6, 5], "label_type": "u16", "big_endian": True, "offset": 3}},
    ),
    "levels.zarr": (
        ["--label", "second", "--scale", "1", "--roi", "1:6,:,:4"],
        {"label": "second", "scale": 1, "roi": [[1, 6], [None, None], [None, 4]]},
    ),
    "sets.h5": (["--dataset", "b/second", "--axes", "xyz"], {"dataset": "b/second", "axes": "xyz"}),
    "absent.zarr": (["--missing-chunks", "fill", "--axes", "xyz"], {"missing_chunks": "fill", "axes": "xyz"}),
}


def written(folder, name):
    path = folder / name
    match name:
        case "axes.npy":
            np.save(path, FIRST)
        case "both.npz":
            np.savez(path, first=TWO[0], second=TWO[1])
        case "layers.nrrd":
            nrrd.write(str(path), TWO, {"kinds": ["list", "domain", "domain", "domain"]})
        case "channels.tif":
            tifffile.imwrite(path, TWO.transpose(1, 0, 2, 3), imagej=True, metadata={"axes": "ZCYX"})
        case "times.nii":
            nibabel.save(nibabel.Nifti1Image(np.moveaxis(TWO, 0, -1), np.eye(4)), path)
        case "levels.zarr":
            picture = zarr.open_group(path, mode="w")
            labels = picture.create_group("labels")
            labels.attrs["ome"] = {"labels": ["first", "second"]}
            for name in ("first", "second"):
                datasets = [{"path": level, "coordinateTransformations": [{"type": "scale", "scale": [size] * 3}]} for level, size in (("0", 1), ("1", 2))]
                image = labels.create_group(name)
                image.attrs["ome"] = {"multiscales": [{"axes": [{"name": axis, "type": "space"} for axis in "zyx"], "datasets": datasets}]}
                image.create_array("0", data=TWO[0], chunks=(2, 3, 4))
                image.create_array("1", data=TWO[1] if name == "second" else np.flip(TWO[1], 0), chunks=(2, 3, 4))
        case "sets.h5":
            with h5py.File(path, "w") as file:
                file["first"], file["b/second"] = TWO
        case "absent.zarr":
            array = zarr.create_array(path, shape=FIRST.shape, dtype="u2", chunks=(3, 3, 7), fill_value=4)
            array[:3] = FIRST[:3]
        case "a.raw":
            path.write_bytes(b"abc" + FIRST.astype(">u2").tobytes())
    return path


def drawn(pumice, subject, out, *more):
    run(pumice, "render", subject, "-o", out, *more).fine()
    return planes(out)


def same(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name], equal_nan=True) for name in a)


@pytest.mark.parametrize("name", KINDS)
def test_a_saved_scene_and_a_picture_draw_what_the_flags_chose(pumice, tmp_path, name):
    flags, said = KINDS[name]
    source, scene = written(tmp_path, name), tmp_path / "s.json"
    first = drawn(pumice, source, tmp_path / "a.exr", *SMALL, *flags, "--save-scene", scene)
    fields = json.loads(scene.read_text())
    assert fields["instances"][0]["reading"] == said
    assert same(first, drawn(pumice, scene, tmp_path / "b.exr", *SMALL))
    run(pumice, "render", "--again", tmp_path / "a.exr", "-o", tmp_path / "c.exr").fine()
    assert same(first, planes(tmp_path / "c.exr"))
    # The control: without the field the scene draws something else, or nothing.
    del fields["instances"][0]["reading"]
    scene.write_text(json.dumps(fields))
    done = run(pumice, "render", scene, "-o", tmp_path / "d.exr", *SMALL)
    assert done.code == 2 or not same(first, planes(tmp_path / "d.exr"))


def test_flags_take_precedence_over_the_scene(pumice, tmp_path):
    source, scene = written(tmp_path, "axes.npy"), tmp_path / "s.json"
    as_zyx = drawn(pumice, source, tmp_path / "a.exr", *SMALL, "--axes", "zyx", "--save-scene", scene)
    over = drawn(pumice, scene, tmp_path / "b.exr", *SMALL, "--axes", "xyz", "--save-scene", tmp_path / "t.json")
    assert not same(as_zyx, over)
    assert json.loads((tmp_path / "t.json").read_text())["instances"][0]["reading"] == {"axes": "xyz"}
    assert same(over, drawn(pumice, tmp_path / "t.json", tmp_path / "c.exr", *SMALL))
    # The surface that is exported is that of the same voxels.
    sizes = {}
    for name, subject, more in [("flags", source, ["--axes", "zyx"]), ("scene", scene, []), ("other", scene, ["--layer", "1"])]:
        done = run(pumice, "export", subject, "-o", tmp_path / f"{name}.stl", *more)
        assert done.code == (2 if name == "other" else 0), done
        sizes[name] = (tmp_path / f"{name}.stl").stat().st_size if done.code == 0 else None
    assert sizes["flags"] == sizes["scene"]


def test_two_instances_of_one_file_are_read_each_in_its_way(pumice, tmp_path):
    source, scene = written(tmp_path, "layers.nrrd"), tmp_path / "s.json"
    run(pumice, "render", source, "-o", tmp_path / "a.exr", *SMALL, "--layer", "0", "--save-scene", scene).fine()
    fields = json.loads(scene.read_text())
    other = json.loads(json.dumps(fields["instances"][0]))
    other.update(id=2, reading={"layer": 1})
    fields["instances"].append(other)
    scene.write_text(json.dumps(fields))
    both = drawn(pumice, scene, tmp_path / "b.exr", *SMALL)
    assert not same(both, planes(tmp_path / "a.exr"))
    other["reading"] = {"layer": 0}
    scene.write_text(json.dumps(fields))
    assert np.array_equal(drawn(pumice, scene, tmp_path / "c.exr", *SMALL)["label.index"], planes(tmp_path / "a.exr")["label.index"])


def test_an_index_0_that_a_scene_records_is_read_where_there_is_one_volume_alone(pumice, tmp_path):
    """Earlier versions recorded it; a caller who says it is told that it has no effect."""
    source, scene = tmp_path / "a.nrrd", tmp_path / "s.json"
    nrrd.write(str(source), FIRST)
    first = drawn(pumice, source, tmp_path / "a.exr", *SMALL, "--save-scene", scene)
    fields = json.loads(scene.read_text())
    for reading in ({"layer": 0}, {"time": 0, "channel": 0}):
        fields["instances"][0]["reading"] = reading
        scene.write_text(json.dumps(fields))
        assert same(first, drawn(pumice, scene, tmp_path / "b.exr", *SMALL))
        # The picture has the record too.
        run(pumice, "render", "--again", tmp_path / "b.exr", "-o", tmp_path / "c.exr").fine()
        assert same(first, planes(tmp_path / "c.exr"))
        run(pumice, "pick", tmp_path / "b.exr", "12,8").fine()
        # Controls: another index is refused, and so is 0 of a caller.
        fields["instances"][0]["reading"] = dict.fromkeys(reading, 1)
        scene.write_text(json.dumps(fields))
        assert "leaves nothing to choose" in run(pumice, "render", scene, "-o", tmp_path / "d.exr", *SMALL).refused()
        fields["instances"][0]["reading"] = reading
        scene.write_text(json.dumps(fields))
    for subject in (source, scene):
        line = run(pumice, "render", subject, "-o", tmp_path / "d.exr", *SMALL, "--layer", "0").refused()
        assert "--layer 0 cannot be chosen: the number of layers is 1" in line and not (tmp_path / "d.exr").exists()


def test_nothing_is_recorded_where_nothing_was_said(pumice, data, tmp_path):
    run(pumice, "render", data / "slicer_Segmentation.seg.nrrd", "-o", tmp_path / "a.exr", *SMALL, "--save-scene", tmp_path / "s.json").fine()
    assert "reading" not in (tmp_path / "s.json").read_text() and b'"reading"' not in (tmp_path / "a.exr").read_bytes()


@pytest.mark.parametrize(
    ("reading", "what"),
    [
        ({"axes": "yxz"}, "expected one of `xyz`, `zyx`"),
        ({"layer": -1}, "line"),
        ({"layer": 7}, "--layer 7"),
        ({"spacing": [0, 1, 1]}, "reading.spacing[0]"),
        ({"spacing": [1, 1]}, "line"),
        ({"raw": {"dims": [0, 1, 1], "label_type": "u8"}}, "raw.dims[0]"),
        ({"raw": {"label_type": "u8"}}, "dims"),
        ({"order": "zyx"}, "order"),
        ({"array": "a"}, "--array a"),
        (7, "line"),
    ],
)
def test_a_reading_that_is_none_is_refused_by_name(pumice, tmp_path, reading, what):
    nrrd.write(str(tmp_path / "a.nrrd"), FIRST)
    scene = tmp_path / "s.json"
    run(pumice, "render", tmp_path / "a.nrrd", "-o", tmp_path / "a.exr", *SMALL, "--save-scene", scene).fine()
    fields = json.loads(scene.read_text())
    fields["instances"][0]["reading"] = reading
    scene.write_text(json.dumps(fields))
    line = run(pumice, "render", scene, "-o", tmp_path / "b.exr", *SMALL).refused()
    assert what in line and not (tmp_path / "b.exr").exists(), line
