"""Tests live pictures: frames, edits, picks, their cost, and errors."""

import gc
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pumice
import pytest


@pytest.fixture
def scene(volume):
    return pumice.figure(volume, size=(60, 40))


def wait(session, wanted=lambda frame: frame.converged):
    """Waits for a frame for which `wanted` holds; fails after a minute."""
    end, serial = time.monotonic() + 60, 0
    while time.monotonic() < end:
        frame = session.latest(serial)
        if frame is not None:
            serial = frame.serial
            if wanted(frame):
                return frame
        time.sleep(0.002)
    raise AssertionError(session.status)


def test_it_converges_to_the_rendered_picture(scene, volume):
    with pumice.Session(scene, [volume], spp=6) as session:
        frame = wait(session)
        pixels = np.asarray(frame)
        assert pixels.shape == (40, 60, 4) and pixels.dtype == np.float32
        picture = pumice.render(scene, volume, spp=6)
        np.testing.assert_array_equal(pixels[::-1, :, :3], picture.color)
        assert (pixels[..., 3] == 1).all()
        assert (frame.width, frame.height, frame.spp, frame.coarse) == (60, 40, 6, False)
        assert session.latest(frame.serial) is None


def test_young_frames_are_filtered_and_the_last_is_not(scene, volume):
    with pumice.Session(scene, [volume], denoise=True) as session:
        assert wait(session, lambda f: not f.coarse).filtered
    with pumice.Session(scene, [volume], spp=6, denoise=True) as session:
        last = wait(session)
        assert not last.filtered
        np.testing.assert_array_equal(np.asarray(last)[::-1, :, :3], pumice.render(scene, volume, spp=6).color)
    with pumice.Session(scene, [volume]) as session:
        assert not wait(session, lambda f: not f.coarse).filtered


def test_frames_are_shown_where_they_lie_and_stay_as_they_are(scene, volume):
    with pumice.Session(scene, [volume]) as session:
        frame = wait(session, lambda f: not f.coarse)
        a, b = np.asarray(frame), np.asarray(frame)
        assert a.ctypes.data == b.ctypes.data and not a.flags.writeable
        view = memoryview(frame)
        assert view.readonly and view.format == "f" and view.shape == (40, 60, 4) and view.c_contiguous
        before = a.copy()
        wait(session, lambda f: f.serial > frame.serial + 2)
        np.testing.assert_array_equal(a, before)
    # The pixels stay valid after the frame, the session and all references are gone.
    del frame, session, b, view
    gc.collect()
    np.testing.assert_array_equal(a, before)


def counted(session):
    return {k: v for k, v in session.status.counters.items() if k != "frames"}


def idle(session, revision):
    end = time.monotonic() + 60
    while not (session.status.state == "converged" and session.status.revision == revision):
        assert time.monotonic() < end, session.status
        time.sleep(0.002)


def test_each_edit_costs_its_own_kind(scene, volume):
    fields = scene.to_dict()
    camera = {**fields["camera"], "shift": [0.25, 0.0]}
    gray = {"base_color": [0.2, 0.2, 0.2]}
    label = str(volume.labels.ids[0])
    cases = [
        ({"edit": "camera", "camera": camera}, {"edits.camera", "rebuilt.camera"}),
        ({"edit": "material", "id": 1, "material": gray}, {"edits.material", "rebuilt.materials"}),
        (
            {"edit": "label_materials", "id": 1, "materials": {label: gray}},
            {"edits.label_materials", "rebuilt.materials"},
        ),
        ({"edit": "suns", "suns": []}, {"edits.suns", "rebuilt.lights"}),
        ({"edit": "cuts", "cuts": [{"shape": {"plane": {"point": [0, 0, 0], "normal": [1, 0, 0]}}}]}, {"edits.cuts"}),
        (
            {"edit": "show", "id": 1, "show": {"except": [int(label)]}},
            {"edits.show", "rebuilt.materials"},  # hidden boxes are skipped in the hierarchy that there is
        ),
    ]
    with pumice.Session(scene, [volume], spp=1, backend="cpu") as session:
        for revision, (edit, costs) in enumerate(cases, start=2):
            idle(session, revision - 1)
            before = counted(session)
            assert session.edit(edit) == revision
            idle(session, revision)
            after = counted(session)
            assert {k: v - before.get(k, 0) for k, v in after.items() if v != before.get(k, 0)} == dict.fromkeys(costs, 1)


def test_edits_that_make_no_sense_change_nothing(scene, volume):
    with pumice.Session(scene, [volume], spp=1) as session:
        before = session.scene
        for edit, what in [
            ({"edit": "suns"}, "missing field `suns`"),
            ({"edit": "colour"}, "unknown variant"),
            ({"edit": "remove", "id": 5}, "no instance 5"),
            ({"edit": "show", "id": 1, "show": {"only": [251]}}, "no label 251"),
            ({"edit": "place", "id": 1, "world_from_index": [0.0] * 12}, "cannot be inverted|can be inverted"),
            ({"edit": "camera", "camera": {"shift": [float("inf"), 0]}}, "edit: "),
        ]:
            with pytest.raises(pumice.InputError, match=what):
                session.edit(edit)
        assert session.scene == before and session.status.revision == 1


