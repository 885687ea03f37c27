//! The error of a growing mean over time, and the histogram of p-values as SVG.

use std::fmt::Write;

use pumice_picture::Image;
use pumice_picture::agreement::Agreement;

use crate::plot::{Axes, Curve as Plotted, log_log_svg};

/// Added to the squared mean, so that black pixels do not count infinitely: as in `metrics::rel_mse`.
const FLOOR: f64 = 0.01;
/// Bars of the histogram.
const BARS: usize = 20;

/// The estimated relative error of the mean of the first n pictures, at n = 2, 4, 8, …: the root of the mean over pixels and channels of the
/// variance of the mean over the squared mean.
#[derive(Default)]
pub(super) struct Curve {
    pictures: usize,
    /// Mean and sum of squared deviations of each value (Welford 1962).
    moments: Vec<[f64; 2]>,
    points: Vec<(f64, f64)>,
}

impl Curve {
    /// Adds a picture that was done after `seconds` of rendering.
    pub(super) fn add(&mut self, picture: &Image, seconds: f64) {
        self.moments.resize(3 * picture.pixels.len(), [0.0; 2]);
        self.pictures += 1;
        let n = self.pictures as f64;
        for (moment, &value) in self.moments.iter_mut().zip(picture.pixels.as_flattened()) {
            // What is not finite is masked elsewhere.
            let value = if value.is_finite() { f64::from(value) } else { moment[0] };
            let before = value - moment[0];
            moment[0] += before / n;
            moment[1] += before * (value - moment[0]);
        }
        if self.pictures > 1 && self.pictures.is_power_of_two() {
            self.points.push((seconds, self.error()));
        }
    }

    /// The error now; infinite with fewer than two pictures.
    pub(super) fn error(&self) -> f64 {
        let n = self.pictures as f64;
        if self.pictures < 2 {
            return f64::INFINITY;
        }
        let of = |m: &[f64; 2]| m[1] / (n - 1.0) / n / (m[0] * m[0] + FLOOR);
        (self.moments.iter().map(of).sum::<f64>() / self.moments.len() as f64).sqrt()
    }

    pub(super) fn points(&self) -> &[(f64, f64)] {
        &self.points
    }
}

/// Error against run time of both renderers.
pub(super) fn error_svg(named: [(&str, &[(f64, f64)]); 2]) -> Option<String> {
    let curves: Vec<Plotted<'_>> = named
        .into_iter()
        .map(|(name, points)| {
            let points = points.iter().filter(|(s, e)| *s > 0.0 && *e > 0.0 && e.is_finite());
            Plotted { name, points: points.map(|&(s, e)| (s, 100.0 * e)).collect() }
        })
        .filter(|curve| !curve.points.is_empty())
        .collect();
    let axes =
        Axes {
            x: "seconds", y: "estimated relative error, %", y_digits: 2, slope: Some((-0.5, "1/√time"))
        };
    log_log_svg("Error against run time", &axes, &curves).ok()
}

/// How often each p-value of the tiles occurs. Where both pictures are of one scene the bars are equal, up to chance: the grey band holds 99
/// of 100 bars.
pub(super) fn histogram_svg(agreement: &Agreement) -> String {
    let mut counts = [0usize; BARS];
    let drawn = agreement.tiles.iter().flatten().filter(|i| i.varies);
    for interval in drawn {
        counts[((interval.p * BARS as f64) as usize).min(BARS - 1)] += 1;
    }
    let all: usize = counts.iter().sum();
    let expected = all as f64 / BARS as f64;
    // A bar is binomial; 2.58 of its standard deviations hold 99 %.
    let band = 2.58 * (expected * (1.0 - 1.0 / BARS as f64)).sqrt();
    let top = counts.iter().map(|&c| c as f64).fold(expected + band, f64::max).max(1.0);
    let (width, height, left, bottom) = (720.0, 260.0, 50.0, 40.0);
    let y = |count: f64| (height - bottom) - (height - bottom - 20.0) * count / top;
    let bar = (width - left - 20.0) / BARS as f64;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"histogram of p-values\">\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\
         <rect x=\"{left}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"#ddd\"/>",
        y(expected + band),
        bar * BARS as f64,
        y((expected - band).max(0.0)) - y(expected + band),
    );
    for (i, &count) in counts.iter().enumerate() {
        let x = left + bar * i as f64;
        let top = y(count as f64);
        // Writing to a string cannot fail.
        let _ = write!(
            svg,
            "<rect x=\"{:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"#1f65a6\"/>",
            x + 1.0,
            bar - 2.0,
            height - bottom - top
        );
    }
    let _ = write!(
        svg,
        "<g font-family=\"sans-serif\" font-size=\"12\" fill=\"#333\"><text x=\"{left}\" y=\"{:.1}\">0</text>\
         <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">1</text>\
         <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">p-value of a tile's difference ({all} tiles and channels)</text>\
         <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{top:.0}</text></g></svg>",
        height - bottom + 16.0,
        width - 20.0,
        height - bottom + 16.0,
        width / 2.0,
        height - 8.0,
        left - 6.0,
        y(top) + 10.0,
    );
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_that_of_the_mean() {
        let mut curve = Curve::default();
        assert!(curve.error().is_infinite());
        for value in [1.0, 3.0, 1.0, 3.0] {
            curve.add(&Image::new(1, 1, vec![[value; 3]]), f64::from(value));
        }
        // Variance of the mean of 1, 3, 1, 3: 4/3 / 4; over 2² + 0.01.
        let expected = (1.0 / 3.0 / 4.01f64).sqrt();
        assert!((curve.error() - expected).abs() < 1e-12);
        assert_eq!(curve.points().len(), 2);
        assert!((curve.points()[1].1 - expected).abs() < 1e-12);
    }
}
