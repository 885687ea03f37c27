# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that the samples in Python of the docs that need Blender run, in order, as a script does that someone copies from the page.

They are those whose marker names this file (tests/python/docs_samples.py says what a marker is)."""

import pytest
from conftest import ROOT
from docs_samples import Broken, samples_of
from run_docs_samples import run_python

PAGES = sorted((ROOT / "docs").rglob("*.md"))


def samples_for_here(page):
    samples = samples_of(str(page.relative_to(ROOT)), page.read_text(encoding="utf-8"))
    return [s for s in samples if s.not_run and s.not_run[0] == "Blender" and "blender-addon/tests/test_docs_samples.py" in s.not_run[1]]


@pytest.fixture
def clone(tmp_path, monkeypatch, blender):
    """A folder that looks like the top of a clone, as the working folder."""
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", [page for page in PAGES if samples_for_here(page)], ids=lambda page: page.name)
def test_every_sample_of_the_page_runs(page, clone):
    namespace = {"__name__": "__main__"}
    for sample in samples_for_here(page):
        run_python(sample, namespace)


def test_some_page_has_such_samples_and_a_broken_one_is_convicted(clone):
    page = ROOT / "docs/blender-scripts.md"
    samples = samples_for_here(page)
    assert len(samples) > 5
    # The labels of a volume that nobody has imported.
    with pytest.raises(Broken, match=f"docs/blender-scripts.md:{samples[1].first_line}: expected no exception, got "):
        run_python(samples[1], {"bpy": __import__("bpy")})
