"""No option is ignored: on each kind of input it has an effect, or one line refuses it by name.

    every option of every subcommand  ──►  OPTIONS: always, or the rule that refuses it
    reading options × kinds of input  ──►  READS: which are taken; all others are refused

The kinds are written by other people's libraries. That an option has its effect is the subject of other tests; the arrays here differ in
dims between layers, so a choice that is taken shows in what `info` says.
"""

import json
import re

import h5py
import nibabel
import nrrd
import numpy as np
import pytest
import tifffile
import zarr
from command import run

# One row a subcommand: each option, with the rule under which it is refused ("" for none).
READING = {
    **dict.fromkeys(["--layer", "--time-step", "--channel", "--array", "--spacing", "--axes"], "where the format leaves nothing to choose"),
    **dict.fromkeys(["--scale", "--label", "--dataset", "--missing-chunks"], "where the format leaves nothing to choose"),
    **dict.fromkeys(["--roi", "--relabel"], "on .pumice files"),
    "--raw-dims": "on .pumice files",
    **dict.fromkeys(["--raw-type", "--raw-offset"], "without --raw-dims"),
    "--raw-big-endian": "without --raw-dims, and where a label has one byte",
}
IN_LABELS = "without --labels"
OPTIONS = {
    "demo": dict.fromkeys(["--volume", "--out", "--time", "--error", "--size"], ""),
    "compress": {
        **dict.fromkeys(["--out", "--json", "--threads", "--memory-limit"], ""),
        **dict.fromkeys(["--level", "--types"], "with --chunks"),
        "--table": "with --types, and with --chunks",
        "--chunks": "with --level, --types, --table, --resume and --restart",
        **dict.fromkeys(["--resume", "--restart"], "with --chunks, with each other, and for a compressed stream"),
        "--time-steps": "with --time-step, and where the input has one time step",
        **READING,
    },
    "merge": {
        **dict.fromkeys(["--out", "--level", "--json", "--threads", "--memory-limit", "--types"], ""),
        "--table": "with --types",
        "--part": "with --level",
    },
    "info": {
        "--json": "with --labels",
        "--labels": "",
        **dict.fromkeys(["--csv", "--query", "--sort"], IN_LABELS),
        **READING,
    },
    "table": {**dict.fromkeys(["--out", "--as", "--query", "--json"], ""), **READING},
    "verify": {"--time-steps": "with --time-step, and where the input has one time step", **READING},
    "decompress": {
        **dict.fromkeys(["--out", "--format"], ""),
        **dict.fromkeys(["--ome-version", "--shards", "--encoding", "--gzip", "--chunk"], "for other formats than its own"),
        "--time-step": "on files of one volume, and for a file for each time step",
    },
    "render": {
        **dict.fromkeys(["--out", "--again", "--backend", "--time", "--threads", "--json", "--save-scene", "--explain", "--no-paths"], ""),
        **dict.fromkeys(["--size", "--spp", "--error", "--noise-threshold", "--mode", "--lod", "--seed", "--transparent", "--denoise"], "with --again"),
        "--labels": "with --again, with --pick, and for labels that no volume has",
        **dict.fromkeys(["--color", "--material"], "with --again, for scenes, and for labels of which none is shown"),
        "--min-spp": "with --again, and where no pixel rests",
        "--bounces": "with --again, and in modes without bounces",
        "--passes": "for a .png",
        "--memory-limit": "with --explain, and where not everything can be drawn from disk",
        "--half": "with --again, and for a .png",
        "--view-transform": "with --again, and for an .exr",
        **dict.fromkeys(["--query", "--background", "--smooth"], "with --again"),
        **dict.fromkeys(["--pick", "--cut", "--floor"], "with --again, and for scenes"),
        **dict.fromkeys(["--focus", "--aperture", "--view", "--distance", "--frame"], "with --again, and for scenes"),
        "--turntable": "with --again, with --explain, and for scenes",
        "--time-steps": "with --again, with --turntable, with --explain, and where no volume has time steps",
        "--width-mm": "with --again, and with --size",
        **dict.fromkeys(["--dpi", "--scale-bar", "--legend"], "with --again"),
        "--scale-bar-corner": "with --again, and without --scale-bar",
        "--source": "without --again",
        "--layer-file": "with --again, for volumes and scenes, and for layers that a state does not show",
        **READING,
    },
    "verify-render": {
        **dict.fromkeys(["--with-blender", "--control", "--out", "--json", "--backend", "--spp", "--time", "--size", "--lod"], ""),
        **dict.fromkeys(["--memory-limit", "--bounces"], ""),
        "--labels": "with --pick, and for labels that no volume has",
        "--pick": "for scenes",
        **READING,
    },
    "export": {
        **dict.fromkeys(["--out", "--region", "--limit", "--json"], ""),
        "--form": "where the format has no such form",
        "--lod": "with --form",
        "--plain": "where no form merges faces",
        "--for": "for formats other than USD",
        "--labels": "for labels that no volume has",
        **READING,
    },
    "compare": dict.fromkeys(["--json", "--max-rel-mse"], ""),
    "pick": {"--json": ""},
    "devices": {"--json": ""},
}

