//! The two windows of the filter: sums over pixels around one, for many pixels beside each other at a time.
//!
//! For each place of a window there is one loop over these pixels, without branches, which compilers turn into vector instructions. Rows are
//! compiled for processors with wider vectors too; no product and sum is fused, so all versions give the same bits.

use multiversion::multiversion;
use pumice_core::NoMemory;
use rayon::prelude::*;

use super::guides::{Guides, likeness};
use super::light::{Light, UNKNOWN};
use super::planes::{LANES, Lanes, MARGIN, Triple, lanes, three_lanes};
use super::welch::WelchTest;
use super::{RADIUS, WIDE_STEP, divisor};

/// Number of pixels of equal weight below which their differences tell no variance.
const FEWEST: f32 = 1.5;

/// Means of the light of pixels, and the variances of these means.
pub(super) struct Means {
    pub(super) mean: Triple,
    pub(super) variance: Triple,
}

/// The first window: means of neighbours.
pub(super) struct FirstWindow<'a> {
    pub(super) guides: &'a Guides,
    pub(super) light: &'a Light,
    pub(super) test: WelchTest,
    /// Whether the variance of the light is known.
    pub(super) is_variance_known: bool,
}

/// The second window: means of some of the first one's, further apart.
pub(super) struct WideWindow<'a> {
    pub(super) guides: &'a Guides,
    pub(super) light: &'a Light,
    pub(super) smooth: &'a Means,
    pub(super) test: WelchTest,
}

/// What is compared of pixels beside each other.
struct Compared<'a> {
    mean: [&'a Lanes; 3],
    variance: [&'a Lanes; 3],
    normal: [&'a Lanes; 3],
    albedo: [&'a Lanes; 3],
    label: &'a Lanes<u32>,
    instance: &'a Lanes<u32>,
    takes_part: &'a Lanes,
}

impl FirstWindow<'_> {
    /// The mean of each pixel that takes part; 0 elsewhere.
    ///
    /// # Errors
    /// [`NoMemory`] where there is none for 24 bytes a pixel.
    pub(super) fn means(&self) -> Result<Means, NoMemory> {
        let layout = self.guides.layout;
        let zeroes = || Ok([layout.zeroes()?, layout.zeroes()?, layout.zeroes()?]);
        let (mut mean, mut variance): (Triple, Triple) = (zeroes()?, zeroes()?);
        let ([red, green, blue], [of_red, of_green, of_blue]) = (&mut mean, &mut variance);
        let n = layout.stride();
        let of_mean = (red.par_chunks_mut(n), green.par_chunks_mut(n), blue.par_chunks_mut(n));
        let of_variance = (of_red.par_chunks_mut(n), of_green.par_chunks_mut(n), of_blue.par_chunks_mut(n));
        let rows = (of_mean, of_variance);
        rows.into_par_iter().enumerate().for_each(|(y, (mean, variance))| {
            row_of_means(self, y, [mean.0, mean.1, mean.2], [variance.0, variance.1, variance.2]);
        });
        Ok(Means { mean, variance })
    }

    /// For the pixels from (x, y) to the right: the mean of the window, and its variance. The pixel itself is one of the window, with weight
    /// 1, so that no sum of weights of one that takes part is 0. What is added is the window's mean difference from the pixel's own light, so
    /// that equal light stays equal to the bit.
    #[inline(always)]
    fn mean_of(&self, x: usize, y: usize) -> ([Lanes; 3], [Lanes; 3]) {
        let layout = self.guides.layout;
        let own = self.compared(layout.place(x, y));
        let (mut weight, mut squared_weight) = ([0.0; LANES], [0.0; LANES]);
        let (mut light, mut spread) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for of_row in y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(layout.height) {
            for column in 0..=2 * RADIUS {
                let other = self.compared(layout.place(x, of_row) + column - RADIUS);
                for lane in 0..LANES {
                    let part = weight_of(&self.test, &own, &other, lane, true);
                    weight[lane] += part;
                    squared_weight[lane] += part * part;
                    for c in 0..3 {
                        let d = other.mean[c][lane] - own.mean[c][lane];
                        light[c][lane] += part * d;
                        spread[c][lane] += match self.is_variance_known {
                            true => part * part * other.variance[c][lane],
                            false => part * d * d,
                        };
                    }
                }
            }
        }
        let (mut mean, mut variance) = (own.mean.map(|of| *of), [[0.0; LANES]; 3]);
        for c in 0..3 {
            for lane in 0..LANES {
                let shift = light[c][lane] / weight[lane];
                mean[c][lane] += shift;
                let count = weight[lane] * weight[lane] / squared_weight[lane];
                variance[c][lane] = if self.is_variance_known {
                    spread[c][lane] / (weight[lane] * weight[lane])
                } else if count >= FEWEST {
                    let of_pixel = (spread[c][lane] / weight[lane] - shift * shift).max(0.0);
                    (of_pixel / (count - 1.0)).min(UNKNOWN)
                } else {
                    UNKNOWN
                };
            }
        }
        (mean, variance)
    }

    #[inline(always)]
    fn compared(&self, at: usize) -> Compared<'_> {
        compared(self.guides, self.light, &self.light.mean, &self.light.variance, at)
    }
}

/// One row of [`FirstWindow::means`].
#[multiversion(targets("x86_64+avx2+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn row_of_means(window: &FirstWindow<'_>, y: usize, means: [&mut [f32]; 3], variances: [&mut [f32]; 3]) {
    let layout = window.guides.layout;
    for x in (0..layout.width).step_by(LANES) {
        let takes_part = lanes(&window.light.takes_part, layout.place(x, y));
        if *takes_part == [0.0; LANES] {
            continue;
        }
        let (mean, variance) = window.mean_of(x, y);
        for c in 0..3 {
            for lane in (0..LANES).filter(|&lane| takes_part[lane] > 0.0) {
                means[c][MARGIN + x + lane] = mean[c][lane];
                variances[c][MARGIN + x + lane] = variance[c][lane];
            }
        }
    }
}

