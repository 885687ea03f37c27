//! Intervals of differences between means, and where they stand to their margins.

use std::collections::BTreeMap;

use serde::Serialize;

use super::picture_set::Moment;
use crate::metrics::student_t::{two_sided_quantile, two_sided_tail};

/// Standard errors below this share of the value count as no variation. Float32 sums of up to 2¹⁴ samples are as inexact.
const NO_NOISE: f64 = 2e-6;

/// A difference, ours less theirs, with its interval and its margin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The difference of the means.
    pub difference: f64,
    /// The true difference lies within this distance of it, for all intervals together with the probability of the confidence level.
    pub half_width: f64,
    /// A difference up to this is negligible.
    pub margin: f64,
    /// Probability of a difference as large, where there is none.
    pub p: f64,
    /// Welch's t; infinite where nothing varies and there is a difference.
    pub t: f64,
    /// Whether anything varies. Where nothing does, `p` and `t` are not drawn by chance.
    pub varies: bool,
}

/// Where an interval stands to its margin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// It lies within the margin.
    Within,
    /// It lies wholly outside.
    Outside,
    /// Some of it is within, some outside.
    Open,
}

impl Interval {
    /// Where it stands to its margin.
    pub fn standing(&self) -> Standing {
        let distance = self.difference.abs();
        if distance + self.half_width <= self.margin {
            Standing::Within
        } else if distance - self.half_width > self.margin {
            Standing::Outside
        } else {
            Standing::Open
        }
    }

    /// Whether the interval proves a difference, however small.
    pub fn is_proven(&self) -> bool {
        self.difference.abs() > self.half_width
    }
}

/// Makes intervals of one confidence level.
pub(super) struct Intervals {
    /// Probability that a single interval misses.
    level: f64,
    /// Where nothing varies, differences up to this share of the value count as rounding.
    rounding: f64,
    /// Quantiles of Student's t by eighths of a degree of freedom.
    quantiles: BTreeMap<u64, f64>,
}

impl Intervals {
    /// Intervals of which all `count` hold with the probability `1 − level` (Šidák 1967). Where nothing varies, differences up to
    /// `rounding` times the value count as none.
    pub(super) fn new(level: f64, count: usize, rounding: f64) -> Self {
        Self { level: single_level(level, count), rounding, quantiles: BTreeMap::new() }
    }

    /// The interval of the difference of two means, each of `n` numbers.
    pub(super) fn of(&mut self, [ours, theirs]: [(&Moment, usize); 2], margin: f64) -> Interval {
        let difference = ours.0.mean() - theirs.0.mean();
        let value = value_of([ours.0, theirs.0]);
        let [a, b] = [ours, theirs].map(|(moment, _)| moment.variance_of_mean());
        let variance = a + b;
        if variance.is_infinite() {
            let half_width = f64::INFINITY;
            return Interval { difference, half_width, margin, p: 1.0, t: 0.0, varies: false };
        }
        if !varies(variance, value) {
            let half_width = self.rounding * value;
            let differs = difference.abs() > half_width;
            let t = if differs { f64::INFINITY.copysign(difference) } else { 0.0 };
            let p = f64::from(u8::from(!differs));
            return Interval { difference, half_width, margin, p, t, varies: false };
        }
        let of = |variance: f64, n: usize| variance * variance / (n as f64 - 1.0);
        let degrees = variance * variance / (of(a, ours.1) + of(b, theirs.1));
        let standard_error = (variance + (NO_NOISE * value).powi(2)).sqrt();
        let t = difference / standard_error;
        Interval {
            difference,
            half_width: self.quantile(degrees) * standard_error,
            margin,
            p: two_sided_tail(t, degrees),
            t,
            varies: true,
        }
    }

    /// The quantile for `degrees` of freedom rounded down, which makes the interval longer.
    fn quantile(&mut self, degrees: f64) -> f64 {
        let eighths = ((8.0 * degrees) as u64).max(8);
        *self.quantiles.entry(eighths).or_insert_with(|| two_sided_quantile(self.level, eighths as f64 / 8.0))
    }
}

/// Whether the variance of the difference of two means of about `value` is more than rounding.
pub(super) fn varies(variance: f64, value: f64) -> bool {
    variance > (NO_NOISE * value).powi(2)
}

/// The larger of two means: what rounding is a share of.
pub(super) fn value_of(means: [&Moment; 2]) -> f64 {
    means.into_iter().map(|moment| moment.mean().abs()).fold(0.0, f64::max)
}

/// The level of one of `count` tests that together have `level`.
pub(super) fn single_level(level: f64, count: usize) -> f64 {
    -f64::exp_m1(f64::ln_1p(-level) / count.max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moment(values: &[f64]) -> (Moment, usize) {
        let mut moment = Moment::default();
        values.iter().for_each(|&v| moment.add(v));
        (moment, values.len())
    }

    /// 1, 2, 3 and 2, 4, 4, 5, 10: variances of the means 1/3 and 9/5, 5.258 degrees of freedom, of which 5.25 are taken; there Student's
    /// t at 5 % is 2.5342, by Simpson's rule over its density.
    #[test]
    fn an_interval_is_welchs() {
        let ((a, n), (b, m)) = (moment(&[1.0, 2.0, 3.0]), moment(&[2.0, 4.0, 4.0, 5.0, 10.0]));
        let interval = Intervals::new(0.05, 1, 1e-4).of([(&a, n), (&b, m)], 0.1);
        assert!((interval.difference + 3.0).abs() < 1e-12);
        assert!((interval.half_width - 2.5342 * 2.133_33f64.sqrt()).abs() < 1e-3, "{}", interval.half_width);
        assert_eq!(interval.standing(), Standing::Open);
        assert!(!interval.is_proven() && interval.varies);
    }

    #[test]
    fn where_an_interval_stands() {
        let at = |difference, half_width| Interval {
            difference,
            half_width,
            margin: 1.0,
            p: 0.5,
            t: 0.0,
            varies: true,
        };
        for (interval, standing) in [
            (at(0.5, 0.5), Standing::Within),
            (at(-0.5, 0.6), Standing::Open),
            (at(1.5, 0.6), Standing::Open),
            (at(-1.5, 0.4), Standing::Outside),
        ] {
            assert_eq!(interval.standing(), standing, "{interval:?}");
        }
        assert!(at(0.5, 0.4).is_proven() && !at(0.5, 0.5).is_proven());
    }

    #[test]
    fn without_noise_rounding_remains() {
        let ((a, n), (b, m)) = (moment(&[1.0; 4]), moment(&[1.0 + 1e-6; 4]));
        let same = Intervals::new(0.01, 10, 1e-4).of([(&a, n), (&b, m)], 0.01);
        assert_eq!((same.standing(), same.p, same.varies), (Standing::Within, 1.0, false));
        let (c, k) = moment(&[1.1; 4]);
        let other = Intervals::new(0.01, 10, 1e-4).of([(&a, n), (&c, k)], 0.01);
        assert_eq!((other.standing(), other.p), (Standing::Outside, 0.0));
        // A single picture says nothing of its noise.
        let (one, k) = moment(&[1.0]);
        assert_eq!(Intervals::new(0.01, 10, 1e-4).of([(&a, n), (&one, k)], 0.01).standing(), Standing::Open);
    }
}
