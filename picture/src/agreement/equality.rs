//! The test of equality: whether two renderers converge to exactly the same picture.
//!
//! With m and r the means over the seeds of ours and of theirs, and v and V their variances, all by pixel and channel:
//!
//! ```text
//! ratio   Σ (m − r)² / Σ (v + V): 1 on average. Random halves of the same pictures give the interval in which it lies by chance, 99 in
//!         100 times
//! tiles   Welch's t of each tile of 8 × 8 pixels and each channel: none may exceed Šidák's bound at 1 % for all of them together
//! mean    of the whole picture: within 4 standard errors in each channel
//! ```
//! Two of a hundred pictures that agree fail one of these by chance. Where nothing varies, a difference up to rounding is none, and a larger
//! one is rejected.

use std::fmt;

use serde::Serialize;

use super::areas::Areas;
use super::chance::chance_interval;
use super::intervals::{Interval, Intervals, single_level, value_of, varies};
use super::picture_set::{Moment, PictureSet, SetStatistics};
use super::reference_picture::{ReferenceError, ReferencePicture};
use super::verdict::LEVEL;

/// Standard errors by which the mean of a channel may be off: the normal distribution is beyond them in 1 of 16,000 cases, Student's t
/// with 14 degrees of freedom in 1 of 800.
const MOST_STANDARD_ERRORS: f64 = 4.0;
/// Against a stored reference: where nothing varies, differences up to this share of the value count as rounding. The ladder's pictures
/// have at most 2¹⁴ samples; ten times what their float32 sums vary by.
const ROUNDING: f64 = 2e-5;

/// What the test of equality finds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Equality {
    /// Sum of squared differences over what noise alone explains: 1 on average where both agree.
    pub ratio: f64,
    /// Middle 99 % of the ratio by chance; `None` with fewer than four pictures of a renderer.
    pub ratio_by_chance: Option<[f64; 2]>,
    /// Tiles and channels tested: those in which anything varies.
    pub tests: usize,
    /// Tiles and channels whose p-value is below Šidák's bound at 1 %, and those that differ without varying.
    pub rejected: usize,
    /// The smallest p-value.
    pub smallest_p: f64,
    /// Largest difference of the means over a channel, in its standard errors; infinite where they differ and nothing varies.
    pub mean_in_standard_errors: f64,
    /// Difference of the picture's mean over all channels, ours less theirs, as a share of theirs; 0 where theirs is black.
    pub mean_difference: f64,
}

/// Tests our pictures against a stored reference of the same size, which should have far more seeds.
///
/// # Errors
/// With fewer than four pictures, of which no interval by chance is known; with pictures of another size than the reference's; with a pixel
/// that is not finite.
pub fn judge_equality(ours: &PictureSet, reference: &ReferencePicture) -> Result<Equality, ReferenceError> {
    let too_few = ReferenceError::TooFew { expected: 4, got: ours.len() };
    if ours.is_empty() {
        return Err(too_few);
    }
    if ours.size() != reference.size() {
        return Err(ReferenceError::Size { expected: reference.size(), got: ours.size() });
    }
    ReferenceError::if_not_finite(ours)?;
    let [width, height] = ours.size();
    let (masked, covered) = (vec![false; width * height], vec![true; width * height]);
    let by_chance = chance_interval(&[ours], &masked, LEVEL).ok_or(too_few)?;
    let areas = Areas::new(ours.size(), &masked, &covered);
    let statistics = [&ours.statistics(&areas), reference.statistics()];
    let found = Differences::new(statistics, LEVEL, ROUNDING, |_| 0.0, 0.0);
    Ok(Equality::new(statistics, &areas, &found, Some(by_chance), ROUNDING))
}

/// The differences of the means of two sets, with their intervals.
pub(super) struct Differences {
    /// By tile, row by row, and channel.
    pub(super) tiles: Vec<[Interval; 3]>,
    /// Of the whole, by channel.
    pub(super) mean: [Interval; 3],
}

impl Differences {
    /// Intervals that all hold with the probability `1 − level`. `tile_margin` is the margin of a tile with their mean. Where nothing
    /// varies, differences up to `rounding` times the value count as none.
    pub(super) fn new(
        [ours, theirs]: [&SetStatistics; 2],
        level: f64,
        rounding: f64,
        tile_margin: impl Fn(&Moment) -> f64,
        mean_margin: f64,
    ) -> Self {
        let mut intervals = Intervals::new(level, 3 * ours.of_tiles.len() + 3, rounding);
        let mut of = |x: &Moment, y: &Moment, margin| intervals.of([(x, ours.n), (y, theirs.n)], margin);
        let mean = [0, 1, 2].map(|c| of(&ours.of_whole[c], &theirs.of_whole[c], mean_margin));
        let pairs = ours.of_tiles.iter().zip(&theirs.of_tiles);
        let tiles = pairs.map(|(x, y)| [0, 1, 2].map(|c| of(&x[c], &y[c], tile_margin(&y[c])))).collect();
        Self { tiles, mean }
    }

    /// The intervals of the tiles that have pixels.
    pub(super) fn of_tiles(&self, areas: &Areas) -> impl Iterator<Item = &Interval> {
        self.tiles
            .iter()
            .zip(&areas.tile_pixels)
            .filter(|(_, pixels)| **pixels > 0)
            .flat_map(|(tile, _)| tile)
    }
}