impl WideWindow<'_> {
    /// Replaces the colours of the pixels that take part.
    pub(super) fn fill(&self, pixels: &mut [[f32; 3]]) {
        let width = self.guides.layout.width.max(1);
        pixels.par_chunks_mut(width).enumerate().for_each(|(y, row)| fill_row(self, y, row));
    }

    /// For the pixels from (x, y) to the right: the window's mean difference from the first window's mean.
    #[expect(clippy::needless_range_loop, reason = "lanes of several arrays side by side")]
    #[inline(always)]
    fn shift(&self, x: usize, y: usize) -> [Lanes; 3] {
        let layout = self.guides.layout;
        let own = self.compared(layout.place(x, y));
        let (mut light, mut weight) = ([[0.0; LANES]; 3], [0.0; LANES]);
        let rows = (0..=2 * RADIUS).filter_map(|row| (y + row * WIDE_STEP).checked_sub(MARGIN));
        for of_row in rows.filter(|&row| row < layout.height) {
            for column in 0..=2 * RADIUS {
                let other = self.compared(layout.place(x, of_row) + column * WIDE_STEP - MARGIN);
                for lane in 0..LANES {
                    let part = weight_of(&self.test, &own, &other, lane, false);
                    weight[lane] += part;
                    for c in 0..3 {
                        light[c][lane] += part * (other.mean[c][lane] - own.mean[c][lane]);
                    }
                }
            }
        }
        for of_channel in &mut light {
            for lane in 0..LANES {
                of_channel[lane] /= weight[lane];
            }
        }
        light
    }

    #[inline(always)]
    fn compared(&self, at: usize) -> Compared<'_> {
        compared(self.guides, self.light, &self.smooth.mean, &self.smooth.variance, at)
    }
}

/// One row of [`WideWindow::fill`].
#[multiversion(targets("x86_64+avx2+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn fill_row(window: &WideWindow<'_>, y: usize, row: &mut [[f32; 3]]) {
    let layout = window.guides.layout;
    for (chunk, pixels) in row.chunks_mut(LANES).enumerate() {
        let x = chunk * LANES;
        let at = layout.place(x, y);
        if *lanes(&window.light.takes_part, at) == [0.0; LANES] {
            continue;
        }
        let shift = window.shift(x, y);
        for (lane, pixel) in pixels.iter_mut().enumerate() {
            if window.light.takes_part[at + lane] > 0.0 {
                for c in 0..3 {
                    let first = window.smooth.mean[c][at + lane] - window.light.mean[c][at + lane];
                    let d = divisor(window.guides.albedo[c][at + lane]);
                    pixel[c] += d * (first + shift[c][lane]);
                }
            }
        }
    }
}

#[inline(always)]
fn compared<'a>(
    guides: &'a Guides,
    light: &'a Light,
    mean: &'a Triple,
    variance: &'a Triple,
    at: usize,
) -> Compared<'a> {
    Compared {
        mean: three_lanes(mean, at),
        variance: three_lanes(variance, at),
        normal: three_lanes(&guides.normal, at),
        albedo: three_lanes(&guides.albedo, at),
        label: lanes(&guides.label, at),
        instance: lanes(&guides.instance, at),
        takes_part: lanes(&light.takes_part, at),
    }
}

/// Weight of one of the pixels `q` for that of `p`, as the module above says, with that for noise or without. It has no branch.
#[inline(always)]
fn weight_of(test: &WelchTest, p: &Compared<'_>, q: &Compared<'_>, lane: usize, for_noise: bool) -> f32 {
    let (mut normal, mut albedo, mut weight) = (0.0, 0.0, q.takes_part[lane]);
    for c in 0..3 {
        let d = q.normal[c][lane] - p.normal[c][lane];
        normal += d * d;
        let d = q.albedo[c][lane] - p.albedo[c][lane];
        albedo += d * d;
        let d = q.mean[c][lane] - p.mean[c][lane];
        weight = weight.min(test.weight(d, p.variance[c][lane], q.variance[c][lane], for_noise));
    }
    let is_of_label = (p.label[lane] == q.label[lane]) & (p.instance[lane] == q.instance[lane]);
    let weight = if is_of_label { weight } else { 0.0 };
    weight * likeness(normal, albedo)
}
