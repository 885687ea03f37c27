"""Tests what `pumice export` leaves where it does not end well: killed, interrupted, on a full disk, where nothing may be written; and
what it makes of odd names and of input that asks for nothing or for too much.

A file of an export, with the one beside it that it refers to, must be byte for byte the former export or the new one, at every moment."""

import json
import os
import random
import re
import shutil
import signal
import subprocess
import time
import urllib.parse

import numpy as np
import pytest
from command import cpu_seconds, run
from pxr import Usd, UsdGeom
from share import one_of_today

FORMATS = ["usda", "usdc", "usdz", "gltf", "glb", "ply", "obj", "stl"]
BESIDE = {"gltf": "bin", "obj": "mtl"}
# Moments at which each export is killed, and interrupted, spread over its duration.
KILLS, INTERRUPTS = 12, 6
# What may stay of a killed process besides: a file that is not whole yet, and one beside that nobody refers to.
MAY_STAY = re.compile(r"\.pumice-\w+|figure\.[0-9a-f]{16}\.(bin|mtl)")


def noise(seed, side, labels, solid):
    """Labels 1 … `labels` by chance in a share of the voxels: nearly every one has faces that are seen."""
    rng = np.random.default_rng(seed)
    shape = (side,) * 3
    return np.where(rng.random(shape) < solid, rng.integers(1, labels + 1, shape), 0).astype(np.uint16)


@pytest.fixture(scope="module")
def volumes(tmp_path_factory):
    """Two volumes whose exports take tenths of a second, and two small ones."""
    folder = tmp_path_factory.mktemp("volumes")
    for i, (name, side) in enumerate({"former": 48, "new": 56, "small-former": 16, "small-new": 20}.items()):
        np.save(folder / f"{name}.npy", noise(i, side, 10 + i, 0.2))
    return folder


def named_beside(path):
    """The name of the file beside that a file refers to; none for formats of one file."""
    if path.suffix == ".gltf":
        return urllib.parse.unquote(json.loads(path.read_bytes())["buffers"][0]["uri"])
    if path.suffix == ".obj":
        with path.open() as file:
            return next(line for line in file if line.startswith("mtllib ")).removeprefix("mtllib ").removesuffix("\n")
    return None


def state_of(path):
    """Names and contents of an export: its file, and the one beside it."""
    names = [path.name, *filter(None, [named_beside(path)])]
    return {name: (path.parent / name).read_bytes() if (path.parent / name).exists() else None for name in names}


def names_in(folder):
    return {entry.name for entry in folder.iterdir()}


class Attempts:
    """Exports to one place, again and again, over a former export."""

    def __init__(self, pumice, volumes, folder, ending, size=""):
        self.pumice, self.volumes, self.size, self.out = pumice, volumes, size, folder / f"figure.{ending}"
        folder.mkdir()
        self.whole, self.seconds = {}, 0
        for name in ("former", "new"):
            begun = time.monotonic()
            done = self.export(name)
            assert done.code == 0, done
            self.seconds = time.monotonic() - begun
            self.whole[name] = state_of(self.out)
            assert names_in(folder) == set(self.whole[name]), "the file beside the former one is gone"
        assert self.whole["former"] != self.whole["new"]

    def export(self, name, meanwhile=None):
        done = run(self.pumice, "export", self.volumes / f"{self.size}{name}.npy", "-o", self.out, meanwhile=meanwhile)
        assert "panicked" not in done.err, done
        return done

    def again(self, meanwhile):
        """Puts the former export back, exports the new volume and disturbs that; returns how it ended, which of both is there, and what
        is there besides."""
        for entry in self.out.parent.iterdir():
            entry.unlink()
        for name, content in self.whole["former"].items():
            (self.out.parent / name).write_bytes(content)
        done = self.export("new", meanwhile)
        found = state_of(self.out)
        (which,) = (name for name, state in self.whole.items() if state == found)
        assert done.code != 0 or which == "new"
        return done, which, names_in(self.out.parent) - set(found)

    def moments(self, count, seed):
        """Seconds from the start, one by chance in each of `count` equal parts of an export."""
        chance = random.Random(seed)
        return [(i + chance.random()) / count * self.seconds for i in range(count)]


