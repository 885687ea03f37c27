"""Tests that a film without memory is an `InputError` in Python and the process goes on: Blender, with an artist's work in it, is one."""

import os
import subprocess
import sys

SCRIPT = """
import resource
import numpy as np, pumice

resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
volume = pumice.compress(np.ones((8, 8, 8), np.uint8))

def refused(call, what):
    try:
        call()
    except pumice.InputError as error:
        text = str(error)
        assert text.startswith(f"film: {what}24000 × 24000 pixels") and "needs" in text and text.endswith("are free"), text
        assert "\\n" not in text, text
    else:
        raise AssertionError("it was not refused")

small, huge = (pumice.figure(volume, size=size) for size in [(40, 30), (24000, 24000)])
refused(lambda: pumice.render(huge, volume, spp=1, backend="cpu"), "a picture of ")
renderer = pumice.Renderer(backend="cpu")
renderer.render(small, volume, spp=1)
refused(lambda: renderer.render(huge, volume, spp=1), "a picture of ")
assert renderer.render(small, volume, spp=1).color.shape == (30, 40, 3)

# A live picture says it in its status, and follows the next edit.
session = pumice.Session(huge, volume, backend="cpu", spp=1)
import time
end = time.monotonic() + 60
while (status := session.status).error is None and time.monotonic() < end:
    time.sleep(0.02)
assert status.error.startswith("film: 24000 × 24000 pixels needs ") and status.state != "failed", status
session.stop()
print("fine")
"""


def test_a_film_without_memory_is_an_exception_and_the_process_goes_on():
    # Two threads, so that their stacks and arenas fit into the limit on any machine.
    env = {**os.environ, "RAYON_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=120, env=env)
    assert (done.returncode, done.stdout) == (0, "fine\n"), done.stderr
