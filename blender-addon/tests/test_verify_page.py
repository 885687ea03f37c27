# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the page of `pumice verify-render` in a browser, as a reader sees it: what is visible, what it asks the network for, how wide it is,
and that the border between the pictures moves. Scripts are off, so all of it works without them."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests/python"))
from browser import Browser  # noqa: E402

pytestmark = pytest.mark.full
WIDTH, HEIGHT = 1280, 900
VERDICT = "document.getElementById('verdict')"


@pytest.fixture(scope="module")
def html(pumice_command, data, tmp_path_factory):
    """The page of a comparison that a limit of time ends after its first picture: a page whatever the verdict."""
    page = tmp_path_factory.mktemp("page") / "page.html"
    quick = ["--size", "64x48", "--spp", "256", "--backend", "cpu", "--lod", "16", "--time", "0.01", "-o", page]
    volume = data / "slicer_Segmentation.seg.nrrd"
    command = [pumice_command, "verify-render", volume, *quick, "--with-blender", sys.executable]
    done = subprocess.run(command, capture_output=True, text=True)
    assert page.is_file(), done
    return page


@pytest.fixture(scope="module")
def opened():
    """A function: an HTML file in the browser."""
    with Browser() as browser:

        def open_file(path):
            page = browser.page(WIDTH, HEIGHT, scripts=False)
            page.open(path.as_uri())
            return page

        yield open_file


def pixels(page, to):
    """A screenshot as numbers from 0 to 1: (height, width, 3). It stays in the file `to` for whoever looks."""
    import OpenImageIO

    to.write_bytes(page.screenshot())
    file = OpenImageIO.ImageInput.open(str(to))
    values = np.asarray(file.read_image(OpenImageIO.FLOAT))[..., :3]
    assert values.shape == (HEIGHT, WIDTH, 3)
    return values


def faults(page, path, sentence):
    """What a reader would object to."""
    found = []
    if page.ask(f"{VERDICT}.innerText") != sentence or page.ask(f"{VERDICT}.getBoundingClientRect().height") < 10:
        found.append("the verdict is not visible")
    if page.ask("document.scripts.length"):
        found.append("a script")
    if (asked := page.requests()) != [path.as_uri()]:
        found.append(f"asks for {asked[1:]}")
    if page.complaints():
        found.append("the console")
    if page.ask("document.documentElement.scrollWidth > document.documentElement.clientWidth"):
        found.append("wider than the window")
    if page.ask("[...document.images].filter(i => !i.complete || !i.naturalWidth).length"):
        found.append("a picture is missing")
    return found


def sentence_of(html):
    """The text of the verdict, found without a browser."""
    (sentence,) = re.findall(r'id="verdict">([^<]*)</p>', html.read_text())
    return sentence.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", '"').replace("&amp;", "&")


def test_a_reader_sees_the_verdict_and_the_pictures(html, opened):
    page, sentence = opened(html), sentence_of(html)
    assert sentence.startswith("Cannot tell")
    assert faults(page, html, sentence) == []
    assert page.ask("document.images.length") == 6
    # The histogram. There is no curve of the error after one picture.
    assert page.ask("document.querySelectorAll('svg').length") == 1
    shown = pixels(page, html.with_name("page.png"))
    # Text and pictures on white paper: most of it is light, and there are many colours.
    colors = np.unique((255 * shown).astype(int) @ [65536, 256, 1])
    assert 0.3 < (shown > 0.95).all(axis=-1).mean() < 0.98 and len(colors) > 100


def test_the_border_between_the_pictures_moves(html, opened):
    page = opened(html)
    page.ask("document.querySelector('.wipe').scrollIntoView({block: 'center'})")

    def rectangle(selector):
        return page.ask(f"(r => [r.left, r.top, r.width, r.height])(document.querySelector('{selector}').getBoundingClientRect())")

    left, top, width, height = rectangle(".wipe .over")
    # The border is 2 pixels wide.
    assert width == rectangle(".wipe")[2] / 2 + 2
    before = pixels(page, html.with_name("before.png"))
    page.drag((left + width - 5, top + height - 5), (left + width - 205, top + height - 5))
    assert rectangle(".wipe .over") == pytest.approx([left, top, width - 200, height], abs=2)
    after = pixels(page, html.with_name("after.png"))
    # The other picture is seen where the border has gone, with another program's noise; the handle before it has 15 pixels.
    changed = (before != after).any(axis=(0, 2)).nonzero()[0]
    assert len(changed) > 150
    assert left + width - 200 - 15 < changed.min() and changed.max() < left + width + 2, (changed.min(), changed.max())
    # Both pictures keep their places: they have the size of the frame.
    assert rectangle(".wipe .over img") == pytest.approx(rectangle(".wipe > img"), abs=2)


@pytest.mark.parametrize(
    "fault, before, after",
    [
        ("the verdict is not visible", 'id="verdict"', 'id="verdict" style="display: none"'),
        ("a script", "</body>", "<script></script></body>"),
        ("asks for ['http://elsewhere.example/p.png']", "</body>", '<img src="http://elsewhere.example/p.png"></body>'),
        ("wider than the window", "</body>", '<div style="width: 1300px">.</div></body>'),
        ("a picture is missing", "base64,", "base64,A"),
    ],
)
def test_a_faulty_page_is_noticed(html, opened, tmp_path, fault, before, after):
    """Controls: the same page with one fault each."""
    text = html.read_text()
    assert before in text
    path = tmp_path / "page.html"
    path.write_text(text.replace(before, after, 1))
    assert fault in faults(opened(path), path, sentence_of(html))