def sending(with_signal, seconds):
    def meanwhile(process):
        time.sleep(seconds)
        # Popen's own methods would take the exit status, for which `run` waits.
        os.kill(process.pid, with_signal)

    return meanwhile


@pytest.mark.full
@pytest.mark.parametrize("ending", FORMATS)
def test_a_killed_export_leaves_the_former_file_or_the_new_one(pumice, volumes, tmp_path, ending):
    attempts = Attempts(pumice, volumes, tmp_path / "out", ending)
    ends = []
    for seconds in attempts.moments(KILLS, ending):
        done, which, besides = attempts.again(sending(signal.SIGKILL, seconds))
        assert done.code in (0, -signal.SIGKILL), done
        assert done.code == 0 and not besides or all(MAY_STAY.fullmatch(name) for name in besides), besides
        ends.append(which)
    assert "former" in ends, "some were killed before their end"
    assert attempts.again(None)[1:] == ("new", set()), "what killed ones leave is in nobody's way"


@pytest.mark.full
@pytest.mark.parametrize("ending", FORMATS)
def test_an_interrupted_export_leaves_nothing_besides(pumice, volumes, tmp_path, ending):
    attempts = Attempts(pumice, volumes, tmp_path / "out", ending)
    cancelled = 0
    for seconds in attempts.moments(INTERRUPTS, ending):
        done, which, besides = attempts.again(sending(signal.SIGINT, seconds))
        assert not besides, "neither a temporary file nor one beside"
        # A signal before the command listens ends it as any program.
        assert done.code in (0, 2, -signal.SIGINT) and which == ("new" if done.code == 0 else "former"), done
        if done.code == 2:
            done.cancelled()
            cancelled += 1
    assert cancelled > 0


@pytest.mark.parametrize("ending", BESIDE)
def test_killed_between_two_files_the_first_refers_to_its_own(pumice, volumes, tmp_path, ending):
    """The kill comes as soon as the new file beside has its name, which is the last moment before the new file has its own."""
    attempts = Attempts(pumice, volumes, tmp_path / "out", ending, "small-")
    (new_beside,) = attempts.whole["new"].keys() - {attempts.out.name}

    def at_its_appearance(process):
        place = attempts.out.parent / new_beside
        while not any(place.exists() for _ in range(100)) and cpu_seconds(process) is not None:
            pass
        os.kill(process.pid, signal.SIGKILL)

    for _ in range(2):
        _, which, besides = attempts.again(at_its_appearance)
        # Either the kill came in between, or the file that refers to the new one had appeared too.
        assert (new_beside in besides) == (which == "former"), (which, besides)
    # Control: the file of one export with the other's beside it is neither, and so is half a file.
    former, new = attempts.whole["former"], attempts.whole["new"]
    (former_beside,) = former.keys() - {attempts.out.name}
    half = new[attempts.out.name][:-1]
    for mixed in [former | {former_beside: new[new_beside]}, new | {attempts.out.name: half}, {attempts.out.name: None}]:
        assert mixed not in attempts.whole.values()


def test_full_and_forbidden_places(pumice, volumes, tmp_path):
    """A full disk, imitated by a limit on the size of files, and a folder that refuses even root."""
    small = volumes / "small-new.npy"
    for ending in one_of_today(["usda", "ply", "glb", "stl"]):
        out = tmp_path / f"figure.{ending}"
        out.write_text("former")
        assert f"{out.name}: File too large" in run(pumice, "export", small, "-o", out, file_size_limit=20_000).refused()
        assert out.read_text() == "former" and names_in(tmp_path) == {out.name}
        out.unlink()
    for ending in FORMATS:
        line = run(pumice, "export", small, "-o", f"/sys/pumice-test.{ending}").refused()
        assert f"/sys/pumice-test.{ending}: " in line or "/sys: " in line, line


