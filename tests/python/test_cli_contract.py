"""Tests what scripts rely on: exit codes, keys of reports, lossless round trips, reproducible bytes and pixels."""

import json
import re
import subprocess

import nibabel
import nrrd
import numpy as np
import pytest
import tifffile
from broken_files import labels
from command import peak_rss_bytes, run
from exr_planes import planes
from PIL import Image

SHIPPED = {
    "connectomics": "connectomics_32x32x40nm.nrrd",
    "brain": "torchio_t1_seg_gif_PIR.nii.gz",
    "ct": "slicer_Segmentation.seg.nrrd",
    "nuclei": "platynereis_nuclei.tif",
}


def voxels_and_affine(path):
    """(voxels indexed [x, y, z], matrix from voxel centres to the world or None) of a shipped volume, by independent readers."""
    name = path.name
    if name.endswith(".nrrd"):
        voxels, header = nrrd.read(str(path))
        affine = np.eye(4)
        if "space directions" in header:
            affine[:3, :3] = np.asarray(header["space directions"], float)[-3:].T
            affine[:3, 3] = header.get("space origin", [0, 0, 0])
        else:
            affine = np.diag([*header["spacings"], 1.0])
        return voxels, affine
    if name.endswith(".nii.gz"):
        image = nibabel.load(path)
        return np.asanyarray(image.dataobj), image.affine
    return tifffile.imread(path).transpose(2, 1, 0), None


@pytest.fixture(scope="session")
def compressed(pumice, data, tmp_path_factory):
    """{name: (path, report)}: each shipped volume as a .pumice file, and the report of `compress`."""
    folder = tmp_path_factory.mktemp("compressed")
    made = {}
    for name, file in SHIPPED.items():
        out = folder / f"{name}.pumice"
        run(pumice, "compress", data / file, "-o", out, "--json", folder / f"{name}.json").fine()
        made[name] = (out, json.loads((folder / f"{name}.json").read_text()))
    return made


def info_of(pumice, path):
    return json.loads(run(pumice, "info", path, "--json").fine())


def test_help_and_version(pumice):
    top = run(pumice, "--help").fine()
    for command in ["demo", "compress", "info", "verify", "decompress", "render", "compare", "devices", "table"]:
        assert f"  {command} " in top
        assert "Usage:" in run(pumice, command, "--help").fine()
    assert run(pumice, "--version").fine().startswith("pumice ")
    assert run(pumice).code == 2


@pytest.mark.parametrize("name", SHIPPED)
def test_info_and_compress_reports(pumice, data, compressed, name):
    path, report = compressed[name]
    info = info_of(pumice, path)
    voxels, affine = voxels_and_affine(data / SHIPPED[name])
    assert info["dims"] == list(voxels.shape)
    assert info["labels"] == len(np.unique(voxels[voxels != 0]))
    assert info["bytes_raw"] == 4 * voxels.size
    assert info["bytes_disk"] == path.stat().st_size
    assert info["label_type"] in ("u8", "u16", "u32", "u64", "i8", "i16", "i32", "i64", "f32", "f64")
    assert "unit" in info and info["boxes"] > 0
    if affine is not None:
        assert info["spacing"] == pytest.approx(np.linalg.norm(affine[:3, :3], axis=0), rel=1e-6)
    parts = info["resident_parts"]
    assert {"boxes", "nodes", "leaves", "labels", "acceleration", "bricks"} <= parts.keys() and parts["bricks"] > 0
    assert sum(parts.values()) == info["bytes_resident"]
    assert parts["boxes"] >= 8 * info["boxes"]

    assert report["seconds"] > 0 and report["cpu_seconds"] > 0 and report["peak_rss_bytes"] > 0
    for key in ["dims", "labels", "boxes", "bytes_raw", "bytes_disk"]:
        assert report[key] == info[key], key
    # One name, one number, to what the tables of a file that was read are longer or shorter in memory; another name for what rays need.
    assert report["bytes_volume"] == pytest.approx(info["bytes_volume"], rel=0.01)
    assert info["bytes_resident"] - info["bytes_volume"] == parts["acceleration"] + parts["bricks"]
    assert "bytes_resident" not in report


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("ending", [".nrrd", ".npy", ".nii.gz", ".tif"])
def test_what_goes_in_comes_out(pumice, data, compressed, tmp_path, name, ending):
    """Voxels and matrix survive a round trip, checked by independent readers. The large connectomics volume takes only one format."""
    if name == "connectomics" and ending != ".nrrd":
        pytest.skip("the other volumes show this format")
    expected, affine = voxels_and_affine(data / SHIPPED[name])
    out = tmp_path / f"back{ending}"
    run(pumice, "decompress", compressed[name][0], "-o", out).fine()
    if ending == ".nrrd":
        got, header = nrrd.read(str(out))
        if affine is not None and "space directions" in header:
            matrix = np.asarray(header["space directions"], float).T
            # The world axes of the two files may point in opposite directions (RAS, LPS), so values agree up to sign.
            assert np.abs(matrix) == pytest.approx(np.abs(affine[:3, :3]), rel=1e-5, abs=1e-5)
            origin = np.asarray(header.get("space origin", [0, 0, 0]), float)
            assert np.abs(origin) == pytest.approx(np.abs(affine[:3, 3]), rel=1e-5, abs=1e-4)
    elif ending == ".npy":
        got = np.load(out)
    elif ending == ".nii.gz":
        image = nibabel.load(out)
        got = np.asanyarray(image.dataobj)
        if affine is not None:
            # NIfTI stores its sform as f32.
            assert np.abs(image.affine) == pytest.approx(np.abs(affine), rel=1e-5, abs=1e-3)
        if name == "brain":
            assert image.affine == pytest.approx(affine, rel=1e-5, abs=1e-3)
            assert nibabel.aff2axcodes(image.affine) == ("P", "I", "R")
    else:
        got = tifffile.imread(out).transpose(2, 1, 0)
    assert np.issubdtype(got.dtype, np.integer)
    assert np.array_equal(got.astype(np.uint64), expected.astype(np.uint64))


