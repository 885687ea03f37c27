"""Tests pictures of volumes that are drawn from disk: the same bits as in memory, a limit that holds, and one line for what cannot be."""

import contextlib
import glob
import json
import os
import re
import signal

import numpy as np
import pytest
from command import run
from exr_planes import planes
from share import one_of_today, some_of_today

RENDER = ["render", "--backend", "cpu", "--size", "96x72", "--spp", "9", "--threads", "2"]
LEVELS = one_of_today(["fast", "default", "small"])


@pytest.fixture(scope="module")
def folder(pumice, tmp_path_factory):
    """`dense.npy`, compressed at levels: 256 × 192 × 128 voxels, a third of which have one of 300 labels, in cubes of 3³ voxels."""
    folder = tmp_path_factory.mktemp("volumes")
    random = np.random.default_rng(7)
    cubes = random.integers(0, 900, (86, 64, 43), np.uint32)
    labels = np.kron(np.where(cubes < 301, cubes, 0), np.ones((3, 3, 3), np.uint32))[:256, :192, :128]
    np.save(folder / "dense.npy", labels)
    for level in {"fast", *LEVELS}:
        run(pumice, "compress", folder / "dense.npy", "--axes", "xyz", "--level", level, "-o", folder / f"{level}.pumice").fine()
    return folder


def drawn(pumice, folder, *flags, source="fast.pumice", out="a.exr", backend="cpu"):
    """The planes of a picture and the report."""
    report = folder / "report.json"
    run(pumice, "render", "--backend", backend, *RENDER[3:], folder / source, *flags, "-o", folder / out, "--json", report).fine()
    return planes(folder / out), json.loads(report.read_text())


def same(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name], equal_nan=True) for name in a)


@pytest.mark.parametrize("level", LEVELS)
def test_a_picture_from_disk_has_the_same_bits(pumice, folder, level):
    whole, report = drawn(pumice, folder, source=f"{level}.pumice")
    assert "pages" not in report
    paged, report = drawn(pumice, folder, "--memory-limit", "1G", source=f"{level}.pumice")
    assert same(whole, paged)
    assert 0 < report["pages"]["loads"] <= report["pages"]["pages"] == 4 * 3 * 2
    # A control of the comparison: another seed gives other bits.
    assert not same(whole, drawn(pumice, folder, "--seed", "1")[0])


def test_time_steps_are_drawn_from_disk(pumice, folder, tmp_path):
    labels = np.load(folder / "dense.npy")[:128, :128]
    for step in range(3):
        np.save(tmp_path / f"t{step}.npy", np.roll(labels, 9 * step, axis=0) if step else labels)
    for level in one_of_today(["default", "small"]):
        steps = [tmp_path / f"t{step}.npy" for step in range(3)]
        run(pumice, "compress", *steps, "--axes", "xyz", "--level", level, "-o", tmp_path / f"{level}.pumice").fine()
        whole, report = drawn(pumice, tmp_path, "--time-step", "1", source=f"{level}.pumice")
        assert "pages" not in report
        paged, report = drawn(pumice, tmp_path, "--time-step", "1", "--memory-limit", "1G", source=f"{level}.pumice")
        assert same(whole, paged) and report["pages"]["pages"] == 2 * 2 * 2
        # A control: the time steps differ.
        assert not same(whole, drawn(pumice, tmp_path, "--time-step", "2", source=f"{level}.pumice")[0])
    # An animation of them, each picture that of its time step.
    run(pumice, *RENDER, tmp_path / f"{level}.pumice", "--time-steps", "all", "--frame", "volume", "-o", tmp_path / "whole.exr").fine()
    run(pumice, *RENDER, tmp_path / f"{level}.pumice", "--time-steps", "all", "--frame", "volume", "--memory-limit", "1G", "-o", tmp_path / "paged.exr").fine()
    for step in range(1, 4):
        assert same(planes(tmp_path / f"whole_{step:04}.exr"), planes(tmp_path / f"paged_{step:04}.exr"))


def test_an_interrupt_while_pages_are_made_leaves_nothing(pumice, folder, tmp_path):
    """Opening writes pages into a file without a name, which the system removes with the process."""
    random = np.random.default_rng(8)
    np.save(tmp_path / "noise.npy", random.integers(1, 200, (200, 200, 200), np.uint8))
    run(pumice, "compress", tmp_path / "noise.npy", "--axes", "xyz", "--level", "fast", "-o", tmp_path / "noise.pumice").fine()
    pages = tmp_path / "pages"
    pages.mkdir()
    seen = []

    def interrupt(process):
        while not seen:
            assert process.poll() is None, "pages are made before the picture"
            for link in glob.glob(f"/proc/{process.pid}/fd/*"):
                # A file may be closed before it is looked at.
                with contextlib.suppress(FileNotFoundError):
                    seen.extend(name for name in [os.readlink(link)] if str(pages) in name)
        process.send_signal(signal.SIGINT)

    command = [*RENDER, tmp_path / "noise.pumice", "--memory-limit", "1G", "-o", tmp_path / "no.exr"]
    run(pumice, *command, env={"TMPDIR": str(pages)}, meanwhile=interrupt).cancelled()
    assert list(pages.iterdir()) == [] and not (tmp_path / "no.exr").exists()