def test_a_full_file_system(pumice, volumes, tmp_path):
    """A file system of 64 kB; where none may be mounted, files of at most 64 kB."""
    is_mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", tmp_path], capture_output=True).returncode == 0
    limit, why = (None, "No space left") if is_mounted else (64 << 10, "File too large")
    try:
        for ending in one_of_today(FORMATS):
            out = tmp_path / f"figure.{ending}"
            out.write_text("former")
            line = run(pumice, "export", volumes / "small-new.npy", "-o", out, file_size_limit=limit).refused()
            assert f"figure.{ending}: " in line and why in line, line
            assert out.read_text() == "former" and len(names_in(tmp_path)) == 1
            out.unlink()
    finally:
        if is_mounted:
            subprocess.run(["umount", tmp_path], check=True)


ODD = ["a b", "'\"quotes\"'", "😀µ", "line\nbreak\ttab", "at@sign", "%41%", "[1]{x}#\\", "-", "x" * 250, os.fsdecode(b"\xff\xfe")]


@pytest.mark.parametrize("ending", FORMATS)
def test_odd_names_of_files(pumice, volumes, tmp_path, ending):
    """Each name is one of the input and of the output. What the file refers to is there, and the stage says the source."""
    for odd in ODD if ending in BESIDE else dict.fromkeys([*one_of_today(ODD), ODD[3], ODD[9]]):
        folder = tmp_path / str(ODD.index(odd))
        folder.mkdir()
        source, out = folder / f"{odd}.npy", folder / f"{odd}.{ending}"
        shutil.copy(volumes / "small-new.npy", source)
        done = run(pumice, "export", source, "-o", out, "--form", "cells4")
        if ending in BESIDE and odd == ODD[9]:
            assert done.code == 2 and "expected a name in UTF-8" in done.err and names_in(folder) == {source.name}, done
            continue
        assert done.code == 0, done
        found = state_of(out)
        assert names_in(folder) == {source.name, *found} and None not in found.values()
        if beside := named_beside(out):
            assert len(beside.split()) == 1 and beside.endswith(BESIDE[ending])
        if ending.startswith("usd"):
            # The name of the source is text of the stage. The library takes some names of files for more than that, so it gets a plain one.
            plain = folder / f"plain.{ending}"
            out.rename(plain)
            stage = Usd.Stage.Open(str(plain))
            (volume,) = (p for p in stage.Traverse() if p.HasAttribute("userProperties:source"))
            said = volume.GetAttribute("userProperties:source").Get()
            assert said == os.fsencode(source.name).decode(errors="replace"), said


NAMES = ["left ventricle", "quote\"s'", "😀 µ日本", "back\\slash", "at@x", "{b}[c]<d>", "#hash", "</Contents>", "a,b:c|d"]
NAMES += ["line\nbreak", "_33_", "x" * 5000]


@pytest.mark.parametrize("ending", ["usda", "usdc", "gltf", "ply", "obj"])
def test_odd_names_of_labels(pumice, tmp_path, ending):
    """Names of labels come back letter by letter; where a name must be one word, the id before it tells which it is."""
    volume, out = tmp_path / "v.seg.nrrd", tmp_path / f"o.{ending}"
    escaped = [name.replace("\\", "\\\\").replace("\n", "\\n") for name in NAMES]
    head = f"NRRD0004\ntype: uint8\ndimension: 3\nsizes: {2 * len(NAMES)} 1 1\nencoding: raw\n"
    for i, name in enumerate(escaped):
        head += f"Segment{i}_LabelValue:={i + 1}\nSegment{i}_Layer:=0\nSegment{i}_Name:={name}\n"
    voxels = np.arange(2 * len(NAMES)) // 2 + 1
    volume.write_bytes(head.encode() + b"\n" + voxels.astype(np.uint8).tobytes())
    run(pumice, "export", volume, "-o", out).fine()
    expected = dict(enumerate(NAMES, 1))
    if ending.startswith("usd"):
        stage = Usd.Stage.Open(str(out))
        (prim,) = (p for p in stage.Traverse() if p.HasAttribute("userProperties:labels"))
        labels = json.loads(prim.GetAttribute("userProperties:labels").Get())
    elif ending == "gltf":
        labels = next(n for n in json.loads(out.read_bytes())["nodes"] if n["name"].startswith("volume_"))["extras"]["labels"]
    elif ending == "ply":
        header = out.read_bytes().split(b"end_header")[0].decode()
        labels = [json.loads(line.split(" ", 4)[4]) for line in header.split("\n") if line.startswith("comment label ")]
    else:
        groups = [line.removeprefix("g ") for line in out.read_text().split("\n") if line.startswith("g ")]
        assert len(groups) == len(NAMES) and all(len(group.split()) == 1 for group in groups)
        for group in groups:
            number, _, word = group.partition("_")
            assert len(word) == len(expected[int(number)]), "a character for each"
        return
    assert {int(id): name for id, name, _ in labels} == expected


