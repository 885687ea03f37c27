"""Tests what reaches a terminal: one line of bounded length without control characters, and an exit code where it cannot be written."""

import os
import resource
import subprocess
import sys

import numpy as np
import pytest
from command import run
from one_of_each import QUICK

# Escape, a line break, characters that turn the direction of what follows (Unicode Standard Annex 9), and a separator of lines.
EVIL = "a\x1b[2J\x07b\nc\u202egnp.\u2066d\u200fe\u2028f"
SHOWN = r"a\u{1b}[2J\u{7}b\nc\u{202e}gnp.\u{2066}d\u{200f}e\u{2028}f"
LONG = "n" * 5000
# No line is longer, escapes included.
MOST_CHARS = 2500


def is_shown_well(text):
    """Whether each line of a text fits on a terminal."""
    return all(line.isprintable() and len(line) <= MOST_CHARS for line in text.splitlines()) and "\r" not in text


@pytest.fixture(scope="module")
def volume(pumice, tmp_path_factory):
    """A volume with labels of evil names and types, and the table that named them."""
    folder = tmp_path_factory.mktemp("named")
    array = np.zeros((4, 4, 4), np.uint8)
    array[:2], array[2:] = 1, 2
    np.save(folder / "v.npy", array)
    quoted = [name.replace('"', '""') for name in (EVIL, LONG)]
    (folder / "t.csv").write_text(f'id,name,type,{LONG}\n1,"{quoted[0]}","{quoted[1]}",3\n2,"{quoted[1]}","{quoted[0]}",4\n', newline="")
    run(pumice, "compress", folder / "v.npy", "--axes", "xyz", "-o", folder / "v.pumice", "--table", folder / "t.csv").fine()
    return folder / "v.pumice"


def test_names_of_labels_are_shown_in_short_lines(pumice, volume):
    for command in [["info", volume, "--labels"], ["info", volume]]:
        assert is_shown_well(run(pumice, *command).fine())
    said = run(pumice, "info", volume, "--labels").fine().splitlines()
    assert len(said) == 3 and SHOWN in said[1] and "nnn … (5000 characters) … nnn" in said[1]
    # Control: as CSV, for programs, a name is whole.
    assert LONG in run(pumice, "info", volume, "--labels", "--csv").fine()


def test_what_is_wrong_is_said_in_a_short_line(pumice, volume, tmp_path):
    def table(text):
        (tmp_path / "t.csv").write_text(text, newline="")
        return ["compress", volume.with_name("v.npy"), "--axes", "xyz", "-o", tmp_path / "o.pumice", "--table", tmp_path / "t.csv"]

    def scene(text):
        (tmp_path / "s.json").write_text(text)
        return ["render", tmp_path / "s.json", "-o", tmp_path / "p.png", *QUICK]

    def header(text):
        (tmp_path / "v.nrrd").write_text(text)
        return ["info", tmp_path / "v.nrrd"]

    for what in (EVIL, LONG, EVIL + LONG):
        for arguments in [
            ["info", what],
            ["render", volume, "-o", what],
            ["render", volume, "-o", tmp_path / "p.png", "--backend", what],
            ["render", volume, "-o", tmp_path / "p.png", "--passes", what],
            ["info", volume, "--labels", f"--query=size>{what}"],
            ["info", volume, "--labels", "--sort", f"no {what}"],
            ["info", volume, f"--{what}"],
            [what],
            ["export", volume, "-o", f"{what}.xyz"],
            ["compress", volume, "-o", tmp_path / "o.pumice", "--array", what],
            table(f'id,name\n"{what}",a\n'),
            scene('{"version": 1, "WHAT": 0}'.replace("WHAT", what)),
            header(f"NRRD0004\ntype: {what}\ndimension: 3\nsizes: 1 1 1\nencoding: raw\n\n"),
        ]:
            said = run(pumice, *arguments).refused()
            assert is_shown_well(said), said
    # The beginning and the end of what is long are there, and its length.
    said = run(pumice, "info", f"begin{'n' * 200}/" * 20 + "end").refused()
    assert said.startswith("pumice: begin") and "characters) … " in said and "(os error 36)" in said


def test_a_short_line_is_whole(pumice, tmp_path):
    """Control of the test above."""
    name = "n" * 200
    assert run(pumice, "info", tmp_path / name).refused().startswith(f"pumice: {tmp_path}/{name}: No such file")


def ended(pumice, *arguments, **streams):
    given = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, **streams}
    return subprocess.run([pumice, *map(str, arguments)], **given, timeout=60).returncode


def test_a_standard_error_that_cannot_be_written_is_exit_code_2(pumice, volume, tmp_path):
    warns = ["export", volume, "--for", "blender", "-o", tmp_path / "o.usdc"]
    with open("/dev/full", "w") as full:
        assert ended(pumice, "info", "no such file", stderr=full) == 2
        assert ended(pumice, "no such command", stderr=full) == 2
        assert ended(pumice, stderr=full) == 2
        # What succeeds and has a warning to say.
        assert ended(pumice, *warns, stderr=full) == 2
        # Control: what has nothing to say there.
        assert ended(pumice, "info", volume, stderr=full) == 0
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as closed:
        assert ended(pumice, "info", "no such file", stderr=closed) == 2
    closed_at_all = [sys.executable, "-c", "import os,sys; os.close(2); os.execv(sys.argv[1], sys.argv[1:])"]
    assert ended(*closed_at_all, pumice, "info", "no such file") == 2
    assert ended(pumice, *warns) == 0


def test_a_standard_output_that_cannot_be_written_is_exit_code_2(pumice, volume, tmp_path):
    commands = [["--help"], ["--version"], ["info", volume], ["info", volume, "--json"], ["info", volume, "--labels", "--csv"], ["devices"]]
    for arguments in commands:
        with open("/dev/full", "w") as full:
            assert ended(pumice, *arguments, stdout=full) == 2, arguments
        # Control: a reader that has seen enough.
        reader, writer = os.pipe()
        os.close(reader)
        with os.fdopen(writer, "w") as closed:
            assert ended(pumice, *arguments, stdout=closed) == 0, arguments


@pytest.mark.parametrize("command", ["info", "compress", "render"])
def test_threads_that_cannot_be_started_are_said_in_a_line(pumice, volume, command, tmp_path):
    arguments = {
        "info": ["info", volume],
        "compress": ["compress", volume.with_name("v.npy"), "--axes", "xyz", "-o", tmp_path / "o.pumice"],
        "render": ["render", volume, "-o", tmp_path / "p.png", *QUICK],
    }[command]
    # Stacks of 4 GiB, of which nothing is used: the addresses suffice for none, for the thread that waits for Ctrl-C alone, or for all.
    for most_gib, threads in [(2, 0), (6, 1), (1 << 10, None)]:

        def limit():
            resource.setrlimit(resource.RLIMIT_AS, (most_gib << 30, most_gib << 30))

        stacks = {**os.environ, "RUST_MIN_STACK": str(4 << 30)}
        done = subprocess.run([pumice, *map(str, arguments)], preexec_fn=limit, env=stacks, capture_output=True, text=True, timeout=60)
        if threads is None:
            assert done.returncode == 0, done
        else:
            assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and list(tmp_path.iterdir()) == [], done
            expected = ["Ctrl-C cannot be handled here", "the threads for the work cannot start"][threads]
            assert done.stderr.startswith(f"pumice: {expected}"), done
