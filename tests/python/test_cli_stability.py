"""Tests `pumice bench stability`: every extreme case must pass on the CPU and on a Vulkan backend, whose pictures are compared with the
CPU's. A run takes one Vulkan backend every eighth day; `--full` takes all."""

import json
from concurrent.futures import ThreadPoolExecutor

import pytest
from command import run
from share import one_of_today

# (A Vulkan backend compiles a program for each kind of case, which takes minutes.)
TURNS = [turn for backend in ("vulkan-rt", "vulkan-query", "vulkan-compute") for turn in ([backend], *([[]] * 7))]
BACKENDS = ["cpu", *(backend for turn in one_of_today(TURNS) for backend in turn)]


@pytest.fixture(scope="module")
def reports(pumice, tmp_path_factory):
    """(standard output, JSON report, Markdown table) by backend. Backends run in parallel: each mostly compiles shaders on one core."""
    folder = tmp_path_factory.mktemp("stability")

    def measured(backend):
        files = ["--json", folder / f"{backend}.json", "--out", folder / f"{backend}.md"]
        # Takes half a minute on an idle core.
        done = run(pumice, "bench", "stability", "--reduced", "--backend", backend, *files, limit_seconds=400)
        said = done.fine()
        return said, json.loads((folder / f"{backend}.json").read_text()), (folder / f"{backend}.md").read_text()

    with ThreadPoolExecutor(2) as pool:
        return dict(zip(BACKENDS, pool.map(measured, BACKENDS), strict=True))


@pytest.mark.parametrize("backend", BACKENDS)
def test_every_bar_is_kept(reports, backend):
    said, report, table = reports[backend]
    assert report["backend"] == backend and report["bad_pixels"] == 0 and report["pixels"] > 5_000
    assert "MISSED" not in said and "| NO |" not in table
    cases = report["cases"]
    assert [c["name"] for c in cases] == [c["name"] for c in reports["cpu"][1]["cases"]], "all backends have the same cases"
    for case in cases:
        assert case["error"] <= case["bar"], case
        # Cases that the backend did not render say why. All others are compared with the CPU's picture, except refused scenes.
        processor_only = case["group"] == "rays"
        assert ("processor_only" in case) == processor_only, case
        beside = backend != "cpu" and case["group"] not in ("rays", "refusals")
        assert ("beside" in case) == beside, case
        if beside:
            assert case["beside"]["apart"] <= 0.05, case
    why = next(c["processor_only"] for c in cases if "processor_only" in c)
    assert f"cases test only the CPU: {why}" in said and table.count(f"processor only: {why}") > 20
    if backend != "cpu":
        # The last bits differ somewhere, which shows that the pictures are not the CPU's.
        assert any(c.get("beside", {}).get("worst", 0.0) > 0.0 for c in cases)


def test_what_is_not_here_is_refused(pumice):
    line = run(pumice, "bench", "stability", "--reduced", "--backend", "abacus").refused()
    assert line.startswith("pumice: backend abacus: no such backend"), line
    line = run(pumice, "bench", "stability", "--backend", "vulkan-rt", env={"PUMICE_VULKAN_LOADER": "/nowhere.so"}).refused()
    assert "no Vulkan here" in line, line