@pytest.mark.parametrize("name", SHIPPED)
def test_verify_says_yes(pumice, data, compressed, name):
    assert run(pumice, "verify", compressed[name][0], data / SHIPPED[name]).code == 0


def test_verify_says_no(pumice, tmp_path):
    """A changed voxel, a changed id, one layer fewer: exit code 1, and standard output names the difference."""
    v = labels(np.uint64)
    np.save(tmp_path / "a.npy", v)
    run(pumice, "compress", tmp_path / "a.npy", "-o", tmp_path / "a.pumice").fine()
    assert run(pumice, "verify", tmp_path / "a.pumice", tmp_path / "a.npy").code == 0
    one_voxel, one_id = v.copy(), v.copy()
    one_voxel[3, 4, 5] += 1
    one_id[v == v[3, 4, 5]] = 2**64 - 1
    lost, found = v.copy(), v.copy()
    lost[10, 10, 10] = 0
    found[0, 0, 0] = 9
    assert v[0, 0, 0] == 0 and v[10, 10, 10] != 0
    for what, other in {"voxel": one_voxel, "id": one_id, "lost": lost, "found": found, "smaller": v[:, :, :-1]}.items():
        np.save(tmp_path / "b.npy", other)
        done = run(pumice, "verify", tmp_path / "a.pumice", tmp_path / "b.npy")
        assert (done.code, done.problems) == (1, []), (what, done)
        assert len(done.out.strip()) > 0, what


def test_every_id_survives(pumice, tmp_path):
    """Ids 0, 1, 2³²−1, 2³², 2⁶⁴−1, and 64-bit ids that f64 cannot represent."""
    ids = np.array([0, 1, 2**32 - 1, 2**32, 2**53 + 1, 2**63 + 1, 2**64 - 1], np.uint64)
    v = ids[np.random.default_rng(2).integers(0, len(ids), (9, 7, 5))]
    np.save(tmp_path / "a.npy", v)
    run(pumice, "compress", tmp_path / "a.npy", "-o", tmp_path / "a.pumice").fine()
    for ending, read in {".npy": np.load, ".nrrd": lambda p: nrrd.read(str(p))[0]}.items():
        run(pumice, "decompress", tmp_path / "a.pumice", "-o", tmp_path / f"b{ending}").fine()
        assert np.array_equal(read(tmp_path / f"b{ending}"), v), ending


