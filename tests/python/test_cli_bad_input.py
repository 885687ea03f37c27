"""Tests bad input, bad paths and interruptions: one clear line, exit code 2, no partial file, no panic, bounded memory."""

import gzip
import json
import os
import random
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest
from broken_files import huge_headers, labels, volumes, wrong_values
from command import interrupt_after, run

# The volumes here have 7,680 voxels, so memory is the program itself, its threads' stacks and its read buffers; and this process, whose
# peak a child inherits before it becomes the command. An allocation by a length in a broken file would be far larger.
MEMORY_BYTES = 400 << 20


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return volumes(tmp_path_factory.mktemp("good"))


@pytest.fixture(scope="module")
def good_pumice(pumice, good, tmp_path_factory):
    out = tmp_path_factory.mktemp("pumice") / "good.pumice"
    run(pumice, "compress", good["raw.nrrd"], "-o", out).fine()
    return out


def left_in(folder):
    return sorted(p.name for p in folder.iterdir())


def attempt(pumice, folder, name, data, beside=None):
    """Compresses `data` as a file called `name`, with copies of the files `beside` next to it; returns how the command ended."""
    for path in folder.iterdir():
        path.unlink()
    for other in beside or []:
        (folder / other.name).write_bytes(other.read_bytes())
    (folder / name).write_bytes(data)
    before = left_in(folder)
    done = run(pumice, "compress", folder / name, "-o", folder / "out.pumice")
    assert done.peak_rss_bytes < MEMORY_BYTES, done
    if done.code == 0:
        assert left_in(folder) == sorted([*before, "out.pumice"]), done
    else:
        done.refused()
        assert left_in(folder) == before, done
    return done


def test_names_do_not_break_the_line_or_steer_the_terminal(pumice, good, tmp_path):
    # Control characters, and a separator of lines that is none, appear as escapes; letters of any language as they are.
    name, shown = "a\nb\x1b[2Jc\u2028脑", r"a\nb\u{1b}[2Jc\u{2028}脑"
    volume = tmp_path / f"{name}.nrrd"
    assert f"{shown}.nrrd: No such file" in run(pumice, "info", volume).refused()
    volume.write_bytes(b"NRRD0004\n")
    assert f"{shown}.nrrd" in run(pumice, "compress", volume, "-o", tmp_path / "out.pumice").refused()
    assert run(pumice, "in\nf\x07o", "a\x1b[2Jb").refused().isprintable()
    # What succeeds is told in a line too, and a report keeps its own.
    volume.write_bytes(good["raw.nrrd"].read_bytes())
    done = run(pumice, "compress", volume, "-o", tmp_path / f"{name}.pumice").fine()
    assert f"{shown}.pumice" in done and all(line.isprintable() for line in done.splitlines()) and len(done.splitlines()) == 1
    assert len(run(pumice, "info", volume, "--json").fine().splitlines()) > 5


FORMATS = [
    *["raw.nrrd", "gzip.nrrd", "ascii.nrrd", "detached.nhdr", "one.nii", "one.nii.gz", "two.nii", "pair.hdr"],
    *["stack.tif", "deflate.tif", "big.tif", "imagej.tif", "c.npy", "fortran.npy", "one.npz", "local.mha", "apart.mhd"],
]
# Data files of formats with a separate header.
DETACHED = {"detached.nhdr": "detached.raw", "pair.hdr": "pair.img", "apart.mhd": "apart.raw"}


def companions(good, name):
    folder = good[name].parent
    return [folder / DETACHED[name]] if name in DETACHED else []


@pytest.mark.parametrize("name", FORMATS)
def test_good_files_are_read(pumice, good, name, tmp_path):
    """Control of the tests below: each of these files is accepted when unbroken, and gives the voxels that were written."""
    done = attempt(pumice, tmp_path, name, good[name].read_bytes(), companions(good, name))
    assert done.code == 0, done
    run(pumice, "decompress", tmp_path / "out.pumice", "-o", tmp_path / "back.npy").fine()
    back = np.load(tmp_path / "back.npy")
    assert np.array_equal(back, labels())