def test_picks(scene, volume, labels):
    with pumice.Session(scene, [volume], spp=1) as session:
        picture = pumice.render(scene, volume, spp=1)
        y, x = np.argwhere(picture.label > 0)[len(picture.label) // 2]
        pick = session.pick(int(x), int(y))
        assert pick.label == volume.labels.ids[picture.label[y, x] - 1]
        assert labels[pick.voxel] == pick.label and pick.instance == 1
        np.testing.assert_allclose(pick.depth, picture.depth[y, x], rtol=1e-6)
        y, x = np.argwhere(picture.label == 0)[0]
        assert session.pick(int(x), int(y)) is None
        assert session.pick(-1, 0) is None and session.pick(60, 0) is None
    with pytest.raises(pumice.InputError, match="has stopped"):
        session.pick(1, 1)


def test_a_label_film_is_the_label_pass_with_instances(scene, volume):
    """And its depth is the Depth pass. The film is read without a copy, and nobody can write to it."""
    with pumice.Session(scene, [volume], spp=1) as session:
        assert session.label_film() is None, "the first call asks for it"
        end = time.monotonic() + 60
        while (film := session.label_film()) is None:
            assert time.monotonic() < end, session.status
            time.sleep(0.002)
        picture = pumice.render(scene, volume, spp=1)
        label = picture.label
        assert film.pixels.dtype == np.uint32 and film.pixels.shape == (40, 60, 2) and film.revision == 1
        assert np.array_equal(film.pixels[..., 1], label)
        assert not np.array_equal(film.pixels[::-1, :, 1], label), "the comparison would notice other rows"
        assert np.array_equal(film.pixels[..., 0], (label > 0).astype(np.uint32)), "the only instance has the id 1"
        assert film.depth.dtype == np.float32 and np.array_equal(film.depth, picture.depth)
        assert np.isinf(film.depth[label == 0]).all() and np.isfinite(film.depth[label > 0]).all()
        assert np.shares_memory(film.pixels, session.label_film().pixels)
        assert np.shares_memory(film.depth, session.label_film().depth)
        with pytest.raises(ValueError):
            film.depth[0, 0] = 1
        with pytest.raises(ValueError):
            film.pixels[0, 0, 0] = 1
    seen = film.pixels.copy()
    del session, film
    gc.collect()
    assert np.array_equal(seen[..., 1], label)


def test_instances_come_with_their_volumes(scene, volume):
    with pumice.Session(scene, [volume], spp=2) as session:
        second = scene.to_dict()["instances"][0]
        second["id"] = 2
        second["world_from_index"][9] += 4.0
        revision = session.add(second, volume)
        wait(session, lambda f: f.converged and f.revision == revision)
        revision = session.edit({"edit": "remove", "id": 1})
        frame = wait(session, lambda f: f.converged and f.revision == revision)
        alone = scene.to_dict()
        alone["instances"] = [second]
        picture = pumice.render(pumice.Scene.from_dict(alone), volume, spp=2)
        np.testing.assert_array_equal(np.asarray(frame)[::-1, :, :3], picture.color)


def test_a_panic_is_a_state_and_no_crash(scene, volume):
    session = pumice.Session(scene, [volume])
    session._panic_on_purpose()
    end = time.monotonic() + 60
    while session.status.state != "failed":
        assert time.monotonic() < end
        time.sleep(0.002)
    assert session.status.error == "internal error: a panic on purpose"
    session.stop()
    with pumice.Session(scene, [volume], spp=1) as other:
        wait(other)


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="only Linux lists the threads of a process")
def test_sessions_end_with_their_last_name(scene, volume):
    def threads():
        """Number of all threads of the process, not only Python's."""
        return len(list(Path("/proc/self/task").iterdir()))

    # The first session starts the thread pool that all share.
    with pumice.Session(scene, volume, spp=1) as session:
        wait(session)
    before = threads()
    sessions = [pumice.Session(scene, volume) for _ in range(8)]
    assert threads() == before + 8
    del sessions
    gc.collect()
    assert threads() == before


# A live picture by the software driver, edited while that compiles: what the status said, and the last frame beside the rendered picture.
COMPILED = """
import json, sys, time
import numpy as np, pumice

scene, said = pumice.Scene.load(sys.argv[1]), []
with pumice.Session(scene, backend="vulkan-compute", spp=4) as session:
    while (status := session.status).state == "rendering":
        now = [status.backend, status.compiling, session.latest(0) is not None]
        if now not in said:
            said.append(now)
        if now[1:] == ["vulkan-compute", True] and status.revision == 1:
            session.edit({"edit": "settings", "settings": {**scene.to_dict()["settings"], "seed": 3}})
        time.sleep(0.002)
    frame, status = session.latest(0), session.status
    said.append([status.backend, status.compiling, frame.revision])
    picture = pumice.render(session.scene, spp=4, backend="vulkan-compute")
    other = pumice.render(scene, spp=4)
colors = np.asarray(frame)[::-1, :, :3]
print(json.dumps([said, status.error, [np.array_equal(colors, one.color) for one in (picture, other)]]))
"""


@pytest.mark.turn(1, 2)
def test_the_processor_draws_while_a_device_compiles(volume, tmp_path):
    """The last frame has the bits of the device, of the scene as it was edited meanwhile."""
    volume.save(tmp_path / "a.pumice")
    pumice.figure(pumice.open(tmp_path / "a.pumice"), size=(60, 40)).save(tmp_path / "scene.json")
    nothing_kept = {"PUMICE_CACHE": str(tmp_path / "cache"), "MESA_SHADER_CACHE_DISABLE": "true"}
    command = [sys.executable, "-c", COMPILED, str(tmp_path / "scene.json")]
    done = subprocess.run(command, env={**os.environ, **nothing_kept}, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    said, error, same = json.loads(done.stdout.splitlines()[-1])
    assert ["cpu", "vulkan-compute", True] in said and error is None, said
    assert said[-1] == ["vulkan-compute", None, 2] and same == [True, False], (said, same)