def test_an_empty_and_a_smallest_volume(pumice, tmp_path):
    for name, v in {"empty": np.zeros((5, 6, 7), np.uint8), "one": np.full((1, 1, 1), 7, np.uint16)}.items():
        np.save(tmp_path / "a.npy", v)
        run(pumice, "compress", tmp_path / "a.npy", "-o", tmp_path / "a.pumice").fine()
        assert info_of(pumice, tmp_path / "a.pumice")["labels"] == (0 if name == "empty" else 1)
        run(pumice, "decompress", tmp_path / "a.pumice", "-o", tmp_path / "b.npy").fine()
        assert np.array_equal(np.load(tmp_path / "b.npy"), v)


def test_same_bytes_whatever_the_threads_and_the_memory(pumice, data, compressed, tmp_path):
    expected = compressed["brain"][0].read_bytes()
    for more in [["--threads", "1"], ["--threads", "3"], ["--memory-limit", "64M"], ["--threads", "2", "--memory-limit", "8M"],
                 ["--memory-limit", "100K"]]:
        out = tmp_path / "again.pumice"
        run(pumice, "compress", data / SHIPPED["brain"], "-o", out, *more).fine()
        assert out.read_bytes() == expected, more
        out.unlink()
    # The error for a limit that is too small for the table of labels states a sufficient one.
    small = ["compress", data / SHIPPED["brain"], "-o", out, "--threads", "1", "--memory-limit"]
    line = run(pumice, *small, "1K").refused()
    assert "--memory-limit 1024 " in line and SHIPPED["brain"] in line and not out.exists(), line
    for _ in range(5):
        # Where there is no room to count all labels, the number is that of those so far.
        done = run(pumice, *small, re.search(r"too small: (\d+) bytes", line)[1])
        if done.code == 0:
            break
        line = done.refused()
    done.fine()
    assert out.read_bytes() == expected


def test_compressing_takes_less_memory_than_the_volume(pumice, data, tmp_path):
    """The volume is read as a stream: the peak memory of the process is less than the decompressed labels of the file."""
    path = data / SHIPPED["connectomics"]
    voxels, _ = nrrd.read(str(path))
    peak = peak_rss_bytes(pumice, "compress", path, "-o", tmp_path / "o.pumice", "--json", tmp_path / "o.json")
    assert 1 << 20 < peak < voxels.nbytes, f"{peak} of {voxels.nbytes} bytes"
    # The command reads its own peak just before its end, so it may be a little lower, but never higher.
    assert 0.9 * peak < json.loads((tmp_path / "o.json").read_text())["peak_rss_bytes"] <= peak


def test_a_report_on_standard_output_is_alone_there(pumice, compressed, data, tmp_path):
    done = run(pumice, "compress", data / SHIPPED["ct"], "-o", tmp_path / "o.pumice", "--json", "-").fine()
    assert json.loads(done)["dims"] == compressed["ct"][1]["dims"]
    args = ["-o", tmp_path / "p.png", "--size", "8x8", "--spp", "1", "--json", "-"]
    assert json.loads(run(pumice, "render", compressed["ct"][0], *args).fine())["spp"] >= 1


@pytest.mark.parametrize("dtype", ["<u2", ">u2", "<u8"])
def test_a_file_without_header(pumice, dtype, tmp_path):
    v = labels(np.uint64)
    (tmp_path / "a.raw").write_bytes(b"seven b" + v.astype(dtype).tobytes(order="F"))
    more = ["--raw-dims", ",".join(map(str, v.shape)), "--raw-type", "u" + str(8 * int(dtype[2])), "--raw-offset", "7"]
    more += ["--raw-big-endian"] if dtype[0] == ">" else []
    run(pumice, "compress", tmp_path / "a.raw", "-o", tmp_path / "a.pumice", *more, "--spacing", "4,5,6").fine()
    assert info_of(pumice, tmp_path / "a.pumice")["spacing"] == [4, 5, 6]
    run(pumice, "decompress", tmp_path / "a.pumice", "-o", tmp_path / "b.npy").fine()
    assert np.array_equal(np.load(tmp_path / "b.npy"), v)
    # Refused: dimensions with more voxels than the file has, and the file without the flags.
    more[1] = f"{v.shape[0]},{v.shape[1]},{v.shape[2] + 1}"
    run(pumice, "compress", tmp_path / "a.raw", "-o", tmp_path / "c.pumice", *more).refused()
    run(pumice, "compress", tmp_path / "a.raw", "-o", tmp_path / "c.pumice").refused()
    assert not (tmp_path / "c.pumice").exists()


