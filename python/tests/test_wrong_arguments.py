"""Tests that a wrong argument of any public function is an `InputError` with one line, whatever it is and wherever it is refused."""

import json
import math
import os

import numpy as np
import pumice
import pytest
import tifffile

# What no argument should be; some arguments accept some of them.
HOSTILE = {
    "an object": object(),
    "nothing": None,
    "a text": "a\x1b[2Jb\n",
    "a long text": "n" * 5000,
    "bytes": b"\xff\0",
    "a complex number": 1j,
    "not a number": math.nan,
    "infinity": math.inf,
    "below zero": -1,
    "half": 0.5,
    "beyond 64 bits": 1 << 70,
    "an empty list": [],
    "a ragged list": [[1], [2, 3]],
    "a list of nothing": [None, None],
    "a dict": {"a": 1},
    "an array that is not a number": np.array(math.nan),
    "an array of objects": np.array([object(), None], dtype=object),
    "an array of five axes": np.zeros((1, 1, 1, 1, 1)),
    "an array of not a number": np.full((3, 3), np.nan),
    "a class": int,
    "a function": lambda *_: None,
}


@pytest.fixture(scope="module")
def small():
    array = np.zeros((4, 4, 4), np.uint8)
    array[:2], array[2:] = 1, 2
    return array


