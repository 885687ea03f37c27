"""Tests the progress bar, which a terminal alone sees: a pseudo-terminal stands for it."""

import os
import pty
import re
import subprocess

import numpy as np
import pytest


@pytest.fixture
def volume(tmp_path):
    """As many voxels as take the command a second or so, with many small labels."""
    z, y, x = np.ogrid[:256, :256, :256]
    np.save(tmp_path / "a.npy", ((x // 5) + 60 * (y // 5) + 3600 * (z // 5)).astype(np.uint32))
    return tmp_path / "a.npy"


def test_a_terminal_sees_progress_and_the_time_that_is_left(pumice, volume, tmp_path):
    command = [pumice, "compress", volume, "--axes", "xyz", "--spacing", "1,1,1", "-o", tmp_path / "a.pumice"]
    leader, follower = pty.openpty()
    # One that can move its cursor: without TERM there is no bar.
    env = {**os.environ, "TERM": "xterm"}
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=follower, env=env)
    os.close(follower)
    seen = b""
    try:
        while piece := os.read(leader, 1 << 16):
            seen += piece
    except OSError:
        # Linux ends a pseudo-terminal without writers by an error.
        pass
    os.close(leader)
    out, _ = process.communicate()
    assert process.returncode == 0 and b"labels" in out
    shown = [int(percent) for percent in re.findall(r"compressing\W.*? (\d+) %  \d+s, done in \d+s", seen.decode())]
    # Of the whole job: it does not begin again where a stage does.
    assert len(shown) > 3 and shown == sorted(shown) and 0 <= shown[0] and 40 < shown[-1] <= 100, shown
    # Elsewhere there is no bar.
    done = subprocess.run([*command[:-1], tmp_path / "b.pumice"], capture_output=True, check=True)
    assert done.stderr == b""