def test_one_of_several_arrays_channels_and_time_steps(pumice, tmp_path):
    """The error names the flag that selects one."""
    a = labels()
    b = np.ascontiguousarray(a[::-1])
    np.savez(tmp_path / "several.npz", first=a, second=b)
    both = np.stack([a.transpose(2, 1, 0), b.transpose(2, 1, 0)])
    tifffile.imwrite(tmp_path / "channels.tif", both.transpose(1, 0, 2, 3), imagej=True, metadata={"axes": "ZCYX"})
    tifffile.imwrite(tmp_path / "times.tif", both, imagej=True, metadata={"axes": "TZYX"})
    for name, flag, choice in [("several.npz", "--array", "second"), ("channels.tif", "--channel", 1), ("times.tif", "--time-step", 1)]:
        assert flag in run(pumice, "compress", tmp_path / name, "-o", tmp_path / "a.pumice").refused()
        run(pumice, "compress", tmp_path / name, "-o", tmp_path / "a.pumice", flag, choice).fine()
        run(pumice, "decompress", tmp_path / "a.pumice", "-o", tmp_path / "b.npy").fine()
        assert np.array_equal(np.load(tmp_path / "b.npy"), b), name
        (tmp_path / "a.pumice").unlink()


def test_types_of_labels(pumice, tmp_path):
    v = labels()
    np.save(tmp_path / "a.npy", v)
    ids = np.unique(v[v != 0])
    (tmp_path / "types.csv").write_text("id,type\n" + "".join(f"{i},{'odd' if i % 2 else 'even'}\n" for i in ids))
    args = ["compress", tmp_path / "a.npy", "-o", tmp_path / "a.pumice", "--types", tmp_path / "types.csv"]
    run(pumice, *args).fine()
    assert info_of(pumice, tmp_path / "a.pumice")["types"] == 2
    assert run(pumice, "verify", tmp_path / "a.pumice", tmp_path / "a.npy").code == 0
    (tmp_path / "a.pumice").unlink()
    for broken in ["id,type\nseven,odd\n", "1 2 3\n", "1,a\n1,b\n"]:
        (tmp_path / "types.csv").write_text(broken)
        assert "types.csv" in run(pumice, *args).refused()
    (tmp_path / "types.csv").unlink()
    assert "types.csv" in run(pumice, *args).refused()
    assert not (tmp_path / "a.pumice").exists()


def test_levels_hold_the_same_and_differ_in_size(pumice, data, tmp_path):
    sizes = {}
    for level in ["fast", "default", "small"]:
        out = tmp_path / f"{level}.pumice"
        run(pumice, "compress", data / SHIPPED["ct"], "-o", out, "--level", level).fine()
        assert run(pumice, "verify", out, data / SHIPPED["ct"]).code == 0
        sizes[level] = out.stat().st_size
    assert sizes["small"] <= sizes["default"] < sizes["fast"]


def test_overlapping_segments_are_layers(pumice, data, tmp_path):
    """Without --layer there is a clear error, never a silent merge; each layer has the voxels that pynrrd reads."""
    path = data / "slicer_SegmentationOverlapping.seg.nrrd"
    voxels, _ = nrrd.read(str(path))
    assert voxels.ndim == 4 and voxels.shape[0] == 2
    line = run(pumice, "compress", path, "-o", tmp_path / "o.pumice").refused()
    assert "--layer" in line
    layers = info_of(pumice, path)["layers"]
    assert len(layers) == 2 and layers[1] == ["overlapping sphere"] and "right lung" in layers[0]
    assert "overlapping sphere" in line and "overlapping sphere" in run(pumice, "info", path).fine()
    for layer in range(2):
        run(pumice, "compress", path, "-o", tmp_path / "o.pumice", "--layer", layer).fine()
        run(pumice, "decompress", tmp_path / "o.pumice", "-o", tmp_path / "o.npy").fine()
        assert np.array_equal(np.load(tmp_path / "o.npy"), voxels[layer]), layer
    run(pumice, "compress", path, "-o", tmp_path / "p.pumice", "--layer", 2).refused()