impl Equality {
    /// What the statistics of two sets, and the differences of their means, say of equality.
    pub(super) fn new(
        [ours, theirs]: [&SetStatistics; 2],
        areas: &Areas,
        found: &Differences,
        ratio_by_chance: Option<[f64; 2]>,
        rounding: f64,
    ) -> Self {
        // Where nothing varies, only what is more than rounding counts.
        let (mut squares, mut noise) = (0.0, 0.0);
        for pixel in areas.pixels() {
            for (x, y) in ours.of_pixels[pixel].iter().zip(&theirs.of_pixels[pixel]) {
                let (difference, value) = (x.mean() - y.mean(), value_of([x, y]));
                let variance = x.variance_of_mean() + y.variance_of_mean();
                if varies(variance, value) {
                    squares += difference.powi(2);
                    noise += variance;
                } else if difference.abs() > rounding * value {
                    squares += difference.powi(2);
                    noise += (rounding * value).powi(2);
                }
            }
        }

        let tiles = || found.of_tiles(areas);
        let tests = tiles().filter(|i| i.varies).count();
        let bound = single_level(LEVEL, tests);
        let total: f64 = theirs.of_whole.iter().map(Moment::mean).sum();
        let difference: f64 = found.mean.iter().map(|i| i.difference).sum();
        Self {
            ratio: if noise > 0.0 { squares / noise } else { 0.0 },
            ratio_by_chance,
            tests,
            rejected: tiles().filter(|i| i.p < bound).count(),
            smallest_p: tiles().map(|i| i.p).fold(1.0, f64::min),
            mean_in_standard_errors: found.mean.iter().map(|i| i.t.abs()).fold(0.0, f64::max),
            mean_difference: if total == 0.0 { 0.0 } else { difference / total },
        }
    }

    /// Whether all three tests pass. The ratio must lie within its interval: below it the pictures are not independent.
    pub fn agrees(&self) -> bool {
        let is_by_chance = |[low, high]: [f64; 2]| (low..=high).contains(&self.ratio);
        self.ratio_by_chance.is_some_and(is_by_chance)
            && self.rejected == 0
            && self.mean_in_standard_errors <= MOST_STANDARD_ERRORS
    }

    /// The tests that prove a difference, in words; empty where none does.
    pub(super) fn proofs(&self) -> Vec<String> {
        let mut proofs = Vec::new();
        if let Some([low, high]) = self.ratio_by_chance.filter(|[_, high]| self.ratio > *high) {
            let ratio = self.ratio;
            proofs.push(format!(
                "its square is {ratio:.3} times what noise explains, by chance {low:.3} to {high:.3}"
            ));
        }
        match self.rejected {
            0 => {}
            1 => proofs.push(format!("1 of {} tiles and channels is not equal", self.tests)),
            n => proofs.push(format!("{n} of {} tiles and channels are not equal", self.tests)),
        }
        if self.mean_in_standard_errors > MOST_STANDARD_ERRORS {
            proofs.push(format!(
                "the picture's mean is off by {:.1} standard errors",
                self.mean_in_standard_errors
            ));
        }
        proofs
    }
}

impl fmt::Display for Equality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ratio {:.3}", if self.agrees() { "agrees" } else { "DIFFERS" }, self.ratio)?;
        if let Some([low, high]) = self.ratio_by_chance {
            write!(f, " of {low:.3} to {high:.3}")?;
        }
        let least = self.smallest_p * self.tests as f64;
        let least = if least < 0.01 { format!("{least:.1e}") } else { format!("{least:.2}") };
        write!(
            f,
            ", {} of {} tiles and channels beyond (least chance × tests {least}), mean off by {:+.1e} = {:.2} standard errors",
            self.rejected, self.tests, self.mean_difference, self.mean_in_standard_errors,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EQUAL: Equality = Equality {
        ratio: 1.0,
        ratio_by_chance: Some([0.9, 1.1]),
        tests: 12,
        rejected: 0,
        smallest_p: 0.05,
        mean_in_standard_errors: 4.0,
        mean_difference: -2e-4,
    };

    #[test]
    fn each_of_the_three_tests_convicts_alone() {
        assert!(EQUAL.agrees() && EQUAL.proofs().is_empty());
        for (found, proof) in [
            (Equality { ratio: 1.11, ..EQUAL }, "1.110 times what noise explains, by chance 0.900 to 1.100"),
            (Equality { rejected: 1, ..EQUAL }, "1 of 12 tiles and channels is not equal"),
            (Equality { rejected: 3, ..EQUAL }, "3 of 12 tiles and channels are not equal"),
            (Equality { mean_in_standard_errors: 4.1, ..EQUAL }, "off by 4.1 standard errors"),
        ] {
            assert!(
                !found.agrees() && found.proofs().len() == 1 && found.proofs()[0].contains(proof),
                "{found}"
            );
        }
        // Pictures that are more alike than independent ones, or too few, do not pass, and prove no difference.
        for found in [Equality { ratio: 0.89, ..EQUAL }, Equality { ratio_by_chance: None, ..EQUAL }] {
            assert!(!found.agrees() && found.proofs().is_empty(), "{found}");
        }
        assert_eq!(
            EQUAL.to_string(),
            "agrees: ratio 1.000 of 0.900 to 1.100, 0 of 12 tiles and channels beyond (least chance × tests 0.60), mean off by \
             -2.0e-4 = 4.00 standard errors"
        );
        let far = Equality { smallest_p: 1e-9, ..EQUAL };
        assert!(far.to_string().contains("(least chance × tests 1.2e-8)"), "{far}");
    }
}