LABELS = (np.arange(4 * 6 * 8) % 5).astype(np.uint16).reshape(4, 6, 8)
TWO = np.stack([LABELS, LABELS[::-1]])

# The options that each kind of input takes beside those that all but .pumice files take; `needed` are those without which it is refused.
RAW = ["--raw-dims", "8,6,4", "--raw-type", "u16"]
READS = {
    "a.pumice": [],
    "a.nrrd": ["--spacing"],
    "a.nii": ["--spacing"],
    "a.tif": ["--spacing", "--axes"],
    "a.mha": ["--spacing"],
    "slices": ["--spacing"],
    "a.npy": ["--spacing", "--axes"],
    "two.npz": ["--spacing", "--axes", "--array"],
    "layers.nrrd": ["--spacing", "--layer"],
    "channels.tif": ["--spacing", "--channel", "--axes"],
    "times.nii": ["--spacing", "--time-step"],
    "a.raw": ["--spacing", "--raw-offset"],
    "a.zarr": ["--spacing", "--axes", "--missing-chunks"],
    "levels.zarr": ["--spacing", "--label", "--scale", "--missing-chunks"],
    "two.h5": ["--spacing", "--axes", "--dataset"],
    "a.n5": ["--spacing", "--missing-chunks"],
    "a.precomputed": ["--spacing", "--missing-chunks"],
}
# Taken by every reader.
BY_ALL = ["--roi", "--relabel"]
NEEDED = {
    "levels.zarr": ["--label", "first"],
    "two.h5": ["--dataset", "first"],
    "two.npz": ["--array", "first"],
    "layers.nrrd": ["--layer", "0"],
    "channels.tif": ["--channel", "0"],
    "times.nii": ["--time-step", "0"],
    "a.raw": RAW,
}
VALUES = {
    "--layer": "1",
    "--time-step": "1",
    "--channel": "1",
    "--array": "second",
    "--spacing": "1,2,3",
    "--axes": "zyx",
    "--raw-offset": "0",
    "--scale": "1",
    "--roi": "1:,:,:3",
    "--label": "second",
    "--dataset": "second",
    "--missing-chunks": "error",
    # The fixture puts the path here.
    "--relabel": "",
}


