"""Tests that Pumice works in a process that was forked from one that has used it, as loaders of training data do. Each child has a time limit:
work that is given to the threads of the parent waits for ever."""

import multiprocessing
import os
import threading
import time

import numpy as np
import pumice
import pytest

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")

FORK = multiprocessing.get_context("fork") if hasattr(os, "fork") else None
LIMIT_S = 60


def in_child(work, *args):
    """The result of `work` in a forked process."""
    here, there = FORK.Pipe(duplex=False)

    def run():
        try:
            there.send(("result", work(*args)))
        except BaseException as error:  # noqa: BLE001 (it is raised again by the parent)
            there.send(("error", f"{type(error).__name__}: {error}"))

    child = FORK.Process(target=run)
    child.start()
    try:
        assert here.poll(LIMIT_S), f"no answer from the forked process within {LIMIT_S} s"
        kind, value = here.recv()
    finally:
        child.join(1)
        child.kill()
        child.join()
    assert kind == "result", value
    return value


@pytest.fixture(scope="module")
def used(labels):
    """A volume and a scene of a process that has compressed, decoded and rendered."""
    volume = pumice.compress(labels)
    scene = pumice.figure(volume, size=(40, 30))
    assert (volume.decode() == labels).all()
    return volume, scene, pumice.render(scene, volume, spp=4, backend="cpu")


def test_a_forked_process_decodes_compresses_and_renders(used, labels):
    volume, scene, picture = used

    def work():
        again = pumice.compress(labels)
        drawn = pumice.render(scene, volume, spp=4, backend="cpu")
        return volume.decode(), again.decode(), np.asarray(drawn.color)

    decoded, again, color = in_child(work)
    assert (decoded == labels).all() and (again == labels).all()
    assert (color == np.asarray(picture.color)).all(), "the same picture, bit for bit"


def test_a_forked_process_forks_again(used):
    volume, scene, picture = used

    def work():
        mine = np.asarray(pumice.render(scene, volume, spp=4, backend="cpu").color)
        return mine, in_child(lambda: np.asarray(pumice.render(scene, volume, spp=4, backend="cpu").color))

    for color in in_child(work):
        assert (color == np.asarray(picture.color)).all()


def test_what_has_a_thread_of_its_parent_says_so(used):
    volume, scene, _ = used
    renderer = pumice.Renderer(backend="cpu")
    renderer.render(scene, volume, spp=1)
    session = pumice.Session(scene, volume, backend="cpu", spp=1)

    def work():
        texts = []
        for call in (lambda: renderer.render(scene, volume, spp=1), lambda: session.pick(1, 1), lambda: session.status):
            with pytest.raises(pumice.InputError) as raised:
                call()
            texts.append(str(raised.value))
        return texts

    ending = "belongs to the process from which this one was forked: make a new one here"
    assert in_child(work) == [f"this renderer {ending}", f"this live picture {ending}", f"this live picture {ending}"]
    # The parent's go on.
    assert renderer.render(scene, volume, spp=1).color.shape == (30, 40, 3)
    session.stop()


def test_a_live_picture_is_made_in_a_forked_process(used):
    volume, scene, _ = used

    def work():
        session = pumice.Session(scene, volume, backend="cpu", spp=4)
        end = time.monotonic() + LIMIT_S / 2
        while session.status.state == "rendering" and time.monotonic() < end:
            time.sleep(0.01)
        # While the live picture waits, other calls work.
        known = volume.decode().any()
        state = session.status.state
        session.stop()
        return state, bool(known)

    assert in_child(work) == ("converged", True)


def test_a_forked_process_ends_normally(used):
    """The calls of the parent's threads are none of the child's, whose end must not wait for them."""
    volume, scene, _ = used
    job = pumice.Job()

    def endless():
        with pytest.raises(pumice.Cancelled):
            pumice.render(scene, volume, spp=1 << 30, backend="cpu", job=job)

    thread = threading.Thread(target=endless)
    thread.start()
    time.sleep(0.2)
    started = time.monotonic()
    child = os.fork()
    if child == 0:
        try:
            pumice._native._end_calls()
        finally:
            os._exit(7)
    done, status = os.waitpid(child, 0)
    took = time.monotonic() - started
    job.cancel()
    thread.join()
    assert os.waitstatus_to_exitcode(status) == 7
    # The end waits at most 10 s for calls; a process without any does not wait. Half of that leaves room for a busy machine.
    assert took < 5, took


