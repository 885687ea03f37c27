"""Tests `pumice.ReferencePicture` against numpy's means and variances, scipy's Welch test, and all halves of a set of pictures."""

import itertools

import numpy as np
import pumice
import pytest
import scipy.stats

SIZE = (16, 24, 3)


def pictures(seed, count, factor=1.0):
    """Pictures with exponentially distributed pixels about a gradient, as skewed as those of a path tracer."""
    random = np.random.default_rng(seed)
    mean = np.linspace(0.1, 1.0, SIZE[1])[None, :, None] * np.ones(SIZE)
    return (factor * mean * random.exponential(size=(count, *SIZE))).astype(np.float32).astype(np.float64)


def tiles(of):
    return of.reshape(len(of), SIZE[0] // 8, 8, SIZE[1] // 8, 8, 3).mean(axis=(2, 4))


def variance_of_mean(of):
    return of.var(axis=0, ddof=1) / len(of)


def test_arrays_are_means_and_their_variances():
    theirs = pictures(1, 40)
    reference = pumice.ReferencePicture.of(theirs)
    assert reference.seeds == 40
    for found, expected in [
        (reference.mean, theirs.mean(axis=0)),
        (reference.variance, variance_of_mean(theirs)),
        (reference.tile_variance, variance_of_mean(tiles(theirs))),
        (reference.total_variance, variance_of_mean(theirs.mean(axis=(1, 2)))),
    ]:
        # Sums of some hundred doubles.
        np.testing.assert_allclose(found, expected, rtol=1e-11)
    noise = {"variance": reference.variance, "tile_variance": reference.tile_variance, "total_variance": reference.total_variance}
    stored = pumice.ReferencePicture(reference.mean, **noise, seeds=40)
    again, before = (which.judge(pictures(2, 8)) for which in (stored, reference))
    assert again.pop("ratio_by_chance") == before.pop("ratio_by_chance") and again.pop("sentence") == before.pop("sentence")
    # The variances are divided by the number of seeds, and multiplied again.
    assert again == pytest.approx(before, rel=1e-12)


@pytest.mark.parametrize("factor", [1.0, 1.05])
def test_statistics_are_those_of_other_programs(factor):
    theirs, ours = pictures(1, 200), pictures(3, 16, factor)
    found = pumice.ReferencePicture.of(theirs).judge(ours)
    ratio = ((ours.mean(axis=0) - theirs.mean(axis=0)) ** 2).sum() / (variance_of_mean(ours) + variance_of_mean(theirs)).sum()
    chances = scipy.stats.ttest_ind(tiles(ours), tiles(theirs), equal_var=False).pvalue
    whole = scipy.stats.ttest_ind(ours.mean(axis=(1, 2)), theirs.mean(axis=(1, 2)), equal_var=False).statistic
    # The share 2e-6 of each mean that counts as rounding is a thousandth of its standard error, and a millionth of its variance.
    assert found["ratio"] == pytest.approx(ratio, rel=1e-9)
    assert found["smallest_p"] == pytest.approx(chances.min(), rel=1e-5)
    assert found["mean_in_standard_errors"] == pytest.approx(np.abs(whole).max(), rel=1e-5)
    assert found["mean_difference"] == pytest.approx(ours.mean() / theirs.mean() - 1, rel=1e-9)
    bound = 1 - 0.99 ** (1 / chances.size)
    assert (found["tests"], found["rejected"]) == (chances.size, (chances < bound).sum())
    assert found["agrees"] == (factor == 1.0) and found["sentence"].startswith("agrees" if factor == 1.0 else "DIFFERS")


def test_the_interval_by_chance_is_that_of_all_halves():
    ours = pictures(4, 8)
    apart = [
        ours[list(half)].mean(axis=0) - ours[[i for i in range(8) if i not in half]].mean(axis=0)
        for half in itertools.combinations(range(8), 4)
    ]
    ratios = np.array([(d**2).sum() for d in apart]) / (4 * variance_of_mean(ours).sum())
    # Each of the 35 different ratios comes 57 times in 2,000 draws, so the outer 0.5 % are the least and the largest. Sums are of 32-bit
    # products.
    found = pumice.ReferencePicture.of(pictures(1, 40)).judge(ours)["ratio_by_chance"]
    assert found == pytest.approx([ratios.min(), ratios.max()], rel=1e-5)


def test_what_cannot_be_judged_is_refused():
    reference = pumice.ReferencePicture.of(pictures(1, 4))
    broken = pictures(2, 4)
    broken[3, 5, 7, 1] = np.nan
    for refused, what in [
        (lambda: reference.judge(pictures(2, 3)), "expected 4 pictures or more, got 3"),
        (lambda: reference.judge(pictures(2, 4)[:, :8]), "expected pictures of 24 × 16 pixels, got 24 × 8"),
        (lambda: reference.judge(broken), r"picture 3, pixel \(7, 5\): expected finite numbers"),
        (lambda: reference.judge(pictures(2, 4)[..., :2]), r"expected the shape \(n, height, width, 3\), got \(4, 16, 24, 2\)"),
        (lambda: pumice.ReferencePicture.of(pictures(1, 1)), "two pictures or more"),
    ]:
        with pytest.raises(pumice.InputError, match=what):
            refused()
    good = {"variance": reference.variance, "tile_variance": reference.tile_variance, "total_variance": reference.total_variance}
    for change, what in [
        ({"variance": reference.variance[1:]}, r"variance: expected the shape \(16, 24, 3\), got \(15, 24, 3\)"),
        ({"tile_variance": -reference.tile_variance}, "tile_variance: expected finite variances of 0 or more, got -"),
        ({"seeds": 1}, "seeds: expected 2 to"),
    ]:
        with pytest.raises(pumice.InputError, match=what):
            pumice.ReferencePicture(reference.mean, **{**good, "seeds": 4, **change})
    with pytest.raises(pumice.InputError, match=r"mean: expected the shape \(height, width, 3\), got \(16, 24\)"):
        pumice.ReferencePicture(reference.mean[..., 0], **good, seeds=4)
