"""Compares image metrics with independent ones: NVIDIA's FLIP, scikit-image's SSIM and PSNR, scipy's Welch test, numpy's arithmetic."""

import json
import subprocess

import flip_evaluator
import numpy as np
import pytest
from scipy import stats
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

SIZE = (97, 61)  # width, height: odd, not multiples of a tile


@pytest.fixture(scope="module")
def compare_raw(rust_example, tmp_path_factory):
    binary = rust_example("compare_raw")
    folder = tmp_path_factory.mktemp("metrics")

    def compare(a, b, variances=(), degrees=None):
        height, width, _ = a.shape
        paths = []
        for i, picture in enumerate([a, b, *variances]):
            paths.append(folder / f"{i}.raw")
            picture.astype("<f4").tofile(paths[-1])
        command = [binary, str(width), str(height), *paths, *([str(degrees)] if variances else [])]
        done = subprocess.run([*command, "--map", folder / "map.raw"], capture_output=True, text=True, check=True)
        return json.loads(done.stdout), np.fromfile(folder / "map.raw", "<f8").reshape(height, width)

    return compare


def pictures(kind):
    """(picture, reference): a reference with gradients, hard edges, dots and saturated colours, and a picture with this kind of fault."""
    width, height = SIZE
    random = np.random.default_rng(7)
    y, x = np.mgrid[0:height, 0:width]
    reference = np.stack([x / width, y / height, 0.5 + 0.5 * np.sin(x * y / 90)], axis=-1)
    reference[20:40, 30:60] = [0.9, 0.1, 0.05]
    reference[50, 10:90:7] = 1.0
    if kind == "noise":
        test = reference * random.gamma(8, 1 / 8, reference.shape)  # means 1, some above 1: clamped on a screen
    elif kind == "blur":
        test = (reference + np.roll(reference, 1, 0) + np.roll(reference, 1, 1)) / 3
    elif kind == "tint":
        test = reference * [1.0, 0.9, 1.05]
    elif kind == "shift":
        test = np.roll(reference, 2, axis=1)
    elif kind == "black":
        test = np.zeros_like(reference)
    elif kind == "complement":
        test = 1 - reference
    return test.astype(np.float32), reference.astype(np.float32)


def srgb(linear):
    v = np.clip(linear.astype(np.float64), 0, 1)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055).astype(np.float32)


KINDS = ["noise", "blur", "tint", "shift", "black", "complement"]


@pytest.mark.parametrize("kind", KINDS)
def test_rel_mse_matches_numpy(compare_raw, kind):
    a, b = (p.astype(np.float64) for p in pictures(kind))
    got, _ = compare_raw(a, b)
    assert got["rel_mse"] == pytest.approx(np.mean((a - b) ** 2 / (b**2 + 0.01)), rel=1e-12)  # order of summation


@pytest.mark.parametrize("kind", KINDS)
def test_psnr_and_ssim_match_scikit_image(compare_raw, kind):
    a, b = pictures(kind)
    got, _ = compare_raw(a, b)
    a, b = srgb(a).astype(np.float64), srgb(b).astype(np.float64)
    # numpy's and Rust's pow differ by one ulp before the rounding to f32, which is 6e-8 on single values.
    assert got["psnr"] == pytest.approx(peak_signal_noise_ratio(b, a, data_range=1), abs=1e-5)
    expected = structural_similarity(
        b, a, channel_axis=2, data_range=1, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
    )
    assert got["ssim"] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_flip_matches_nvidias(compare_raw, kind):
    a, b = pictures(kind)
    got, ours = compare_raw(a, b)
    theirs, mean, _ = flip_evaluator.evaluate(srgb(b), srgb(a), "LDR", applyMagma=False)
    # NVIDIA's computes in f32 with f32 filters. The square root in the feature term turns 1e-7 of luminance into 3e-4 of FLIP.
    assert got["flip"] == pytest.approx(mean, abs=1e-4)
    assert np.abs(ours - theirs[..., 0]).max() < 2e-3
    assert got["flip"] == pytest.approx(ours.mean(), rel=1e-12)


def test_flip_check_notices_a_wrong_viewing_distance(compare_raw):
    """Negative control of the tolerance above: an error of 10 % in pixels per degree is detected."""
    a, b = pictures("noise")
    got, _ = compare_raw(a, b)
    _, mean, _ = flip_evaluator.evaluate(srgb(b), srgb(a), "LDR", applyMagma=False, parameters={"ppd": 67.02 * 1.1})
    assert abs(got["flip"] - mean) > 1e-3


def test_equal_pictures(compare_raw):
    _, b = pictures("tint")
    got, _ = compare_raw(b, b)
    assert (got["rel_mse"], got["psnr"], got["flip"]) == (0, None, 0)
    assert got["ssim"] == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("degrees", [1.0, 3.0, 15.0, float("inf")])
def test_chance_matches_scipy(compare_raw, degrees):
    """Recomputes p-values, Satterthwaite's degrees of freedom and Šidák's level tile by tile."""
    random = np.random.default_rng(11)
    _, b = pictures("tint")
    va, vb = (random.gamma(2, 0.001, b.shape).astype(np.float32) for _ in range(2))
    a = (b + random.normal(0, np.sqrt(va + vb))).astype(np.float32)
    a[8:16, 24:32, 1] += 0.05  # one tile that differs
    got, _ = compare_raw(a, b, [va, vb], degrees)
    chance = got["chance"]

    width, height = SIZE
    a, b, va, vb = (p.astype(np.float64) for p in (a, b, va, vb))
    smallest, where, rejected, tests = 1.0, None, 0, 0
    count = 3 * -(-width // 8) * -(-height // 8)
    level = 1 - 0.99 ** (1 / count)
    for y in range(0, height, 8):
        for x in range(0, width, 8):
            for c in range(3):
                cut = np.s_[y : y + 8, x : x + 8, c]
                variance = va[cut].sum() + vb[cut].sum()
                freedom = variance**2 / ((va[cut] ** 2).sum() / degrees + (vb[cut] ** 2).sum() / degrees) \
                    if np.isfinite(degrees) else np.inf
                t = (a[cut] - b[cut]).sum() / np.sqrt(variance)
                p = 2 * (stats.t.sf(abs(t), freedom) if np.isfinite(freedom) else stats.norm.sf(abs(t)))
                tests += 1
                rejected += p < level
                if p < smallest:
                    smallest, where = p, [x, y]
    assert (chance["tests"], chance["rejected"], chance["worst_tile"]) == (tests, rejected, where)
    assert rejected >= 1 and where == [24, 8]
    assert chance["level_per_test"] == pytest.approx(level, rel=1e-9)
    assert chance["smallest_p"] == pytest.approx(smallest, rel=1e-6)  # scipy's own tail near 1e-20 is good to this
    difference = (a - b).reshape(-1, 3)
    expected = difference.sum(0) / np.sqrt((va + vb).reshape(-1, 3).sum(0))
    assert chance["mean_difference_in_standard_errors"] == pytest.approx(expected, rel=1e-9)
    assert chance["mean_difference"] == pytest.approx(difference.mean(0), rel=1e-9)
    assert chance["mse_over_expected"] == pytest.approx((difference**2).mean(0) / (va + vb).reshape(-1, 3).mean(0))
