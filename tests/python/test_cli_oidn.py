"""`pumice render --denoise=oidn`: which library is opened, what it is given, what files say, and what is refused before anything is rendered.

The library is a stand-in (`oidn_stand_in.c`) whose filter is one line of arithmetic. `blender-addon/tests/test_oidn.py` has the real one.
"""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from command import run
from exr_planes import attributes_of, planes
from PIL import Image

SMALL = ["--size", "24x16", "--spp", "8", "--backend", "cpu"]
SAID = "Open Image Denoise 2.7.1, biased"
NOISY, ALBEDO, NORMAL = "ViewLayer.Noisy Image.", "ViewLayer.Denoising Albedo.", "ViewLayer.Normal."


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """A function that compiles a stand-in with some definitions and gives its path."""

    def compiled(*definitions):
        path = tmp_path_factory.mktemp("oidn") / "libOpenImageDenoise.so.2"
        source = Path(__file__).with_name("oidn_stand_in.c")
        subprocess.run(["cc", "-shared", "-fPIC", *(f"-D{one}" for one in definitions), "-o", path, source], check=True)
        return path

    return compiled


@pytest.fixture(scope="module")
def two(library):
    return library("MAJOR=2")


@pytest.fixture(scope="module")
def volume(pumice, tmp_path_factory):
    root = tmp_path_factory.mktemp("denoise")
    labels = np.zeros((12, 12, 12), np.uint8)
    labels[2:10, 2:10, 2:6], labels[2:10, 2:10, 6:10] = 1, 2
    np.save(root / "a.npy", labels)
    run(pumice, "compress", root / "a.npy", "-o", root / "a.pumice").fine()
    return root / "a.pumice"


def layer(found, name=""):
    return np.stack([found[f"{name}{channel}"] for channel in ("XYZ" if name == NORMAL else "RGB")], axis=2)


def made_of(found):
    """What the stand-in makes of the passes of a picture."""
    return np.float32(2) * layer(found, NOISY) + layer(found, ALBEDO) + layer(found, NORMAL)


def test_the_library_gets_the_mean_of_the_samples_with_base_colour_and_normal(pumice, volume, two, tmp_path):
    out, raw = tmp_path / "a.exr", tmp_path / "raw.exr"
    said = run(pumice, "render", volume, "-o", out, "--denoise=oidn", "--json", tmp_path / "r.json", *SMALL, env={"PUMICE_OIDN": str(two)}).fine()
    assert "before denoising, denoised by Open Image Denoise 2.7.1 (biased)" in said
    run(pumice, "render", volume, "-o", raw, *SMALL).fine()
    smooth = planes(out)
    assert np.array_equal(layer(smooth, NOISY), layer(planes(raw))), "the mean of the samples stays, bit for bit"
    assert np.array_equal(layer(smooth), made_of(smooth)) and not np.array_equal(layer(smooth), layer(smooth, NOISY))
    # Everything says so.
    attributes, _ = attributes_of(out.read_bytes())
    assert json.loads(attributes["pumice"])["denoised"] == SAID == json.loads((tmp_path / "r.json").read_text())["denoised"]
    run(pumice, "render", volume, "-o", tmp_path / "a.png", f"--denoise=oidn:{two}", *SMALL).fine()
    assert json.loads(Image.open(tmp_path / "a.png").text["pumice"])["denoised"] == SAID
    # No statistical test of such a picture.
    run(pumice, "compare", raw, out, "--json", tmp_path / "c.json").fine()
    assert json.loads((tmp_path / "c.json").read_text()).get("chance") is None


def test_alpha_stays_and_so_does_an_empty_film(pumice, volume, two, tmp_path):
    out, raw = tmp_path / "a.exr", tmp_path / "raw.exr"
    run(pumice, "render", volume, "-o", raw, "--transparent", *SMALL).fine()
    run(pumice, "render", volume, "-o", out, "--transparent", f"--denoise=oidn:{two}", *SMALL).fine()
    before, after = planes(raw), planes(out)
    empty = before["A"] == 0
    assert empty.any() and not empty.all() and np.array_equal(after["A"], before["A"])
    assert np.array_equal(layer(after)[empty], layer(before)[empty])
    assert np.array_equal(layer(after)[~empty], made_of(after)[~empty])


