"""Tests a renderer that is kept: pictures are those of `render`, what is equal is not built again, frames and cancelled pictures."""

import threading
import time

import numpy as np
import pumice
import pytest


@pytest.fixture
def scene(volume):
    return pumice.figure(volume, size=(60, 40))


def changed(scene, change):
    fields = scene.to_dict()
    change(fields)
    return pumice.Scene.from_dict(fields)


def test_each_picture_is_that_of_render(scene, volume):
    def move(fields):
        fields["camera"]["shift"] = [0.1, 0.0]

    def ghost(fields):
        fields["instances"][0]["style"]["material"] = {"alpha": 0.4}

    renderer = pumice.Renderer(backend="cpu")
    for one in (scene, changed(scene, move), changed(scene, ghost), scene):
        kept = renderer.render(one, [volume], spp=3, growing=True)
        fresh = pumice.render(one, volume, spp=3, backend="cpu")
        assert kept.passes.keys() == fresh.passes.keys()
        for name, pixels in {"color": fresh.color, **fresh.passes}.items():
            np.testing.assert_array_equal(getattr(kept, name), pixels, err_msg=name)
    assert renderer.rebuilt["acceleration"] == 1 and renderer.rebuilt["camera"] == 3


def test_frames_are_seen_from_another_thread(volume):
    scene = pumice.figure(volume, size=(400, 300))
    renderer, job, seen = pumice.Renderer(backend="cpu"), pumice.Job(), []

    def look():
        end, serial = time.monotonic() + 60, 0
        while (not seen or seen[-1][0]) and time.monotonic() < end:
            frame = renderer.latest(serial)
            if frame is not None:
                serial = frame.serial
                seen.append((frame.coarse, frame.width, frame.height, np.asarray(frame).shape))
            time.sleep(0.005)
        job.cancel()

    watcher = threading.Thread(target=look)
    watcher.start()
    picture = renderer.render(scene, [volume], spp=1 << 20, growing=True, unfinished=True, job=job)
    watcher.join()
    assert seen[0][0] and seen[0][3] == (seen[0][2], seen[0][1], 4), "a coarse frame comes first"
    assert seen[-1] == (False, 400, 300, (300, 400, 4))
    assert picture.mean_spp >= 1 and picture.color.shape == (300, 400, 3) and np.isfinite(picture.color).all()


def test_passes_are_taken_from_another_thread_while_the_picture_grows(volume):
    scene = changed(pumice.figure(volume, size=(120, 90)), lambda fields: fields["film"].update(passes=["samples", "cryptomatte_label"]))
    renderer, job, taken = pumice.Renderer(backend="cpu"), pumice.Job(), []

    def look():
        end = time.monotonic() + 60
        while not taken and time.monotonic() < end:
            found = renderer.take_so_far()
            if found is not None:
                taken.append(found)
            time.sleep(0.002)
        taken.append(renderer.take_so_far())
        job.cancel()

    watcher = threading.Thread(target=look)
    watcher.start()
    last = renderer.render(scene, [volume], spp=1 << 20, growing_passes=True, unfinished=True, job=job)
    watcher.join()
    so_far, again = taken
    assert again is None, "the next one comes seconds later"
    # The oracle: a render of as many samples.
    fresh = pumice.render(scene, volume, spp=so_far.spp, backend="cpu")
    assert so_far.passes.keys() == fresh.passes.keys() >= {"depth", "label", "samples", "cryptomatte_label"}
    for name, pixels in {"color": fresh.color, **fresh.passes}.items():
        np.testing.assert_array_equal(getattr(so_far, name, None) if name == "color" else so_far.passes[name], pixels, err_msg=name)
    assert last.mean_spp > so_far.spp >= 1 and not np.array_equal(last.color, so_far.color), "control: it went on"
    renderer.render(scene, [volume], spp=2, growing=True)
    assert renderer.take_so_far() is None, "nobody asked for passes"


def test_a_cancelled_render_raises_unless_what_there_is_is_wanted(scene, volume):
    renderer = pumice.Renderer(backend="cpu")

    def cancel(job):
        return lambda _point: job.cancel()

    for unfinished in (False, True):
        job = pumice.Job()
        render = lambda: renderer.render(  # noqa: E731
            scene, [volume], spp=1 << 20, unfinished=unfinished, job=job, on_progress=cancel(job)
        )
        if unfinished:
            picture = render()
            fresh = pumice.render(scene, volume, spp=picture.spp, backend="cpu")
            np.testing.assert_array_equal(picture.color, fresh.color)
        else:
            with pytest.raises(pumice.Cancelled):
                render()


def test_bad_arguments_are_refused(scene, volume):
    with pytest.raises(pumice.InputError, match="nosuch"):
        pumice.Renderer(backend="nosuch")
    renderer = pumice.Renderer(backend="cpu")
    with pytest.raises(pumice.InputError, match="it would never end"):
        renderer.render(scene, [volume])
    with pytest.raises(pumice.InputError, match="instances: expected one volume"):
        renderer.render(scene, [], spp=1)
    with pytest.raises(ZeroDivisionError):
        renderer.render(scene, [volume], spp=4, on_progress=lambda _point: 1 / 0)
    assert renderer.latest() is None
