//! What is drawn over a finished picture: a scale bar in a corner, the lower right one unless another is asked for, and a legend in its
//! upper left one.
//!
//! ```text
//! Annotations  ── pumice-session knows scene and volumes ──► length of the bar in pixels, rows of the legend
//!                                                              │ Paper: millimetres to pixels
//!                                                              ▼
//!                                           Marks: coverage in pixels and one ink each ────────────────── in Picture::marks
//!   PNG: over the display values, after the view transform, so that colours are those that labels have
//!   EXR: over the scene-linear colour; every pass stays as it is
//! ```
//! Lengths on paper are those of the add-on for Blender, in millimetres: text of 3, a margin of 4, a bar of 0.7. A picture without a density
//! counts as one of 300 dpi. Text and bar are black or white, whichever reads better over the picture ([`Ink`]). [`crate::Picture::color`] in memory has no marks; files have, and a file that is read has them in its colour.

mod ink;
mod legend;
mod mark;
mod paper;
mod scale_bar;
mod settings;
mod text;

pub use ink::Ink;
pub use legend::{LegendRow, legend_marks, reach_of};
pub use mark::Mark;
pub use paper::{DEFAULT_DPI, Paper, pixels_of_mm};
pub use scale_bar::{length_text, meters_of, round_length, scale_bar_marks};
pub use settings::{Annotations, BarLength, BarPlane, Corner, ScaleBar};
pub use text::missing_characters;

pub(crate) use ink::Inks;
pub(crate) use mark::{drawn_over, over_display};
