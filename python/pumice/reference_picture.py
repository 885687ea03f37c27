"""A picture that others are tested against again and again: the mean over many seeds, with its noise."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native, arguments
from .checked import checked
from .errors import InputError


# Pixels along the side of a tile.
TILE = 8


class ReferencePicture:
    """The mean of many pictures of one scene, each with a seed of its own, and its noise. Immutable; its arrays can be stored."""

    @checked
    def __init__(
        self,
        mean: npt.ArrayLike,
        *,
        variance: npt.ArrayLike,
        tile_variance: npt.ArrayLike,
        total_variance: npt.ArrayLike,
        seeds: int,
    ) -> None:
        """`mean` (height, width, 3) is the mean picture, `variance` the variance of that mean by pixel; `tile_variance`
        (rows, columns, 3) that of the mean of each tile of 8 × 8 pixels, `total_variance` (3,) that of the mean of the whole picture.
        `seeds` is the number of pictures, 2 or more."""
        shape = np.shape(mean)
        if len(shape) != 3 or shape[2] != 3:
            raise InputError(f"mean: expected the shape (height, width, 3), got {shape}")
        tiles = (-(-shape[0] // TILE), -(-shape[1] // TILE), 3)
        self._native = _native.ReferencePicture.stored(
            _array("mean", mean, shape),
            _array("variance", variance, shape),
            _array("tile_variance", tile_variance, tiles),
            _array("total_variance", total_variance, (3,)),
            arguments.whole("seeds", seeds, 2, arguments.MOST_32),
        )

    @classmethod
    @checked
    def of(cls, pictures: npt.ArrayLike) -> ReferencePicture:
        """The reference of `pictures` (n, height, width, 3), scene-linear, two or more. They are rounded to 32-bit floats."""
        made = cls.__new__(cls)
        made._native = _native.ReferencePicture.of(_pictures(pictures))
        return made

    @property
    def mean(self) -> npt.NDArray[np.float64]:
        """The mean picture: (height, width, 3)."""
        return np.asarray(self._native.arrays()[0])

    @property
    def variance(self) -> npt.NDArray[np.float64]:
        """Variance of the mean, by pixel: (height, width, 3)."""
        return np.asarray(self._native.arrays()[1])

    @property
    def tile_variance(self) -> npt.NDArray[np.float64]:
        """Variance of the mean of each tile of 8 × 8 pixels: (rows, columns, 3)."""
        return np.asarray(self._native.arrays()[2])

    @property
    def total_variance(self) -> npt.NDArray[np.float64]:
        """Variance of the mean of the whole picture: (3,)."""
        return np.asarray(self._native.arrays()[3])

    @property
    def seeds(self) -> int:
        """Number of pictures."""
        return self._native.arrays()[4]

    @checked
    def judge(self, pictures: npt.ArrayLike) -> dict[str, Any]:
        """Tests whether `pictures` (n, height, width, 3) converge to exactly this one: the test of equality of the ladder of scenes.

        Each has a seed of its own, none of them the reference's; four or more are needed. Returns

            `agrees`                  whether all three tests pass, as they do for 98 of 100 pictures that agree
            `sentence`                the statistics in words
            `ratio`                   squared difference over what noise explains; in `ratio_by_chance` (lowest, highest) for 99 of 100
            `tests`, `rejected`       tiles and channels in which anything varies, and those beyond Šidák's bound at 1 % for all together
            `smallest_p`              the smallest of their probabilities
            `mean_in_standard_errors` the mean of the whole picture, in the channel where it is furthest off; 4 are allowed. None where
                                      the means differ and nothing varies
            `mean_difference`         that mean over all channels, less the reference's, as a share of it
        """
        report: dict[str, Any] = json.loads(self._native.judge(_pictures(pictures)))
        return report


def _array(name: str, values: npt.ArrayLike, shape: tuple[int, ...]) -> npt.NDArray[np.float64]:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.shape != shape:
        raise InputError(f"{name}: expected the shape {shape}, got {array.shape}")
    return array


def _pictures(pictures: npt.ArrayLike) -> npt.NDArray[np.float32]:
    array = np.ascontiguousarray(pictures, dtype=np.float32)
    if array.ndim != 4 or array.shape[3] != 3:
        raise InputError(f"pictures: expected the shape (n, height, width, 3), got {array.shape}")
    return array
