"""`denoise=True`: the same picture as without, filtered, beside the mean of its samples."""

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