@pytest.fixture(scope="module")
def made(small, tmp_path_factory):
    """Objects of each kind, and functions of the module with arguments that they accept."""
    folder = tmp_path_factory.mktemp("made")
    np.save(folder / "v.npy", small)
    volume = pumice.compress(small)
    volume.save(folder / "v.pumice")
    table = pumice.AnnotationTable([1, 2], names=["a", "b"])
    table.save(folder / "t.csv")
    (folder / "types.csv").write_text("id,type\n1,a\n")
    scene = pumice.figure(volume, size=(8, 8), source=folder / "v.pumice")
    scene.save(folder / "s.json")
    steps = {axis: [1, "m"] for axis in "xyz"}
    layer = {"type": "segmentation", "name": "a", "source": "v.pumice", "segments": ["1"]}
    (folder / "ng.json").write_text(json.dumps({"dimensions": steps, "layers": [layer]}))
    triangle = {"positions": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "triangles": [[0, 1, 2]]}
    pumice.render(scene, volume, spp=1, backend="cpu").save(folder / "p.exr")
    mesh = pumice.Mesh(**triangle)
    mesh.save(folder / "m.ply")
    material = {"base_color": [0.5, 0.5, 0.5]}
    groups = {"ids": [1, 2], "groups": [0, 0], "colors": np.zeros((2, 3)), "materials": [material], "colored": [True]}
    labels = pumice.LabelGroups(**groups)
    pictures = np.random.default_rng(1).uniform(0.5, 1, (8, 8, 8, 3)).astype(np.float32)
    reference = pumice.ReferencePicture.of(pictures)
    stored = {name: getattr(reference, name) for name in ("mean", "variance", "tile_variance", "total_variance", "seeds")}
    limits = {"spp": 1, "seconds": 0.05, "error": 1e-9}
    rendering = {"scene": scene, "volumes": volume, "meshes": (), **limits, "denoise": False, "job": None, "on_progress": None}
    picture = pumice.render(scene, volume, spp=1, backend="cpu")
    session = pumice.Session(scene, volume, spp=1, backend="cpu")
    renderer = pumice.Renderer(backend="cpu")
    of_file = pumice.figure(pumice.open(folder / "v.pumice"), size=(8, 8))
    instance = {**scene.to_dict()["instances"][0], "id": 7}
    first = scene.to_dict()["instances"][0]["id"]
    placed = {"id": 1, "source": "m", "world_from_mesh": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], "materials": [material]}
    reading = {"layer": None, "time": None, "channel": None, "array": None, "axes": "xyz"}
    raw = {"raw_dims": (4, 4, 4), "raw_type": "u16", "raw_big_endian": True, "raw_offset": 0}
    pumice.compress_part(small, folder / "v.part", 0)
    tifffile.imwrite(folder / "t.tif", np.stack([small, small]).astype(np.uint16), imagej=True, metadata={"axes": "TZYX"})
    (folder / "v.raw").write_bytes(small.astype(">u2").tobytes("F"))
    rows = {"names": ["a", "b"], "types": ["c", "d"], "columns": {"n": [1.0, 2.0]}}
    showing = {"visible": ([1], [True]), "groups": labels}
    calls = {
        "open": (pumice.open, {"path": folder / "v.npy", "mapped": False, "job": None, "spacing": (1, 1, 1), **reading}),
        "open labels": (pumice.open, {"path": folder / "v.pumice", "labels": [1]}),
        "open raw": (pumice.open, {"path": folder / "v.raw", "spacing": (1, 1, 1), **raw}),
        "probe": (pumice.probe, {"path": folder / "v.npy", "job": None, "spacing": (1, 1, 1), **reading}),
        "compress": (
            pumice.compress,
            {
                **{"source": small, "spacing": (1, 1, 1), "unit": "nm", "names": {1: "a"}, "types": {1: "a"}, "axes": "xyz"},
                **{"memory_limit": 1 << 30, "threads": 1, "job": None},
            },
        ),
        "compress with a table": (pumice.compress, {"source": small, "world_from_index": np.eye(4), "table": table}),
        "compress a file": (pumice.compress, {"source": folder / "v.npy", "types": folder / "types.csv", **reading}),
        "chunk_count": (pumice.chunk_count, {"dims": (4, 4, 4)}),
        "compress_file": (
            pumice.compress_file,
            {
                **{"source": small, "out": "out.pumice", "level": "fast", "spacing": (1, 1, 1), "unit": "nm", "names": {1: "a"}, "types": {1: "a"}},
                **{"memory_limit": 1 << 30, "threads": 1, "job": None, "axes": "xyz"},
            },
        ),
        "compress_file with a table": (pumice.compress_file, {"source": small, "out": "out.pumice", "world_from_index": np.eye(4), "table": table}),
        "compress_part": (
            pumice.compress_part,
            {
                **{"source": small, "out": "out.part", "chunks": "0", "fingerprint": "a", "spacing": (1, 1, 1), "unit": "nm", "names": {1: "a"}},
                **{"memory_limit": 1 << 30, "threads": 1, "job": None, "axes": "xyz"},
            },
        ),
        "merge_into_part": (pumice.merge_into_part, {"parts": [folder / "v.part"], "out": "out.part", "memory_limit": 1 << 28, "threads": 1, "job": None}),
        "merge": (
            pumice.merge,
            {"parts": [folder / "v.part"], "out": "out.pumice", "level": "fast", "types": {1: "a"}, "memory_limit": 1 << 30, "threads": 1, "job": None},
        ),
        "compress_series": (
            pumice.compress_series,
            {
                **{"source": [small, small], "out": "out.pumice", "level": "fast", "spacing": (1, 1, 1), "unit": "nm", "names": {1: "a"}},
                **{"types": {1: "a"}, "memory_limit": 1 << 30, "threads": 1, "job": None, "axes": "xyz"},
            },
        ),
        "compress_series of a file": (
            pumice.compress_series,
            {"source": folder / "t.tif", "out": "out.pumice", "time_steps": "all", "resume": True, "restart": False},
        ),
        "compress_part of a series": (pumice.compress_part, {"source": folder / "t.tif", "out": "out.part", "chunks": 0, "time_steps": "all"}),
        "distinct_colors": (pumice.distinct_colors, {"count": 3, "color_blind_safe": True}),
        "Volume.save": (volume.save, {"path": "out.pumice", "level": "fast", "job": None}),
        "Volume.verify": (volume.verify, {"source": small, "job": None, "axes": "xyz"}),
        "Volume.decode": (volume.decode, {"dtype": "u1", "job": None}),
        "Volume.label_at": (volume.label_at, {"x": 0, "y": 0, "z": 0}),
        "Volume.faces": (volume.faces, {"labels": [1], "interfaces": "all", "shared_corners": True, "job": None}),
        "Volume.coarse_surface": (volume.coarse_surface, {"visible": [True, False], "most_faces": 100, "job": None}),
        "LabelTable.index_of": (volume.labels.index_of, {"label": 1}),
        "LabelTable.rows_of": (volume.labels.rows_of, {"labels": [1]}),
        "LabelTable.isin": (volume.labels.isin, {"labels": [1]}),
        "LabelTable.query": (volume.labels.query, {"line": "*"}),
        "LabelTable.auto_colors": (volume.labels.auto_colors, {"visible": [True, True], "known": np.zeros((2, 3))}),
        "AnnotationTable": (pumice.AnnotationTable, {"ids": [1, 2], "colors": np.zeros((2, 3)), **rows}),
        "AnnotationTable.save": (table.save, {"path": "out.csv", "format": "csv"}),
        "AnnotationTable.query": (table.query, {"line": "*"}),
        "AnnotationTable.read": (pumice.AnnotationTable.read, {"path": folder / "t.csv"}),
        "read_label_table": (pumice.read_label_table, {"path": folder / "t.csv"}),
        "query_labels": (pumice.query_labels, {"line": "*", "ids": [1, 2], **rows}),
        "LabelGroups": (pumice.LabelGroups, groups),
        "LabelGroups.with_colors": (labels.with_colors, {"ids": [1, 2], "colors": np.zeros((2, 3))}),
        "Mesh": (pumice.Mesh, {**triangle, "materials": [0], "normals": [[0, 0, 1]] * 3}),
        "Mesh.open": (pumice.Mesh.open, {"path": folder / "m.ply"}),
        "Mesh.save": (mesh.save, {"path": "out.ply"}),
        "Scene.from_dict": (pumice.Scene.from_dict, {"fields": scene.to_dict()}),
        "Scene.from_json": (pumice.Scene.from_json, {"text": scene.to_json()}),
        "Scene.load": (pumice.Scene.load, {"path": folder / "s.json"}),
        "Scene.save": (scene.save, {"path": "out.json"}),
        "Volume.with_labels": (pumice.open(folder / "v.pumice", labels=[1]).with_labels, {"labels": [2], "job": None}),
        "Scene.with_labels": (scene.with_labels, {"instance": first, **showing}),
        "figure": (pumice.figure, {"volume": volume, "source": "v", "size": (8, 8), "labels": [1], "pick": None, "view_deg": (1.0, 2.0)}),
        "figure of some": (pumice.figure, {"volume": volume, "pick": 1}),
        "render": (pumice.render, {**rendering, "backend": "cpu"}),
        "Renderer": (pumice.Renderer, {"backend": "cpu"}),
        "Renderer.render": (renderer.render, {**rendering, "growing": False, "growing_passes": False, "unfinished": False}),
        "Renderer.latest": (renderer.latest, {"after": 0}),
        "Session": (pumice.Session, {"scene": scene, "volumes": volume, "meshes": (), "backend": "cpu", "denoise": False, **limits}),
        "Session of files": (pumice.Session, {"scene": of_file, "memory_limit": 1 << 30, "job": None, "spp": 1}),
        "PageMemory": (pumice.PageMemory, {"limit": 1 << 30}),
        "open in a memory": (pumice.open, {"path": folder / "v.pumice", "memory": pumice.PageMemory(1 << 30)}),
        "Session.edit": (lambda edit: session.edit(edit), {"edit": {"edit": "cuts", "cuts": []}}),
        "Session.set_labels": (session.set_labels, {"instance": first, **showing}),
        "Session.add": (session.add, {"instance": instance, "volume": volume}),
        "Session.add_mesh": (session.add_mesh, {"fields": placed, "triangles": mesh}),
        "Session.latest": (session.latest, {"after": 0}),
        "Session.pick": (session.pick, {"x": 1, "y": 1}),
        "Picture.save": (picture.save, {"path": "out.exr", "passes": ["depth"]}),
        "open_picture": (pumice.open_picture, {"path": folder / "p.exr"}),
        "open_state": (pumice.open_state, {"state": folder / "ng.json", "layer_files": {"a": folder / "v.pumice"}, "size": (8, 8), "job": None}),
        "state_layers": (pumice.state_layers, {"state": folder / "ng.json"}),
        "is_on_server": (pumice.is_on_server, {"path": "https://server/cells.zarr"}),
        "Picture.pick": (picture.pick, {"x": 1, "y": 1, "volume": volume}),
        "Picture.srgb": (picture.srgb, {"view_transform": "agx"}),
        "cryptomatte_hash": (pumice.cryptomatte_hash, {"name": "a"}),
        "surface": (pumice.surface, {"volume": volume, "labels": [1], "lod": 4, "merged": True, "shared_corners": True, "job": None}),
        "count_faces": (pumice.count_faces, {"volume": volume, "labels": [1], "lod": 1, "merged": False, "limit": 1000, "job": None}),
        "export": (
            pumice.export,
            {
                **{"path": folder / "s.json", "out": "out.usdc", "form": "voxels", "plain": True, "for_blender": True},
                **{"labels": [1], "region": (0, 0, 0, 2, 2, 2), "limit_bytes": 1 << 30, "job": None},
            },
        ),
        "agreement": (pumice.agreement, {"ours": pictures, "theirs": pictures + 1, "covered": np.ones((8, 8))}),
        "ReferencePicture": (pumice.ReferencePicture, stored),
        "ReferencePicture.of": (pumice.ReferencePicture.of, {"pictures": pictures}),
        "ReferencePicture.judge": (reference.judge, {"pictures": pictures}),
    }
    with session:
        yield calls