@pytest.mark.parametrize("name", FORMATS)
def test_truncated_files_are_refused(pumice, good, name, tmp_path):
    # With a detached header, cuts the data file: a header may still be complete without its last lines.
    victim = companions(good, name)[0] if name in DETACHED else good[name]
    whole = victim.read_bytes()
    for keep in sorted({0, 1, 4, 100, len(whole) // 3, len(whole) // 2, len(whole) * 9 // 10, len(whole) - 40}):
        if name in DETACHED:
            (tmp_path / "cut").mkdir(exist_ok=True)
            cut = tmp_path / "cut" / victim.name
            cut.write_bytes(whole[:keep])
            folder = tmp_path / "run"
            folder.mkdir(exist_ok=True)
            done = attempt(pumice, folder, name, good[name].read_bytes(), [cut])
        else:
            done = attempt(pumice, tmp_path, name, whole[:keep])
        assert done.code == 2, f"{name} cut to {keep} of {len(whole)} bytes: {done}"


@pytest.mark.parametrize("name", FORMATS)
def test_flipped_bits_never_panic(pumice, good, name, tmp_path):
    """Without a checksum a changed label goes unnoticed, but nothing crashes, hangs, takes much memory or leaves a partial file."""
    whole = good[name].read_bytes()
    dice = random.Random(name)
    # 16 flips are in the first 400 bytes, where headers are, and 8 anywhere.
    places = [dice.randrange(min(400, len(whole))) for _ in range(16)] + [dice.randrange(len(whole)) for _ in range(8)]
    codes = set()
    for place in places:
        broken = bytearray(whole)
        broken[place] ^= 1 << dice.randrange(8)
        codes.add(attempt(pumice, tmp_path, name, bytes(broken), companions(good, name)).code)
    assert codes <= {0, 2}


def test_broken_pumice_files_are_refused(pumice, good_pumice, good, tmp_path):
    whole = good_pumice.read_bytes()
    dice = random.Random(5)
    victims = [(f"cut to {n}", whole[:n]) for n in [0, 1, 8, 64, len(whole) // 2, len(whole) - 1]]
    for _ in range(25):
        broken = bytearray(whole)
        place, bit = dice.randrange(len(whole)), dice.randrange(8)
        broken[place] ^= 1 << bit
        victims.append((f"bit {bit} of byte {place} flipped", bytes(broken)))
    victims.append(("longer by a byte", whole + b"\0"))
    refused = 0
    for what, data in victims:
        (tmp_path / "broken.pumice").write_bytes(data)
        done = run(pumice, "decompress", tmp_path / "broken.pumice", "-o", tmp_path / "out.npy")
        assert done.peak_rss_bytes < MEMORY_BYTES
        if done.code == 0:
            # Accepted, so only padding may have changed, and no voxel.
            assert np.array_equal(np.load(tmp_path / "out.npy"), labels()), what
            (tmp_path / "out.npy").unlink()
            continue
        line = done.refused()
        assert "broken.pumice" in line, f"{what}: {line}"
        assert left_in(tmp_path) == ["broken.pumice"], what
        for command in [
            ("info", tmp_path / "broken.pumice", "--json"),
            ("verify", tmp_path / "broken.pumice", good["raw.nrrd"]),
            ("render", tmp_path / "broken.pumice", "-o", tmp_path / "p.png", "--spp", 1, "--size", "8x8"),
        ]:
            assert "broken.pumice" in run(pumice, *command).refused(), what
        assert left_in(tmp_path) == ["broken.pumice"], what
        refused += 1
    assert refused > 25, "most faults are detected, so the checks above have run"


def test_pumice_files_of_other_versions_are_refused(pumice, good_pumice, good, tmp_path):
    whole = good_pumice.read_bytes()
    file = tmp_path / "other.pumice"
    for version, way_out in [
        (1, "compress the source volume again"),
        (4, "compress the source volume again"),
        (7, "a newer pumice wrote it"),
    ]:
        file.write_bytes(whole[:8] + version.to_bytes(4, "little") + whole[12:])
        for command in [
            ("info", file, "--json"),
            ("decompress", file, "-o", tmp_path / "out.npy"),
            ("verify", file, good["raw.nrrd"]),
            ("render", file, "-o", tmp_path / "p.png", "--spp", 1, "--size", "8x8"),
        ]:
            line = run(pumice, *command).refused()
            expected = f"other.pumice: file version at byte 8: expected 6, got {version}; "
            assert expected in line and way_out in line, line
        assert left_in(tmp_path) == ["other.pumice"]
    # Control: with the right version the same file is accepted.
    file.write_bytes(whole)
    run(pumice, "decompress", file, "-o", tmp_path / "out.npy").fine()


@pytest.mark.parametrize("name", huge_headers())
def test_sizes_that_multiply_past_64_bits(pumice, name, tmp_path):
    assert attempt(pumice, tmp_path, name, huge_headers()[name]).code == 2


@pytest.mark.parametrize("name", wrong_values())
def test_what_is_no_label_or_no_place(pumice, name, tmp_path):
    assert attempt(pumice, tmp_path, name, wrong_values()[name]).code == 2


@pytest.mark.parametrize("spacing", ["nan,1,1", "0,1,1", "-1,1,1", "inf,1,1", "1,1", "1,1,1,1", "a,b,c"])
def test_spacing_that_is_none(pumice, good, spacing, tmp_path):
    run(pumice, "compress", good["raw.nrrd"], "-o", tmp_path / "o.pumice", f"--spacing={spacing}").refused()
    assert left_in(tmp_path) == []


TABLES = {
    "no id": (b"name,depth\na,1\n", "line 1, column 1: expected a column id, label or index"),
    "negative": (b"id,name\n1,a\n-7,b\n", "line 3, column 1: expected an id"),
    "fraction": (b"id,name\n1.5,a\n", "line 2, column 1: expected an id"),
    "too large": (b"id\n18446744073709551616\n", "line 2, column 1: expected an id up to"),
    "twice": (b"id,name\n7,a\n7,b\n", "line 3, column 1: expected each id once, got 7 as in line 2"),
    "not a number": (b"id,depth\n7,NaN\n", "line 2, column 2: expected a finite number"),
    "infinite": (b"id,depth\n7,1\n8,-inf\n", "line 3, column 2: expected a finite number"),
    "cut": (b"id,name,depth\n7,a,1\n8,b\n", "line 3, column 3: expected 3 fields"),
    "cut in quotes": (b'id,name\n7,"a\n', "line 2, column 2: expected a closing quote"),
    "no colour": (b"id,color\n7,red\n", "line 2, column 2: expected a colour #rrggbb"),
    "bright": (b"id,r,g,b\n7,0,0,999\n", "line 2, column 4: expected a colour from 0"),
    "UTF-16": ("id,name\n7,a\n".encode("utf-16"), "expected text in UTF-8, got UTF-16"),
    "Latin-1": ("id,name\n7,ä\n".encode("latin-1"), "line 2, column 3: expected text in UTF-8, got byte e4"),
    "binary": (bytes(range(256)), "expected a table of labels, got a binary file"),
    "empty": (b"", "got an empty file"),
    "JSON of another kind": (b'{"@type": "neuroglancer_multiscale_volume"}', "@type: expected `neuroglancer_segment_properties`"),
    "cut JSON": (b'{"@type": "neuroglancer_segment_properties", "inline": {"ids": ["1"', "line 1, column 67: JSON"),
    "deep JSON": (b"[" * 100_000, "JSON"),
}


@pytest.mark.parametrize("what", TABLES)
def test_tables_that_are_none(pumice, good, what, tmp_path):
    content, expected = TABLES[what]
    (tmp_path / "table").write_bytes(content)
    done = run(pumice, "compress", good["raw.nrrd"], "-o", tmp_path / "o.pumice", "--table", tmp_path / "table")
    line = done.refused()
    assert str(tmp_path / "table") in line and expected in line, line
    assert done.peak_rss_bytes < MEMORY_BYTES and left_in(tmp_path) == ["table"]


def test_a_table_of_absurd_size(pumice, good, tmp_path):
    """A terabyte that takes no room on disk, and a device that never ends."""
    with (tmp_path / "table").open("wb") as file:
        file.truncate(1 << 40)
    for table in [tmp_path / "table", "/dev/zero", tmp_path / "absent"]:
        done = run(pumice, "compress", good["raw.nrrd"], "-o", tmp_path / "o.pumice", "--table", table)
        assert str(table) in done.refused() and done.peak_rss_bytes < MEMORY_BYTES
    assert left_in(tmp_path) == ["table"]


@pytest.mark.parametrize(
    "query,expected",
    [
        ("glia size>", "query, column 11: expected a number, got the end of the line"),
        ("voxels>many", "query, column 8: expected a number, got many"),
        ("size>3", "query, column 1: expected a column of numbers (id, voxels, boxes"),
        ('name:"open', "query, column 6: expected a closing quote"),
        ("9-3", "query, column 1: expected a range from a lower id to a higher one"),
        ("-", "query, column 1: expected a condition after -"),
    ],
)
def test_queries_that_are_none(pumice, good_pumice, query, expected, tmp_path):
    for command in [("info", good_pumice, "--labels"), ("table", good_pumice, "-o", tmp_path / "t.csv")]:
        assert expected in run(pumice, *command, f"--query={query}").refused()
    assert left_in(tmp_path) == []


def test_tables_that_cannot_be_written(pumice, good_pumice, tmp_path):
    assert "ending names no format" in run(pumice, "table", good_pumice, "-o", tmp_path / "t.xls").refused()
    assert "t.csv" in run(pumice, "table", good_pumice, "-o", tmp_path / "no" / "t.csv").refused()
    (tmp_path / "t.csv").write_text("what was here before")
    line = run(pumice, "table", good_pumice, "-o", tmp_path / "t.csv", file_size_limit=1024).refused()
    assert "t.csv" in line and left_in(tmp_path) == ["t.csv"] and (tmp_path / "t.csv").read_text() == "what was here before"
    assert "sort: expected id, name, type, voxels" in run(pumice, "info", good_pumice, "--labels", "--sort", "size").refused()


def test_a_compression_bomb_stays_small_in_memory(pumice, tmp_path):
    """A header for 8 voxels, followed by a gigabyte of zeros that is compressed to a megabyte."""
    head = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: gzip\n\n"
    attempt(pumice, tmp_path, "bomb.nrrd", head + gzip.compress(bytes(1 << 30), 1))


@pytest.mark.parametrize("name", ["endless.nrrd", "endless.nii", "endless.nii.gz", "endless.tif", "endless.npy", "endless.mha"])
def test_an_endless_file(pumice, name, tmp_path):
    (tmp_path / name).symlink_to("/dev/zero")
    done = run(pumice, "compress", tmp_path / name, "-o", tmp_path / "o.pumice")
    done.refused()
    assert done.peak_rss_bytes < MEMORY_BYTES
    assert left_in(tmp_path) == [name]


@pytest.mark.parametrize("name", sorted(DETACHED))
def test_the_data_beside_a_header_is_missing(pumice, good, name, tmp_path):
    done = attempt(pumice, tmp_path, name, good[name].read_bytes())
    assert done.code == 2 and Path(DETACHED[name]).stem in done.err, done


def test_input_that_cannot_be_read(pumice, tmp_path):
    """A missing file, an empty folder, an empty file, an unknown file extension, and a file that even root cannot read."""
    (tmp_path / "empty.nrrd").touch()
    (tmp_path / "folder").mkdir()
    (tmp_path / "what.xyz").write_bytes(b"hello")
    (tmp_path / "denied.nrrd").symlink_to("/proc/self/mem")
    for name in ["absent.nrrd", "absent.pumice", "empty.nrrd", "folder", "what.xyz", "denied.nrrd"]:
        for command in [("compress", tmp_path / name, "-o", tmp_path / "o.pumice"), ("info", tmp_path / name)]:
            line = run(pumice, *command).refused()
            assert name.split(".")[0] in line, line
    assert not (tmp_path / "o.pumice").exists()


def test_output_that_cannot_be_written(pumice, good, good_pumice, tmp_path):
    """A missing folder, a folder in the file's place, and a folder in which nobody may write."""
    (tmp_path / "is-a-folder.pumice").mkdir()
    denied = Path("/sys/pumice-test.pumice")  # refused to root as well
    for out in [tmp_path / "no" / "such" / "o.pumice", tmp_path / "is-a-folder.pumice", denied]:
        line = run(pumice, "compress", good["raw.nrrd"], "-o", out).refused()
        assert str(out.parent.name) in line or out.name in line, line
    for folder in [tmp_path / "no", Path("/sys")]:
        for ending in [".nrrd", ".npy", ".nii.gz", ".tif"]:
            run(pumice, "decompress", good_pumice, "-o", folder / f"pumice-test{ending}").refused()
    run(pumice, "render", good_pumice, "-o", tmp_path / "no" / "p.png", "--spp", 1, "--size", "8x8").refused()
    assert left_in(tmp_path) == ["is-a-folder.pumice"]
    assert left_in(tmp_path / "is-a-folder.pumice") == []


def test_a_read_only_folder(pumice, good, tmp_path):
    if os.geteuid() == 0:
        pytest.skip("root may write anywhere; test_output_that_cannot_be_written has a place that refuses root too")
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o555)
    run(pumice, "compress", good["raw.nrrd"], "-o", locked / "o.pumice").refused()
    assert left_in(locked) == []


@pytest.fixture(scope="module")
def noise(tmp_path_factory):
    """A file with 128³ labels of pure noise: 8 MiB that cannot be compressed, which take seconds."""
    path = tmp_path_factory.mktemp("noise") / "noise.npy"
    np.save(path, np.random.default_rng(1).integers(0, 2**32, (128, 128, 128), np.uint32))
    return path


@pytest.fixture(scope="module")
def little_noise(pumice, tmp_path_factory):
    """A file with 48³ labels of pure noise, which take 432 KiB in any lossless form, and its .pumice file."""
    path = tmp_path_factory.mktemp("little") / "noise.npy"
    np.save(path, np.random.default_rng(2).integers(0, 2**32, (48, 48, 48), np.uint32))
    run(pumice, "compress", path, "-o", path.with_suffix(".pumice")).fine()
    return path, path.with_suffix(".pumice")


def test_a_full_disk(pumice, little_noise, tmp_path):
    """Writing fails halfway, through a limit on the size of files, which sends a signal to a program that does not expect it."""
    noise, noise_pumice = little_noise
    out = tmp_path / "o.pumice"
    out.write_bytes(b"what was here before")
    line = run(pumice, "compress", noise, "-o", out, file_size_limit=64 << 10).refused()
    assert left_in(tmp_path) == ["o.pumice"] and out.read_bytes() == b"what was here before", line
    for ending in [".nrrd", ".npy", ".nii", ".tif"]:
        back = tmp_path / f"back{ending}"
        line = run(pumice, "decompress", noise_pumice, "-o", back, file_size_limit=64 << 10).refused()
        assert back.name in line and left_in(tmp_path) == ["o.pumice"], (ending, line)
    for name in ["p.png", "p.exr"]:
        line = run(pumice, "render", noise_pumice, "-o", tmp_path / name, "--spp", 1, "--size", "320x180",
                   file_size_limit=4096).refused()
        assert name in line and left_in(tmp_path) == ["o.pumice"], line


def test_a_full_file_system(pumice, little_noise, tmp_path):
    """Writing fails halfway on a real file system of 64 KiB, if one can be mounted."""
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", tmp_path], capture_output=True)
    if mounted.returncode != 0:
        pytest.skip("a file system cannot be mounted here")
    try:
        line = run(pumice, "compress", little_noise[0], "-o", tmp_path / "o.pumice").refused()
        assert left_in(tmp_path) == [] and "space" in line.lower(), line
    finally:
        subprocess.run(["umount", tmp_path], check=True)


def test_output_streams_that_are_full_or_closed(pumice, good, good_pumice, tmp_path):
    with open("/dev/full", "w") as full:
        run(pumice, "info", good_pumice, stdout=full).refused()
    run(pumice, "compress", good["raw.nrrd"], "-o", tmp_path / "o.pumice", "--json", "/dev/full").refused()
    # `pumice info … | head -0`: a closed pipe is no error.
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as closed:
        assert run(pumice, "info", good_pumice, "--json", stdout=closed).code == 0


@pytest.mark.parametrize("with_signal", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("seconds_of_cpu", [0.1, 0.6, 1.5])
def test_ctrl_c_while_compressing(pumice, noise, seconds_of_cpu, with_signal, tmp_path):
    out = tmp_path / "o.pumice"
    done = run(pumice, "compress", noise, "-o", out, meanwhile=interrupt_after(seconds_of_cpu, with_signal))
    if done.code == 0:
        # The command had finished, or was too close to its end to stop: then the file must be complete.
        assert run(pumice, "verify", out, noise).code == 0
        assert left_in(tmp_path) == ["o.pumice"]
    else:
        done.cancelled()
        assert left_in(tmp_path) == []


def test_ctrl_c_stops_at_least_once(pumice, noise, tmp_path):
    """Control of the test above: an early signal does stop the command. It leaves nothing in the temporary folder either."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    done = run(pumice, "compress", noise, "-o", tmp_path / "o.pumice", "--memory-limit", "1G", env={"TMPDIR": str(temporary)},
               meanwhile=interrupt_after(0.1))
    done.cancelled()
    assert left_in(tmp_path) == ["temporary"] and left_in(temporary) == []


@pytest.fixture(scope="module")
def noise_pumice(pumice, noise):
    run(pumice, "compress", noise, "-o", noise.with_suffix(".pumice"), "--level", "fast").fine()
    return noise.with_suffix(".pumice")


@pytest.mark.parametrize("command", ["render", "verify", "info", *[f"decompress{e}" for e in [".nrrd", ".npy", ".nii.gz", ".tif"]]])
def test_ctrl_c_in_other_commands(pumice, noise, noise_pumice, command, tmp_path):
    """An interrupted command leaves no file under the final name or a temporary one. Rendering would take an hour."""
    args = {
        "render": ["render", noise_pumice, "-o", tmp_path / "p.exr", "--size", "48x27", "--time", "3600"],
        "verify": ["verify", noise_pumice, noise],
        "info": ["info", noise_pumice],
    }.get(command) or ["decompress", noise_pumice, "-o", tmp_path / f"back{command.removeprefix('decompress')}"]
    stopped = 0
    for seconds_of_cpu in [0.05, 0.4, 3.0] if command == "render" else [0.05, 0.3]:
        done = run(pumice, *args, meanwhile=interrupt_after(seconds_of_cpu))
        if done.code != 0:
            done.cancelled()
            stopped += 1
            assert left_in(tmp_path) == []
        else:
            assert command != "render", "rendering would take an hour, so it must be stopped"
    assert stopped > 0, "every signal came too late"


@pytest.mark.full
def test_a_killed_process_leaves_no_half_file(pumice, noise, tmp_path):
    """Kills the command later and later until it finishes: the final name holds either nothing or a complete file."""
    out = tmp_path / "o.pumice"
    killed = 0
    for seconds_of_cpu in [0.05, 0.3, 0.6, 1.2, 2.4, 4.8, 9.6, 1e9]:
        done = run(pumice, "compress", noise, "-o", out, meanwhile=interrupt_after(seconds_of_cpu, signal.SIGKILL))
        if done.code == 0:
            break
        assert done.code == -signal.SIGKILL, done
        killed += 1
        if out.exists():
            assert run(pumice, "verify", out, noise).code == 0
            out.unlink()
    assert killed > 0 and done.code == 0, (killed, done)
    assert run(pumice, "verify", out, noise).code == 0


def test_broken_scenes(pumice, good_pumice, tmp_path):
    saved = tmp_path / "scene.json"
    run(pumice, "render", good_pumice, "-o", tmp_path / "p.png", "--spp", 1, "--size", "8x8", "--save-scene", saved).fine()
    text = saved.read_text()
    for what, broken in {
        "cut": text[: len(text) // 2],
        "empty": "",
        "no object": "[1, 2]",
        "no such key": text.replace('"camera"', '"camara"', 1),
        "future": text.replace('"version": 1', '"version": 999', 1),
        "no number": text.replace('"width": 8', '"width": "wide"', 1),
        "no pixels": text.replace('"width": 8', '"width": 0', 1),
        "too many pixels": text.replace('"width": 8', '"width": 4294967295', 1).replace('"height": 8', '"height": 4294967295', 1),
        "deep": "[" * 100_000,
        "not a number": text.replace('"width": 8', '"width": NaN', 1),
        "unknown field": text.replace('"version": 1', '"version": 1, "nonsense": 3', 1),
        "no volume": text.replace("good.pumice", "absent.pumice"),
    }.items():
        assert broken != text, what
        saved.write_text(broken)
        done = run(pumice, "render", saved, "-o", tmp_path / "q.png", "--spp", 1)
        line = done.refused()
        # The error names the file, and the field, the volume or (for a wrong type) the line.
        named = {"no such key": "camara", "future": "version", "no number": "line", "no pixels": "width", "too many pixels": "width",
                 "unknown field": "nonsense", "no volume": "absent.pumice"}
        assert "scene.json" in line or what == "no volume", line
        assert named.get(what, "") in line, line
        assert done.peak_rss_bytes < MEMORY_BYTES, what
        assert not (tmp_path / "q.png").exists(), what


@pytest.mark.parametrize(
    "args",
    [
        ["--nonsense"],
        ["nonsense"],
        ["compress"],
        ["compress", "a", "b", "-o", "c"],
        ["render", "a", "-o", "b.png", "--size", "0x0"],
        ["render", "a", "-o", "b.png", "--spp", "0"],
        ["render", "a", "-o", "b.png", "--error", "-1"],
        ["render", "a", "-o", "b.png", "--lod", "3"],
        ["render", "a", "-o", "b.png", "--passes", "depth,nonsense"],
        ["render", "a", "-o", "b.png", "--backend", "nonsense"],
        ["render", "-o", "b.png"],
        ["compress", "a", "-o", "b", "--memory-limit", "0"],
        ["compress", "a", "-o", "b", "--raw-dims", "2,2,2"],
        ["info"],
        ["info", "a", "--csv"],
        ["info", "a", "--labels", "--json"],
        ["table", "a"],
        ["table", "a", "-o", "b", "--as", "xls"],
        ["compress", "a", "-o", "b", "--types", "c", "--table", "d"],
    ],
)
def test_bad_usage(pumice, args):
    run(pumice, *args).refused()


@pytest.mark.parametrize("option", ["--spp", "--threads", "--seed", "--distance", "--dpi", "--bounces", "--turntable"])
def test_a_negative_number_is_a_value_of_its_option(pumice, option):
    assert option in run(pumice, "render", "a", "-o", "b.png", option, "-1").refused()
    assert "minus sign" in run(pumice, "render", "a", "-o", "b.png", "--size", "-1x10").refused()


def test_more_threads_than_any_machine_has_are_refused(pumice, tmp_path):
    for command in (["render", "a", "-o", "b.png"], ["compress", "a", "-o", "b.pumice"], ["merge", "a", "-o", "b.pumice"]):
        assert "1025 is not in 1..=1024" in run(pumice, *command, "--threads", "1025").refused()
        # A control: the file is what is wrong.
        assert "No such file" in run(pumice, *command, "--threads", "1024").refused()


def test_a_picture_of_nothing_says_so(pumice, tmp_path):
    small = ["-o", tmp_path / "o.png", "--size", "8x8", "--spp", 1, "--backend", "cpu"]
    for value in (0, 1):
        np.save(tmp_path / "a.npy", np.full((4, 5, 6), value, np.uint8))
        done = run(pumice, "render", tmp_path / "a.npy", "--axes", "xyz", *small)
        assert done.code == 0 and ("a.npy: nothing is shown" in done.err) == (value == 0), done
    # The last one, seen past: a camera that looks beside it.
    run(pumice, "render", tmp_path / "a.npy", "--axes", "xyz", *small, "--save-scene", tmp_path / "s.json").fine()
    scene = json.loads((tmp_path / "s.json").read_text())
    scene["camera"]["shift"] = [50, 0]
    (tmp_path / "s.json").write_text(json.dumps(scene))
    done = run(pumice, "render", tmp_path / "s.json", "-o", tmp_path / "o.png", "--spp", 1, "--backend", "cpu")
    assert done.code == 0 and "s.json: no pixel shows a surface" in done.err, done


def test_a_pumice_file_is_no_source(pumice, good_pumice):
    assert "this is a .pumice file" in run(pumice, "verify", good_pumice, good_pumice).refused()


def test_unknown_endings_and_backends(pumice, good, good_pumice, tmp_path):
    run(pumice, "decompress", good_pumice, "-o", tmp_path / "o.xyz").refused()
    run(pumice, "render", good_pumice, "-o", tmp_path / "o.gif", "--spp", 1, "--size", "8x8").refused()
    run(pumice, "render", good_pumice, "-o", tmp_path / "o.png", "--spp", 1, "--size", "8x8", "--backend", "no").refused()
    run(pumice, "render", good_pumice, "-o", tmp_path / "o.png", "--spp", 1, "--size", "8x8", "--passes", "no").refused()
    run(pumice, "compare", good["raw.nrrd"], good["raw.nrrd"]).refused()
    assert left_in(tmp_path) == []