def test_the_least_limit_holds_and_is_named(pumice, folder):
    whole, _ = drawn(pumice, folder)
    line = run(pumice, *RENDER, folder / "fast.pumice", "--memory-limit", "1000", "-o", folder / "no.exr").refused()
    found = re.fullmatch(r"pumice: memory limit: 1000 bytes are too few, (\d+) are needed: .* for tables, and .* for what 3 threads load and use at once", line)
    assert found, line
    assert not (folder / "no.exr").exists()
    report = folder / "report.json"
    done = run(pumice, *RENDER, folder / "fast.pumice", "--memory-limit", found[1], "-o", folder / "least.exr", "--json", report)
    assert done.code == 0 and same(whole, planes(folder / "least.exr"))
    pages = json.loads(report.read_text())["pages"]
    assert pages["loads"] > 4 * pages["pages"] and "loaded" in done.err, done
    assert pages["most_bytes"] <= int(found[1]) == pages["limit_bytes"] and pages["bytes_of_all"] > 0


def test_levels_labels_and_cuts_are_drawn_from_disk_too(pumice, folder):
    ways = ["--lod 4", "--labels 5,7,9", "--lod auto", "--cut x=0.5", "--lod 16", "--query voxels>1000 --mode ao"]
    for way in some_of_today(ways, 2):
        flags = way.split()
        whole, _ = drawn(pumice, folder, *flags)
        assert same(whole, drawn(pumice, folder, *flags, "--memory-limit", "1G")[0]), flags


@pytest.mark.full
def test_a_graphics_processor_holds_pages(pumice, folder):
    """With all passes; where little fits, pages come again. What does not suffice says what would."""
    everything = {"backend": "vulkan-compute", "source": "default.pumice"}
    whole, report = drawn(pumice, folder, "--passes", "all", **everything)
    assert report["backend"] == "vulkan-compute" and "pages" not in report
    paged, report = drawn(pumice, folder, "--passes", "all", "--memory-limit", "1G", **everything)
    assert report["backend"] == "vulkan-compute" and same(whole, paged)
    assert 10 < report["pages"]["loads"] <= report["pages"]["pages"] == 24
    limit = report["pages"]["most_bytes"] * 3 // 4
    paged, report = drawn(pumice, folder, "--passes", "all", "--memory-limit", str(limit), **everything)
    assert same(whole, paged) and report["pages"]["most_bytes"] <= limit and report["pages"]["loads"] > 24, report["pages"]
    assert not same(whole, drawn(pumice, folder, "--passes", "all", "--seed", "1", "--memory-limit", "1G", **everything)[0])
    few = ["--memory-limit", "100K", "-o", folder / "no.exr"]
    line = run(pumice, "render", "--backend", "vulkan-compute", *RENDER[3:], folder / "fast.pumice", *few).refused()
    assert re.search(r"memory limit: 102400 bytes are too few, \d+ are needed", line), line
    far, _ = drawn(pumice, folder, "--lod", "auto", **everything)
    paged, report = drawn(pumice, folder, "--lod", "auto", "--memory-limit", "1G", **everything)
    assert report["backend"] == "vulkan-compute" and report["pages"]["loads"] > 10 and same(far, paged)
    assert not (folder / "no.exr").exists()


@pytest.mark.parametrize("value", ["0", "NaN", "-1", "1.5G", "much"])
def test_a_limit_that_is_no_amount_is_refused(pumice, folder, value):
    assert "--memory-limit" in run(pumice, *RENDER, folder / "fast.pumice", f"--memory-limit={value}", "-o", folder / "no.exr").err


def test_what_needs_everything_in_memory_is_refused(pumice, folder):
    line = run(pumice, *RENDER, folder / "fast.pumice", "--smooth", "--memory-limit", "1G", "-o", folder / "no.exr").problems
    assert line and "smooth" in line[0], line
    assert not (folder / "no.exr").exists()


def test_other_formats_are_to_be_compressed_first(pumice, folder):
    line = run(pumice, *RENDER, folder / "dense.npy", "--axes", "xyz", "--memory-limit", "1G", "-o", folder / "no.exr").refused()
    assert "dense.npy is not a .pumice file" in line and "compress it first" in line


def test_damage_and_a_missing_folder_for_pages_are_one_line(pumice, folder, tmp_path):
    whole = (folder / "fast.pumice").read_bytes()
    cut, changed = tmp_path / "cut.pumice", tmp_path / "changed.pumice"
    cut.write_bytes(whole[:-4096])
    changed.write_bytes(whole[:-5000] + bytes([whole[-5000] ^ 1]) + whole[-4999:])
    for path in (cut, changed, tmp_path / "missing.pumice"):
        line = run(pumice, *RENDER, path, "--memory-limit", "1G", "-o", tmp_path / "no.exr").refused()
        assert path.name in line, line
    nowhere = {"TMPDIR": str(tmp_path / "nowhere")}
    line = run(pumice, *RENDER, folder / "fast.pumice", "--memory-limit", "1G", "-o", tmp_path / "no.exr", env=nowhere).refused()
    assert "nowhere" in line, line
    assert not (tmp_path / "no.exr").exists()
