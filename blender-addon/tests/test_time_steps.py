# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests which time step is shown at a frame, against tables written by hand, and which files are one series."""

import importlib

import pytest

# (start, Frames, offset, step), number of time steps of the file; then for each mode the time steps of these frames. A dash shows nothing.
TABLES = [
    (
        (10, 4, 0, 1), 4,
        "frame      6 7 8 9 10 11 12 13 14 15 16 17 18",
        "CLIP       - - - - 0  1  2  3  -  -  -  -  -",
        "EXTEND     0 0 0 0 0  1  2  3  3  3  3  3  3",
        "REPEAT     0 1 2 3 0  1  2  3  0  1  2  3  0",
        "PING_PONG  2 3 2 1 0  1  2  3  2  1  0  1  2",
    ),
    (
        (1, 3, 0, 3), 3,
        "frame      -3 -2 -1 0 1 2 3 4 5 6 7 8 9 10 11 12 13",
        "CLIP       -  -  -  - 0 0 0 1 1 1 2 2 2 -  -  -  -",
        "EXTEND     0  0  0  0 0 0 0 1 1 1 2 2 2 2  2  2  2",
        "REPEAT     1  2  2  2 0 0 0 1 1 1 2 2 2 0  0  0  1",
        "PING_PONG  2  1  1  1 0 0 0 1 1 1 2 2 2 1  1  1  0",
    ),
    (
        (1, 2, 3, 1), 9,
        "frame      -1 0 1 2 3 4",
        "CLIP       -  - 3 4 - -",
        "EXTEND     3  3 3 4 4 4",
        "REPEAT     3  4 3 4 3 4",
        "PING_PONG  3  4 3 4 3 4",
    ),
    (  # two of the time steps that are asked for are not in the file
        (1, 4, 3, 1), 5,
        "frame      -1 0 1 2 3 4",
        "CLIP       -  - 3 4 - -",
        "EXTEND     3  3 3 4 4 4",
        "REPEAT     3  4 3 4 3 4",
        "PING_PONG  3  4 3 4 3 4",
    ),
    (  # an offset behind the end of the file
        (1, 4, 7, 1), 5,
        "frame      0 1 2",
        "CLIP       - 4 -",
        "EXTEND     4 4 4",
        "REPEAT     4 4 4",
        "PING_PONG  4 4 4",
    ),
    (  # frames between whole ones, and one that time remapping has computed in single precision
        (1, 3, 0, 1), 3,
        "frame      0.5 1.5 1.9999998 2.75 3.5 4.5",
        "CLIP       -   0   1         1    2   -",
        "EXTEND     0   0   1         1    2   2",
        "REPEAT     2   0   1         1    2   0",
        "PING_PONG  1   0   1         1    2   1",
    ),
]  # fmt: skip


@pytest.fixture
def load(extension):
    return lambda name: importlib.import_module(f"{extension.__name__}.{name}")


def test_frames_show_the_time_steps_of_tables_by_hand(load):
    playback, compared = load("time_steps").Playback, 0
    for (start, duration, offset, step), count, head, *rows in TABLES:
        frames = [float(frame) for frame in head.split()[1:]]
        for row in rows:
            mode, *expected = row.split()
            played = playback(start, duration, offset, step, mode)
            shown = [played.shown(frame, count) for frame in frames]
            assert shown == [None if one == "-" else int(one) for one in expected], (row, shown)
            nearest = [played.nearest(frame, count) for frame in frames]
            assert nearest == ([playback(start, duration, offset, step).shown(f, count) for f in frames] if mode == "CLIP" else shown)
            compared += len(shown)
    assert compared > 200
    # Control: no mode has another's row, and neither start, offset nor step is without effect, so each that is mistaken is convicted.
    assert len({tuple(row.split()[1:]) for row in TABLES[0][3:]}) == 4
    frames = range(-3, 14)
    rows = {tuple(playback(*of, "REPEAT").shown(frame, 9) for frame in frames) for of in [(1, 4, 0, 1), (2, 4, 0, 1), (1, 3, 0, 1), (1, 4, 1, 1), (1, 4, 0, 2)]}
    assert len(rows) == 5


def test_files_whose_names_differ_in_their_last_number_are_siblings(load, tmp_path):
    siblings = load("file_series").siblings
    for name in ["c1_t9.nii.gz", "c1_t10.nii.gz", "c1_t011.nii.gz", "c2_t12.nii.gz", "c1_t13.nii", "c1_t.nii.gz", "x.0001.h5", "x.0002.h5", "y.h5"]:
        (tmp_path / name).touch()
    for name in ["s_2.zarr", "s_3.zarr"]:
        (tmp_path / name).mkdir()
    found = lambda name: [path.removeprefix(f"{tmp_path}/") for path in siblings(str(tmp_path / name))]  # noqa: E731
    assert found("c1_t10.nii.gz") == ["c1_t9.nii.gz", "c1_t10.nii.gz", "c1_t011.nii.gz"]
    assert found("x.0002.h5") == ["x.0001.h5", "x.0002.h5"] and found("s_2.zarr") == ["s_2.zarr", "s_3.zarr"]
    # Controls: the number of another column, a name without one, the digit of an ending.
    assert found("c2_t12.nii.gz") == ["c2_t12.nii.gz"] and found("y.h5") == ["y.h5"] and found("c1_t.nii.gz") == ["c1_t.nii.gz"]


def test_the_header_says_how_many_time_steps_there_are(load, tmp_path):
    time_steps = load("cache").time_steps
    for data, count in [(b"\x89PUMICE\n" + bytes(28) + b"\7\0\0\0", 7), (b"\x89PUMICE\n" + bytes(28) + b"\1\0\0\0", 1), (b"\x89PUMICE\n", 1), (b"", 1), (bytes(36) + b"\7\0\0\0", 1)]:
        (tmp_path / "a.pumice").write_bytes(data)
        assert time_steps(tmp_path / "a.pumice") == count