@pytest.fixture(scope="session")
def picture(pumice, compressed, tmp_path_factory):
    """(path, report, arguments) of a small EXR picture of the CT volume."""
    folder = tmp_path_factory.mktemp("picture")
    args = ["--size", "48x32", "--spp", "8", "--seed", "5", "--backend", "cpu"]
    run(pumice, "render", compressed["ct"][0], "-o", folder / "a.exr", *args, "--json", folder / "a.json").fine()
    return folder / "a.exr", json.loads((folder / "a.json").read_text()), args


def exr_pixels(path):
    """Channels R, G, B of a picture, by NVIDIA's reader."""
    import flip_evaluator

    return np.asarray(flip_evaluator.load(str(path)))


def test_render_report(picture):
    _, report, _ = picture
    for key in ["seconds", "cpu_seconds", "peak_rss_bytes", "spp", "error_estimate", "backend", "curve"]:
        assert key in report, key
    assert (report["spp"], report["backend"]) == (8, "cpu")
    assert report["curve"] and {"seconds", "cpu_seconds", "spp", "error_estimate"} <= report["curve"][-1].keys()
    assert [p["spp"] for p in report["curve"]] == sorted(p["spp"] for p in report["curve"])


def test_picture_shows_something(picture):
    pixels = exr_pixels(picture[0])
    assert pixels.shape[:2] == (32, 48) and np.isfinite(pixels).all()
    assert pixels.std() > 0.01 and pixels.max() > 0.1


def test_same_pixels_whatever_the_threads(pumice, compressed, picture, tmp_path):
    expected = exr_pixels(picture[0])
    for threads in ["1", "2"]:
        run(pumice, "render", compressed["ct"][0], "-o", tmp_path / "b.exr", *picture[2], "--threads", threads).fine()
        assert np.array_equal(exr_pixels(tmp_path / "b.exr"), expected), threads
    # Negative control: another seed gives another picture.
    other = [a if a != "5" else "6" for a in picture[2]]
    run(pumice, "render", compressed["ct"][0], "-o", tmp_path / "c.exr", *other).fine()
    assert not np.array_equal(exr_pixels(tmp_path / "c.exr"), expected)


def test_a_picture_can_be_rendered_again(pumice, picture, tmp_path):
    run(pumice, "render", "--again", picture[0], "-o", tmp_path / "again.exr").fine()
    assert np.array_equal(exr_pixels(tmp_path / "again.exr"), exr_pixels(picture[0]))
    # The whole file is the same, with passes and metadata.
    assert (tmp_path / "again.exr").read_bytes() == picture[0].read_bytes()


def test_a_png_can_be_rendered_again(pumice, compressed, picture, tmp_path):
    a, b = tmp_path / "a.png", tmp_path / "b.png"
    run(pumice, "render", compressed["ct"][0], "-o", a, *picture[2]).fine()
    run(pumice, "render", "--again", a, "-o", b).fine()
    assert np.array_equal(np.asarray(Image.open(a)), np.asarray(Image.open(b)))
    # Rendered again as EXR, it is the picture before quantisation.
    run(pumice, "render", "--again", a, "-o", tmp_path / "c.exr").fine()
    assert np.array_equal(exr_pixels(tmp_path / "c.exr"), exr_pixels(picture[0]))


def test_a_picture_is_not_rendered_again_from_another_volume(pumice, data, tmp_path):
    np.save(tmp_path / "a.npy", labels())
    run(pumice, "render", tmp_path / "a.npy", "-o", tmp_path / "a.png", "--size", "16x9", "--spp", "1").fine()
    again = ["render", "--again", tmp_path / "a.png", "-o", tmp_path / "b.png"]
    run(pumice, *again).fine()
    (tmp_path / "b.png").unlink()
    np.save(tmp_path / "a.npy", labels()[::-1])
    line = run(pumice, *again).refused()
    assert "a.npy" in line and not (tmp_path / "b.png").exists()
    (tmp_path / "a.npy").unlink()
    assert "a.npy" in run(pumice, *again).refused()
    Image.new("RGB", (4, 4)).save(tmp_path / "a.png")
    assert "a.png" in run(pumice, *again).refused()