@pytest.fixture(scope="module")
def inputs(pumice, tmp_path_factory):
    """A folder with a file of each kind, and a scene of one of them (s.json)."""
    folder = tmp_path_factory.mktemp("inputs")
    nrrd.write(str(folder / "a.nrrd"), LABELS)
    nrrd.write(str(folder / "layers.nrrd"), TWO, {"kinds": ["list", "domain", "domain", "domain"]})
    nibabel.save(nibabel.Nifti1Image(LABELS, np.eye(4)), folder / "a.nii")
    nibabel.save(nibabel.Nifti1Image(np.moveaxis(TWO, 0, -1), np.eye(4)), folder / "times.nii")
    tifffile.imwrite(folder / "a.tif", LABELS, photometric="minisblack")
    tifffile.imwrite(folder / "channels.tif", TWO.transpose(1, 0, 2, 3), imagej=True, metadata={"axes": "ZCYX"})
    (folder / "slices").mkdir()
    for z, plane in enumerate(LABELS):
        tifffile.imwrite(folder / "slices" / f"{z}.tif", plane)
    np.save(folder / "a.npy", LABELS)
    np.savez(folder / "two.npz", first=LABELS, second=LABELS[::-1])
    (folder / "a.raw").write_bytes(LABELS.tobytes())
    (folder / "pairs.csv").write_text("1,7\n")
    VALUES["--relabel"] = str(folder / "pairs.csv")
    write_stores(folder)
    header = "ObjectType = Image\nNDims = 3\nDimSize = 8 6 4\nElementSpacing = 1 1 1\nElementType = MET_USHORT\nElementDataFile = LOCAL\n"
    (folder / "a.mha").write_bytes(header.encode() + LABELS.tobytes())
    run(pumice, "compress", folder / "a.nrrd", "-o", folder / "a.pumice").fine()
    small = ["--size", "4x4", "--spp", "1", "--backend", "cpu"]
    run(pumice, "render", folder / "a.pumice", "-o", folder / "a.exr", *small, "--save-scene", folder / "s.json").fine()
    return folder


def write_stores(folder):
    zarr.create_array(folder / "a.zarr", data=LABELS)
    labels = zarr.open_group(folder / "levels.zarr" / "labels", mode="w")
    zarr.open_group(folder / "levels.zarr", mode="a")
    labels.attrs["ome"] = {"labels": ["first", "second"]}
    for name in ("first", "second"):
        image = labels.create_group(name)
        axes = [{"name": axis, "type": "space"} for axis in "zyx"]
        image.attrs["ome"] = {"multiscales": [{"axes": axes, "datasets": [{"path": "0"}, {"path": "1"}]}]}
        image.create_array("0", data=LABELS)
        image.create_array("1", data=LABELS)
    with h5py.File(folder / "two.h5", "w") as file:
        file["first"], file["second"] = TWO
    (folder / "a.n5").mkdir()
    about = {"dimensions": [8, 6, 4], "blockSize": [8, 6, 4], "dataType": "uint16", "compression": {"type": "raw"}}
    (folder / "a.n5" / "attributes.json").write_text(json.dumps(about))
    scale = {"key": "s", "size": [8, 6, 4], "resolution": [1, 1, 1], "chunk_sizes": [[8, 6, 4]], "encoding": "raw"}
    (folder / "a.precomputed" / "s").mkdir(parents=True)
    about = {"type": "segmentation", "data_type": "uint16", "num_channels": 1, "scales": [scale]}
    (folder / "a.precomputed" / "info").write_text(json.dumps(about))


def test_every_option_of_every_subcommand_has_its_row(pumice):
    for command, rows in OPTIONS.items():
        text = run(pumice, command, "--help").fine()
        told = set(re.findall(r"^ +(?:-\w, )?(--[\w-]+)", text, re.MULTILINE)) - {"--help"}
        assert told == set(rows), f"{command}: an option without a row, or a row without an option"


def options_of(kind, option):
    """The arguments of a kind of input with this option in addition."""
    # The order of the pages says that there are no channels.
    needed = [] if (kind, option) == ("channels.tif", "--axes") else NEEDED.get(kind, [])
    if option in needed:
        at = needed.index(option)
        needed = needed[:at] + needed[at + 2 :]
    return [*needed, option, VALUES[option]]


