# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests `pumice bench convergence --scenes real-light` beside Cycles in this Blender: both programs have their rows, a ratio with its
interval, and the same mean picture."""

import csv
import re
import subprocess
import sys

import pytest


@pytest.mark.full
def test_both_programs_are_measured_alike_and_draw_the_same(pumice_command, data, tmp_path):
    volume = data / "slicer_Segmentation.seg.nrrd"
    tiny = ["--scenes", "real-light", "--only", "hdr-area-floor", "--pick", "6", "--size", "48x32", "--bounces", "2"]
    cost = ["--spp", "16,64", "--repeats", "4", "--parts", "16"]
    command = [pumice_command, "bench", "convergence", volume, "--with-blender", sys.executable, *tiny, *cost, "--out", tmp_path]
    subprocess.run(command, check=True)
    with (tmp_path / "convergence_real_light.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(r["program"].split()[0], r["samples"]) for r in rows] == [(p, n) for p in ("Pumice", "Cycles") for n in ("16", "64")]
    for ours, theirs in zip(rows[:2], rows[2:], strict=True):
        value, low, high = (float(ours[c]) for c in ("noise over Cycles'", "low", "high"))
        assert low < value < high and theirs["low"] == ""
        # The CSV has four digits of each noise, and three decimals of the ratio.
        assert value == pytest.approx(float(ours["noise"]) / float(theirs["noise"]), rel=2e-3, abs=1e-3)
        assert float(theirs["CPU s"]) > 0
    page = (tmp_path / "convergence_real_light.md").read_text()
    # Channels depend on each other, so errors are up to 1.7 times as large; 5 of those are 8.7.
    assert float(re.search(r"means differ by ([\d.]+) standard errors", page)[1]) < 8.7
    with (tmp_path / "convergence_real_light_parts.csv").open() as file:
        parts = {r["part"]: r for r in csv.DictReader(file)}
    assert list(parts) == ["whole", "sky alone", "area lights alone", "direct light", "matte", "unfiltered"]
    assert all(float(r["Cycles' noise"]) > 0 and float(r["low"]) < float(r["high"]) for r in parts.values())
