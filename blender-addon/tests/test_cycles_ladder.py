# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rungs of the ladder (tests/cycles_ladder) drawn anew in this Blender: is what is checked in still what Cycles draws?

Some of them each day, at least one: number i of the list on days whose share is i modulo the number of shares, or of rungs where those are
fewer (PUMICE_TEST_SHARE is `K/N`; `full`: all; unset: the first). Cycles runs in a process of its own, as it does for `pumice bench convergence`.
"""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests/cycles_ladder"))
import by_cycles
import reference
import rung as rungs
import verdict


def of_today():
    names, (k, _, shares) = rungs.judged(), os.environ.get("PUMICE_TEST_SHARE", "").partition("/")
    if k == "full":
        return names
    groups = min(int(shares or len(names)), len(names))
    return [name for i, name in enumerate(names) if i % groups == int(k or 0) % groups]


@pytest.fixture(scope="module", params=of_today())
def rung(request, tmp_path_factory):
    return rungs.Rung(request.param, tmp_path_factory.mktemp("rung"))


# Seeds that no reference has.
FIRST = 1 << 20


def test_cycles_still_draws_its_reference(rung):
    truth, about = reference.load(rung.name)

    def draw(first, seeds):
        # As many samples as the reference has: what Cycles' tables of 256 patterns leave, whatever the seeds, is then the same in both.
        return by_cycles.pictures(sys.executable, rung, FIRST + first, seeds, spp=about["spp"])[0]

    found = verdict.heard(draw, truth, rung.seeds)
    print(found)
    assert found.agrees, found


def test_smooth_normals_are_convicted(rung):
    # What a mesh without flat normals would look like: the trap of every comparison with voxels.
    truth, _ = reference.load(rung.name)
    smooth, _ = by_cycles.pictures(sys.executable, rung, FIRST, rung.seeds, smooth=True)
    found = verdict.judge(smooth, truth)
    print(found)
    assert not found.agrees and np.isfinite(found.ratio), found
