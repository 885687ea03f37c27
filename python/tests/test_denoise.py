"""`denoise=True`: the same picture as without, filtered, beside the mean of its samples. Open Image Denoise itself is the subject of
`blender-addon/tests/test_oidn.py`."""

import numpy as np
import pumice
import pytest


@pytest.fixture
def scene(volume):
    return pumice.figure(volume, size=(60, 40))


def test_the_picture_is_denoised_and_keeps_the_mean_of_its_samples(scene, volume):
    raw = pumice.render(scene, volume, spp=8, backend="cpu")
    smooth = pumice.render(scene, volume, spp=8, backend="cpu", denoise=True)
    assert raw.noisy is None and raw.denoised is None
    assert smooth.denoised == "statistical, biased"
    np.testing.assert_array_equal(smooth.noisy, raw.color)
    np.testing.assert_array_equal(smooth.variance, raw.variance)
    assert not np.array_equal(smooth.color, raw.color)
    kept = pumice.Renderer(backend="cpu").render(scene, [volume], spp=8, denoise=True)
    np.testing.assert_array_equal(kept.color, smooth.color)


def test_a_file_keeps_both_and_says_so(scene, volume, tmp_path):
    smooth = pumice.render(scene, volume, spp=8, backend="cpu", denoise=True)
    smooth.save(tmp_path / "a.exr")
    back = pumice.open_picture(tmp_path / "a.exr")
    assert back.denoised == smooth.denoised
    np.testing.assert_array_equal(back.color, smooth.color)
    np.testing.assert_array_equal(back.noisy, smooth.noisy)


@pytest.mark.parametrize("no", [False, np.False_])
def test_names_and_truths_choose_the_denoiser(scene, volume, no):
    smooth, named = (pumice.render(scene, volume, spp=8, backend="cpu", denoise=yes).color for yes in (True, "statistical"))
    np.testing.assert_array_equal(named, smooth)
    assert pumice.render(scene, volume, spp=1, backend="cpu", denoise=no).denoised is None


@pytest.mark.parametrize("wrong", ["", "optix", "True", "oidn:", None, 1, 0.5, ["oidn"]])
def test_other_denoisers_are_refused(scene, volume, wrong):
    expected = "^denoise: expected .*statistical.*oidn.*, got "
    with pytest.raises(pumice.InputError, match=expected):
        pumice.render(scene, volume, spp=1, backend="cpu", denoise=wrong)
    with pytest.raises(pumice.InputError, match=expected):
        pumice.Renderer(backend="cpu").render(scene, [volume], spp=1, denoise=wrong)


def test_a_missing_library_is_one_line_before_the_render(scene, volume, monkeypatch, tmp_path):
    for name in ("oidn", f"oidn:{tmp_path}/none.so"):
        monkeypatch.setenv("PUMICE_OIDN", f"{tmp_path}/none.so")
        with pytest.raises(pumice.InputError, match=r"^Open Image Denoise: tried .*none\.so.*; set PUMICE_OIDN to the path of "):
            pumice.render(scene, volume, spp=1 << 30, backend="cpu", denoise=name)


@pytest.mark.parametrize("wrong", ["oidn", "optix", 1])
def test_live_pictures_have_the_statistical_denoiser_alone(scene, volume, wrong):
    with pytest.raises(pumice.InputError, match="^denoise: expected True, False"):
        pumice.Session(scene, volume, spp=1, backend="cpu", denoise=wrong)
    pumice.Session(scene, volume, spp=1, backend="cpu", denoise="statistical").stop()
