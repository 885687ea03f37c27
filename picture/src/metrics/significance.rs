//! Whether noise alone explains the difference of two rendered pictures whose variances are known.
//!
//! Per channel and tile of 8 × 8 pixels: Welch's t of the two tiles' means. A picture has thousands of tiles, so some p-values are
//! small by luck: the level is corrected for their number after Šidák (1967), as Subr and Arvo 2007, *Statistical Hypothesis
//! Testing for Assessing Monte Carlo Estimators*, advise. A true difference of a few pixels shows in its tile, a faint tint of the
//! whole picture in the mean difference, and wrong noise (correlated pixels, false variances) in the ratio of squared errors.

use serde::Serialize;

use super::student_t::two_sided_tail;
use crate::image::Image;

/// Pixels along a tile's side: wide enough to average heavy-tailed noise, small enough to keep a wrong edge from drowning.
pub const TILE_PIXELS: usize = 8;
/// Probability that at least one tile of two equal pictures is rejected.
pub const LEVEL: f64 = 0.01;

/// Variances of a picture's pixels.
#[derive(Clone, Copy, Debug)]
pub struct Variance<'a> {
    /// Per pixel and channel, of the pixel's mean (not of one sample).
    pub of_mean: &'a Image,
    /// Degrees of freedom behind each of these: independent estimates less one. Infinite where the variances are exact.
    pub degrees_of_freedom: f64,
}

/// What the tests say; arrays are by channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Significance {
    /// Tests made: tiles × 3 channels.
    pub tests: usize,
    /// Tests whose p-value is below `level_per_test`: more than 0 is a difference at 1 %.
    pub rejected: usize,
    /// Šidák's level of a single test.
    pub level_per_test: f64,
    /// Smallest p-value of all tests.
    pub smallest_p: f64,
    /// Pixel of the upper left corner of the tile with the smallest p-value.
    pub worst_tile: [usize; 2],
    /// Mean of a − b over the picture.
    pub mean_difference: [f64; 3],
    /// The same in its standard errors: beyond ±3 is a difference. 0 where nothing varies and nothing differs.
    pub mean_difference_in_standard_errors: [f64; 3],
    /// Mean of (a − b)² over the mean that the variances make one expect: about 1.
    pub mse_over_expected: [f64; 3],
}

/// Tests `a` against `b`; the four pictures are of one size.
pub fn significance(
    a: &Image,
    b: &Image,
    variance_a: Variance<'_>,
    variance_b: Variance<'_>,
) -> Significance {
    let tiles_across = a.width.div_ceil(TILE_PIXELS);
    let tiles_down = a.height.div_ceil(TILE_PIXELS);
    let tests = tiles_across * tiles_down * 3;
    let level_per_test = -f64::exp_m1(f64::ln_1p(-LEVEL) / tests as f64);

    let mut result = Significance {
        tests,
        rejected: 0,
        level_per_test,
        smallest_p: 1.0,
        worst_tile: [0; 2],
        mean_difference: [0.0; 3],
        mean_difference_in_standard_errors: [0.0; 3],
        mse_over_expected: [0.0; 3],
    };
    for channel in 0..3 {
        let mut whole = Sums::default();
        for tile in 0..tiles_across * tiles_down {
            let corner = [tile % tiles_across * TILE_PIXELS, tile / tiles_across * TILE_PIXELS];
            let mut sums = Sums::default();
            for y in corner[1]..(corner[1] + TILE_PIXELS).min(a.height) {
                for x in corner[0]..(corner[0] + TILE_PIXELS).min(a.width) {
                    let at = |picture: &Image| f64::from(picture.pixels[y * a.width + x][channel]);
                    sums.add(at(a) - at(b), at(variance_a.of_mean), at(variance_b.of_mean));
                }
            }
            let p = sums.p_value(variance_a.degrees_of_freedom, variance_b.degrees_of_freedom);
            result.rejected += usize::from(p < level_per_test);
            if p < result.smallest_p {
                (result.smallest_p, result.worst_tile) = (p, corner);
            }
            whole.merge(&sums);
        }
        let variance = whole.variance_a + whole.variance_b;
        result.mean_difference[channel] = whole.difference / whole.pixels;
        result.mean_difference_in_standard_errors[channel] = ratio(whole.difference, variance.sqrt());
        result.mse_over_expected[channel] = ratio(whole.square, variance);
    }
    result
}

/// Sums over the pixels of a tile in one channel.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    pixels: f64,
    difference: f64,
    square: f64,
    variance_a: f64,
    variance_b: f64,
    /// Sums of the variances' squares.
    square_a: f64,
    square_b: f64,
}

impl Sums {
    fn add(&mut self, difference: f64, variance_a: f64, variance_b: f64) {
        self.pixels += 1.0;
        self.difference += difference;
        self.square += difference * difference;
        self.variance_a += variance_a;
        self.variance_b += variance_b;
        self.square_a += variance_a * variance_a;
        self.square_b += variance_b * variance_b;
    }