def test_a_picture_is_made_again_by_the_library_of_this_machine(pumice, volume, two, tmp_path):
    first, second = tmp_path / "a.exr", tmp_path / "b.exr"
    run(pumice, "render", volume, "-o", first, f"--denoise=oidn:{two}", *SMALL).fine()
    run(pumice, "render", "--again", first, "-o", second, env={"PUMICE_OIDN": str(two)}).fine()
    a, b = planes(first), planes(second)
    assert set(a) == set(b) and all(np.array_equal(a[name], b[name]) for name in a)
    # Of another version it says so, and where there is none it is refused.
    other = tmp_path / "other.exr"
    other.write_bytes(first.read_bytes().replace(b"Denoise 2.7.1", b"Denoise 2.9.1"))
    said = run(pumice, "render", "--again", other, "-o", second, env={"PUMICE_OIDN": str(two)})
    assert said.code == 0 and "Open Image Denoise 2.7.1, and the earlier picture by Open Image Denoise 2.9.1" in said.err
    assert "PUMICE_OIDN" in run(pumice, "render", "--again", first, "-o", second, env={"PUMICE_OIDN": "/nowhere.so"}).refused()
    # A picture that names no denoiser that there is.
    other.write_bytes(first.read_bytes().replace(b"Denoise 2.7.1", b"Denoise 2.x.1"))
    assert "expected a denoiser" in run(pumice, "render", "--again", other, "-o", second, env={"PUMICE_OIDN": str(two)}).refused()


def test_turntables_go_through_it_too(pumice, volume, two, tmp_path):
    run(pumice, "render", volume, "-o", tmp_path / "t.exr", f"--denoise=oidn:{two}", "--turntable", "2", *SMALL).fine()
    for number in (1, 2):
        found = planes(tmp_path / f"t_{number:04}.exr")
        assert np.array_equal(layer(found), made_of(found))


@pytest.mark.parametrize(
    "what,said",
    [
        ("nothing", "(where the system looks for libraries): "),
        ("missing", "(of PUMICE_OIDN): cannot open shared object file"),
        ("text", "(of PUMICE_OIDN): "),
        ("libm.so.6", "(of PUMICE_OIDN): expected version 2, which has the function oidnNewDevice, got a library without it"),
        ("MAJOR=1", "(of PUMICE_OIDN): expected version 2, which has the function oidnSetDeviceInt, got a library without it"),
        ("MAJOR=3", "(of PUMICE_OIDN): expected version 2, got 3.7.1"),
        ("NO_DEVICE", "(of PUMICE_OIDN): no such device here"),
    ],
)
def test_a_library_that_does_not_serve_is_refused_before_anything_is_rendered(pumice, volume, library, tmp_path, what, said):
    (tmp_path / "text").write_text("not a library\n")
    given = {
        "nothing": "",
        "missing": str(tmp_path / "none.so"),
        "text": str(tmp_path / "text"),
        "libm.so.6": "libm.so.6",
    }
    named = given[what] if what in given else str(library("MAJOR=2" if what == "NO_DEVICE" else what, what))
    flags = ["--denoise=oidn", "--save-scene", tmp_path / "s.json", "--spp", "1000000000"]
    line = run(pumice, "render", volume, "-o", tmp_path / "a.exr", *flags, env={"PUMICE_OIDN": named}).refused()
    assert line.startswith("pumice: Open Image Denoise: tried ") and said in line, line
    assert line.endswith("; set PUMICE_OIDN to the path of libOpenImageDenoise.so.2"), line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["text"], "nothing is written"


def test_what_the_library_reports_is_one_line_and_no_picture(pumice, volume, library, tmp_path):
    broken = library("MAJOR=2", 'FAULT="out of memory"')
    line = run(pumice, "render", volume, "-o", tmp_path / "a.exr", f"--denoise=oidn:{broken}", *SMALL).refused()
    assert line == "pumice: Open Image Denoise 2.7.1: out of memory" and not any(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["", "true", "OIDN", "oidn:", "optix"])
def test_other_denoisers_are_refused(pumice, volume, tmp_path, name):
    line = run(pumice, "render", volume, "-o", tmp_path / "a.exr", f"--denoise={name}", *SMALL).refused()
    assert "--denoise" in line and "statistical" in line and "oidn" in line, line
