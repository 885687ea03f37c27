//! How far a picture is from a reference, by five yardsticks that answer different questions.
//!
//! | yardstick | question | space it is taken in |
//! |---|---|---|
//! | [`rel_mse`] | how much energy is wrong, weighted so that dark pixels count | scene-linear |
//! | [`psnr`] | the same as a figure people know | display (see below), peak 1 |
//! | [`ssim`] | is the local structure kept | display |
//! | [`flip`] | would a person notice when flipping between the two | display |
//! | [`significance`] | can noise alone explain the difference | scene-linear, with variances |
//!
//! *Display* is the scene-linear picture clamped to [0, 1] and encoded with the sRGB curve (IEC 61966-2-1): what an 8-bit PNG of
//! it would show, before rounding. Rendered pictures have no upper bound, and the last three yardsticks are defined for what a
//! screen can show.
//!
//! [`compare()`] takes them all.

pub mod compare;
pub mod display;
pub mod error_map;
pub mod flip;
mod gaussian;
pub mod psnr;
pub mod rel_mse;
pub mod significance;
pub mod ssim;
pub(crate) mod student_t;

pub use compare::{CompareError, Comparison, compare};
pub use error_map::error_map;
pub use significance::{Significance, Variance};
