"""Tests that the interpreter ends normally, with the exit code of the script, while threads are inside calls of the module."""

import subprocess
import sys

import pytest

# A daemon thread, for which Python does not wait, is in a long call. A finalizer delays the end of the interpreter, without holding the
# GIL, for longer than a waiting call sleeps. Python kills a thread that tries to take the GIL at this point.
SCRIPT = """
import sys, threading, time
import numpy as np, pumice

volume = pumice.compress(np.ones((8, 8, 8), np.uint8))
scene = pumice.figure(volume, size=(400, 300))
begun = threading.Event()

class Endless:
    dtype, shape = np.dtype(np.uint8), (1 << 14, 1 << 14, 1 << 14)
    def __getitem__(self, key):
        begun.set()
        return np.zeros([s.stop - s.start for s in key], np.uint8)

class Last:
    sleep = time.sleep
    def __del__(self):
        Last.sleep(0.5)

def work():
    {work}

threading.Thread(target=work, daemon=True).start()
begun.wait()
sys.last = Last()
sys.last.itself = sys.last
print("ready", flush=True)
"""

WORKS = {
    "render": "begun.set(); pumice.render(scene, volume, spp=1 << 30)",
    "render, told of": "pumice.render(scene, volume, spp=1 << 30, on_progress=lambda point: begun.set() or time.sleep(0.05))",
    "compress": "pumice.compress(Endless())",
    "again and again": """
    while True:
        try:
            begun.set()
            pumice.render(scene, volume, seconds=0.01)
        except pumice.Cancelled:
            pass
""",
    "a live picture": "session = pumice.Session(scene, [volume]); sys.kept = session; begun.set()",
}

# Also in threads that are not daemons, which Python waits for before it runs what is registered with `atexit`.
WAITED_FOR = ["render", "render, told of", "compress"]


@pytest.mark.parametrize(("work", "daemon"), [(work, True) for work in WORKS] + [(work, False) for work in WAITED_FOR])
def test_the_interpreter_ends_while_a_thread_works(work, daemon):
    script = SCRIPT.replace("{work}", WORKS[work]).replace("daemon=True", f"daemon={daemon}")
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    # Nor does a thread print while Python ends, which now and then aborts the process.
    assert (done.returncode, done.stdout, done.stderr) == (0, "ready\n", ""), done


# An object that outlives the module's end and calls it then, when Python has no standard streams and no names of modules any more.
LATE = """
import os, sys
import numpy as np, pumice

class Late:
    volume = pumice.compress(np.ones((8, 8, 8), np.uint8))._native
    def __del__(self, write=os.write, Cancelled=pumice.Cancelled, str=str):
        try:
            self.volume.label_at(1, 1, 1)
        except Cancelled as error:
            write(1, str(error).encode())

sys.late = Late()
sys.late.itself = sys.late
print("ready", flush=True)
"""


def test_a_finalizer_that_calls_pumice_after_its_end_gets_an_exception():
    done = subprocess.run([sys.executable, "-c", LATE], capture_output=True, text=True, timeout=60)
    expected = "ready\ncancelled: the interpreter is ending"
    assert (done.returncode, done.stdout, done.stderr) == (0, expected, "")