def exr_channels(path):
    """Names of the channels in an EXR header. In the file format, the attribute `channels` is a list of zero-terminated names, each
    followed by 16 bytes."""
    data = path.read_bytes()
    at = data.index(b"channels\0chlist\0") + len(b"channels\0chlist\0") + 4
    names = set()
    while data[at]:
        end = data.index(b"\0", at)
        names.add(data[at:end].decode())
        at = end + 1 + 16
    return names


def test_passes(pumice, compressed, picture, tmp_path):
    def channels(*more):
        run(pumice, "render", compressed["ct"][0], "-o", tmp_path / "a.exr", "--size", "16x9", "--spp", "1", *more).fine()
        return exr_channels(tmp_path / "a.exr")

    everything, nothing, two = channels(), channels("--passes", "none"), channels("--passes", "depth,label")
    assert everything == channels("--passes", "all") and everything == channels("--passes", "depth,position,label,albedo,normal,variance")
    assert {"R", "G", "B"} <= nothing < two < everything
    added = {name.split(".")[-2].lower() for name in two - nothing}
    assert len(added) == 2 and any("depth" in n or n == "z" for n in added) and any("label" in n for n in added), added


def test_png_is_what_the_exr_shows(pumice, compressed, picture, tmp_path):
    run(pumice, "render", compressed["ct"][0], "-o", tmp_path / "a.png", *picture[2]).fine()
    png = np.asarray(Image.open(tmp_path / "a.png").convert("RGB")).astype(float)
    assert png.shape == (32, 48, 3)
    linear = np.clip(exr_pixels(picture[0])[..., :3], 0, 1)
    encoded = 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    # Half a step for rounding, and half a step for the EXR's half floats.
    assert np.abs(png - encoded).max() <= 1.0


def test_scene_file_gives_the_same_picture(pumice, compressed, picture, tmp_path):
    scene = tmp_path / "scene.json"
    run(pumice, "render", compressed["ct"][0], "-o", tmp_path / "a.exr", *picture[2], "--save-scene", scene).fine()
    assert json.loads(scene.read_text())["version"] == 1
    run(pumice, "render", scene, "-o", tmp_path / "b.exr", "--spp", "8").fine()
    assert np.array_equal(exr_pixels(tmp_path / "b.exr"), exr_pixels(picture[0]))


def test_levels_of_detail_and_modes_draw(pumice, compressed, tmp_path):
    seen = {}
    for args in [("--lod", "1"), ("--lod", "4"), ("--lod", "16"), ("--mode", "one-bounce"), ("--mode", "ao")]:
        out = tmp_path / "a.exr"
        run(pumice, "render", compressed["ct"][0], "-o", out, "--size", "48x32", "--spp", "2", *args).fine()
        seen[args] = exr_pixels(out).tobytes()
    assert len(set(seen.values())) == len(seen), "each level and mode gives a different picture"


def test_stops_by_time_and_by_error(pumice, compressed, tmp_path):
    for limit in [("--time", "0.5"), ("--error", "0.5")]:
        run(pumice, "render", compressed["ct"][0], "-o", tmp_path / "a.png", "--size", "32x24", *limit, "--json",
            tmp_path / "a.json").fine()
        report = json.loads((tmp_path / "a.json").read_text())
        assert report["spp"] >= 1
    assert report["error_estimate"] <= 0.5


def test_an_error_target_decides_about_samples_and_nothing_else_does(pumice, compressed, tmp_path):
    """Neither threads nor load: the error is looked at with the same numbers of samples. The control is another target."""
    out, report, seen = tmp_path / "a.png", tmp_path / "a.json", {}
    for target, threads in [("6%", 1), ("6%", 2), ("6%", 2), ("3%", 2)]:
        arguments = ["--size", "64x48", "--backend", "cpu", "--error", target, "--threads", threads, "--json", report]
        run(pumice, "render", compressed["ct"][0], "-o", out, *arguments).fine()
        seen.setdefault(target, []).append((json.loads(report.read_text())["spp"], out.read_bytes()))
    first, *others = seen["6%"]
    assert others == [first] * 2 and seen["3%"][0][0] > first[0] >= 4, [spp for spp, _ in others]


