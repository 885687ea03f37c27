//! The light of each pixel without its surface's colour, and how much its samples say that it varies.

use pumice_core::NoMemory;

use super::guides::Guides;
use super::planes::Triple;
use super::{RADIUS, divisor};
use crate::image::Image;

/// Light above this, whose squares are beyond single precision, takes no part.
const MOST_LIGHT: f32 = 1e18;

/// Stands for a variance that is not known: the test then accepts any difference below a thousand million.
const UNKNOWN: f32 = 1e18;

/// Mean and variance of the light of each pixel.
pub(super) struct Light {
    pub(super) mean: Triple,
    pub(super) variance: Triple,
    /// 1 where the pixel takes part, else 0.
    pub(super) takes_part: Vec<f32>,
}

impl Light {
    /// The light of a picture. The variance of a pixel is at least the mean of those of its label among the 3 × 3 pixels around it: an estimate
    /// from four classes is often far too small, and where a rare bright sample is missing, mean and variance are too small together.
    pub(super) fn of(image: &Image, variance: Option<&Image>, guides: &Guides) -> Result<Self, NoMemory> {
        let layout = guides.layout;
        let place = |i: usize| i / layout.width * layout.stride() + RADIUS + i % layout.width;
        let takes_part = layout.plane(|i| {
            let is_sound = image.pixels[i].iter().all(|c| c.abs() <= MOST_LIGHT);
            if is_sound { guides.is_surface[place(i)] } else { 0.0 }
        })?;
        let mean = |i: usize, c: usize| match takes_part[place(i)] > 0.0 {
            true => image.pixels[i][c] / divisor(guides.albedo[c][place(i)]),
            false => 0.0,
        };
        let own = |i: usize, c: usize| {
            let of = variance?.pixels[i][c] / divisor(guides.albedo[c][place(i)]).powi(2);
            // Negative, infinite or no number: as if it were not known.
            (0.0..UNKNOWN).contains(&of).then_some(of)
        };
        let label = |i: usize| (guides.label[place(i)], guides.instance[place(i)]);
        let pooled = |i: usize, c: usize| {
            let Some(alone) = own(i, c) else { return UNKNOWN };
            let (x, y) = (i % layout.width, i / layout.width);
            let (mut sum, mut count) = (0.0, 0.0);
            for row in y.saturating_sub(1)..(y + 2).min(layout.height) {
                for column in x.saturating_sub(1)..(x + 2).min(layout.width) {
                    let other = row * layout.width + column;
                    if takes_part[place(other)] > 0.0
                        && label(other) == label(i)
                        && let Some(of) = own(other, c)
                    {
                        sum += of;
                        count += 1.0;
                    }
                }
            }
            alone.max(sum / f32::max(count, 1.0))
        };
        Ok(Self { mean: layout.triple(mean)?, variance: layout.triple(pooled)?, takes_part })
    }
}
