"""Tests that films and files which need more memory than there is get one line and exit code 2, by every way on which a size comes in.

The address space is limited (`ulimit -v`) and two threads work, so that these tests mean the same on any machine: a process takes some
hundreds of MB of it for libraries, and some more for the stack and the allocator's arena of each thread."""

import json
import re
import zlib

import numpy as np
import pytest
from command import run

LIMIT = 3 << 30
HUGE = "24000x24000"


def limited(pumice, *args, **more_env):
    return run(pumice, *args, address_limit=LIMIT, env={"RAYON_NUM_THREADS": "2", **more_env})


@pytest.fixture(scope="module")
def volume(pumice, tmp_path_factory):
    folder = tmp_path_factory.mktemp("volume")
    labels = np.zeros((16, 16, 16), np.uint8)
    labels[4:12, 4:12, 4:12] = 3
    np.save(folder / "labels.npy", labels)
    run(pumice, "compress", folder / "labels.npy", "--axes", "xyz", "-o", folder / "a.pumice").fine()
    return folder / "a.pumice"


def refused(done, folder, needed_gb):
    """The line of a refusal names the film, what it needs and what is free; no file is left."""
    line = done.refused()
    found = re.search(r"film: a picture of 24000 × 24000 pixels(?: with \d+ pass(?:es)?)? needs ([\d.]+) GB of memory, ([\d.]+) GB are free$", line)
    assert found, line
    assert float(found[1]) == pytest.approx(needed_gb, rel=0.01), line
    assert 0.5 < float(found[2]) < LIMIT / 1e9, line
    assert not list(folder.glob("*.exr")), line
    # It is refused before anything is made for it.
    assert done.peak_rss_bytes < 400 << 20, done


def enlarge(picture):
    """Rewrites the scene that a PNG file carries, in a chunk `iTXt` (length, name, data, CRC of name and data), with a film of 24,000² pixels."""
    data = picture.read_bytes()
    at = data.index(b"iTXt") - 4
    length = int.from_bytes(data[at : at + 4], "big")
    text = data[at + 8 : at + 8 + length].replace(b'"width":8,"height":8', b'"width":24000,"height":24000')
    assert len(text) > length
    chunk = b"iTXt" + text
    new = len(text).to_bytes(4, "big") + chunk + zlib.crc32(chunk).to_bytes(4, "big")
    picture.write_bytes(data[:at] + new + data[at + 12 + length :])


def test_a_film_without_memory_is_refused_by_flag_scene_and_again(pumice, volume, tmp_path):
    out = tmp_path / "out.exr"
    render = ["render", "--backend", "cpu", "-o", out]
    # 576 million pixels: 12 floats of samples, 3 of colour, 11 of the first surface and 11 of the record that these are taken from.
    refused(limited(pumice, *render, volume, "--size", HUGE), tmp_path, 85.2)

    scene, picture = tmp_path / "scene.json", tmp_path / "small.png"
    run(pumice, "render", volume, "--size", "8x8", "--spp", "1", "--backend", "cpu", "-o", picture, "--save-scene", scene).fine()
    text = json.loads(scene.read_text())
    text["film"].update(width=24000, height=24000)
    scene.write_text(json.dumps(text))
    refused(limited(pumice, *render, scene), tmp_path, 85.2)
    enlarge(picture)
    refused(limited(pumice, *render, "--again", picture), tmp_path, 85.2)
    # With 11 passes of light and color: 33 floats of sums, and 33 of pictures, which are made when the record's 11 are gone.
    refused(limited(pumice, *render, volume, "--size", HUGE, "--passes", "light"), tmp_path, 212.0)


@pytest.mark.parametrize("more", [[], ["--level", "small"]])
def test_many_small_pieces_fit_under_a_limit(pumice, more, tmp_path):
    """A label for each voxel. One reserve of addresses for all threads needs less than 90 MiB; with one of 64 MiB for each thread the process ends at
    130 MiB and below."""
    np.save(tmp_path / "a.npy", np.arange(32**3, dtype=np.uint32).reshape(32, 32, 32))
    compress = ["compress", tmp_path / "a.npy", "--axes", "xyz", "-o", tmp_path / "a.pumice", "--threads", "2", *more]
    run(pumice, *compress, address_limit=110 << 20).fine()


def test_a_film_with_memory_is_drawn_under_the_same_limit(pumice, volume, tmp_path):
    """The control: the limit alone refuses nothing."""
    out = tmp_path / "out.exr"
    limited(pumice, "render", volume, "--size", "64x64", "--spp", "1", "--backend", "cpu", "-o", out).fine()
    assert out.exists()


def test_without_threads_a_command_says_so(pumice, volume, tmp_path):
    """Stacks of which only one fits stand for a system that starts no more threads: the first thread waits for Ctrl-C."""
    out = tmp_path / "out.png"
    command = [pumice, "render", volume, "--spp", "1", "--backend", "cpu", "-o", out]
    line = limited(*command, RUST_MIN_STACK=str(3 << 29)).refused()
    assert line.startswith("pumice: the threads for the work cannot start: ") and not out.exists(), line