def test_pixels_rest_once_they_are_good_enough(pumice, compressed, tmp_path):
    args = [compressed["ct"][0], "--size", "48x32", "--backend", "cpu"]
    rest = ["--noise-threshold", "15%", "--min-spp", "8"]
    out, again, report = tmp_path / "a.exr", tmp_path / "b.exr", tmp_path / "a.json"
    line = run(pumice, "render", *args, *rest, "--passes", "samples", "-o", out, "--json", report).fine()
    report = json.loads(report.read_text())
    samples = planes(out)["ViewLayer.Debug Sample Count.X"]
    assert samples.min() == 8 and samples.max() == report["spp"] > 8
    assert report["mean_spp"] == pytest.approx(samples.mean(), rel=1e-6) and report["error_estimate"] < 0.15
    assert f"{report['spp']} samples a pixel ({report['mean_spp']:.1f} on average)" in line
    # `--again` gives the same file. Pixels that stopped at 8 samples equal those of a picture with 8 samples everywhere.
    run(pumice, "render", "--again", out, "-o", again, "--passes", "samples").fine()
    assert again.read_bytes() == out.read_bytes()
    run(pumice, "render", *args, "--spp", "8", "-o", again).fine()
    same = (exr_pixels(again) == exr_pixels(out)).all(axis=-1)
    assert same[samples == 8].all() and not same.all()
    for wrong in (["--min-spp", "8"], ["--noise-threshold", "0"], [*rest[:2], "--min-spp", "3"], ["--noise-threshold", "nan"]):
        run(pumice, "render", *args, "-o", again, *wrong).refused()


def test_compare(pumice, compressed, picture, tmp_path):
    same = json.loads(run(pumice, "compare", picture[0], picture[0], "--json", "-").fine())
    assert (same["rel_mse"], same["flip"]) == (0, 0) and same["ssim"] == pytest.approx(1)
    assert same["psnr"] is None, "without error the PSNR is infinite, which JSON cannot express"
    small = tmp_path / "small.exr"
    run(pumice, "render", compressed["ct"][0], "-o", small, "--size", "16x9", "--spp", "1").fine()
    line = run(pumice, "compare", small, picture[0]).refused()
    assert "small.exr" in line and "16" in line and "48" in line
    noisy = tmp_path / "noisy.exr"
    args = [a if a != "5" else "6" for a in picture[2]]
    run(pumice, "render", compressed["ct"][0], "-o", noisy, *args).fine()
    run(pumice, "compare", noisy, picture[0], "--json", tmp_path / "c.json").fine()
    other = json.loads((tmp_path / "c.json").read_text())
    a, b = exr_pixels(noisy)[..., :3].astype(float), exr_pixels(picture[0])[..., :3].astype(float)
    assert other["rel_mse"] == pytest.approx(np.mean((a - b) ** 2 / (b**2 + 0.01)), rel=1e-4)
    assert other["psnr"] > 0 and 0 < other["ssim"] < 1 and 0 < other["flip"] < 1
    assert run(pumice, "compare", noisy, picture[0], "--max-rel-mse", "1e-9").code == 1
    assert "alpha_rmse" not in other
    # Alpha, which an opaque picture has as 1.
    clear = tmp_path / "clear.exr"
    run(pumice, "render", compressed["ct"][0], "-o", clear, *picture[2], "--transparent").fine()
    alpha = planes(clear)["A"].astype(float)
    assert 0.0 < alpha.mean() < 1.0
    line = run(pumice, "compare", clear, picture[0], "--json", tmp_path / "c.json").fine()
    rmse = np.sqrt(np.mean((alpha - 1.0) ** 2))
    assert json.loads((tmp_path / "c.json").read_text())["alpha_rmse"] == pytest.approx(rmse, rel=1e-6)
    assert line.rstrip().endswith(f"alpha RMSE {rmse:.5f}")
    assert json.loads(run(pumice, "compare", clear, clear, "--json", "-").fine())["alpha_rmse"] == 0.0


def test_devices(pumice):
    devices = json.loads(run(pumice, "devices", "--json").fine())["devices"]
    assert [d for d in devices if d["backend"] == "cpu"]
    assert sum(d["chosen"] for d in devices) == 1
    assert all(d["device"] and d["reason"] for d in devices)


def test_no_progress_bar_in_a_pipe(pumice, data, tmp_path):
    done = subprocess.run([pumice, "compress", data / SHIPPED["ct"], "-o", tmp_path / "o.pumice"], capture_output=True)
    assert done.returncode == 0 and done.stderr == b"" and b"\r" not in done.stdout and b"\x1b" not in done.stdout