@pytest.mark.parametrize("ending", FORMATS)
def test_nothing_to_write(pumice, tmp_path, ending):
    np.save(tmp_path / "empty.npy", np.zeros((9, 9, 9), np.uint8))
    out = tmp_path / f"figure.{ending}"
    out.write_text("former")
    line = run(pumice, "export", tmp_path / "empty.npy", "-o", out).refused()
    assert "no label is shown, or cuts remove them all" in line, line
    assert out.read_text() == "former" and names_in(tmp_path) == {"empty.npy", out.name}


def test_no_label_asked_for(pumice, volumes, tmp_path):
    for labels, what in [("", "--labels"), (",", "--labels"), ("99", "no label 99")]:
        done = run(pumice, "export", volumes / "small-new.npy", "-o", tmp_path / "o.usdc", "--labels", labels)
        assert done.code == 2 and what in done.err and "panicked" not in done.err, done
    assert names_in(tmp_path) == set()


@pytest.mark.full
def test_more_boxes_than_memory_are_refused_before_they_are_kept(pumice, tmp_path):
    """A scene of a few megabytes asks for 2³² boxes, by one small volume in many places."""
    np.save(tmp_path / "v.npy", noise(4, 96, 1000, 0.5))
    run(pumice, "compress", tmp_path / "v.npy", "-o", tmp_path / "v.pumice").fine()
    boxes = json.loads(run(pumice, "info", tmp_path / "v.pumice", "--json").fine())["boxes"]
    shown = ["--spp", 1, "--size", "8x8", "--save-scene", tmp_path / "scene.json"]
    run(pumice, "render", tmp_path / "v.pumice", "-o", tmp_path / "p.png", *shown).fine()
    scene = json.loads((tmp_path / "scene.json").read_text())
    (instance,) = scene["instances"]
    places = 2**32 // boxes + 1
    scene["instances"] = [instance | {"id": i} for i in range(places)]
    (tmp_path / "many.json").write_text(json.dumps(scene))
    for ending in ("usdc", "gltf"):
        done = run(pumice, "export", tmp_path / "many.json", "-o", tmp_path / f"o.{ending}", "--form", "instances")
        assert "is more than the limit of 4294967296" in done.refused()
        # The boxes that fit the limit of the file would take 3 GB in memory; the scene itself takes a kilobyte for each place.
        assert done.peak_rss_bytes < (400 << 20) + places * 1024, done
    # Control: as many places as fit are written, each with its boxes.
    scene["instances"] = scene["instances"][:3]
    (tmp_path / "few.json").write_text(json.dumps(scene))
    assert run(pumice, "export", tmp_path / "few.json", "-o", tmp_path / "few.usdc", "--form", "instances").code == 0
    stage = Usd.Stage.Open(str(tmp_path / "few.usdc"))
    found = [p for p in stage.Traverse() if p.IsA(UsdGeom.PointInstancer)]
    assert [len(UsdGeom.PointInstancer(p).GetPositionsAttr().Get()) for p in found] == [boxes] * 3
