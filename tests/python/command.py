"""Runs the command `pumice` as a subprocess."""

import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass

# A limit against hangs: a command on the small volumes here takes a second or two, on a busy machine several times that.
LIMIT_SECONDS = 120

# Below every limit of memory that tests have, and above what the process of the tests begins with (40 MB).
SMALL_BYTES = 100 << 20

# How a line on standard error begins that a reader of volumes has something to say in.
WARNING = "pumice: warning: "


@dataclass
class Done:
    code: int  # negative: ended by that signal
    out: str
    err: str
    # At least that of the tests' own process up to SMALL_BYTES, and without that bound with `meanwhile` or `file_size_limit`.
    peak_rss_bytes: int

    def cancelled(self):
        """Asserts the end by Ctrl-C: exit code 2 and one line with "cancelled"."""
        assert "cancelled" in self.refused(), self

    @property
    def warnings(self):
        """What standard error says that a reader found odd, or assumed: its lines without `pumice: warning: `."""
        lines = self.err.splitlines()
        return [line.removeprefix(WARNING) for line in lines if line.startswith(WARNING)]

    @property
    def problems(self):
        """All other lines of standard error."""
        return [line for line in self.err.splitlines() if not line.startswith(WARNING)]

    def refused(self):
        """Asserts the end by bad usage or bad input: exit code 2 and, beside warnings, one line on standard error, no panic. Returns it."""
        assert "panicked" not in self.err, self
        assert self.code == 2, self
        assert len(self.problems) == 1, self
        line = self.problems[0]
        assert line.startswith("pumice: ") and len(line) > len("pumice: x"), self
        return line.strip()

    def fine(self):
        """Asserts the end without a failure; standard error may have warnings of readers. Returns what is on standard output."""
        assert self.code == 0, self
        assert self.problems == [], self
        return self.out


def run(
    pumice,
    *args,
    cwd=None,
    file_size_limit=None,
    address_limit=None,
    stdout=None,
    env=None,
    meanwhile=None,
    limit_seconds=LIMIT_SECONDS,
    exact_peak=False,
):
    """Runs `pumice args…` to its end; calls `meanwhile(process)` after the start.

    `file_size_limit`: largest size of any file in bytes, which imitates a full disk.

    `address_limit`: largest address space in bytes (`ulimit -v`), which imitates a machine with little memory.

    `exact_peak`: the peak of memory is the command's own, also below SMALL_BYTES.
    """

    def limit():
        for what, most in [(resource.RLIMIT_FSIZE, file_size_limit), (resource.RLIMIT_AS, address_limit)]:
            if most is not None:
                resource.setrlimit(what, (most, most))

    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        # A child inherits the peak of its parent. Where the tests have grown, a small process starts the command and tells how it ended, which
        # takes 14 ms.
        told, tells = os.pipe()
        has_grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 > SMALL_BYTES
        apart = (exact_peak or has_grown) and meanwhile is None and file_size_limit is None
        process = subprocess.Popen(
            [*([sys.executable, "-I", "-S", "-c", APART, str(tells)] if apart else []), str(pumice), *map(str, args)],
            cwd=cwd,
            stdin=subprocess.DEVNULL,
            stdout=stdout or out,
            stderr=err,
            # Turns on backtraces, for the case of a panic.
            env={**os.environ, "RUST_BACKTRACE": "1", **(env or {})},
            preexec_fn=limit if file_size_limit is not None or address_limit is not None else None,
            pass_fds=[tells] if apart else [],
            process_group=0 if apart else None,
        )
        os.close(tells)
        if meanwhile:
            meanwhile(process)
        deadline = time.monotonic() + limit_seconds
        while True:
            pid, status, used = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            if time.monotonic() > deadline:
                (os.killpg if apart else os.kill)(process.pid, signal.SIGKILL)
                process.wait()
                os.close(told)
                raise AssertionError(f"pumice {' '.join(map(str, args))} did not end in {limit_seconds} s")
            time.sleep(0.002)
        process.returncode, peak = os.waitstatus_to_exitcode(status), used.ru_maxrss * 1024
        with os.fdopen(told) as answer:
            if apart:
                assert process.returncode == 0, f"pumice {' '.join(map(str, args))} was not started"
                status, peak = map(int, answer.read().split())
                process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        return Done(process.returncode, out.read().decode(), err.read().decode(), peak)


# Runs a program, and writes its exit status and peak memory in bytes to a pipe. Python ignores two signals that the program is to have.
APART = """
import os, signal, sys
child = os.fork()
if not child:
    os.close(int(sys.argv[1]))
    for one in (signal.SIGPIPE, signal.SIGXFSZ):
        signal.signal(one, signal.SIG_DFL)
    os.execv(sys.argv[2], sys.argv[2:])
_, status, used = os.wait4(child, 0)
os.write(int(sys.argv[1]), b"%d %d" % (status, used.ru_maxrss * 1024))
"""


def peak_rss_bytes(pumice, *args):
    """Peak memory of `pumice args…` as the system counts it. The command must succeed."""
    done = run(pumice, *args, exact_peak=True)
    assert done.code == 0, done
    return done.peak_rss_bytes


def cpu_seconds(process):
    """User and system seconds that a running process has used; None if it has ended."""
    try:
        with open(f"/proc/{process.pid}/stat") as stat:
            fields = stat.read().rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return None
    return None if fields[0] == "Z" else (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def interrupt_after(seconds_of_cpu, with_signal=signal.SIGINT):
    """A function for `meanwhile` of `run` that sends a signal after so much CPU time, unless the process has ended before."""

    def meanwhile(process):
        while (used := cpu_seconds(process)) is not None and used < seconds_of_cpu:
            time.sleep(0.001)
        if used is not None:
            os.kill(process.pid, with_signal)

    return meanwhile