# The names in `made`, which needs a volume, and so is a fixture.
NAMES = [
    *["open", "open labels", "open raw", "probe", "compress", "compress with a table", "compress a file", "distinct_colors"],
    *["chunk_count", "compress_file", "compress_file with a table", "compress_part", "merge", "merge_into_part", "compress_series", "compress_series of a file", "compress_part of a series"],
    *["Volume.save", "Volume.verify", "Volume.decode", "Volume.label_at", "Volume.faces", "Volume.coarse_surface", "Volume.with_labels"],
    *["LabelTable.index_of", "LabelTable.rows_of", "LabelTable.isin", "LabelTable.query", "LabelTable.auto_colors"],
    *["AnnotationTable", "AnnotationTable.save"],
    *["AnnotationTable.query", "AnnotationTable.read", "read_label_table", "query_labels", "LabelGroups", "LabelGroups.with_colors"],
    *["Mesh", "Mesh.open", "Mesh.save"],
    *["Scene.from_dict", "Scene.from_json", "Scene.load", "Scene.save", "Scene.with_labels", "figure", "figure of some"],
    *["render", "Renderer", "Renderer.render", "Renderer.latest", "Session", "Session of files"],
    *["PageMemory", "open in a memory", "Session.edit", "Session.set_labels"],
    *["Session.add", "Session.add_mesh", "Session.latest", "Session.pick", "Picture.save", "cryptomatte_hash"],
    *["open_picture", "open_state", "state_layers", "is_on_server", "Picture.pick", "Picture.srgb"],
    *["surface", "count_faces", "export", "agreement", "ReferencePicture", "ReferencePicture.of", "ReferencePicture.judge"],
]


