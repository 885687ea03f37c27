"""`pumice render --denoise`: the picture is smoother and says that it is biased; the mean of the samples stays beside it, bit for bit.

What the filter itself does is the subject of the tests in `picture/src/denoise/tests.rs`. Files are read by numpy, zlib and Pillow.
"""

import json

import numpy as np
import pytest
from command import run
from exr_planes import attributes_of, planes
from PIL import Image

SMALL = ["--size", "48x32", "--spp", "8", "--backend", "cpu"]
SAID = "statistical, biased"


def colors(found, layer=""):
    return np.stack([found[f"{layer}{channel}"] for channel in "RGB"], axis=2)


def told(path):
    """What an OpenEXR file says of how it was made."""
    attributes, _ = attributes_of(path.read_bytes())
    return json.loads(attributes["pumice"])


@pytest.fixture(scope="module")
def study(pumice, tmp_path_factory):
    """A folder with a.pumice, and its pictures raw.exr and smooth.exr of the same samples."""
    root = tmp_path_factory.mktemp("denoise")
    labels = np.zeros((12, 12, 12), np.uint8)
    labels[2:10, 2:10, 2:6], labels[2:10, 2:10, 6:10] = 1, 2
    np.save(root / "a.npy", labels)
    run(pumice, "compress", root / "a.npy", "-o", root / "a.pumice").fine()
    run(pumice, "render", root / "a.pumice", "-o", root / "raw.exr", *SMALL).fine()
    said = run(pumice, "render", root / "a.pumice", "-o", root / "smooth.exr", "--denoise", "--json", root / "r.json", *SMALL).fine()
    assert "before denoising, denoised (biased)" in said
    return root


def test_the_mean_of_the_samples_stays_beside_the_denoised_picture(study):
    raw, smooth = planes(study / "raw.exr"), planes(study / "smooth.exr")
    noisy = "ViewLayer.Noisy Image."
    assert set(smooth) - set(raw) == {f"{noisy}{channel}" for channel in "RGB"}
    assert np.array_equal(colors(smooth, noisy), colors(raw)), "bit for bit"
    assert not np.array_equal(colors(smooth), colors(raw))
    assert all(np.array_equal(smooth[name], raw[name]) for name in raw if name not in "RGB"), "every other pass is the same"
    # Noise is what differs between neighbours of one label beyond what the light does: it is less in every channel.
    inside = (raw["label.index"][:, 1:] == raw["label.index"][:, :-1]) & (raw["label.index"][:, 1:] > 0)
    rough = [np.abs(np.diff(colors(found), axis=1))[inside].mean(axis=0) for found in (raw, smooth)]
    assert (rough[1] < 0.7 * rough[0]).all(), rough
    # Nothing is seen behind the figure, and nothing there changes.
    behind = np.isinf(raw["ViewLayer.Depth.Z"])
    assert behind.any() and np.array_equal(colors(smooth)[behind], colors(raw)[behind])


def test_file_and_report_say_that_the_picture_is_denoised_and_others_say_nothing(pumice, study):
    assert told(study / "smooth.exr")["denoised"] == SAID and "denoised" not in told(study / "raw.exr")
    report = json.loads((study / "r.json").read_text())
    assert report["denoised"] == SAID and len(report["denoise_seconds"]) == 2
    run(pumice, "render", study / "a.pumice", "-o", study / "s.png", "--denoise", *SMALL).fine()
    assert json.loads(Image.open(study / "s.png").text["pumice"])["denoised"] == SAID
    run(pumice, "render", study / "a.pumice", "-o", study / "n.exr", "--denoise", "--passes", "none", *SMALL).fine()
    assert set(planes(study / "n.exr")) == set("RGB")


def test_a_denoised_picture_is_made_again_denoised_and_a_raw_one_raw(pumice, study):
    for name in ("smooth", "raw"):
        run(pumice, "render", "--again", study / f"{name}.exr", "-o", study / "again.exr").fine()
        first, second = planes(study / f"{name}.exr"), planes(study / "again.exr")
        assert set(first) == set(second) and all(np.array_equal(first[key], second[key]) for key in first), name
    line = run(pumice, "render", "--again", study / "raw.exr", "-o", study / "x.exr", "--denoise")
    assert line.code == 2 and "--denoise" in line.err and "--again" in line.err


def test_denoised_pictures_get_no_statistical_test_and_are_never_verified(pumice, study):
    def statistics(a, b):
        run(pumice, "compare", study / a, study / b, "--json", study / "c.json").fine()
        return json.loads((study / "c.json").read_text()).get("chance")

    assert statistics("raw.exr", "raw.exr") is not None
    assert statistics("smooth.exr", "raw.exr") is None and statistics("raw.exr", "smooth.exr") is None
    refused = run(pumice, "verify-render", study / "a.pumice", "--with-blender", "python3", "--denoise")
    assert refused.code == 2 and "--denoise" in refused.err


def test_turntables_are_denoised_too(pumice, study):
    run(pumice, "render", study / "a.pumice", "-o", study / "t.exr", "--denoise", "--turntable", "2", *SMALL).fine()
    assert all(told(study / f"t_{number:04}.exr")["denoised"] == SAID for number in (1, 2))
