"""Tests size on paper, scale bar and legend of `pumice.render`; what they look like is tested through the command."""

import numpy as np
import pumice
import pytest
from PIL import Image


@pytest.fixture
def scene(volume):
    fields = pumice.figure(volume, size=(300, 200)).to_dict()
    fields["camera"]["projection"] = {"orthographic": {"scale": 14.0}}
    return pumice.Scene.from_dict(fields)


def test_files_and_display_values_have_bar_and_legend_and_arrays_do_not(scene, volume, tmp_path):
    wishes = {"spp": 1, "backend": "cpu", "dpi": 100}
    plain = pumice.render(scene, volume, **wishes)
    marked = pumice.render(scene, volume, scale_bar="auto", legend=3, **wishes)
    np.testing.assert_array_equal(marked.color, plain.color)
    assert (marked.srgb() != plain.srgb()).any(axis=-1).sum() > 300
    marked.save(tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as png:
        assert png.info["dpi"] == pytest.approx((100, 100), abs=0.02)
        np.testing.assert_array_equal(np.asarray(png), marked.srgb())
    marked.save(tmp_path / "a.exr")
    back = pumice.open_picture(tmp_path / "a.exr")
    # Both are mixed in linear light; the PNG's background is rounded before, by half a step of 8 bits, which text above it only lessens, and
    # both are rounded after. What is brighter than white is clamped before in the PNG, and after in the EXR.
    within = (plain.color <= 1).all(axis=-1)
    assert np.abs(back.srgb().astype(int) - marked.srgb())[within].max() <= 1 and within.mean() > 0.9
    np.testing.assert_array_equal(back.label, plain.label)


def test_a_figure_with_a_legend_shows_its_labels_beside_it(volume):
    size = {"size": (400, 250), "view": (90, 0)}
    pictures = {}
    for legend in (None, 3):
        scene = pumice.figure(volume, legend=legend, dpi=None if legend is None else 150, **size)
        plain, marked = (pumice.render(scene, volume, spp=1, backend="cpu", dpi=150, legend=drawn) for drawn in (None, 3))
        pictures[legend] = (plain.label > 0) & (marked.srgb() != plain.srgb()).any(axis=-1), plain.label > 0
    assert pictures[3][0].sum() == 0 and pictures[3][1].sum() > 1000
    # Negative control: the same labels without room for the legend.
    assert pictures[None][0].sum() > 100


@pytest.mark.parametrize("corner", [None, "lower_right", "lower_left", "upper_right", "upper_left"])
def test_a_scale_bar_stands_in_its_corner_alone(scene, volume, corner):
    wishes = {} if corner is None else {"scale_bar_corner": corner}
    plain, marked = (pumice.render(scene, volume, spp=1, backend="cpu", dpi=100, scale_bar=bar, **wishes) for bar in (None, "auto"))
    rows, columns = np.nonzero((plain.srgb() != marked.srgb()).any(axis=-1))
    is_upper, is_left = (corner or "lower_right").startswith("upper"), (corner or "lower_right").endswith("left")
    assert len(rows) > 50 and ((rows < 100) == is_upper).all() and ((columns < 150) == is_left).all()


def test_a_width_in_millimetres_sets_the_pixels(scene, volume):
    picture = pumice.render(scene, volume, spp=1, backend="cpu", width_mm=20, dpi=100)
    # 20 mm at 100 dpi are 78.7 pixels, in the shape 3 : 2.
    assert picture.color.shape == (53, 79, 3)
    assert scene.to_dict()["film"]["width"] == 300, "scenes are values"


@pytest.mark.parametrize(
    ("wishes", "said"),
    [
        ({"width_mm": 0}, "width_mm: expected a number above 0"),
        ({"width_mm": float("nan")}, "width_mm: expected"),
        ({"width_mm": "85"}, "width_mm: expected"),
        ({"width_mm": 1e9}, "film.width"),
        ({"dpi": float("inf")}, "dpi: expected"),
        ({"dpi": 1e6}, "dpi: expected 1 to 100000"),
        ({"scale_bar": 10}, "scale_bar: expected a text"),
        ({"scale_bar": "10 miles"}, "scale_bar: expected a length with nm"),
        ({"scale_bar": "1m"}, "scale bar 1m: it would be"),
        ({"scale_bar": "1mm", "scale_bar_corner": "middle"}, "scale_bar_corner: expected lower-right, lower-left"),
        ({"scale_bar": "1mm", "scale_bar_corner": None}, "scale_bar_corner: expected a text"),
        ({"scale_bar": "auto", "scale_bar_corner": "upper_left", "legend": 3}, "the legend is in the upper left corner"),
        ({"legend": 0}, "legend: expected 1 to"),
        ({"legend": 2.5}, "legend: expected a whole number"),
        ({"legend": 3, "dpi": 5000}, "legend: a picture of 300 × 200 pixels at 5000 dpi has no room"),
    ],
)
def test_wrong_wishes_are_refused(scene, volume, wishes, said):
    with pytest.raises(pumice.InputError, match=said):
        pumice.render(scene, volume, spp=1, backend="cpu", **wishes)
