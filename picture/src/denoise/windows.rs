//! The windows of the filter: sums over pixels around one, for many pixels beside each other at a time.
//!
//! For each place of a window there is one loop over these pixels, without branches, which compilers turn into vector instructions. Rows are
//! compiled for processors with wider vectors too; no product and sum is fused, so all versions give the same bits.

use multiversion::multiversion;
use pumice_core::Job;
use rayon::prelude::*;

use super::guides::{Guides, likeness};
use super::light::{Light, UNKNOWN};
use super::planes::{LANES, Lanes, Layout, Means, RowOfMeans, lanes, three_lanes};
use super::welch::WelchTest;
use super::{RADIUS, divisor};

/// Number of pixels of equal weight below which their differences tell no variance.
const FEWEST: f32 = 1.5;

/// By how much the variance of a mean of the second window is larger than if the means that it averages shared no pixel. Along a line each of five
/// pixels in a row lies in a mean of the first window, and the means are three apart: of 17 pixels eight count twice, (9 + 8 · 2²) / 5² = 41 / 25.
/// This is its square.
const OVERLAP: f32 = 2.6896;

/// The first window: means of neighbours.
pub(super) struct FirstWindow<'a> {
    pub(super) guides: &'a Guides,
    pub(super) light: &'a Light,
    pub(super) test: WelchTest,
    /// Whether the variance of the light is known.
    pub(super) is_variance_known: bool,
}

/// A wide window: means of some of another one's, further apart.
pub(super) struct WideWindow<'a> {
    pub(super) guides: &'a Guides,
    pub(super) takes_part: &'a [f32],
    /// What it averages.
    pub(super) from: &'a Means,
    pub(super) test: WelchTest,
    /// Pixels from one of the window to the next.
    pub(super) step: usize,
}

/// A window around each pixel.
pub(super) trait Window: Sync {
    /// Where pixels lie.
    fn layout(&self) -> Layout;

    /// 1 where a pixel takes part, else 0.
    fn takes_part(&self) -> &[f32];

    /// For the pixels from (x, y) to the right: the mean of the window, and its variance.
    fn mean_of(&self, x: usize, y: usize) -> ([Lanes; 3], [Lanes; 3]);

    /// Finds the mean of each pixel that takes part; what lies elsewhere stays, and the rows that are left when `job` is cancelled.
    fn find(&self, means: &mut Means, job: &Job)
    where
        Self: Sized,
    {
        means.fill_rows(self.layout(), |y, row| {
            if !job.is_cancelled() {
                row_of_means(self, y, row);
            }
        });
    }
}

/// One row of [`Window::find`].
#[multiversion(targets("x86_64+avx2+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn row_of_means<W: Window>(window: &W, y: usize, mut row: RowOfMeans<'_>) {
    let layout = window.layout();
    for x in (0..layout.width).step_by(LANES) {
        let takes_part = lanes(window.takes_part(), layout.place(x, y));
        if *takes_part != [0.0; LANES] {
            let (mean, variance) = window.mean_of(x, y);
            row.set(x, takes_part, &mean, &variance);
        }
    }
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

impl Window for FirstWindow<'_> {
    fn layout(&self) -> Layout {
        self.guides.layout
    }

    fn takes_part(&self) -> &[f32] {
        &self.light.takes_part
    }

    // The pixel itself is one of the window, with weight 1, so that no sum of weights of one that takes part is 0. What is added is the window's
    // mean difference from the pixel's own light, so that equal light stays equal to the bit.
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
}

impl FirstWindow<'_> {
    #[inline(always)]
    fn compared(&self, at: usize) -> Compared<'_> {
        compared(self.guides, &self.light.takes_part, &self.light.means, at)
    }
}

impl Window for WideWindow<'_> {
    fn layout(&self) -> Layout {
        self.guides.layout
    }

    fn takes_part(&self) -> &[f32] {
        self.takes_part
    }

    // The variance is that of the second window.
    #[inline(always)]
    fn mean_of(&self, x: usize, y: usize) -> ([Lanes; 3], [Lanes; 3]) {
        let (layout, reach) = (self.guides.layout, RADIUS * self.step);
        let own = self.compared(layout.place(x, y));
        let (mut light, mut spread, mut weight) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3], [0.0; LANES]);
        let rows = (0..=2 * RADIUS).filter_map(|row| (y + row * self.step).checked_sub(reach));
        for of_row in rows.filter(|&row| row < layout.height) {
            for column in 0..=2 * RADIUS {
                let other = self.compared(layout.place(x, of_row) + column * self.step - reach);
                for lane in 0..LANES {
                    let part = weight_of(&self.test, &own, &other, lane, false);
                    weight[lane] += part;
                    for c in 0..3 {
                        light[c][lane] += part * (other.mean[c][lane] - own.mean[c][lane]);
                        spread[c][lane] += part * part * other.variance[c][lane];
                    }
                }
            }
        }
        let (mut mean, mut variance) = (own.mean.map(|of| *of), [[0.0; LANES]; 3]);
        for c in 0..3 {
            for lane in 0..LANES {
                mean[c][lane] += light[c][lane] / weight[lane];
                let of_mean = OVERLAP * spread[c][lane] / (weight[lane] * weight[lane]);
                variance[c][lane] = of_mean.min(UNKNOWN);
            }
        }
        (mean, variance)
    }
}

impl WideWindow<'_> {
    /// Replaces the colours of the pixels that take part, except in the rows that are left when `job` is cancelled.
    pub(super) fn fill(&self, pixels: &mut [[f32; 3]], job: &Job) {
        let width = self.guides.layout.width.max(1);
        pixels.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            if !job.is_cancelled() {
                fill_row(self, y, row);
            }
        });
    }

    #[inline(always)]
    fn compared(&self, at: usize) -> Compared<'_> {
        compared(self.guides, self.takes_part, self.from, at)
    }
}

/// One row of [`WideWindow::fill`].
#[multiversion(targets("x86_64+avx2+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn fill_row(window: &WideWindow<'_>, y: usize, row: &mut [[f32; 3]]) {
    let layout = window.guides.layout;
    for (chunk, pixels) in row.chunks_mut(LANES).enumerate() {
        let x = chunk * LANES;
        let at = layout.place(x, y);
        if *lanes(window.takes_part, at) == [0.0; LANES] {
            continue;
        }
        let (mean, _) = window.mean_of(x, y);
        for (lane, pixel) in pixels.iter_mut().enumerate() {
            if window.takes_part[at + lane] > 0.0 {
                for c in 0..3 {
                    // As a difference, so that equal light stays equal to the bit.
                    let d = divisor(window.guides.albedo[c][at + lane]);
                    pixel[c] += d * (mean[c][lane] - pixel[c] / d);
                }
            }
        }
    }
}

#[inline(always)]
fn compared<'a>(guides: &'a Guides, takes_part: &'a [f32], means: &'a Means, at: usize) -> Compared<'a> {
    Compared {
        mean: three_lanes(&means.mean, at),
        variance: three_lanes(&means.variance, at),
        normal: three_lanes(&guides.normal, at),
        albedo: three_lanes(&guides.albedo, at),
        label: lanes(&guides.label, at),
        instance: lanes(&guides.instance, at),
        takes_part: lanes(takes_part, at),
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
