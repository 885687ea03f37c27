"""Tests statistically whether two renderers converge to the same picture: pictures of several seeds against a reference's mean and variance.

With m the mean over n seeds and v its variance, R the reference and V its variance, all per pixel and channel:

    ratio   Σ (m − R)² / Σ (v + V) is 1 in expectation if they agree. Its distribution by chance comes from the pictures themselves: random
            halves of the seeds, drawn 2,000 times, give the same ratio between pictures that agree. It must lie in their middle 99 %
    tiles   Welch's t of each tile of 8 × 8 pixels and each channel; none may exceed Šidák's bound at 1 % for all of them together
    mean    the mean of the whole picture must be within 4 standard errors, in each channel

Two of a hundred pictures that agree fail one of these by chance. So a failure is tested again (`heard`) with four times the seeds, all of
them new. A picture that agrees fails both times in about 1 of 2,500 cases, while a real difference only becomes clearer.
"""

import dataclasses
import math

import numpy as np

TILE = 8
DEALS = 2000
LEVEL = 0.01
STANDARD_ERRORS = 4.0
# Differences below this share of the mean count as rounding (float32 sums of up to 2^14 samples), whatever the noise.
ROUNDING = 2e-6


@dataclasses.dataclass(frozen=True)
class Reference:
    """A mean picture (height, width, channels), the variance of that mean by pixel, by tile and of the whole, and the number of seeds."""

    mean: np.ndarray
    variance: np.ndarray
    tile_variance: np.ndarray
    total_variance: np.ndarray
    seeds: int

    @classmethod
    def of(cls, pictures):
        """The reference from pictures of many seeds (seeds, height, width, channels)."""
        pictures = np.asarray(pictures, dtype=np.float64)
        n = len(pictures)
        return cls(
            pictures.mean(axis=0),
            pictures.var(axis=0, ddof=1) / n,
            tiles(pictures).var(axis=0, ddof=1) / n,
            pictures.mean(axis=(1, 2)).var(axis=0, ddof=1) / n,
            n,
        )


@dataclasses.dataclass(frozen=True)
class Verdict:
    """The statistics of a comparison; `agrees` is its result."""

    ratio: float
    low: float
    high: float
    tiles_beyond: int
    tiles_judged: int
    worst_tile: float
    mean_errors: float
    mean_difference: float

    @property
    def agrees(self):
        return self.low <= self.ratio <= self.high and self.tiles_beyond == 0 and self.mean_errors <= STANDARD_ERRORS

    def __str__(self):
        return (
            f"{'agrees' if self.agrees else 'DIFFERS'}: ratio {self.ratio:.3f} of {self.low:.3f} to {self.high:.3f}, "
            f"{self.tiles_beyond} of {self.tiles_judged} tiles beyond (least chance × tiles {self.worst_tile:.2g}), "
            f"mean off by {self.mean_difference:+.2e} = {self.mean_errors:.2f} standard errors"
        )


def tiles(pictures):
    """Means of tiles: (seeds, rows, columns, channels)."""
    n, height, width, channels = pictures.shape
    if height % TILE or width % TILE:
        raise ValueError(f"expected a picture whose width and height are multiples of {TILE}, got {width} × {height}")
    return pictures.reshape(n, height // TILE, TILE, width // TILE, TILE, channels).mean(axis=(2, 4))


def judge(pictures, reference):
    """The verdict on pictures of several seeds (seeds, height, width, channels)."""
    pictures = np.asarray(pictures, dtype=np.float64)
    n = len(pictures)
    mean, variance = pictures.mean(axis=0), pictures.var(axis=0, ddof=1) / n
    off = mean - reference.mean
    floor = (ROUNDING * np.abs(reference.mean)) ** 2
    ratio = (off**2).sum() / (variance + reference.variance + floor).sum()
    low, high = chance_interval(pictures, floor)

    own = tiles(pictures)
    va, vb = own.var(axis=0, ddof=1) / n, reference.tile_variance
    apart = np.abs(own.mean(axis=0) - tiles(reference.mean[None])[0])
    scale = ROUNDING * np.abs(tiles(reference.mean[None])[0])
    # A tile without noise in either picture has one value, and only rounding may make a difference.
    noisy = va + vb > scale**2
    t = apart[noisy] / np.sqrt((va + vb)[noisy])
    freedom = (va + vb)[noisy] ** 2 / (va[noisy] ** 2 / (n - 1) + vb[noisy] ** 2 / (reference.seeds - 1))
    chances = two_sided(t, freedom)
    judged = max(1, len(chances))
    bound = 1.0 - (1.0 - LEVEL) ** (1.0 / judged)
    beyond = int((chances < bound).sum() + (apart[~noisy] > 10 * scale[~noisy]).sum())

    whole = pictures.mean(axis=(1, 2))
    total = reference.mean.mean(axis=(0, 1))
    apart = whole.mean(axis=0) - total
    error = np.sqrt(whole.var(axis=0, ddof=1) / n + reference.total_variance + (ROUNDING * total) ** 2)
    return Verdict(
        ratio=float(ratio),
        low=low,
        high=high,
        tiles_beyond=beyond,
        tiles_judged=judged,
        worst_tile=float(chances.min(initial=1.0) * judged),
        mean_errors=float((np.abs(apart) / error).max()),
        mean_difference=float(apart.sum() / total.sum()),
    )


def heard(draw, reference, seeds):
    """The verdict on `draw(first, n)`, which returns pictures of n seeds from number `first` on. A failure is tested again with four times
    as many new seeds."""
    first = judge(draw(0, seeds), reference)
    return first if first.agrees else judge(draw(seeds, 4 * seeds), reference)


def chance_interval(pictures, floor):
    """Bounds of the middle 99 % of the ratio between random halves of the same pictures."""
    n = len(pictures)
    rng = np.random.default_rng(1)
    half = n // 2
    # Each ratio needs only the sums over pixels of the products of two seeds.
    flat = pictures.reshape(n, -1)
    flat = flat - flat.mean(axis=0)
    products = flat @ flat.T
    noise = products.trace() / (n - 1) * (1 / half + 1 / (n - half)) + floor.sum()
    sides = np.array([np.where(rng.permutation(n) < half, 1.0 / half, -1.0 / (n - half)) for _ in range(DEALS)])
    ratios = (np.einsum("di,ij,dj->d", sides, products, sides) + floor.sum()) / noise
    low, high = np.quantile(ratios, [LEVEL / 2, 1 - LEVEL / 2])
    return float(low), float(high)


def two_sided(t, freedom):
    """Probability of a Student's t beyond ±t: 2 ∫ of its density by Simpson's rule over the angle θ with t = √f · tan θ. For arrays."""
    steps = 400
    low = np.arctan(t / np.sqrt(freedom))[:, None]
    angles = low + (math.pi / 2 - low) * np.linspace(0.0, 1.0, steps + 1)
    weights = np.ones(steps + 1)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    density = np.clip(np.cos(angles), 0.0, 1.0) ** (freedom[:, None] - 1.0)
    gammas = np.array([math.lgamma((f + 1) / 2) - math.lgamma(f / 2) for f in freedom])
    scale = np.exp(gammas) / math.sqrt(math.pi)
    return 2 * scale * (density * weights).sum(axis=1) * (math.pi / 2 - low[:, 0]) / steps / 3