    fn merge(&mut self, other: &Self) {
        self.pixels += other.pixels;
        self.difference += other.difference;
        self.square += other.square;
        self.variance_a += other.variance_a;
        self.variance_b += other.variance_b;
        self.square_a += other.square_a;
        self.square_b += other.square_b;
    }

    /// Welch 1947, *The generalization of "Student's" problem*: t of the difference, with the degrees of freedom of a sum of
    /// variance estimates after Satterthwaite (1946): (Σv)² / Σ(v²/ν).
    fn p_value(&self, degrees_a: f64, degrees_b: f64) -> f64 {
        let variance = self.variance_a + self.variance_b;
        if variance == 0.0 {
            // Nothing varies here, so any difference is a real one.
            return if self.square == 0.0 { 1.0 } else { 0.0 };
        }
        let degrees = variance * variance / (self.square_a / degrees_a + self.square_b / degrees_b);
        two_sided_tail(self.difference / variance.sqrt(), degrees)
    }
}

/// x / y, and 0 for 0 / 0.
fn ratio(x: f64, y: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x / y }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 96;
    const HEIGHT: usize = 70;
    const SAMPLES: usize = 16;

    /// Uniform noise from a 64-bit mix of a counter (splitmix64).
    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = self.0;
            z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ z >> 31) >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    /// A picture of means of skewed noise, with its variances estimated from the same samples as a renderer does it.
    fn noisy(seed: u64, truth: impl Fn(usize) -> f64) -> (Image, Image) {
        let mut noise = Noise(seed);
        let (mut means, mut variances) = (Vec::new(), Vec::new());
        for i in 0..WIDTH * HEIGHT {
            let pixel: [(f64, f64); 3] = std::array::from_fn(|_| {
                let samples: Vec<f64> = (0..SAMPLES).map(|_| truth(i) * 3.0 * noise.next().powi(2)).collect();
                let mean = samples.iter().sum::<f64>() / SAMPLES as f64;
                let square: f64 = samples.iter().map(|s| (s - mean).powi(2)).sum();
                (mean, square / (SAMPLES * (SAMPLES - 1)) as f64)
            });
            means.push(pixel.map(|p| p.0 as f32));
            variances.push(pixel.map(|p| p.1 as f32));
        }
        (Image::new(WIDTH, HEIGHT, means), Image::new(WIDTH, HEIGHT, variances))
    }

    fn test(a: &(Image, Image), b: &(Image, Image)) -> Significance {
        let variance = |v| Variance { of_mean: v, degrees_of_freedom: (SAMPLES - 1) as f64 };
        significance(&a.0, &b.0, variance(&a.1), variance(&b.1))
    }

    #[test]
    fn equal_truths_pass_and_unequal_ones_do_not() {
        let reference = noisy(1, |_| 1.0);
        let result = test(&noisy(2, |_| 1.0), &reference);
        assert_eq!(result.tests, 12 * 9 * 3);
        assert_eq!(result.rejected, 0, "{result:?}");
        for c in 0..3 {
            assert!(result.mean_difference_in_standard_errors[c].abs() < 4.0, "{result:?}"); // 4 σ: p = 6e-5
            // 6,720 squared differences of noise with kurtosis below 9: the mean's own σ is below 3 %, so this is 5 σ.
            assert!((result.mse_over_expected[c] - 1.0).abs() < 0.15, "{result:?}");
        }

        // Negative controls: one wrong tile is found and named; a tint too faint for any tile shows in the mean.
        let wrong_tile = |i: usize| (i % WIDTH / 8, i / WIDTH / 8) == (5, 3);
        let result = test(&noisy(3, |i| if wrong_tile(i) { 1.5 } else { 1.0 }), &reference);
        assert!(result.rejected > 0 && result.worst_tile == [40, 24], "{result:?}");
        let result = test(&noisy(4, |_| 1.03), &reference);
        assert!(result.mean_difference_in_standard_errors.iter().any(|z| z.abs() > 4.0), "{result:?}");
        // And variances that are a quarter of the truth show in the squared error.
        let mut proud = noisy(5, |_| 1.0);
        proud.1 = proud.1.map(|v| v.map(|v| v / 4.0));
        assert!(test(&proud, &reference).mse_over_expected.iter().all(|&r| r > 1.4));
    }

    #[test]
    fn where_nothing_varies_equal_is_equal() {
        let (a, zero) = (Image::new(3, 3, vec![[0.5; 3]; 9]), Image::new(3, 3, vec![[0.0; 3]; 9]));
        let exact = Variance { of_mean: &zero, degrees_of_freedom: f64::INFINITY };
        let same = significance(&a, &a, exact, exact);
        assert_eq!((same.tests, same.rejected, same.smallest_p), (3, 0, 1.0));
        assert_eq!(same.mean_difference_in_standard_errors, [0.0; 3]);
        let mut b = a.clone();
        b.pixels[4][1] += 1e-6;
        assert_eq!(significance(&b, &a, exact, exact).rejected, 1);
    }
}