@pytest.mark.parametrize("kind", READS)
def test_each_kind_takes_what_it_leaves_open_and_refuses_the_rest_by_name(pumice, inputs, kind):
    for option in VALUES:
        if option == "--raw-offset" and kind != "a.raw":
            continue  # clap asks for --raw-dims
        done = run(pumice, "info", inputs / kind, "--json", *options_of(kind, option))
        if option in READS[kind] or option in BY_ALL and kind != "a.pumice":
            found = json.loads(done.fine())
            assert option != "--spacing" or found["spacing"] == [1, 2, 3], kind
        else:
            line = done.refused()
            assert option in line and kind in line, line
            # The first of one leaves nothing to choose either.
            if VALUES[option] == "1":
                first = [*options_of(kind, option)[:-1], "0"]
                line = run(pumice, "info", inputs / kind, "--json", *first).refused()
                assert f"{option} 0 cannot be chosen" in line or kind == "a.pumice" and option in line, line


@pytest.mark.parametrize("command", ["info", "labels", "table", "render", "export", "verify-render"])
def test_every_subcommand_refuses_them_on_a_compressed_volume(pumice, inputs, tmp_path, command):
    more = {
        "labels": ["--labels"],
        "table": ["-o", tmp_path / "o.csv"],
        "render": ["-o", tmp_path / "o.png"],
        "export": ["-o", tmp_path / "o.ply"],
        "verify-render": ["--with-blender", "python3"],
    }.get(command, [])
    name = "info" if command == "labels" else command
    for option in [*VALUES, "--raw-dims"]:
        if option == "--raw-offset":
            continue
        value = [VALUES[option]] if option in VALUES else ["2,2,2", "--raw-type", "u8"]
        line = run(pumice, name, inputs / "a.pumice", *more, option, *value).refused()
        assert option in line and "a.pumice" in line, line
    assert not list(tmp_path.iterdir())


def test_big_endian_labels_of_one_byte_are_refused(pumice, inputs):
    more = [*RAW[:3], "u8", "--raw-big-endian"]
    line = run(pumice, "info", inputs / "a.raw", *more).refused()
    assert "--raw-big-endian" in line and "a.raw" in line
    run(pumice, "info", inputs / "a.raw", *RAW, "--raw-big-endian").fine()


# Subject, ending of the picture, options, the option that is refused (None: taken).
RENDERS = [
    ("a.pumice", "exr", ["--pick", "1"], None),
    ("s.json", "exr", ["--pick", "1"], "--pick"),
    ("a.pumice", "exr", ["--view", "10,20"], None),
    ("s.json", "exr", ["--view", "10,20"], "--view"),
    ("a.pumice", "exr", ["--half"], None),
    ("a.pumice", "png", ["--half"], "--half"),
    ("a.pumice", "exr", ["--passes", "depth"], None),
    ("a.pumice", "png", ["--passes", "depth"], "--passes"),
    ("a.pumice", "png", ["--passes", "none"], "--passes"),
    ("a.pumice", "png", ["--view-transform", "agx"], None),
    ("a.pumice", "exr", ["--view-transform", "agx"], "--view-transform"),
    ("s.json", "exr", ["--view-transform", "agx"], "--view-transform"),
    ("a.pumice", "exr", ["--min-spp", "8"], "--min-spp"),
    ("a.pumice", "exr", ["--min-spp", "8", "--noise-threshold", "90%"], None),
    ("a.pumice", "exr", ["--bounces", "1"], None),
    ("a.pumice", "exr", ["--bounces", "1", "--mode", "one-bounce"], "--bounces"),
    ("s.json", "exr", ["--bounces", "1", "--mode", "ao"], "--bounces"),
    ("a.nrrd", "exr", ["--mode", "ao", "--color", "1=#f00"], "--color"),
    ("a.nrrd", "exr", ["--mode", "ao", "--material", "metal"], "--material"),
    ("a.pumice", "exr", ["--labels", "1,999"], "999"),
    ("s.json", "exr", ["--labels", "1,999"], "999"),
    ("a.nrrd", "exr", ["--labels", "0"], "label 0"),
    ("a.nrrd", "exr", ["--layer", "0"], "--layer 0"),
    ("s.json", "exr", ["--layer", "0"], "--layer"),
    ("layers.nrrd", "exr", ["--layer", "0"], None),
    ("a.pumice", "exr", ["--labels", "1,2", "--color", "3=#fff"], "--color: label 3 is not shown; add it to labels"),
    ("a.pumice", "exr", ["--labels", "1,2", "--color", "2=#fff"], None),
    ("a.nrrd", "exr", ["--query", "id<3", "--material", "3=glass"], "--material: label 3 is not shown; the query does not match"),
    ("a.nrrd", "exr", ["--query", "id<3", "--material", "2-4=glass"], None),
    ("a.pumice", "exr", ["--source", "a.nrrd"], "--source"),
]


