"""Tests size on paper, scale bar and legend of `pumice render`: by Pillow, and by an independent reader of OpenEXR."""

import json

import numpy as np
import pytest
from command import run
from exr_planes import attributes_of, planes
from PIL import Image

FAST = ["--spp", "1", "--backend", "cpu", "--bounces", "1"]
DPI, MM = 100, 100 / 25.4


@pytest.fixture(scope="module")
def folder(pumice, data, tmp_path_factory):
    """A folder with `v.pumice`, a shipped volume in mm, and the scene `flat.json` of it in an orthographic view with a plain backdrop."""
    folder = tmp_path_factory.mktemp("annotations")
    source = data / "torchio_t1_seg_gif_PIR.nii.gz"
    run(pumice, "compress", source, "-o", folder / "v.pumice").fine()
    run(pumice, "render", folder / "v.pumice", "-o", folder / "a.exr", *FAST, "--size", "300x200", "--save-scene", folder / "s.json").fine()
    fields = json.loads((folder / "s.json").read_text())
    fields["camera"]["projection"] = {"orthographic": {"scale": 12.0}}
    fields["world"]["backdrop"] = [[0.8, 0.8, 0.8], [0.8, 0.8, 0.8]]
    (folder / "flat.json").write_text(json.dumps(fields))
    return folder


def drawn(pumice, folder, out, *wishes, scene="flat.json"):
    run(pumice, "render", folder / scene, "-o", folder / out, *FAST, *wishes).fine()
    return folder / out


def test_pillow_reads_the_density_and_the_width_in_millimetres(pumice, folder):
    picture = Image.open(drawn(pumice, folder, "a.png", "--width-mm", "85", "--dpi", "100"))
    # 85 mm at 100 dpi are 334.6 pixels; the film has the shape 3 : 2. A PNG counts whole pixels a metre.
    assert picture.size == (335, 223)
    assert picture.info["dpi"] == pytest.approx((100, 100), abs=0.02)
    alone = Image.open(drawn(pumice, folder, "b.png", "--width-mm", "20"))
    assert alone.size == (236, 157) and alone.info["dpi"] == pytest.approx((300, 300), abs=0.02)
    kept = Image.open(drawn(pumice, folder, "c.png", "--dpi", "72"))
    assert kept.size == (300, 200) and kept.info["dpi"] == pytest.approx((72, 72), abs=0.02)
    assert "dpi" not in Image.open(drawn(pumice, folder, "d.png")).info
    attributes, _ = attributes_of(drawn(pumice, folder, "a.exr", "--dpi", "300").read_bytes())
    assert np.frombuffer(attributes["xDensity"], "<f4")[0] == 300 and np.frombuffer(attributes["pixelAspectRatio"], "<f4")[0] == 1
    assert "xDensity" not in attributes_of(drawn(pumice, folder, "b.exr").read_bytes())[0]


def bar_length(darkness):
    """Length in pixels of a black bar that a picture shows over a plain backdrop, from the coverage of its middle row."""
    height = darkness.shape[0]
    # 4 mm from the lower side, 0.7 mm thick.
    row = round(height - 4 * MM - 0.35 * MM)
    return darkness[row].sum()


def coverage(plain, marked):
    """Part of each pixel that is covered by black; 0 where it was black before."""
    return 1 - np.divide(marked, plain, out=np.ones_like(plain), where=plain > 0)


