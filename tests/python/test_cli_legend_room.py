"""Tests where a legend lies beside what is shown, and that its text and the scale bar can be read over dark and light pictures."""

import json

import numpy as np
import pytest
from command import run
from exr_planes import planes
from PIL import Image

FAST = ["--spp", "1", "--backend", "cpu", "--bounces", "1"]
DPI, MM = 100, 100 / 25.4


@pytest.fixture(scope="module")
def volumes(pumice, data, tmp_path_factory):
    """A CT with names, and nuclei with ids alone."""
    folder = tmp_path_factory.mktemp("legend_room")
    run(pumice, "compress", data / "slicer_Segmentation.seg.nrrd", "-o", folder / "ct.pumice").fine()
    nuclei = ["--spacing", "1,1,1", data / "platynereis_nuclei.tif"]
    assert run(pumice, "compress", *nuclei, "-o", folder / "nuclei.pumice").code == 0
    return folder


def bounds(mask):
    """First and last row and column of what is true."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return rows[0], rows[-1], columns[0], columns[-1]


def shown_and_legend(pumice, volume, out, *flags):
    """Bounds of the pixels that show a label, and of those that the legend changes: it is drawn in one of two pictures by one camera."""
    scene = out.with_suffix(".json")
    run(pumice, "render", volume, "-o", out, *FAST, "--dpi", DPI, *flags, "--save-scene", scene).fine()
    marked = planes(out)
    run(pumice, "render", scene, "-o", out, *FAST).fine()
    plain = planes(out)
    np.testing.assert_array_equal(marked["label.index"], plain["label.index"])
    return bounds(plain["label.index"] > 0), bounds(np.any([marked[c] != plain[c] for c in "RGB"], axis=0))


def overlap(a, b):
    return a[0] <= b[1] and b[0] <= a[1] and a[2] <= b[3] and b[2] <= a[3]


@pytest.mark.parametrize(
    ("volume", "flags"),
    [
        ("ct", ["--size", "360x240", "--legend", "--view", "30,15"]),
        ("ct", ["--size", "240x360", "--legend=3", "--view", "90,0"]),
        ("nuclei", ["--size", "360x240", "--legend=20", "--view", "20,30"]),
        ("nuclei", ["--size", "300x300", "--legend=2", "--view", "0,80", "--pick", "5"]),
    ],
)
def test_what_is_shown_keeps_clear_of_the_legend(pumice, volumes, tmp_path, volume, flags):
    shown, legend = shown_and_legend(pumice, volumes / f"{volume}.pumice", tmp_path / "a.exr", *flags)
    assert not overlap(shown, legend), (shown, legend)
    # It is still the subject of the picture: as high or as wide as a third of it at least.
    width, height = (int(n) for n in flags[1].split("x"))
    assert shown[1] - shown[0] > height / 3 or shown[3] - shown[2] > width / 3, shown


def test_in_a_turntable_every_picture_keeps_clear_of_the_legend(pumice, volumes, tmp_path):
    flags = [*FAST, "--size", "360x240", "--turntable", "3", "--save-scene", tmp_path / "s.json"]
    run(pumice, "render", volumes / "ct.pumice", "-o", tmp_path / "wide.exr", *flags).fine()
    run(pumice, "render", volumes / "ct.pumice", "-o", tmp_path / "turn.exr", *flags, "--dpi", DPI, "--legend").fine()
    run(pumice, "render", tmp_path / "s.json", "-o", tmp_path / "plain.exr", *FAST).fine()
    marked, plain = planes(tmp_path / "turn_0001.exr"), planes(tmp_path / "plain.exr")
    legend = bounds(np.any([marked[c] != plain[c] for c in "RGB"], axis=0))
    shown = {name: [bounds(planes(tmp_path / f"{name}_000{n}.exr")["label.index"] > 0) for n in (1, 2, 3)] for name in ("turn", "wide")}
    assert not any(overlap(one, legend) for one in shown["turn"]), (shown, legend)
    # Negative control: without a legend the same figure is where it would be.
    assert any(overlap(one, legend) for one in shown["wide"]), (shown, legend)


def test_a_camera_that_is_given_is_not_moved_and_the_legend_lies_over_the_picture(pumice, volumes, tmp_path):
    for flags in (["--distance", "20"], ["--frame", "volume"]):
        size = ["--size", "360x240", "--legend", "--view", "30,15", *flags]
        shown, legend = shown_and_legend(pumice, volumes / "ct.pumice", tmp_path / "a.exr", *size)
        assert overlap(shown, legend), flags
        camera = json.loads((tmp_path / "a.json").read_text())["camera"]
        run(pumice, "render", volumes / "ct.pumice", "-o", tmp_path / "b.exr", *FAST, *size[:2], *size[3:], "--save-scene", tmp_path / "b.json").fine()
        assert camera == json.loads((tmp_path / "b.json").read_text())["camera"]


def test_a_legend_that_leaves_no_room_says_so(pumice, volumes, tmp_path):
    for dpi, says in ((300, True), (60, False)):
        flags = ["--size", "320x240", "--legend=30", "--dpi", dpi]
        done = run(pumice, "render", volumes / "ct.pumice", "-o", tmp_path / "a.png", *FAST, *flags)
        assert done.code == 0 and ("legend: it leaves no room" in done.err) == says, done


@pytest.mark.parametrize("view", ["standard", "filmic", "agx"])
@pytest.mark.parametrize(("backdrop", "ink"), [(0.01, 1), (0.8, 0)])
def test_text_is_white_over_dark_pictures_and_black_over_light_ones(pumice, volumes, tmp_path, view, backdrop, ink):
    scene = tmp_path / "s.json"
    run(pumice, "render", volumes / "ct.pumice", "-o", tmp_path / "a.png", *FAST, "--size", "300x200", "--distance", "60", "--save-scene", scene).fine()
    fields = json.loads(scene.read_text())
    fields["world"]["backdrop"] = [[backdrop] * 3] * 2
    fields["camera"]["projection"] = {"orthographic": {"scale": 40.0}}
    scene.write_text(json.dumps(fields))
    wishes = ["--dpi", DPI, "--scale-bar", "auto", "--legend=2"]
    run(pumice, "render", scene, "-o", tmp_path / "a.exr", *FAST, *wishes).fine()
    run(pumice, "render", scene, "-o", tmp_path / "a.png", *FAST, *wishes, "--view-transform", view).fine()
    exr, png = planes(tmp_path / "a.exr")["G"], np.asarray(Image.open(tmp_path / "a.png"))[..., 1]
    # The middle of the bar: 4 mm from the lower side, 0.7 mm thick; its end is 4 mm from the right side.
    y, x = round(200 - 4.35 * MM), round(300 - 6 * MM)
    assert (exr[y, x], png[y, x]) == (ink, 255 * ink)
    # Of the legend's text, beside swatches of 0.7 of 3 mm, the strongest pixel is nearly covered.
    text = (slice(round(3 * MM), round(10 * MM)), slice(round(8 * MM), round(20 * MM)))
    strongest = exr[text].max() if ink else exr[text].min()
    assert abs(strongest - ink) < 0.2 * abs(backdrop - ink), strongest


def test_a_background_that_is_laid_below_decides_the_ink_of_both_files(pumice, volumes, tmp_path):
    for background, ink in (("black", 1), ("white", 0), ("transparent", 0)):
        flags = ["--size", "300x200", "--distance", "60", "--dpi", DPI, "--scale-bar", "auto@center", "--background", background]
        for name in ("a.png", "a.exr"):
            run(pumice, "render", volumes / "ct.pumice", "-o", tmp_path / name, *FAST, *flags).fine()
        y, x = round(200 - 4.35 * MM), round(300 - 6 * MM)
        png = np.asarray(Image.open(tmp_path / "a.png"))[y, x]
        exr = planes(tmp_path / "a.exr")
        assert png[0] == 255 * ink and exr["R"][y, x] == ink and exr["A"][y, x] == 1, background