def test_no_function_is_missing_here(made):
    assert sorted(made) == sorted(NAMES)
    functions = {name for name in pumice.__all__ if callable(getattr(pumice, name))}
    # Classes that only results have, what is raised, and what needs Blender.
    others = {"CoarseSurface", "CurvePoint", "Faces", "Frame", "Job", "LabelFilm", "LabelTable", "Pick", "PickedPixel"}
    others |= {"PageFigures", "Picture", "Scene", "Status", "Volume"}
    raised = {name for name in functions if name.endswith("Error")} | {"Cancelled", "PumiceWarning"}
    assert functions - others - raised - {"devices", "verify_render"} == {n for n in NAMES if "." not in n and " " not in n}


@pytest.mark.filterwarnings("ignore::pumice.PumiceWarning")
@pytest.mark.parametrize("name", NAMES)
def test_wrong_arguments_are_input_errors_in_one_line(made, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    function, good = made[name]
    # Control: with good arguments it works.
    function(**good)
    refused = 0
    for argument in good:
        for what, value in HOSTILE.items():
            try:
                function(**{**good, argument: value})
            except pumice.InputError as error:
                text = str(error)
                assert text.isprintable() and 0 < len(text) < 2500, (argument, what, text)
                refused += 1
            except Exception as error:
                raise AssertionError(f"{name}({argument}={what}) raises {type(error).__name__}: {error}") from error
    assert refused > len(HOSTILE) / 3, refused


def test_an_unknown_keyword_is_named(tmp_path):
    with pytest.raises(TypeError, match="unexpected keyword argument 'names'"):
        pumice.open(tmp_path / "v.npy", names={1: "a"})


@pytest.mark.parametrize("spacing", [(0, 1, 1), (5e-324, 1, 1), (1e-200, 1, 1), (1e200, 1, 1), (math.nan, 1, 1), (math.inf, 1, 1), (-1, 1, 1)])
def test_lengths_of_voxels_that_are_none(small, spacing):
    with pytest.raises(pumice.InputError, match="spacing: expected three lengths above 0"):
        pumice.compress(small, spacing=spacing)
    if spacing[0] >= 0 or math.isnan(spacing[0]):  # a matrix may mirror
        with pytest.raises(pumice.InputError, match="world_from_index: "):
            pumice.compress(small, world_from_index=np.diag([*spacing, 1]))


def test_errors_of_the_caller_pass_as_they_are(small, made):
    """Control: what a function of the caller raises is no error of an argument, and neither is a wrong call."""
    function, good = made["render"]

    def stop(_):
        raise ValueError("of my own")

    with pytest.raises(ValueError, match="of my own") as caught:
        function(**{**good, "on_progress": stop})
    assert not isinstance(caught.value, pumice.InputError)

    class Refusing:
        dtype, shape = small.dtype, small.shape

        def __getitem__(self, _):
            raise TypeError("of my own")

    with pytest.raises(TypeError, match="of my own"):
        pumice.compress(Refusing())
    with pytest.raises(TypeError, match="unexpected keyword argument 'speling'"):
        pumice.open("v.npy", speling=1)
    with pytest.raises(TypeError, match="unexpected keyword argument 'spelling'"):
        pumice.distinct_colors(3, spelling=1)
    with pytest.raises(TypeError, match="missing 1 required positional argument"):
        pumice.open()


def test_pipes_and_devices_are_not_waited_for(small, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, what in [(tmp_path / "pipe", "a pipe"), ("/dev/zero", "a device")]:
        for read in [
            pumice.open,
            pumice.read_label_table,
            pumice.Scene.load,
            lambda path: pumice.compress(small, types=path),
            lambda path: pumice.compress(small, table=path),
        ]:
            with pytest.raises(pumice.InputError, match=f"expected an ordinary file, got {what}"):
                read(path)


def test_what_is_read_is_not_replaced(small, tmp_path):
    np.save(tmp_path / "v.npy", small)
    volume = pumice.open(tmp_path / "v.npy", axes="xyz")
    scene = pumice.figure(volume, source=tmp_path / "v.npy")
    scene.save(tmp_path / "s.json")
    (tmp_path / "link.ply").symlink_to("s.json")
    with pytest.raises(pumice.InputError, match="link.ply: expected another file for the output, got one that is read as .*s.json"):
        pumice.export(tmp_path / "s.json", tmp_path / "link.ply")
    # Control.
    pumice.export(tmp_path / "s.json", tmp_path / "other.ply")
