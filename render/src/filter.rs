//! Pixel filters, sampled: each camera ray is shot through a point drawn from the filter, and every sample counts 1.
//!
//! Nothing is splatted, so pixels are independent: they can be made in any order, and the variance of a pixel's mean is that of
//! its own samples (Ernst, Stamminger, Greiner 2006, *Filter Importance Sampling*).
//!
//! ```text
//! sample(u0, u1) = (invert_cdf(u0), invert_cdf(u1)) · width      both filters are separable and symmetric
//! ```
//! The Blackman-Harris window is that of Cycles (`filter_func_blackman_harris`, `src/scene/film.cpp`). Its CDF has a closed form
//! but its inverse has none: the CDF is tabulated at 1025 points and inverted by linear interpolation, which makes the
//! density a constant a step, at most 2e-6 of probability away from the window's (the bound is in the test).

use std::f64::consts::TAU;

use pumice_scene::Filter;

/// Steps of the tabulated CDF.
const STEPS: usize = 1024;

/// A filter that is ready to be sampled.
#[derive(Clone, Debug)]
pub struct PixelFilter {
    width: f32,
    /// CDF at i / [`STEPS`] of the width; empty for a box.
    cdf: Vec<f32>,
}

impl PixelFilter {
    /// Tabulates a filter.
    pub fn new(filter: Filter) -> Self {
        match filter {
            Filter::Box { width } => Self { width, cdf: Vec::new() },
            Filter::BlackmanHarris { width } => {
                let cdf = (0..=STEPS).map(|i| blackman_harris_cdf(i as f64 / STEPS as f64) as f32);
                Self { width, cdf: cdf.collect() }
            }
        }
    }

    /// Offset in pixels from the pixel's centre, each within ± half the width, for two numbers in [0, 1).
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> [f32; 2] {
        u.map(|u| self.width * (self.invert_cdf(u) - 0.5))
    }

    /// The place in [0, 1] below which the filter has a share of `u`.
    #[inline]
    fn invert_cdf(&self, u: f32) -> f32 {
        if self.cdf.is_empty() {
            return u;
        }
        // The first entry is 0 and the last is 1, so `i` is a step: cdf[i] <= u, and u < cdf[i + 1] unless u is 1.
        let i = self.cdf.partition_point(|&c| c <= u).clamp(1, STEPS) - 1;
        let (low, high) = (self.cdf[i], self.cdf[i + 1]);
        let within = if high > low { (u - low) / (high - low) } else { 0.5 };
        (i as f32 + within) / STEPS as f32
    }
}

/// Integral from 0 to x of Cycles' window 0.35875 − 0.48829 cos 2πx + 0.14128 cos 4πx − 0.01168 cos 6πx, over that to 1.
fn blackman_harris_cdf(x: f64) -> f64 {
    let s = |k: f64| (k * TAU * x).sin() / (k * TAU);
    let integral = 0.35875 * x - 0.48829 * s(1.0) + 0.14128 * s(2.0) - 0.01168 * s(3.0);
    (integral / 0.35875).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CDF of the window over `width` pixels at an offset in pixels, by adding up 10⁴ midpoints of the window itself.
    fn naive_cdf(width: f64) -> impl Fn(f64) -> f64 {
        let steps = 10_000;
        let mut sums = vec![0.0];
        for i in 0..steps {
            let v = TAU * (f64::from(i) + 0.5) / f64::from(steps);
            let w = 0.35875 - 0.48829 * v.cos() + 0.14128 * (2.0 * v).cos() - 0.01168 * (3.0 * v).cos();
            sums.push(sums[i as usize] + w);
        }
        move |offset| {
            let at = ((offset / width + 0.5) * f64::from(steps)).clamp(0.0, f64::from(steps));
            let i = (at as usize).min(steps as usize - 1);
            (sums[i] + (at - i as f64) * (sums[i + 1] - sums[i])) / sums[steps as usize]
        }
    }

    /// Greatest distance between the sampled distribution and `cdf`: sampling is monotonic, so 10⁵ even steps of u show it.
    fn worst(filter: &PixelFilter, axis: usize, cdf: impl Fn(f64) -> f64) -> f64 {
        let us = (0..100_000).map(|i| (i as f32 + 0.5) / 100_000.0);
        us.map(|u| {
            let offset = filter.sample(if axis == 0 { [u, 0.3] } else { [0.3, u] })[axis];
            (cdf(f64::from(offset)) - f64::from(u)).abs()
        })
        .fold(0.0, f64::max)
    }

    #[test]
    fn samples_follow_the_window() {
        for width in [1.0f32, 3.0, 3.7] {
            let filter = PixelFilter::new(Filter::BlackmanHarris { width });
            for axis in [0, 1] {
                // Interpolating a CDF in steps of h errs by at most h²/8 · max |slope of the density|, and that slope is at most
                // 2π (0.48829 + 2 · 0.14128 + 3 · 0.01168) / 0.35875 = 14.1: 1.7e-6. Offsets as f32 add about 1.2e-7 · density
                // 2.8 at the centre; the naive CDF's own linear pieces add 1.8e-8.
                let distance = worst(&filter, axis, naive_cdf(f64::from(width)));
                assert!(distance < 2.2e-6, "width {width}, axis {axis}: {distance}");
            }
        }
    }

    #[test]
    fn the_check_notices_a_wrong_window() {
        let boxed = PixelFilter::new(Filter::Box { width: 3.0 });
        assert!(worst(&boxed, 0, naive_cdf(3.0)) > 0.1);
        let narrow = PixelFilter::new(Filter::BlackmanHarris { width: 2.99 });
        assert!(worst(&narrow, 0, naive_cdf(3.0)) > 1e-4);
    }

    #[test]
    fn a_box_is_even() {
        let boxed = PixelFilter::new(Filter::Box { width: 2.0 });
        for i in 0..1000 {
            let u = i as f32 / 1000.0;
            assert_eq!(boxed.sample([u, 1.0 - u]), [2.0 * (u - 0.5), 2.0 * (1.0 - u - 0.5)]);
        }
    }

    #[test]
    fn the_ends_stay_within_the_width() {
        let last = 1.0 - f32::EPSILON / 2.0;
        for filter in [Filter::Box { width: 1.0 }, Filter::BlackmanHarris { width: 1.0 }] {
            for u in [0.0, f32::MIN_POSITIVE, 1e-7, 0.5, last, 1.0] {
                let [x, y] = PixelFilter::new(filter).sample([u, u]);
                assert!(x.abs() <= 0.5 && x == y, "{filter:?} at {u}: {x}");
            }
        }
        let filter = PixelFilter::new(Filter::BlackmanHarris { width: 3.0 });
        assert!(filter.sample([0.5, 0.5])[0].abs() < 1e-6, "the middle is the centre");
    }
}
