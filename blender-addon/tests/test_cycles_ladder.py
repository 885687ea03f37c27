# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders rungs of the ladder (tests/cycles_ladder) again in this Blender, and tests that they agree with the references checked in.

A run takes at least one rung: number i of the list if PUMICE_TEST_SHARE is `K/N` and K is i modulo N (or modulo the number of rungs if
there are fewer than N); `full`: all; unset: the first. Cycles runs in a separate process, as for `pumice bench convergence`.
"""

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests/cycles_ladder"))
import by_cycles
import reference
import rung as rungs


def of_today():
    names, (k, _, shares) = rungs.judged(), os.environ.get("PUMICE_TEST_SHARE", "").partition("/")
    if k == "full":
        return names
    groups = min(int(shares or len(names)), len(names))
    return [name for i, name in enumerate(names) if i % groups == int(k or 0) % groups]


@pytest.fixture(scope="module", params=of_today())
def rung(request, tmp_path_factory):
    return rungs.Rung(request.param, tmp_path_factory.mktemp("rung"))


# First seed; no reference uses this one or later ones.
FIRST = 1 << 20


def test_cycles_still_draws_its_reference(rung):
    truth, about = reference.load(rung.name)

    def draw(first, seeds):
        # As many samples as the reference: then the error of Cycles' tables of 256 patterns, which no seeds remove, is the same in both.
        return by_cycles.pictures(sys.executable, rung, FIRST + first, seeds, spp=about["spp"])[0]

    found = reference.heard(draw, truth, rung.seeds)
    print(found["sentence"])
    assert found["agrees"], found


def test_smooth_normals_are_convicted(rung):
    # Control: smooth normals on the voxel mesh, a likely mistake in comparisons with voxels, are detected.
    truth, _ = reference.load(rung.name)
    smooth, _ = by_cycles.pictures(sys.executable, rung, FIRST, rung.seeds, smooth=True)
    found = truth.judge(smooth)
    print(found["sentence"])
    assert not found["agrees"], found
