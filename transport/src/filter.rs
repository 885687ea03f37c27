//! Pixel filters by importance sampling: the filter's distribution gives a sample's position, and the sample counts fully in its own pixel,
//! as in Cycles. A non-negative filter then needs no weights, and pixels stay independent of each other (Ernst et al. 2006, *Filter
//! Importance Sampling*).

use std::f64::consts::PI;

use pumice_scene::Filter;

/// Steps of the inverted distribution of one half of the filter.
const STEPS: usize = 1024;

/// Offsets from a pixel's centre, distributed as the filter.
///
/// The Blackman-Harris distribution is inverted by bisection at 1,024 levels of each half and interpolated linearly: the cdf of the samples
/// is within 1/2048 of the exact one everywhere, and exact at the levels.
#[derive(Clone, Debug)]
pub struct FilterTable {
    width: f32,
    /// Inverse cdf of the upper half, in units of the width; empty for a box filter.
    inverse: Vec<f32>,
}

impl FilterTable {
    /// Prepares a filter.
    pub fn new(filter: &Filter) -> Self {
        match *filter {
            Filter::Box { width } => Self { width, inverse: Vec::new() },
            Filter::BlackmanHarris { width } => {
                let inverse = (0..=STEPS)
                    .map(|i| {
                        let level = i as f64 / STEPS as f64;
                        let (mut low, mut high) = (0.0f64, 0.5f64);
                        for _ in 0..50 {
                            let middle = 0.5 * (low + high);
                            if half_distribution(middle) < level { low = middle } else { high = middle }
                        }
                        (0.5 * (low + high)) as f32
                    })
                    .collect();
                Self { width, inverse }
            }
        }
    }

    /// Full width in pixels.
    pub fn width(&self) -> f32 {
        self.width
    }

    /// Inverse cdf of the upper half at equal steps, in units of the width; empty for a box filter.
    pub fn inverse(&self) -> &[f32] {
        &self.inverse
    }

    /// Offset in pixels for u in [0, 1), monotone in u.
    #[inline]
    pub fn sample(&self, u: f32) -> f32 {
        if self.inverse.is_empty() {
            return (u - 0.5) * self.width;
        }
        let s = 2.0 * u - 1.0;
        let place = s.abs() * STEPS as f32;
        let i = (place as usize).min(STEPS - 1);
        let x = self.inverse[i] + (self.inverse[i + 1] - self.inverse[i]) * (place - i as f32);
        x.copysign(s) * self.width
    }
}

/// Integral of the Blackman-Harris window (Harris 1978, table 1, 4 terms) from its centre to x widths, divided by that to ½.
fn half_distribution(x: f64) -> f64 {
    let p = 2.0 * PI * x;
    // Around its centre the window is a0 + a1 cos p + a2 cos 2p + a3 cos 3p; its integral over half of it is that of a0 alone.
    (0.35875 * p + 0.48829 * p.sin() + 0.14128 / 2.0 * (2.0 * p).sin() + 0.01168 / 3.0 * (3.0 * p).sin())
        / (0.35875 * PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with the window's own integral by the trapezoid rule.
    #[test]
    fn blackman_harris_follows_its_window() {
        let table = FilterTable::new(&Filter::BlackmanHarris { width: 3.0 });
        let window = |x: f64| {
            let v = 2.0 * PI * (x / 3.0 + 0.5);
            0.35875 - 0.48829 * v.cos() + 0.14128 * (2.0 * v).cos() - 0.01168 * (3.0 * v).cos()
        };
        const N: usize = 30_000;
        let total: f64 = (0..N).map(|i| window(-1.5 + 3.0 * (i as f64 + 0.5) / N as f64)).sum();
        let mut below = 0.0;
        let mut draws = (0..N).map(|i| f64::from(table.sample((i as f32 + 0.5) / N as f32))).peekable();
        let mut drawn = 0;
        let mut worst = 0.0f64;
        for i in 0..N {
            let x = -1.5 + 3.0 * (i as f64 + 1.0) / N as f64;
            below += window(x - 1.5 / N as f64) / total;
            while draws.next_if(|&d| d <= x).is_some() {
                drawn += 1;
            }
            worst = worst.max((drawn as f64 / N as f64 - below).abs());
        }
        // 1/2048 from the table; the rest is the step of the comparison.
        assert!(worst < 1.0 / 2048.0 + 2.0 / N as f64, "{worst}");
        // Negative control: a box of the same width is far off.
        let b = FilterTable::new(&Filter::Box { width: 3.0 });
        assert!((b.sample(0.75) - table.sample(0.75)).abs() > 0.2);
    }
}
