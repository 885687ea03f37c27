"""Tests figures in the docs that other files decide: how many rungs there are, what the demo draws, how small volumes become."""

import csv
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def only(pattern, text):
    """The one place where a pattern holds; its groups, or its group if it has one."""
    [found] = re.findall(pattern, text)
    return found


def judged_rungs():
    """Names of the rungs whose files await nothing, without the code that reads rungs."""
    files = {path.stem: json.loads(path.read_text()) for path in (ROOT / "tests/cycles_ladder/rungs").glob("*.json")}
    return sorted(name for name, fields in files.items() if name != "base" and "awaits" not in fields)


def test_the_page_of_vulkan_counts_the_rungs_that_are_judged():
    rungs = judged_rungs()
    assert len(rungs) > 20
    assert int(only(r"every rung of the .* that is judged, (\d+) rungs", text_of("docs/vulkan.md"))) == len(rungs)


def test_the_page_of_cycles_has_a_row_for_each_rung_that_is_judged():
    assert re.findall(r"(?m)^\| (\d\d_\w+) \|", text_of("docs/cycles.md")) == judged_rungs()


def test_captions_and_samples_have_as_many_labels_as_the_demo_draws():
    drawn = int(only(r"FIGURE_LABELS: usize = (\d+)", text_of("cli/src/demo.rs")))
    words = {32: "thirty-two"}[drawn]
    for page in ("README.md", "docs/artists.md"):
        text = text_of(page)
        assert only(r"!\[(\S+) \w+ of mouse visual cortex", text).lower() == words
        assert str(drawn) in re.findall(r"--pick (\d+)", text)
    assert words in text_of("docs/artists.md").split("## Choose what to show")[0] and words in text_of("cli/src/args/demo.rs")


@pytest.fixture
def shares():
    """Per cent of 4 bytes a voxel of each volume of the committed table: [in memory, as `pumice info` counts; on disk at --level small]."""
    with (ROOT / "bench/results/sizes.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 5
    columns = (("together", "brick bytes", "acceleration bytes"), ("disk, small",))
    return [[100 * sum(int(row[c].split()[0]) for c in column) / (4 * int(row["voxels"])) for row in rows] for column in columns]


@pytest.mark.parametrize("page", ["README.md", "CHANGELOG.md"])
def test_sizes_are_those_of_the_committed_table(page, shares):
    sentence = r"to ([\d.]+) to ([\d.]+) % of 4 bytes a voxel in memory,? and ([\d.]+) to ([\d.]+) % on disk at\s+`--level small`"
    said = only(sentence, text_of(page))
    for figure, exact in zip(said, [f(column) for column in shares for f in (min, max)]):
        # As many digits as the page has.
        assert figure == f"{exact:.{len(figure.partition('.')[2])}f}", (said, exact)


def test_registers_and_spills_are_those_of_the_committed_figures():
    rows = json.loads((ROOT / "bench/results/shaders.json").read_text())
    page = text_of("docs/vulkan.md").split("## Whether the shaders fit")[1].split("\n## ")[0]
    table = re.findall(r"(?m)^\| `(vulkan-\w+)` \| (.*) \|$", page)
    assert [name for name, _ in table] == ["vulkan-compute", "vulkan-query", "vulkan-rt"]
    for backend, cells in table:
        counted = []
        for card in ("NAVI21", "NAVI31", "GFX1201"):
            of = [r for r in rows if (r["backend"], r["scene"], r["entry"]) == (backend, "principled", "samples") and card in r["device"]]
            # In a ray tracing pipeline, the shader that draws samples is the largest.
            most = max((dict(r["statistics"]) for r in of), key=lambda s: s["Instructions"])
            counted.append(f"{most['VGPRs']:.0f}, {most['Spilled VGPRs']:.0f}")
        assert cells.split(" | ") == counted, backend
