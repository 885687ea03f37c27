"""Tests what the outputs of all commands have in common: what must not be replaced is not, and what is replaced keeps its place and mode."""

import os
import stat
from pathlib import Path

import pytest
from command import run
from one_of_each import NO_FILES, QUICK, arguments, left_in, one_of_each

@pytest.fixture(scope="module")
def made(pumice, tmp_path_factory):
    return one_of_each(pumice, tmp_path_factory.mktemp("made"))


# By name: the output's ending, and the arguments, in which OUT is its name and each other file one of `made`.
WRITERS = {
    "compress": ("out.pumice", "compress raw.nrrd -o OUT"),
    "compress --json": ("out.json", "compress raw.nrrd -o rest.pumice --json OUT"),
    **{f"decompress {e}": (f"out{e}", "decompress v.pumice -o OUT") for e in [".nrrd", ".npy", ".nii.gz", ".tif"]},
    **{f"render {e}": (f"out{e}", "render v.pumice -o OUT QUICK") for e in [".png", ".exr"]},
    "render --save-scene": ("out.json", "render v.pumice -o rest.png QUICK --save-scene OUT"),
    "render --json": ("out.json", "render v.pumice -o rest.png QUICK --json OUT"),
    **{f"export {e}": (f"out{e}", "export v.pumice -o OUT") for e in [".usda", ".usdc", ".usdz", ".glb", ".gltf", ".ply", ".obj", ".stl"]},
    "export --json": ("out.json", "export v.pumice -o rest.ply --json OUT"),
    "table": ("out.csv", "table v.pumice -o OUT"),
    "compare --json": ("out.json", "compare a.exr b.exr --json OUT"),
}


@pytest.mark.parametrize("writer", WRITERS)
def test_what_is_replaced_keeps_its_link_its_mode_and_its_owner(pumice, made, writer, tmp_path):
    name, line = WRITERS[writer]
    (tmp_path / "far").mkdir()
    target, out = tmp_path / "far" / name, tmp_path / name
    target.write_bytes(b"before")
    target.chmod(0o600)
    owner = (4321, 4322) if os.geteuid() == 0 else (os.geteuid(), os.getegid())
    os.chown(target, *owner)
    out.symlink_to(Path("far") / name)
    done = run(pumice, *arguments(line, made, out))
    assert done.code == 0, done
    there = target.stat()
    assert out.is_symlink() and target.read_bytes() != b"before"
    assert stat.S_IMODE(there.st_mode) == 0o600 and (there.st_uid, there.st_gid) == owner
    # What has a file beside it has it where the link leads to, and nothing temporary is left.
    assert not [n for n in left_in(tmp_path / "far") + left_in(tmp_path) if n.startswith(".")]
    assert set(left_in(tmp_path)) <= {"far", name, *(p.name for p in tmp_path.glob("rest.*"))}


def test_what_is_new_has_the_mode_of_any_new_file(pumice, made, tmp_path):
    """Control of the test above."""
    run(pumice, "decompress", made / "v.pumice", "-o", tmp_path / "out.npy").fine()
    (tmp_path / "plain").touch()
    assert (tmp_path / "out.npy").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize("writer", WRITERS)
def test_what_is_no_ordinary_file_is_not_replaced(pumice, made, writer, tmp_path):
    """A pipe, a folder, a socket, and a link to a device: the command ends with a line, before its work, and waits for nobody."""
    name, line = WRITERS[writer]
    out = tmp_path / name

    # Each command meets two of them.
    kinds = [*NO_FILES.items(), ("a folder", os.mkdir)]
    for what, make in kinds[len(writer) % 2 :: 2]:
        make(out)
        before = out.lstat()
        said = run(pumice, *arguments(line, made, out), limit_seconds=20).refused()
        assert f"{name}: expected an ordinary file, got {what}" in said
        assert (out.lstat().st_ino, out.lstat().st_mode) == (before.st_ino, before.st_mode) and left_in(tmp_path) == [name]
        out.rmdir() if what == "a folder" else out.unlink()


