"""Tests volumes that are drawn from disk: live pictures and renderers have the bits of volumes in memory, edits keep pages, errors are one line."""

import os
import re
import sys
import time

import numpy as np
import pumice
import pytest

SPP = 9


@pytest.fixture(scope="module")
def bodies(tmp_path_factory):
    """(file, scene, volume in memory): small bodies of 200 labels, in pages enough."""
    x, y, z = np.ogrid[:256, :192, :128]
    hashed = ((x // 3) * 0x9E37 + (y // 4) * 0x85EB) ^ (z // 5 * 0xC2B3)
    labels = np.where(hashed % 13 < 2, 1 + hashed % 200, 0).astype(np.uint16)
    path = tmp_path_factory.mktemp("bodies") / "bodies.pumice"
    pumice.compress(labels).save(path)
    volume = pumice.open(path)
    return path, pumice.figure(volume, size=(60, 40)), volume


def least(path, scene):
    """The least limit, which a refusal of a lower one says."""
    with pytest.raises(pumice.InputError, match="memory limit: 1000 bytes are too few") as raised:
        pumice.render(scene, memory_limit=1000, spp=1)
    return int(re.search(r"(\d+) are needed", str(raised.value))[1])


def wait(session, revision):
    """The finished frame of a revision, with its pixels from the top; fails after a minute, and where it cannot be drawn."""
    end = time.monotonic() + 60
    while time.monotonic() < end:
        frame, status = session.latest(), session.status
        if frame is not None and frame.converged and frame.revision == revision:
            return np.array(np.asarray(frame)[::-1, :, :3])
        assert status.error is None, status.error
        time.sleep(0.002)
    raise AssertionError(session.status)


def failure(session):
    end = time.monotonic() + 60
    while session.status.error is None:
        assert time.monotonic() < end, session.status
        time.sleep(0.002)
    assert "\n" not in session.status.error
    return session.status.error


def test_a_session_within_a_limit_has_the_same_bits(bodies):
    path, scene, volume = bodies
    limit = least(path, scene) + 100_000
    some = volume.labels.ids % 3 > 0
    camera = {**scene.to_dict()["camera"], "shift": [0.1, 0.0]}
    with pumice.Session(scene, memory_limit=limit, spp=SPP, denoise=True) as session:
        assert session.status.backend == "cpu" or session.status.notices == []
        first = wait(session, 1)
        assert np.array_equal(first, pumice.render(scene, volume, spp=SPP, backend="cpu").color)
        fewer = wait(session, session.set_labels(1, visible=(volume.labels.ids, some)))
        moved = wait(session, session.edit({"edit": "camera", "camera": camera}))
        assert np.array_equal(moved, pumice.render(session.scene, volume, spp=SPP, backend="cpu").color)
        assert not np.array_equal(first, fewer) and not np.array_equal(fewer, moved)
        pages = session.status.pages
        assert pages.limit_bytes == limit and pages.loads > pages.pages > 8, pages
        assert pages.most_bytes <= limit
    with pumice.Session(scene, volume, spp=1) as session:
        assert session.status.pages is None


def test_volumes_share_a_memory(bodies):
    path, scene, volume = bodies
    memory = pumice.PageMemory(1 << 30)
    paged = pumice.open(path, memory=memory)
    assert paged.memory is memory and memory.limit == 1 << 30 and volume.memory is None and "1073741824" in repr(memory)
    assert paged.boxes == volume.boxes and paged.content_hash == volume.content_hash and paged.is_whole
    for column in ("ids", "voxels", "low", "high", "boxes"):
        assert np.array_equal(getattr(paged.labels, column), getattr(volume.labels, column)), column
    ours, theirs = (one.coarse_surface(most_faces=3000) for one in (paged, volume))
    assert ours.cell == theirs.cell and len(ours.quads) == len(theirs.quads) > 1000
    assert pumice.figure(paged, size=(60, 40)).to_dict() == scene.to_dict()
    renderer = pumice.Renderer(backend="cpu")
    first = renderer.render(scene, paged, spp=SPP)
    assert np.array_equal(first.color, pumice.render(scene, volume, spp=SPP, backend="cpu").color)
    # Another picture of the same pages loads none again.
    again = renderer.render(scene, paged, spp=SPP)
    assert first.pages.loads > 8 and again.pages.loads == 0 and memory.figures.loads == first.pages.loads
    with pumice.Session(scene, paged, spp=SPP, backend="cpu") as session:
        assert np.array_equal(wait(session, 1), first.color)
        with pytest.raises(pumice.InputError, match="these volumes are open"):
            pumice.Session(scene, paged, memory_limit=1 << 30)


def test_what_needs_everything_says_so(bodies, tmp_path):
    path, scene, _ = bodies
    paged = pumice.open(path, memory=pumice.PageMemory(1 << 30))
    calls = {
        "save": lambda: paged.save(tmp_path / "out.pumice"),
        "write": lambda: paged.write(tmp_path / "out.nrrd"),
        "decode": paged.decode,
        "label_at": lambda: paged.label_at(3, 3, 3),
        "faces": paged.faces,
        "surface": lambda: pumice.surface(paged),
        "count_faces": lambda: pumice.count_faces(paged),
        "verify": lambda: paged.verify(path),
        "box_arrays": paged.box_arrays,
    }
    for name, call in calls.items():
        with pytest.raises(pumice.InputError) as raised:
            call()
        said = str(raised.value)
        # (A `.pumice` file is no source of voxels, whatever is compared with it.)
        assert name == "verify" or re.search("memory limit: .* needs the whole volume in memory: leave the limit out", said), (name, said)
        assert "\n" not in said
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(pumice.InputError, match="memory: labels has no effect"):
        pumice.open(path, labels=[1], memory=pumice.PageMemory(1 << 30))
    with pytest.raises(pumice.InputError, match="memory: mapped has no effect"):
        pumice.open(path, mapped=True, memory=pumice.PageMemory(1 << 30))
    with pytest.raises(pumice.InputError, match="not a .pumice file"):
        np.save(tmp_path / "a.npy", np.ones((4, 4, 4), np.uint8))
        pumice.open(tmp_path / "a.npy", memory=pumice.PageMemory(1 << 30))
    with pumice.Session(scene, paged, spp=1, backend="cpu") as session:
        session.edit({"edit": "settings", "settings": {**scene.to_dict()["settings"], "smooth_voxels": True}})
        assert failure(session).startswith("memory limit: smooth shading of voxels")


def test_a_file_may_go_once_it_is_open(bodies, tmp_path):
    path, scene, volume = bodies
    copy = tmp_path / "copy.pumice"
    copy.write_bytes(path.read_bytes())
    paged = pumice.open(copy, memory=pumice.PageMemory(1 << 30))
    os.truncate(copy, 100)
    with pumice.Session(scene, paged, spp=SPP, backend="cpu") as session:
        assert np.array_equal(wait(session, 1), pumice.render(scene, volume, spp=SPP, backend="cpu").color)
    # A file that is damaged when it is opened is one line.
    with pytest.raises(pumice.InputError, match="copy.pumice"):
        pumice.open(copy, memory=pumice.PageMemory(1 << 30))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="finds the nameless temporary files in /proc")
def test_a_temporary_file_that_fails_is_one_line_of_the_status(bodies):
    path, scene, volume = bodies
    before = set(os.listdir("/proc/self/fd"))
    paged = pumice.open(path, memory=pumice.PageMemory(1 << 30))
    with pumice.Session(scene, paged, spp=1, backend="cpu") as session:
        wait(session, 1)
        for number in set(os.listdir("/proc/self/fd")) - before:
            link = f"/proc/self/fd/{number}"
            if os.path.exists(link) and "(deleted)" in os.readlink(link):
                os.truncate(link, 0)
        # The labels that change have their pages read again.
        session.set_labels(1, visible=(volume.labels.ids, volume.labels.ids % 2 > 0))
        said = failure(session)
        assert session.status.state != "failed" and session.latest() is not None, said
        # Of an earlier revision, whole.
        assert session.latest().revision == 1
    with pytest.raises(pumice.InputError, match="failed to fill whole buffer"):
        paged.labels  # noqa: B018
