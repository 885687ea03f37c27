"""Tests that every sample of README.md and of the pages in docs/ runs, from top to bottom of its page, on the volumes that are shipped.

Each page runs in a folder of its own, which looks to it like the top folder of a clone: it has `data`, and nothing else at first. What a
sample is and what excuses one from running is in `docs_samples.py`, how it runs in `run_docs_samples.py`.
"""

import collections
import os
import subprocess
import sys
from pathlib import Path

import pytest
from docs_samples import KINDS, Broken, samples_of
from run_docs_samples import matches

ROOT = Path(__file__).resolve().parents[2]
RUNNER = Path(__file__).with_name("run_docs_samples.py")
PAGES = ["README.md", *sorted(str(page.relative_to(ROOT)) for page in (ROOT / "docs").rglob("*.md"))]
# Pages whose samples take longer than the short run allows, and what takes long there.
LONG = {
    "README.md": "final pictures of the shipped cortex, and one of 640 × 480 pixels",
    "docs/artists.md": "final pictures of the shipped cortex",
    "docs/cookbook.md": "pictures at the size of a journal's column",
    "docs/print.md": "a picture of 85 mm at 300 dpi",
    "docs/peers.md": "a dozen programs, each in processes of its own",
}
# A limit against hangs: the longest page takes some minutes of CPU time.
LIMIT_SECONDS = 3600


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def run(page, folder, pumice):
    """Runs the samples of a page (a path from ROOT, or an absolute one) in a folder that gets `data`: what the run said, exit code."""
    (folder / "bin").mkdir()
    (folder / "bin" / "pumice").symlink_to(pumice)
    clone = folder / "clone"
    clone.mkdir()
    (clone / "data").symlink_to(ROOT / "data")
    path = os.pathsep.join([str(folder / "bin"), str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        [sys.executable, RUNNER, page],
        cwd=clone,
        env={**os.environ, "PATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=LIMIT_SECONDS,
    )
    return done.returncode, done.stdout


@pytest.mark.parametrize("page", [pytest.param(page, marks=[pytest.mark.full] * (page in LONG)) for page in PAGES])
def test_every_sample_of_the_page_runs(page, pumice, tmp_path):
    code, said = run(page, tmp_path, pumice)
    expected = sum(sample.runs for sample in samples_of(page, text_of(page)))
    assert code == 0 and said.splitlines()[-1] == f"samples run: {expected}", said


def test_what_does_not_run_is_counted_by_reason(capsys):
    counted, reasons = collections.Counter(), []
    for page in PAGES:
        for sample in samples_of(page, text_of(page)):
            if sample.not_run:
                kind, why = sample.not_run
                counted[kind] += 1
                reasons.append(f"{page}:{sample.first_line}: {kind}: {why}")
            else:
                counted["text" if sample.language == "text" else "run"] += 1
    with capsys.disabled():
        print("\nsamples of the docs: " + ", ".join(f"{counted[kind]} {kind}" for kind in ("run", "text", *KINDS) if counted[kind]))
        print("\n".join(reasons))
    # Most of the pages have samples; were the finder blind, every page would pass.
    assert counted["run"] > 30 and all(page in PAGES for page in LONG)


def page_with(block, tmp_path):
    """A page that has a sample which runs, and from line 9 on the block."""
    page = tmp_path / "page.md"
    before = "# Page\n\n```sh\nseq 3 > three.txt\n```\n\nText.\n\n"
    assert before.count("\n") == 8
    page.write_text(before + block, encoding="utf-8")
    return page


BROKEN = {
    "a command that fails": ("```sh\ntrue\nls none.txt\ntrue\n```\n", 11, "none.txt"),
    "a command in a pipe that fails": ("```sh\nls none.txt | cat\n```\n", 10, "none.txt"),
    "a variable that is not set": ("```sh\necho $NO_SUCH_VARIABLE\n```\n", 10, "NO_SUCH_VARIABLE"),
    "what bash cannot read": ("```sh\nif true\n```\n", 10, "syntax error"),
    "bad input to pumice": ("```sh\npumice info none.nrrd\n```\n", 10, "none.nrrd"),
    "another output": ("```console\n$ cat three.txt\n1\n2\n3\n$ cat three.txt\n1\n2\n4\n```\n", 14, "expected the output"),
    "a command with output that fails": ("```console\n$ ls none.txt\n…\n```\n", 10, "none.txt"),
    "output without a command": ("```console\n1\n```\n", 10, "expected a line that begins with $"),
    "an exception": ("```python\na = 1\n\nb = a / 0\n```\n", 12, "ZeroDivisionError"),
    "an exception in a function": ("```python\ndef f():\n    return none\n\nf()\n```\n", 11, "NameError"),
    "what Python cannot read": ("```python\na = 1\nb = (\n```\n", 11, "expected Python"),
    "an end of Python": ("```python\nimport sys\nsys.exit()\n```\n", 11, "SystemExit"),
    "what is not JSON": ('```json\n{\n  "version": 1,\n}\n```\n', 12, "expected JSON"),
    "a scene with an unknown field": ('```json\n{"version": 1, "colour": 2}\n```\n', 10, "colour"),
    "a field of a scene that no sample has written": ('```json\n"cuts": []\n```\n', 10, "scene.json"),
    "no language": ("```\nls\n```\n", 9, "the language ''"),
    "an unknown language": ("```js\nlet a = 1\n```\n", 9, "'js'"),
    "a command in text": ("```text\nline\npumice info three.txt\n```\n", 11, "expected no command"),
    "a block without an end": ("```sh\ntrue\n", 9, "the end of the page"),
    "a marker without a block": ("<!-- sample not run: Blender: a window -->\n\nText.\n", 9, "expected a block"),
    "a marker at the end": ("<!-- sample not run: Blender: a window -->\n", 9, "expected a block"),
    "a marker of an unknown kind": ("<!-- sample not run: slow: a minute -->\n```sh\nls\n```\n", 9, "with a kind of"),
    "a marker without a reason": ("<!-- sample not run: Blender -->\n```sh\nls\n```\n", 9, "with a kind of"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_sample_is_convicted_with_page_and_line(what, pumice, tmp_path):
    block, line, word = BROKEN[what]
    page = page_with(block, tmp_path)
    code, said = run(str(page), tmp_path, pumice)
    assert code == 1 and said.startswith(f"{page}:{line}: ") and word in said, said


def test_a_field_that_breaks_the_scene_is_convicted(pumice, tmp_path):
    draw = "pumice render data/slicer_Segmentation.seg.nrrd --size 16x16 --spp 1 -o p.png --save-scene scene.json"
    page = page_with(f'```sh\n{draw}\n```\n\n```json\n"cuts": [{{"shape": {{"ball": 1}}}}]\n```\n', tmp_path)
    code, said = run(str(page), tmp_path, pumice)
    assert code == 1 and said.startswith(f"{page}:14: expected a scene, got ") and "ball" in said, said
    (tmp_path / "again").mkdir()
    right = page.read_text().replace('"ball": 1', '"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}')
    # The scene of the reader then has the field, and what it had.
    page.write_text(right + "```console\n$ grep -o 'plane\\|slicer_Segmentation' scene.json\nslicer_Segmentation\nplane\n```\n")
    assert run(str(page), tmp_path / "again", pumice) == (0, "samples run: 4\n")


def test_samples_of_a_page_run_in_order_in_one_folder_and_one_process(pumice, tmp_path):
    blocks = "```python\nlines = open('three.txt').read().split()\n```\n```python\nopen('four.txt', 'w').write(lines[-1] + '4')\n```\n"
    blocks += "```console\n$ cat four.txt\n34\n$ ls data/README.md\ndata/README.md\n```\n"
    marked = "<!-- sample not run: Blender: a window -->\n```python\nimport bpy_window\n```\n"
    assert run(str(page_with(blocks + marked, tmp_path)), tmp_path, pumice) == (0, "samples run: 4\n")
    # Without its marker, the last is convicted.
    (tmp_path / "bare").mkdir()
    code, said = run(str(page_with(blocks + marked.split("\n", 1)[1], tmp_path)), tmp_path / "bare", pumice)
    assert code == 1 and "bpy_window" in said, said


def test_a_page_that_ends_its_process_early_does_not_pass(pumice, tmp_path):
    page = page_with("```python\nimport os\nos._exit(0)\n```\n", tmp_path)
    code, said = run(str(page), tmp_path, pumice)
    assert code == 0 and "samples run" not in said


def test_shown_output_is_compared_but_for_wildcards_times_and_memory():
    same = [
        ("", ""),
        ("a\nb", "a\nb\n"),
        ("a … c", "a b c"),
        ("a\n…", "a"),
        ("a\n…\nd", "a\nb\nc\nd"),
        ("…\nd", "d"),
        ("done in 2.0 s, 58 MB", "done in 17.31 s, 7 MB"),
        ("took 3 CPU s", "took 1.5 CPU s"),
        ("(a+b)*", "(a+b)*"),
    ]
    apart = [
        ("a", ""),
        ("", "a"),
        ("a\nb", "a"),
        ("a", "a\nb"),
        ("a … c", "a b\nd c"),
        ("a\n…\nd", "a\nb\nc"),
        ("2 samples", "3 samples"),
        ("557056 bytes", "557057 bytes"),
        ("2.0 s", "2.0 ms"),
        ("a.c", "abc"),
    ]
    assert [case for case in same if not matches(*case)] == [] and [case for case in apart if matches(*case)] == []


def test_a_sample_within_a_list_loses_its_indent():
    [sample] = samples_of("page.md", "* item\n\n  ```python\n  if a:\n      b()\n  ```\n")
    assert sample.text == "if a:\n    b()\n" and sample.first_line == 4 and sample.runs
    with pytest.raises(Broken, match="page.md:1: "):
        samples_of("page.md", "```python\n")