# The output is one of these files, under the name OUT where its ending must be another.
OVER = {
    "the volume": ("raw.nrrd", "out.pumice", "compress raw.nrrd -o OUT"),
    "the voxels of a MetaImage": ("apart.raw", "out.pumice", "compress apart.mhd -o OUT"),
    "the voxels of an NRRD": ("detached.raw", "out.json", "compress detached.nhdr -o rest.pumice --json OUT"),
    "the voxels of a pair": ("pair.img", "out.pumice", "compress pair.hdr -o OUT"),
    "a slice": ("slices/s07.tif", "out.json", "compress slices -o rest.pumice --json OUT"),
    "the table": ("table.csv", "out.json", "compress raw.nrrd --table table.csv -o rest.pumice --json OUT"),
    "the types": ("types.csv", "out.pumice", "compress raw.nrrd --types types.csv -o OUT"),
    "what is decompressed": ("v.pumice", "out.nrrd", "decompress v.pumice -o OUT"),
    "what is rendered": ("v.pumice", "out.png", "render v.pumice -o OUT QUICK"),
    "the scene": ("scene.json", "out.json", "render scene.json -o rest.png QUICK --save-scene OUT"),
    "the scene's volume": ("v.pumice", "out.json", "render scene.json -o rest.png QUICK --json OUT"),
    "the scene's mesh": ("mesh.ply", "out.ply", "export scene.json -o OUT"),
    "the scene's sky": ("a.exr", "out.exr", "render scene.json -o OUT QUICK"),
    "the picture that is drawn again": ("b.exr", "out.exr", "render --again b.exr -o OUT"),
    "the volume of a picture that is drawn again": ("v.pumice", "out.json", "render --again b.exr -o rest.png --json OUT"),
    "what is exported": ("raw.nrrd", "out.usda", "export raw.nrrd -o OUT"),
    "what has the labels": ("v.pumice", "out.csv", "table v.pumice -o OUT"),
    "a picture that is compared": ("b.exr", "out.json", "compare a.exr b.exr --json OUT"),
    "the scene that is verified": ("scene.json", "out.html", "verify-render scene.json --with-blender /bin/false -o OUT"),
    "Blender": ("types.csv", "out.json", "verify-render scene.json --with-blender types.csv --json OUT"),
    "the volume of the demonstration": ("raw.nrrd", "picture.png", "demo --volume raw.nrrd --out FOLDER"),
}


@pytest.mark.parametrize("what", OVER)
def test_what_is_read_is_not_replaced(pumice, made, what, tmp_path):
    name, out, line = OVER[what]
    out = tmp_path / out
    content = (made / name).read_bytes()
    for link in [lambda: os.link(made / name, out), lambda: out.symlink_to(made / name)]:
        link()
        said = run(pumice, *arguments(line, made, out)).refused()
        assert f"{out.name}: expected another file for the output, got one that is read" in said, said
        assert (made / name).read_bytes() == content and left_in(tmp_path) == [out.name]
        out.unlink()


def test_a_file_is_not_compressed_onto_itself(pumice, made, tmp_path):
    copy = tmp_path / "copy.nrrd"
    copy.write_bytes((made / "raw.nrrd").read_bytes())
    said = run(pumice, "compress", copy, "-o", copy).refused()
    assert said.endswith("copy.nrrd: expected another file for the output, got one that is read")
    said = run(pumice, "compress", copy, "-o", tmp_path / "o.pumice", "--json", copy).refused()
    assert "copy.nrrd: expected another file" in said
    assert copy.read_bytes() == (made / "raw.nrrd").read_bytes() and left_in(tmp_path) == ["copy.nrrd"]


def test_two_outputs_are_two_files(pumice, made, tmp_path):
    (tmp_path / "below").mkdir()
    same = tmp_path / "below" / ".." / "p.png"
    said = run(pumice, "render", made / "v.pumice", "-o", tmp_path / "p.png", *QUICK, "--json", same).refused()
    assert "expected a file of its own, got that of another output" in said and left_in(tmp_path) == ["below"]


@pytest.mark.parametrize("line", ["compare a.exr b.exr --json OUT", "render v.pumice -o rest.png QUICK --save-scene OUT"])
def test_a_full_disk_leaves_no_part_of_a_text(pumice, made, line, tmp_path):
    # Control: what fits is written. Names are short, because the limit counts for what is said too.
    words = arguments(line, made, Path("out.json"))
    assert run(pumice, *words, cwd=tmp_path).code == 0
    limit = (tmp_path / "out.json").stat().st_size - 1
    for before in [None, b"what was here before"]:
        for path in tmp_path.iterdir():
            path.unlink()
        if before:
            (tmp_path / "out.json").write_bytes(before)
        said = run(pumice, *words, cwd=tmp_path, file_size_limit=limit).refused()
        assert said.startswith("pumice: out.json: File too large"), said
        assert left_in(tmp_path) == (["out.json"] if before else [])
        assert not before or (tmp_path / "out.json").read_bytes() == before


def test_an_output_may_take_the_place_of_an_earlier_one(pumice, made, tmp_path):
    """Control of the tests above: the same commands twice."""
    for _ in range(2):
        words = "render scene.json -o rest.png QUICK --save-scene OUT --json rest.json"
        run(pumice, *arguments(words, made, tmp_path / "out.json")).fine()
    run(pumice, "compress", made / "raw.nrrd", "-o", tmp_path / "o.pumice").fine()
    assert left_in(tmp_path) == ["o.pumice", "out.json", "rest.json", "rest.png"]
