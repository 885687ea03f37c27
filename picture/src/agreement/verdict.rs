//! The verdict on two sets of pictures.

use serde::Serialize;

use super::TILE_PIXELS;
use super::areas::{Areas, tiles_across_and_down};
use super::chance::chance_interval;
use super::equality::{Differences, Equality};
use super::intervals::{Interval, Standing};
use super::picture_set::{Moment, PictureSet};

/// Probability that some interval does not hold the true difference, over all looks together.
pub const LEVEL: f64 = 0.01;
/// Margin of a tile: a share of the larger of the tile's and the picture's mean.
const TILE_MARGIN: f64 = 0.01;
/// Margin of the picture's mean: a share of it.
const MEAN_MARGIN: f64 = 0.002;
/// Where nothing varies, differences up to this share of the value count as rounding: adding the same float32 2,048 times loses up to
/// 2,048 · 2⁻²⁴ of it, always to the same side.
const ROUNDING: f64 = 1.3e-4;
/// Share of the covered pixels that may be masked.
pub(super) const MOST_MASKED: f64 = 0.02;

/// The answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Every difference is negligible.
    Agrees,
    /// A difference is larger than its margin.
    Differs,
    /// The pictures are too few or too noisy, or too much is masked.
    CannotTell,
}

/// What the pictures say. Tiles are row by row, intervals by channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// The answer.
    pub verdict: Verdict,
    /// Probability that some of the intervals misses.
    pub level: f64,
    /// Pictures of ours and theirs.
    pub pictures: [usize; 2],
    /// Tiles across and down.
    pub tiles_across_and_down: [usize; 2],
    /// The differences of the tiles; all of a tile without pixels are 0.
    #[serde(skip)]
    pub tiles: Vec<[Interval; 3]>,
    /// The differences of the picture's mean, over the pixels that show a surface, if there are any: a bright background would hide them.
    pub mean: [Interval; 3],
    /// That mean of theirs over the channels: what shares of the picture are taken of.
    pub scale: f64,
    /// Masked pixels among the covered ones, as a share.
    pub masked: f64,
    /// Tiles and channels, by where they stand: within, open, outside.
    pub standing: [usize; 3],
    /// The largest difference of a tile that is proven, as a share of what its margin is a share of; with the tile's upper left pixel.
    pub proven_in_tile: Option<(f64, [usize; 2])>,
    /// The largest proven difference of the mean of a channel, as a share of the picture's mean.
    pub proven_in_mean: Option<f64>,
    /// The test of equality.
    pub equality: Equality,
    /// Pixels that were left out, row by row.
    #[serde(skip)]
    pub mask: Vec<bool>,
}

/// The level of look number `look`, counted from 0, of whoever looks again when there are more pictures: half of what is left, so that all
/// looks together have [`LEVEL`].
pub fn level_of_look(look: u32) -> f64 {
    LEVEL * 0.5f64.powi(look as i32 + 1)
}

/// Judges our pictures against theirs. `covered` marks the pixels that show a surface; `level` is the probability that some interval
/// misses. Pixels that are not finite in some picture are masked.
///
/// # Panics
/// When the sets are of different sizes, or `covered` has another length.
pub fn judge(ours: &PictureSet, theirs: &PictureSet, covered: &[bool], level: f64) -> Agreement {
    let [width, height] = ours.size();
    assert_eq!(ours.size(), theirs.size());
    assert_eq!(covered.len(), width * height);
    let mut mask = vec![false; width * height];
    ours.mark_not_finite(&mut mask);
    theirs.mark_not_finite(&mut mask);
    let covered_pixels = covered.iter().filter(|c| **c).count();
    let masked_pixels = covered.iter().zip(&mask).filter(|(c, m)| **c && **m).count();
    let masked = if covered_pixels == 0 { 0.0 } else { masked_pixels as f64 / covered_pixels as f64 };

    // Intervals of all tiles, and of the mean.
    let areas = Areas::new([width, height], &mask, covered);
    let (a, b) = (ours.statistics(&areas), theirs.statistics(&areas));
    let mean_of = |moments: &[Moment; 3]| moments.iter().map(|m| m.mean().abs()).sum::<f64>() / 3.0;
    let scale = mean_of(&b.of_whole);
    let tile_margin = |theirs: &Moment| TILE_MARGIN * scale.max(theirs.mean().abs());
    let found = Differences::new([&a, &b], level, ROUNDING, tile_margin, MEAN_MARGIN * scale);

    // The verdict: of intervals that exist.
    let count = |standing| found.of_tiles(&areas).filter(|i| i.standing() == standing).count();
    let standing = [Standing::Within, Standing::Open, Standing::Outside].map(count);
    let is_mean = |standing| found.mean.iter().any(|i| i.standing() == standing);
    let is_open = standing[1] > 0 || is_mean(Standing::Open) || masked > MOST_MASKED || scale == 0.0;
    let verdict = if standing[2] > 0 || is_mean(Standing::Outside) {
        Verdict::Differs
    } else if is_open {
        Verdict::CannotTell
    } else {
        Verdict::Agrees
    };

    let [across, down] = tiles_across_and_down([width, height]);
    let proven = |i: &Interval| i.is_proven().then(|| i.difference / i.margin);
    let proven_in_tile = found
        .tiles
        .iter()
        .enumerate()
        .flat_map(|(n, tile)| tile.iter().filter_map(proven).map(move |share| (share, n)))
        .max_by(|x, y| x.0.abs().total_cmp(&y.0.abs()))
        .map(|(share, n)| (share * TILE_MARGIN, [n % across, n / across].map(|t| t * TILE_PIXELS)));
    let proven_in_mean = found
        .mean
        .iter()
        .filter_map(proven)
        .max_by(|x, y| x.abs().total_cmp(&y.abs()))
        .map(|s| s * MEAN_MARGIN);
    let equality =
        Equality::new([&a, &b], &areas, &found, chance_interval(&[ours, theirs], &mask, LEVEL), ROUNDING);
    Agreement {
        verdict,
        level,
        pictures: [a.n, b.n],
        tiles_across_and_down: [across, down],
        tiles: found.tiles,
        mean: found.mean,
        scale,
        masked,
        standing,
        proven_in_tile,
        proven_in_mean,
        equality,
        mask,
    }
}
