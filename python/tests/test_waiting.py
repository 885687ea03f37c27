"""Tests long calls: other threads run during them, jobs and Ctrl-C cancel them, panics become exceptions."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pumice
import pytest


@pytest.fixture(scope="module")
def endless(volume):
    """A function that starts a render that would take years."""
    scene = pumice.figure(volume, size=(400, 300))

    def render(job=None, **keywords):
        return pumice.render(scene, volume, spp=1 << 30, job=job, **keywords)

    return render


def test_another_thread_runs_and_cancels(endless):
    job, turns = pumice.Job(), []

    def meanwhile():
        for turn in range(50):
            turns.append(turn)
            time.sleep(0.002)
        job.cancel()

    thread = threading.Thread(target=meanwhile)
    thread.start()
    with pytest.raises(pumice.Cancelled, match="^cancelled$"):
        endless(job)
    thread.join()
    # If the call held the GIL, the thread could not have run, and nobody would have cancelled.
    assert len(turns) == 50 and job.cancelled


OPENINGS = {
    "open": lambda url, job, out: pumice.open(url, job=job),
    "probe": lambda url, job, out: pumice.probe(url, job=job),
    "compress_file": lambda url, job, out: pumice.compress_file(url, out, job=job),
}


@pytest.mark.parametrize("call", OPENINGS)
def test_a_silent_server_is_not_waited_for_once_the_job_is_cancelled(call, tmp_path):
    """It counts as silent after 30 seconds, and is then asked three times more."""
    job, heard = pumice.Job(), threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as silent:

        def cancel():
            connection, _ = silent.accept()
            with connection:
                job.cancel()
                assert heard.wait(20.0), "the call goes on"

        thread = threading.Thread(target=cancel, daemon=True)
        thread.start()
        with pytest.raises(pumice.Cancelled, match="^cancelled$"):
            OPENINGS[call](f"http://127.0.0.1:{silent.getsockname()[1]}/cells", job, tmp_path / "cells.pumice")
        assert thread.is_alive(), "the connection was still open"
        heard.set()
        thread.join()
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def large(cortex):
    """A volume for which the calls below take tens of milliseconds."""
    return pumice.open(cortex)


@pytest.fixture
def turns_during():
    """Counts the turns of another thread during a call. Python's switch interval is so long that the call must release the GIL itself."""
    turns, ended = [0], threading.Event()

    def other():
        while not ended.is_set():
            turns[0] += 1
            time.sleep(0.0005)

    def count(call):
        before = turns[0]
        call()
        return turns[0] - before

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000)
    thread = threading.Thread(target=other)
    thread.start()
    yield count
    ended.set()
    thread.join()
    sys.setswitchinterval(interval)


CALLS = {
    "bounds": lambda volume: volume._native.bounds(),
    "auto_colors": lambda volume: volume._native.auto_colors(None),
    "figure": lambda volume: pumice.figure(volume),
    "figure, picked": lambda volume: pumice.figure(volume, pick=9),
    "decode": lambda volume: volume._native.decode_block((0, 0, 0), (64, 64, 64)),
}


@pytest.mark.parametrize("call", CALLS)
def test_other_threads_have_their_turn_during(call, large, turns_during):
    # A single call may end before the system wakes the other thread, so try often.
    assert any(turns_during(lambda: CALLS[call](large)) for _ in range(100))


def test_a_call_that_keeps_the_interpreter_is_found_out(turns_during):
    assert not any(turns_during(lambda: sorted(range(200_000), reverse=True)) for _ in range(20))


def test_compressing_can_be_cancelled_and_tells_its_progress():
    job, seen = pumice.Job(), set()
    array = np.arange(256**3, dtype=np.uint32).reshape(256, 256, 256) >> 9

    def watch():
        while not job.cancelled:
            seen.add(job.fraction)
            if len(seen) > 2:
                job.cancel()

    thread = threading.Thread(target=watch)
    thread.start()
    with pytest.raises(pumice.Cancelled):
        while True:
            pumice.compress(array, job=job, threads=1)
    thread.join()
    assert all(f is None or 0 <= f <= 1 for f in seen)


def test_a_cancelled_job_stops_before_it_begins(volume, tmp_path):
    job = pumice.Job()
    job.cancel()
    for call in (
        lambda: volume.save(tmp_path / "a.pumice", job=job),
        lambda: volume.decode(job=job),
        lambda: volume.verify(volume.decode(), job=job),
    ):
        with pytest.raises(pumice.Cancelled):
            call()
    assert list(tmp_path.iterdir()) == []


def test_an_exception_of_the_callback_ends_the_render(endless):
    def fail(point):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        endless(on_progress=fail)


def test_control_c_ends_a_render_without_a_job():
    script = (
        "import numpy as np, pumice\n"
        "v = pumice.compress(np.ones((8, 8, 8), np.uint8))\n"
        "s = pumice.figure(v, size=(400, 300))\n"
        "print('ready', flush=True)\n"
        "try:\n"
        "    pumice.render(s, v, spp=1 << 30)\n"
        "except KeyboardInterrupt:\n"
        "    print('interrupted', flush=True)\n"
    )
    child = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "ready\n"
    time.sleep(0.3)
    os.kill(child.pid, signal.SIGINT)
    out, _ = child.communicate(timeout=60)
    assert (child.returncode, out) == (0, "interrupted\n")


def test_a_panic_is_an_exception():
    with pytest.raises(pumice.InternalError, match="internal error: a panic on purpose"):
        pumice._native._panic_on_purpose()
    assert issubclass(pumice.InternalError, pumice.PumiceError) and issubclass(pumice.InputError, ValueError)
