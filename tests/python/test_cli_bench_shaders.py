"""Tests `pumice bench shaders`: figures of a driver that tells them, and a plain word about one that does not."""

import json
import os
from pathlib import Path

import pytest
from command import run


@pytest.fixture
def card():
    """Environment variables of Mesa's driver for AMD cards, which compiles for one that is not there (cargo xtask test unpacks it)."""
    file = os.environ["PUMICE_SHADER_COMPILER"]
    library = json.loads(Path(file).read_text())["ICD"]["library_path"]
    return {
        "VK_DRIVER_FILES": file,
        "VK_ICD_FILENAMES": file,
        "LD_LIBRARY_PATH": str(Path(library).parent),
        "MESA_SHADER_CACHE_DISABLE": "true",
        "RADV_FORCE_FAMILY": "navi31",
    }


def test_a_compiler_counts(pumice, card, tmp_path):
    flags = ("--backends", "vulkan-compute", "--scenes", "diffuse", "--device", "navi31")
    said = run(pumice, "bench", "shaders", *flags, "--out", tmp_path / "a" / "b", env=card)
    page = (tmp_path / "a" / "b" / "shaders.md").read_text()
    assert said.code == 0 and said.out.strip() == page.strip() and page.startswith("# shaders\n\nPumice "), said
    samples, first = json.loads((tmp_path / "a" / "b" / "shaders.json").read_text())
    assert (samples["entry"], first["entry"]) == ("samples", "first surfaces")
    for row in (samples, first):
        assert row["backend"] == "vulkan-compute" and row["scene"] == "diffuse" and "NAVI31" in row["device"] and row["seconds"] > 0
        counted = dict(row["statistics"])
        assert counted["Spilled VGPRs"] == 0 and 0 < counted["VGPRs"] <= 256 and counted["Instructions"] > 1000
    assert dict(first["statistics"])["Instructions"] < dict(samples["statistics"])["Instructions"]


def test_a_driver_without_figures_is_told(pumice, tmp_path):
    said = run(pumice, "bench", "shaders", "--out", tmp_path)
    assert said.code == 1 and "tells no figures of compiled shaders" in said.out and len(said.out.splitlines()) == 1, said
    assert list(tmp_path.iterdir()) == []


def test_what_is_not_there_is_told(pumice):
    said = run(pumice, "bench", "shaders", "--device", "a card of another world")
    assert said.code == 1 and "“a card of another world”" in said.out, said
    line = run(pumice, "bench", "shaders", env={"PUMICE_VULKAN_LOADER": "/there/is/none.so"}).refused()
    assert "/there/is/none.so" in line, line
    assert run(pumice, "bench", "shaders", "--backends", "cuda").code == 2
