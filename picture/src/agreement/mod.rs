//! Whether two renderers converge to the same picture, from pictures of several seeds of each.
//!
//! ```text
//! ours:   seed 1, seed 2, …  ─┐                          every interval within its margin      agrees
//!                             ├─► intervals of the       one interval wholly outside           differs
//! theirs: seed 1, seed 2, …  ─┘   differences of tiles   anything else                         cannot tell
//! ```
//! **An equivalence test.** No two programs agree to the last digit, so with enough samples a test of equality rejects everything. Here
//! the question is whether the difference is *small*: the margin is 1 % in each tile of 8 × 8 pixels and 0.2 % in the mean of the
//! picture (Schuirmann 1987, *A comparison of the two one-sided tests procedure*; the form with intervals is Westlake 1972). More samples
//! make intervals shorter, never the margin, so they never turn a negligible difference into a verdict. A difference that is proven, but
//! smaller than its margin, is named beside the verdict.
//!
//! **Intervals.** Per channel and tile: the difference of the means over the seeds, ± Welch's t (Welch 1947) times its standard error, at a
//! level that Šidák (1967) divides among all tiles and channels: with the probability `1 − level` *all* of them hold the true differences,
//! whatever the correlation between tiles. So a false *agrees* or a false *differs* has at most the probability `level`. Whoever looks
//! several times at a growing number of seeds shares the level among the looks ([`level_of_look`]).
//!
//! **The ladder's test.** Beside it stands a [test of equality](Equality), for scenes that must agree exactly: Welch's t of each tile, and
//! the ratio of the squared difference to what noise alone explains, with the interval that random halves of the same pictures give. It
//! compares two sets of pictures, or one set with a [`ReferencePicture`] that was stored ([`judge_equality`]).

mod areas;
mod chance;
mod equality;
mod intervals;
mod maps;
mod picture_set;
mod reference_picture;
mod sentence;
mod verdict;

pub use equality::{Equality, judge_equality};
pub use intervals::{Interval, Standing};
pub use maps::{signed_difference_map, tile_difference_map, tile_t_map};
pub use picture_set::PictureSet;
pub use reference_picture::{ReferenceArrays, ReferenceError, ReferencePicture};
pub use sentence::{counted, percent};
pub use verdict::{Agreement, LEVEL, Verdict, judge, level_of_look};

/// Pixels along a tile's side.
pub use crate::metrics::significance::TILE_PIXELS;
