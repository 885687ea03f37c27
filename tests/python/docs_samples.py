"""Finds the samples of a page of the docs: its fenced blocks of code, with language and line.

    ```sh        commands                                 run by bash, in order
    ```console   `$ command` with what it prints          run; the output is compared
    ```python    statements                               run in one process, each block after those before it
    ```json      a whole scene, or fields of one          becomes `scene.json`, or is added to it
    ```text      a drawing, a formula, a line of a log    no sample; a line that begins with `pumice ` or `$ ` is refused

A sample of any other language needs a marker, and so does one that cannot run. The marker is the line before the block, and says why:

    <!-- sample not run: browser: three.js runs in a page -->

`run_docs_samples.py` runs what is found here.
"""

import re
from dataclasses import dataclass

LANGUAGES = ("sh", "console", "python", "json", "text")
# Why a sample cannot run in the tests.
KINDS = {
    "graphics card": "its result depends on the card of the machine",
    "Blender": "it needs Blender; those in Python run in the tests of the extension",
    "installs": "it installs or downloads something",
    "builds": "it compiles Pumice",
    "browser": "it runs in a page of a browser",
    "illustration": "it shows something that the reader does not have",
}
MARKER = re.compile(r"<!-- sample not run: ([^:]+): (\S.*) -->")
FENCE = re.compile(r"( *)(```+)(.*)")


class Broken(Exception):
    """A sample that fails, or that breaks these rules. The text is one line: page, line, what."""

    def __init__(self, page, line, what):
        super().__init__(f"{page}:{line}: {what}")


@dataclass(frozen=True)
class Sample:
    """One fenced block."""

    page: str
    # Line of the page, from 1, on which its text begins.
    first_line: int
    language: str
    text: str
    # Kind and reason of its marker; None if it runs.
    not_run: tuple | None

    @property
    def runs(self):
        return self.not_run is None and self.language != "text"


def samples_of(page, text):
    """The samples of a page in order.

    Raises `Broken` for a block without a language or without an end, a marker that is not written as above or has no block below it, and a
    command in a block of text.
    """
    lines = text.splitlines()
    found, marker, i = [], None, 0
    while i < len(lines):
        fence = FENCE.fullmatch(lines[i])
        if not fence:
            if marker:
                raise Broken(page, i, "expected a block of code below the marker, got none")
            marker = _marker(page, i + 1, lines[i])
            i += 1
            continue
        indent, ticks, language = fence.groups()
        end = next((j for j in range(i + 1, len(lines)) if lines[j].strip() == ticks), None)
        if end is None:
            raise Broken(page, i + 1, f"expected {ticks} at the end of the block, got the end of the page")
        body = [line.removeprefix(indent) for line in lines[i + 1 : end]]
        found.append(_checked(Sample(page, i + 2, language.strip(), "\n".join(body) + "\n", marker)))
        marker, i = None, end + 1
    if marker:
        raise Broken(page, len(lines), "expected a block of code below the marker, got the end of the page")
    return found


def _marker(page, line, text):
    """Kind and reason of a marker, None for any other line."""
    if not re.match(r"\s*<!--\s*sample", text):
        return None
    written = MARKER.fullmatch(text.strip())
    if not written or written[1] not in KINDS:
        kinds = ", ".join(KINDS)
        raise Broken(page, line, f"expected <!-- sample not run: KIND: WHY --> with a kind of {kinds}, got {text.strip()}")
    return written.groups()


def _checked(sample):
    """The sample, if its language may run or a marker says why it does not."""
    if sample.not_run:
        return sample
    page, fence_line = sample.page, sample.first_line - 1
    if sample.language not in LANGUAGES:
        languages = ", ".join(LANGUAGES)
        raise Broken(page, fence_line, f"expected one of {languages}, or a marker, got the language {sample.language!r}")
    if sample.language == "text":
        for i, line in enumerate(sample.text.splitlines()):
            if re.match(r"\s*(\$ |pumice [a-z-]+ )", line):
                raise Broken(page, sample.first_line + i, f"expected no command in a block of text, got {line.strip()}")
    return sample