def test_the_bar_of_an_orthographic_view_has_its_closed_form_length(pumice, folder):
    fields = json.loads((folder / "flat.json").read_text())
    matrix = np.array(fields["instances"][0]["world_from_index"]).reshape(4, 3)[:3]
    info = json.loads(run(pumice, "info", folder / "v.pumice", "--json").fine())
    assert info["unit"] == "mm"
    # The film is 300 pixels across for 12 world units.
    for length_mm in (20.0, 37.5):
        expected = length_mm * np.linalg.norm(matrix[0]) / info["spacing"][0] / 12.0 * 300
        said = f"{length_mm}mm"
        plain = planes(drawn(pumice, folder, "plain.exr", "--dpi", DPI))
        exr = planes(drawn(pumice, folder, "bar.exr", "--dpi", DPI, "--scale-bar", said))
        assert abs(bar_length(coverage(plain["G"], exr["G"])) - expected) < 0.25
        # The bar of 8 bits is mixed in linear light; a step there is up to 1/100 of a pixel at each end.
        before, after = (
            np.asarray(Image.open(drawn(pumice, folder, name, "--dpi", DPI, *bar)), dtype=float)[..., 1] / 255
            for name, bar in (("plain.png", []), ("bar.png", ["--scale-bar", said]))
        )
        linear = [np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4) for v in (before, after)]
        assert abs(bar_length(coverage(*linear)) - expected) < 0.25
        # In µm it is the same bar, with another text.
        same = planes(drawn(pumice, folder, "um.exr", "--dpi", DPI, "--scale-bar", f"{length_mm * 1000}um"))
        np.testing.assert_array_equal(same["G"], exr["G"])
    # Negative control: another length is another bar.
    other = planes(drawn(pumice, folder, "other.exr", "--dpi", DPI, "--scale-bar", "38mm"))
    assert abs(bar_length(coverage(plain["G"], other["G"])) - expected) > 0.25


def test_in_perspective_a_bar_needs_its_plane_and_scales_with_its_distance(pumice, folder):
    fields = json.loads((folder / "s.json").read_text())
    fields["world"]["backdrop"] = [[0.8, 0.8, 0.8], [0.8, 0.8, 0.8]]
    (folder / "deep.json").write_text(json.dumps(fields))
    matrix = np.array(fields["instances"][0]["world_from_index"]).reshape(4, 3)[:3]
    spacing = json.loads(run(pumice, "info", folder / "v.pumice", "--json").fine())["spacing"]
    plain = planes(drawn(pumice, folder, "plain.exr", "--dpi", DPI, scene="deep.json"))
    for distance in (10.0, 20.0):
        half = np.tan(fields["camera"]["projection"]["perspective"]["fov_rad"] / 2)
        expected = 20 * np.linalg.norm(matrix[0]) / spacing[0] / (2 * half * distance) * 300
        bar = planes(drawn(pumice, folder, "bar.exr", "--dpi", DPI, "--scale-bar", f"20mm@{distance}", scene="deep.json"))
        assert abs(bar_length(coverage(plain["G"], bar["G"])) - expected) < 0.25
    for wish, said in [("20mm", "in a perspective view"), ("20mm@focus", "no depth of field"), ("auto", "in a perspective view")]:
        line = run(pumice, "render", folder / "deep.json", "-o", folder / "no.png", *FAST, "--scale-bar", wish).refused()
        assert said in line and not (folder / "no.png").exists(), line
    run(pumice, "render", folder / "deep.json", "-o", folder / "c.png", *FAST, "--dpi", DPI, "--scale-bar", "auto@center").fine()


@pytest.mark.parametrize("view", ["standard", "agx"])
def test_the_legend_has_the_colors_of_the_labels_whatever_the_view_transform(pumice, folder, view):
    fields = json.loads((folder / "flat.json").read_text())
    listed = run(pumice, "info", folder / "v.pumice", "--labels", "--csv", "--sort", "voxels").fine().splitlines()
    ids = [line.split(",")[0] for line in listed[1:4]]
    wanted = [[0.9, 0.05, 0.1], [0.1, 0.6, 0.2], [0.05, 0.1, 0.8]]
    fields["instances"][0]["style"]["materials"] = {i: {"base_color": c} for i, c in zip(ids, wanted)}
    (folder / "colors.json").write_text(json.dumps(fields))
    wishes = ["--dpi", DPI, "--legend=3"]
    png = np.asarray(Image.open(drawn(pumice, folder, "l.png", *wishes, "--view-transform", view, scene="colors.json")))
    exr = planes(drawn(pumice, folder, "l.exr", *wishes, scene="colors.json"))
    for i, color in enumerate(wanted):
        # Swatches of 0.7 of 3 mm, 1.4 of 3 mm apart, 4 mm from the sides.
        y, x = round(4 * MM + (1.4 * 3 * i + 1) * MM), round(5 * MM)
        encoded = [round(255 * (c * 12.92 if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055)) for c in color]
        assert png[y, x].tolist() == encoded, i
        assert [float(exr[c][y, x]) for c in "RGB"] == pytest.approx(color, rel=1e-6)


