"""The peak of memory that `command.run` tells is the command's own, however large the process of the tests has grown before."""

import os
import subprocess

import numpy as np
from command import peak_rss_bytes, run

GROWN = 300 << 20


def test_a_large_test_process_does_not_count_as_the_command(pumice):
    held = np.ones(GROWN, dtype=np.uint8)
    done = run(pumice, "--version")
    assert done.fine().startswith("pumice ") and 1 << 20 < done.peak_rss_bytes < 100 << 20, done
    assert peak_rss_bytes(pumice, "--version") < 100 << 20
    # Control: a child that this process starts by itself has its peak.
    process = subprocess.Popen([str(pumice), "--version"], stdout=subprocess.DEVNULL)
    _, _, used = os.wait4(process.pid, 0)
    process.returncode = 0
    assert used.ru_maxrss * 1024 > held.size


def test_exit_codes_and_signals_are_the_commands_own(pumice, tmp_path):
    assert run(pumice, "info", tmp_path / "nothing.pumice").code == 2
    shell = "/bin/sh"
    for exact_peak in (False, True):
        assert run(shell, "-c", "kill -9 $$", exact_peak=exact_peak).code == -9
        assert run(shell, "-c", "exit 7", exact_peak=exact_peak).code == 7
        # The signals that Python ignores are not ignored by the command.
        assert run(shell, "-c", "kill -PIPE $$; exit 3", exact_peak=exact_peak).code == -13