@pytest.mark.parametrize(("subject", "ending", "options", "refused"), RENDERS)
def test_a_render_takes_an_option_or_names_it(pumice, inputs, tmp_path, subject, ending, options, refused):
    out = tmp_path / f"o.{ending}"
    limit = [] if "--noise-threshold" in options else ["--spp", "1"]
    done = run(pumice, "render", inputs / subject, "-o", out, "--size", "4x4", "--backend", "cpu", *limit, *options)
    if refused is None:
        done.fine()
        assert out.exists()
    else:
        assert refused in done.refused() and not out.exists()


@pytest.mark.parametrize("option", [name for name, rule in OPTIONS["render"].items() if rule.startswith("with --again")])
def test_an_earlier_picture_is_rendered_again_as_it_was(pumice, inputs, tmp_path, option):
    values = {"--size": "8x8", "--error": "1%", "--mode": "ao", "--view-transform": "agx", "--view": "1,2", "--noise-threshold": "5%"}
    values |= {"--color": "1=#fff", "--material": "glass", "--cut": "x=0.5", "--frame": "volume", "--background": "white", "--aperture": "f/2"}
    value = [] if option in ("--transparent", "--half", "--floor", "--smooth", "--legend") else [values.get(option, "4")]
    line = run(pumice, "render", "--again", inputs / "a.exr", "-o", tmp_path / "o.exr", option, *value).refused()
    assert option in line and not list(tmp_path.iterdir())


def test_a_query_names_the_labels_that_there_are_not(pumice, inputs, tmp_path):
    done = run(pumice, "info", inputs / "a.pumice", "--labels", "--csv", "--query", "1 3 77 100-200 -88")
    assert done.warnings == ["query: the volume has no label 77"] and len(done.fine().splitlines()) == 1 + 2
    told = run(pumice, "table", inputs / "a.pumice", "-o", tmp_path / "t.csv", "--query", "1 77").fine()
    assert "note: query: the volume has no label 77" in told


def test_exports_name_what_has_no_effect(pumice, inputs, tmp_path):
    def export(name, *options, subject="a.pumice"):
        return run(pumice, "export", inputs / subject, "-o", tmp_path / name, *options)

    assert "--plain" in export("o.usda", "--form", "instances", "--plain").refused()
    assert "--plain" in export("o.ply", "--form", "smooth", "--plain").refused()
    assert "blender" in export("o.ply", "--for", "blender").refused()
    for subject in ("a.pumice", "s.json", "a.nrrd"):
        assert "999" in export("o.ply", "--labels", "1,999", subject=subject).refused()
    assert "--pick" in run(pumice, "verify-render", inputs / "s.json", "--with-blender", "python3", "--pick", "1").refused()
    assert not list(tmp_path.iterdir())
    export("o.ply", "--plain").fine()