def test_characters_that_the_font_lacks_are_named(pumice, data, tmp_path):
    (tmp_path / "t.csv").write_text("id,name\n1,漢β\n2,β\n")
    run(pumice, "compress", data / "slicer_Segmentation.seg.nrrd", "-o", tmp_path / "v.pumice", "--table", tmp_path / "t.csv")
    for labels, lacks in (("1", True), ("2", False)):
        wishes = ["--dpi", DPI, "--legend", "--labels", labels, "--size", "300x200"]
        done = run(pumice, "render", tmp_path / "v.pumice", "-o", tmp_path / "a.png", *FAST, *wishes)
        assert done.code == 0 and ("the font lacks 漢," in done.err) == lacks, done


def test_bar_and_legend_change_no_pass_and_come_again(pumice, folder):
    wishes = ["--width-mm", "60", "--dpi", DPI, "--scale-bar", "auto", "--legend=2"]
    marked = drawn(pumice, folder, "m.exr", *wishes)
    plain = planes(drawn(pumice, folder, "p.exr", *wishes[:4]))
    for name, plane in planes(marked).items():
        is_same = np.array_equal(plane, plain[name])
        assert is_same == (name not in ("R", "G", "B")), name
    run(pumice, "render", "--again", marked, "-o", folder / "again.exr").fine()
    assert (folder / "again.exr").read_bytes() == marked.read_bytes()
    first = drawn(pumice, folder, "m.png", *wishes)
    run(pumice, "render", "--again", first, "-o", folder / "again.png").fine()
    assert (folder / "again.png").read_bytes() == first.read_bytes()


def test_bad_wishes_are_refused_in_one_line_before_anything_is_written(pumice, folder):
    for wishes, said in [
        (["--width-mm", "85", "--size", "10x10"], "--width-mm"),
        (["--width-mm", "0"], "expected a number above 0"),
        (["--width-mm", "nan"], "expected a number above 0"),
        (["--width-mm", "1e9"], "--width-mm: 1000000000 mm at 300 dpi are 11811023622 pixels, expected 1 to 65536"),
        (["--width-mm", "0.01"], "are 0 pixels"),
        (["--dpi=-3"], "expected a number above 0"),
        (["--dpi", "1e9"], "dpi: expected 1 to 100000"),
        (["--scale-bar", "10 parsecs"], "expected a length with nm, um, mm or m"),
        (["--scale-bar", "0mm"], "expected a length"),
        (["--scale-bar", "5m"], "pixels long"),
        (["--scale-bar", "1nm"], "pixels long"),
        (["--scale-bar", "auto", "--dpi", "3000"], "pixels"),
        (["--scale-bar", "auto", "--scale-bar-corner", "left"], "expected lower-right, lower-left, upper-right or upper-left"),
        (["--scale-bar-corner", "lower-left"], "--scale-bar"),
        (["--scale-bar", "auto", "--scale-bar-corner", "upper-left", "--legend"], "the legend is in the upper left corner"),
        (["--legend=0"], "0 is not in"),
        (["--legend=x"], "x"),
        (["--legend", "--dpi", "3000"], "legend: a picture of 300 × 200 pixels"),
        (["--legend", "--mode", "ao"], "legend: in ambient occlusion"),
    ]:
        fast = [] if "ao" in wishes else FAST  # ambient occlusion has no bounces to limit
        line = run(pumice, "render", folder / "flat.json", "-o", folder / "bad.png", *fast, *wishes).refused()
        assert said in line and not (folder / "bad.png").exists(), (wishes, line)
    fields = json.loads((folder / "flat.json").read_text())
    fields["instances"][0]["world_from_index"][0:3] = [2 * v for v in fields["instances"][0]["world_from_index"][0:3]]
    (folder / "uneven.json").write_text(json.dumps(fields))
    line = run(pumice, "render", folder / "uneven.json", "-o", folder / "bad.png", *FAST, "--scale-bar", "auto").refused()
    assert "scaled unevenly" in line
