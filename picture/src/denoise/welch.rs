//! Welch's t test of two pixels' means, as one comparison without a division by a square root.
//!
//! Two means with the variances a and b, each estimated with k degrees of freedom, differ significantly if d² > t²(ν) · (a + b). By Welch
//! (1947, *The Generalization of "Student's" Problem when Several Different Population Variances are Involved*) and Satterthwaite,
//! ν = k (a + b)² / (a² + b²): from k, where one pixel alone is noisy, to 2k, where both are equally noisy. With r = k / ν from ½ to 1,
//! t² is a smooth function of r, and the parabola through its values at ½, ¾ and 1 stands for it: a look at three planes of floats, which
//! compilers turn into vector instructions, where a table would be a look at memory for each lane.

use crate::metrics::student_t::two_sided_quantile;

/// Probability that the test tells apart two pixels of one mean, by channel. With 0.05 the error is larger by a few per cent, with 0.002 the
/// same.
const LEVEL: f64 = 0.01;

/// The same for the wide windows: what the first one's means have left of noise is so little that telling apart more costs nothing. With 0.01 the
/// error of noisy reflections is larger by a fifth.
const WIDE_LEVEL: f64 = 0.1;

/// Degrees of freedom of the variance of a window's mean: of the first one's 25 pixels where they tell it by how they differ, and where each has
/// three of its own as if two thirds of them counted nothing. That of the second window has more; 100 in place of 24 changes nothing.
const WIDE_DEGREES: f64 = 24.0;

/// A neighbour has the weight of this times the own variance over the sum of both, at most 1: less than 1 where its variance is more than seven
/// times as large. Estimates from four classes differ by up to that by chance, together with the means, and with 2 in place of 8 pictures
/// of 4 samples lost twice the light, up to an eighth, and had up to a half more visible difference.
const NOISIER: f32 = 8.0;

/// Added to the sum of two variances, so that there is something to divide by.
const LEAST: f32 = 1e-30;

/// The test at one level.
#[derive(Clone, Copy, Debug)]
pub struct WelchTest {
    /// Coefficients of t² in r: constant, linear, quadratic.
    t_squared: [f32; 3],
}

impl WelchTest {
    /// The denoiser's test, where each variance has these degrees of freedom; `None` where no variance is known.
    pub fn of(degrees: Option<f64>) -> Self {
        Self::new(LEVEL, degrees.unwrap_or(1.0))
    }

    /// The test of the wide windows.
    pub fn wide() -> Self {
        Self::new(WIDE_LEVEL, WIDE_DEGREES)
    }

    /// Coefficients of t² in r (the module says what that is): constant, linear, quadratic.
    pub fn t_squared(&self) -> [f32; 3] {
        self.t_squared
    }

    /// The test that rejects equal means with the probability `level`, where each variance has `degrees` of freedom.
    pub fn new(level: f64, degrees: f64) -> Self {
        let at = |r: f64| two_sided_quantile(level, degrees / r).powi(2);
        let (low, middle, high) = (at(0.5), at(0.75), at(1.0));
        // Newton's form through three points that are a quarter apart.
        let slope = (middle - low) / 0.25;
        let bend = (high - 2.0 * middle + low) / 0.125;
        let coefficients = [low - 0.5 * slope + 0.375 * bend, slope - 1.25 * bend, bend];
        Self { t_squared: coefficients.map(|c| c as f32) }
    }

    /// The weight of a pixel whose mean differs by `d`: 0 where the test rejects that both are equal, else 1, or with `for_noise` less where
    /// the other is much noisier ([`NOISIER`]). `own` and `other` are their variances, finite and not negative.
    #[inline(always)]
    pub(super) fn weight(&self, d: f32, own: f32, other: f32, for_noise: bool) -> f32 {
        let sum = own + other;
        // Of two variances of 0, r is 0, and the weight 1.
        let inverse = 1.0 / (sum + LEAST);
        let r = (own * own + other * other) * inverse * inverse;
        let share = if for_noise { ((NOISIER * own + LEAST) * inverse).min(1.0) } else { 1.0 };
        let [constant, linear, quadratic] = self.t_squared;
        if d * d <= (constant + r * (linear + r * quadratic)) * sum { share } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::student_t::two_sided_tail;

    /// Against the tail of Student's t itself: means at the edge of acceptance have the level as their probability. The parabola is off by
    /// most between its points: there the level may be a tenth larger or smaller.
    #[test]
    fn means_at_the_edge_have_the_level_as_their_probability() {
        for level in [0.05, 0.01, 0.002] {
            let test = WelchTest::new(level, 3.0);
            for i in 0..=20 {
                let (a, b) = (1.0f64, f64::from(i) / 20.0);
                let degrees = 3.0 * (a + b).powi(2) / (a * a + b * b);
                // The smallest difference that is rejected, by bisection.
                let (mut low, mut high) = (0.0f32, 100.0f32);
                for _ in 0..40 {
                    let middle = 0.5 * (low + high);
                    if test.weight(middle, a as f32, b as f32, true) > 0.0 {
                        low = middle
                    } else {
                        high = middle
                    }
                }
                let tail = two_sided_tail(f64::from(low) / (a + b).sqrt(), degrees);
                assert!((tail / level - 1.0).abs() < 0.1, "{level}, {b}: {tail}");
            }
        }
    }

    #[test]
    fn without_noise_only_equal_means_are_accepted() {
        let test = WelchTest::new(0.01, 3.0);
        assert_eq!((test.weight(0.0, 0.0, 0.0, true), test.weight(1e-18, 0.0, 0.0, true)), (1.0, 0.0));
        // Variances whose squares are beyond single precision.
        assert_eq!((test.weight(0.0, 1e-30, 1e-30, true), test.weight(1e-9, 1e-30, 1e-30, true)), (1.0, 0.0));
        assert_eq!(test.weight(1e6, 1e18, 1e18, true), 1.0);
    }

    /// A quiet neighbour counts in full, and so does one with seven times the variance; one with 39 times a fifth, 8 / (1 + 39).
    #[test]
    fn noisy_neighbours_count_less() {
        let test = WelchTest::new(0.01, 3.0);
        let cases = [
            (1.0, 1.0, 1.0),
            (1.0, 0.1, 1.0),
            (1.0, 7.0, 1.0),
            (1.0, 39.0, 0.2),
            (9.0, 1.0, 1.0),
            (0.0, 1.0, 0.0),
        ];
        for (own, other, weight) in cases {
            assert!((test.weight(0.0, own, other, true) - weight).abs() < 1e-6, "{own}, {other}");
        }
    }
}
