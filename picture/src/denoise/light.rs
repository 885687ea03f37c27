//! The light of each pixel without its surface's colour, and how much its samples say that it varies.

use pumice_core::NoMemory;
use rayon::prelude::*;

use super::divisor;
use super::guides::Guides;
use super::planes::{LANES, MARGIN, Means, Triple, lanes};
use crate::image::Image;

/// Light above this, whose squares are beyond single precision, takes no part.
const MOST_LIGHT: f32 = 1e18;

/// Stands for a variance that is not known: the test then accepts any difference below a thousand million.
pub(super) const UNKNOWN: f32 = 1e18;

/// The light of each pixel.
pub(super) struct Light {
    pub(super) means: Means,
    /// 1 where the pixel takes part, else 0.
    pub(super) takes_part: Vec<f32>,
}

impl Light {
    /// The light of a picture. The variance of a pixel is at least the mean of those of its label among the 3 × 3 pixels around it: an estimate
    /// from four classes is often far too small, and where a rare bright sample is missing, mean and variance are too small together.
    pub(super) fn of(image: &Image, variance: Option<&Image>, guides: &Guides) -> Result<Self, NoMemory> {
        let layout = guides.layout;
        let takes_part = layout.plane(|i, at| {
            let is_sound = image.pixels[i].iter().all(|c| c.abs() <= MOST_LIGHT);
            if is_sound { guides.is_surface[at] } else { 0.0 }
        })?;
        let mean = layout.triple(|i, at, c| match takes_part[at] > 0.0 {
            true => image.pixels[i][c] / divisor(guides.albedo[c][at]),
            false => 0.0,
        })?;
        let own = layout.triple(|i, at, c| {
            let of = variance.map_or(UNKNOWN, |v| v.pixels[i][c] / divisor(guides.albedo[c][at]).powi(2));
            // Negative, infinite or no number: as if it were not known.
            if takes_part[at] > 0.0 && (0.0..UNKNOWN).contains(&of) { of } else { UNKNOWN }
        })?;
        let variance = pooled(&own, &takes_part, guides)?;
        Ok(Self { means: Means { mean, variance }, takes_part })
    }
}

/// Of each pixel that takes part, the greater of its own variance and the mean of those that are known of its label among the 3 × 3 pixels
/// around it; [`UNKNOWN`] where its own is. `own` is UNKNOWN also where a pixel takes no part.
fn pooled(own: &Triple, takes_part: &[f32], guides: &Guides) -> Result<Triple, NoMemory> {
    let layout = guides.layout;
    let [mut red, mut green, mut blue] = [layout.zeroes()?, layout.zeroes()?, layout.zeroes()?];
    let stride = layout.stride();
    let rows = (red.par_chunks_mut(stride), green.par_chunks_mut(stride), blue.par_chunks_mut(stride));
    rows.into_par_iter().enumerate().for_each(|(y, (red, green, blue))| {
        let planes = [red, green, blue];
        for x in (0..layout.width).step_by(LANES) {
            let at = layout.place(x, y);
            if *lanes(takes_part, at) == [0.0; LANES] {
                continue;
            }
            let (label, instance) = (lanes(&guides.label, at), lanes(&guides.instance, at));
            let (mut sum, mut count) = ([[0.0f32; LANES]; 3], [[0.0f32; LANES]; 3]);
            for row in y.saturating_sub(1)..(y + 2).min(layout.height) {
                for column in 0..3 {
                    let other = layout.place(x, row) + column - 1;
                    let (of_label, of_instance) =
                        (lanes(&guides.label, other), lanes(&guides.instance, other));
                    // Room around the rows has label 0, as meshes have, and no light.
                    let of_part = lanes(takes_part, other);
                    for c in 0..3 {
                        let of = lanes(&own[c], other);
                        for lane in 0..LANES {
                            let is_of_label =
                                (of_label[lane] == label[lane]) & (of_instance[lane] == instance[lane]);
                            let counts = is_of_label & (of_part[lane] > 0.0) & (of[lane] < UNKNOWN);
                            sum[c][lane] += if counts { of[lane] } else { 0.0 };
                            count[c][lane] += if counts { 1.0 } else { 0.0 };
                        }
                    }
                }
            }
            for c in 0..3 {
                let alone = lanes(&own[c], at);
                let pooled = &mut planes[c][MARGIN + x..][..LANES];
                for lane in 0..LANES {
                    let mean = sum[c][lane] / count[c][lane].max(1.0);
                    pooled[lane] = alone[lane].max(mean);
                }
            }
        }
    });
    Ok([red, green, blue])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Picture;

    const WIDTH: usize = 21;
    const HEIGHT: usize = 9;

    /// The variance of one pixel and channel as the definition says it, from a picture whose light is divided by 1.
    fn naive(variance: &Image, label: &[u32], sound: &[bool], i: usize, c: usize) -> f32 {
        let known = |j: usize| Some(variance.pixels[j][c]).filter(|v| (0.0..UNKNOWN).contains(v));
        let Some(alone) = known(i) else { return UNKNOWN };
        let near = |j: usize| {
            (i % WIDTH).abs_diff(j % WIDTH) <= 1
                && (i / WIDTH).abs_diff(j / WIDTH) <= 1
                && label[j] == label[i]
        };
        let of: Vec<f32> = (0..WIDTH * HEIGHT).filter(|&j| sound[j] && near(j)).filter_map(known).collect();
        alone.max(of.iter().sum::<f32>() / of.len() as f32)
    }

    /// Also at the edges of the picture, where meshes have the label of the room around the rows, beside pixels that show nothing, and
    /// beside variances that are not known.
    #[test]
    fn pooled_variance_matches_naive() {
        let mut state = 3u64;
        let mut draw = |n: u64| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) % n
        };
        let pixels = WIDTH * HEIGHT;
        let label: Vec<u32> = (0..pixels).map(|_| draw(2) as u32).collect();
        let sound: Vec<bool> = (0..pixels).map(|_| draw(5) > 0).collect();
        let value = |n: u64| match n {
            0 => f32::NAN,
            1 => f32::INFINITY,
            n => n as f32,
        };
        let variance =
            Image::new(WIDTH, HEIGHT, (0..pixels).map(|_| [0; 3].map(|_| value(draw(12)))).collect());
        let color = Image::new(WIDTH, HEIGHT, vec![[1.0; 3]; pixels]);
        let picture = Picture {
            depth: Some(sound.iter().map(|&s| if s { 1.0 } else { f32::INFINITY }).collect()),
            label: Some(label.clone()),
            normal: Some(Image::new(WIDTH, HEIGHT, vec![[0.0, 0.0, 1.0]; pixels])),
            albedo: Some(Image::new(WIDTH, HEIGHT, vec![[1.0 - super::super::ALBEDO_FLOOR; 3]; pixels])),
            ..Picture::of(color.clone())
        };
        let guides = Guides::of(&picture).unwrap().unwrap();
        let light = Light::of(&color, Some(&variance), &guides).unwrap();
        for i in (0..pixels).filter(|&i| sound[i]) {
            let at = guides.layout.place(i % WIDTH, i / WIDTH);
            for c in 0..3 {
                assert_eq!(
                    light.means.variance[c][at],
                    naive(&variance, &label, &sound, i, c),
                    "pixel {i}, {c}"
                );
            }
        }
    }
}
