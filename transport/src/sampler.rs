//! Sample points: Owen-scrambled Sobol, one independent scramble for each pixel, replicate and named dimension.
//!
//! A path's dimensions are taken in pairs. Each pair is the first two dimensions of the Sobol sequence, a (0,2)-sequence, whose index is
//! shuffled and whose values are scrambled by hashes of (seed, pixel, replicate, pair). This "padding" gives any number of bounces good
//! points (Burley 2020, *Practical Hash-based Owen Scrambling*, JCGT 9(4)).
//!
//! Samples alternate among [`REPLICATES`] scrambles. Within a replicate the points are stratified, so their variance does not measure the
//! error; the replicates are independent, so the variance between them does.
//!
//! **Dithered across pixels.** For pairs of the camera and the first surfaces (`SPREAD`), the first point of each replicate itself follows
//! a scrambled Sobol sequence along a Z-order curve through the picture. Neighbouring pixels draw different numbers, so that one is too
//! bright where another is too dark, and the noise of a few samples is fine grained (Ahmed and Wonka 2020, *Screen-Space Blue-Noise
//! Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels*). Only the first point is chosen, by flipping digits of the
//! pixel's own scramble at all positions where the point must differ. An Owen scramble with flipped digits is again an Owen scramble, so no
//! pixel's estimate gets worse, after any number of samples, and the final number of samples need not be known.

use pumice_picture::film::REPLICATES;

/// The purpose of a pair of random numbers. The dimensions of bounces start at [`Dimension::Bounce`], in steps of [`PAIRS_A_BOUNCE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Dimension {
    /// Position within the pixel's filter.
    Film = 0,
    /// First pair of the first bounce.
    Bounce = 1,
    /// Point of the camera's aperture. It is the last dimension, which no bounce reaches, so pictures without depth of field do not depend
    /// on it.
    Lens = u32::MAX,
}

/// The pairs that each bounce uses, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum BouncePair {
    /// Direction towards the chosen light.
    Light = 0,
    /// Direction of scattering.
    Scatter = 1,
    /// Choice of a light, choice of a lobe.
    Choice = 2,
    /// Russian roulette.
    Roulette = 3,
}

/// Number of pairs of one bounce.
pub const PAIRS_A_BOUNCE: u32 = 4;

/// The random numbers of one sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelSampler {
    base: u64,
    index: u32,
    /// Key that all pixels of a replicate share.
    shared: u64,
    /// Index of the pixel along a Z-order curve through the picture.
    place: u32,
}

impl PixelSampler {
    /// Random numbers of sample number `sample` at `pixel` (x, y).
    pub fn new(seed: u64, pixel: [u32; 2], sample: u32) -> Self {
        // Pixels and replicates of one seed have different words (17 bits for each coordinate), and `mix` is a bijection: no two share
        // their points, as thousands would if their words were hashed to 32 bits.
        let word = u64::from(pixel[0]) | u64::from(pixel[1]) << 17 | u64::from(sample % REPLICATES) << 34;
        let (seed, base) = (mix(seed), mix(mix(seed) ^ word));
        let shared = mix(seed ^ (u64::from(sample % REPLICATES) << 34 | SHARED_BY_PIXELS));
        Self { base, index: sample / REPLICATES, shared, place: z_order(pixel) }
    }

    /// The pair for `pair` of bounce `bounce`, each number in [0, 1).
    #[inline]
    pub fn bounce(&self, bounce: u32, pair: BouncePair) -> [f32; 2] {
        self.pair(Dimension::Bounce as u32 + bounce * PAIRS_A_BOUNCE + pair as u32)
    }

    /// The pair for the position on the film.
    #[inline]
    pub fn film(&self) -> [f32; 2] {
        self.pair(Dimension::Film as u32)
    }

    /// The pair for the point of the camera's aperture.
    #[inline]
    pub fn lens(&self) -> [f32; 2] {
        self.pair(Dimension::Lens as u32)
    }

    #[inline]
    fn pair(&self, dimension: u32) -> [f32; 2] {
        let key = key_of(self.base, dimension);
        let [mut x, mut y] = scrambled_point(self.index, key);
        if SPREAD.contains(&dimension) {
            // Moves the first point to its place in the sequence across pixels.
            let first = scrambled_point(0, key);
            let there = scrambled_point(self.place, key_of(self.shared, dimension));
            (x, y) = (x ^ first[0] ^ there[0], y ^ first[1] ^ there[1]);
        }
        [unit(x), unit(y)]
    }
}

/// Pairs whose first points are spread over the picture: those of the film and of the first two surfaces. After these, neighbouring pixels
/// see different things.
const SPREAD: std::ops::Range<u32> = 0..1 + 2 * PAIRS_A_BOUNCE;

/// A bit that is 0 in the word of every pixel, since these words have 37 bits.
const SHARED_BY_PIXELS: u64 = 1 << 63;

/// Key of the scramble of one dimension.
#[inline]
fn key_of(base: u64, dimension: u32) -> u64 {
    mix(base.wrapping_add(u64::from(dimension).wrapping_mul(0x9E37_79B9_7F4A_7C15)))
}

/// Point `index` of the sequence, with order and digits scrambled by `key`.
#[inline]
fn scrambled_point(index: u32, key: u64) -> [u32; 2] {
    let (low, high) = (key as u32, (key >> 32) as u32);
    let index = owen_scramble(index, low);
    let x = owen_scramble(index.reverse_bits(), high);
    let y = owen_scramble(sobol_second(index), low.rotate_left(16) ^ high.wrapping_mul(0x85EB_CA6B));
    [x, y]
}

/// Interleaves the bits of x and y: the position of a pixel on a curve that finishes each square of 2ⁿ × 2ⁿ pixels before the next. Pixels
/// 65,536 apart share their position and their first points.
#[inline]
fn z_order([x, y]: [u32; 2]) -> u32 {
    z_order_part(x) | z_order_part(y) << 1
}

/// Spreads the low 16 bits, with a gap after each.
#[inline]
fn z_order_part(v: u32) -> u32 {
    let v = v & 0xFFFF;
    let v = (v | v << 8) & 0x00FF_00FF;
    let v = (v | v << 4) & 0x0F0F_0F0F;
    let v = (v | v << 2) & 0x3333_3333;
    (v | v << 1) & 0x5555_5555
}

/// The high 24 bits as a number in [0, 1): every value is exact and below 1.
#[inline]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Second dimension of the Sobol sequence. Its direction numbers are Pascal's triangle modulo 2: bit j of the value, from the top, is the
/// sum of the index's bits i for which i contains all bits of j (Lucas), a sum over supersets in five steps.
#[inline]
fn sobol_second(index: u32) -> u32 {
    let mut x = index;
    x ^= x >> 16;
    x ^= (x >> 8) & 0x00FF_00FF;
    x ^= (x >> 4) & 0x0F0F_0F0F;
    x ^= (x >> 2) & 0x3333_3333;
    x ^= (x >> 1) & 0x5555_5555;
    x.reverse_bits()
}

/// Nested uniform scramble by a hash in which each bit depends only on the bits above it: Laine and Karras 2011 with the constants of
/// Burley 2020, listing 3.
#[inline]
fn owen_scramble(value: u32, seed: u32) -> u32 {
    let mut x = value.reverse_bits();
    x = x.wrapping_add(seed);
    x ^= x.wrapping_mul(0x6C50_B47C);
    x ^= x.wrapping_mul(0xB82F_1E52);
    x ^= x.wrapping_mul(0xC7AF_E638);
    x ^= x.wrapping_mul(0x8D22_F6E6);
    x.reverse_bits()
}

/// A bijective hash of 64-bit words: the finaliser of SplitMix64 (Steele, Lea, Flood 2014).
#[inline]
fn mix(mut x: u64) -> u64 {
    x ^= x >> 30;
    x = x.wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x ^= x >> 27;
    x = x.wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_pixels_share_their_points() {
        // 1920 × 1080 × 4 words hashed to 32 bits would collide some 8,000 times.
        let mut bases: Vec<u64> = (0..1080)
            .flat_map(|y| (0..1920).flat_map(move |x| (0..REPLICATES).map(move |r| (x, y, r))))
            .map(|(x, y, r)| PixelSampler::new(7, [x, y], r).base)
            .collect();
        let all = bases.len();
        bases.sort_unstable();
        bases.dedup();
        assert_eq!(bases.len(), all);
    }

    /// Compares with the recurrence of the direction numbers (Joe and Kuo 2008, polynomial x + 1).
    #[test]
    fn second_dimension_follows_its_direction_numbers() {
        for i in (0..4096u32).chain([u32::MAX, 0x8000_0000, 0xDEAD_BEEF]) {
            let (mut index, mut direction, mut value) = (i, 1u32 << 31, 0);
            while index != 0 {
                value ^= direction * (index & 1);
                index >>= 1;
                direction ^= direction >> 1;
            }
            assert_eq!(sobol_second(i), value, "{i}");
        }
    }

    fn boxes_hit_once(points: &[[f32; 2]]) -> bool {
        let n = points.len();
        let bits = n.trailing_zeros();
        (0..=bits).all(|k| {
            let (w, h) = (1usize << k, n >> k);
            let mut seen = vec![false; n];
            points.iter().all(|p| {
                let i = (p[0] * w as f32) as usize + w * (p[1] * h as f32) as usize;
                !std::mem::replace(&mut seen[i], true)
            })
        })
    }

    /// The first 2ⁿ points of a replicate, for any n, have one point in every elementary box: a (0,2)-sequence.
    #[test]
    fn replicates_are_zero_two_sequences() {
        for seed in 0..20 {
            for replicate in 0..REPLICATES {
                let points: Vec<_> = (0..256)
                    .map(|i| {
                        PixelSampler::new(seed, [3, 9], i * REPLICATES + replicate)
                            .bounce(2, BouncePair::Light)
                    })
                    .collect();
                for n in [1, 4, 16, 64, 256] {
                    assert!(boxes_hit_once(&points[..n]), "seed {seed}, {n} points");
                }
            }
        }
        // Negative control: independent numbers have no such order.
        let random: Vec<_> =
            (0..256).map(|i| [2 * i + 1, 2 * i + 2].map(|word| unit(mix(word) as u32))).collect();
        assert!(!boxes_hit_once(&random));
    }

    /// Pixels, replicates and dimensions are uncorrelated: the correlation over 4,096 pixels is within 5 σ = 5/√4096. (Pixels are
    /// correlated in the first two points of a replicate, on purpose.)
    #[test]
    fn scrambles_are_independent() {
        let mut sums = [0f64; 4];
        for p in 0..4096u32 {
            let at = |x, s| {
                f64::from(PixelSampler::new(7, [x, p / 64], s).bounce(0, BouncePair::Scatter)[0]) - 0.5
            };
            let other = PixelSampler::new(7, [p % 64, p / 64], 0);
            let here = at(p % 64, 0);
            sums[0] += at(p % 64, 2 * REPLICATES) * at(p % 64 + 1, 2 * REPLICATES);
            sums[1] += here * at(p % 64, 1);
            sums[2] += here * (f64::from(other.bounce(0, BouncePair::Light)[0]) - 0.5);
            sums[3] += here * (f64::from(other.bounce(0, BouncePair::Scatter)[1]) - 0.5);
        }
        for s in sums {
            assert!((s / 4096.0 * 12.0).abs() < 5.0 / 64.0, "{sums:?}");
        }
    }

    /// Mean square, over blocks of 8 × 8 pixels, of the error of their mean of a function with one sample for each pixel, times the number
    /// of pixels: 1 for white noise of unit variance.
    fn coarse_error(sample: u32, pair: impl Fn(&PixelSampler) -> [f32; 2]) -> f64 {
        // The function is 1 under a hyperbola in a corner of the square; its mean and variance have closed forms.
        let (mean, variance) = (0.25 * (1.0 + 4f64.ln()), 0.25 * (1.0 + 4f64.ln()));
        let variance = variance - mean * mean;
        let f = |[u, v]: [f32; 2]| f64::from(u8::from(f64::from(u) * f64::from(v) < 0.25));
        let blocks = (0..256u32).map(|block| {
            let pixels = (0..64).map(|p| [8 * (block % 16) + p % 8, 8 * (block / 16) + p / 8]);
            let sum: f64 = pixels.map(|pixel| f(pair(&PixelSampler::new(3, pixel, sample)))).sum();
            (sum / 64.0 - mean).powi(2)
        });
        blocks.sum::<f64>() / 256.0 * 64.0 / variance
    }

    /// 64 stratified points leave about 8 of 64 cells that the curve crosses, each with less variance than a random point has: a fourth at
    /// most. For second points only the first digit is chosen: they fall into the other half than the first point, so half of the variance
    /// disappears. White noise of 256 blocks: 1 ± 0.09, so 5 σ is 0.45.
    #[test]
    fn the_first_samples_of_neighbours_cancel() {
        for sample in 0..2 * REPLICATES {
            let film = coarse_error(sample, PixelSampler::film);
            let scatter = coarse_error(sample, |s| s.bounce(1, BouncePair::Scatter));
            let most = if sample < REPLICATES { 0.25 } else { 0.75 };
            assert!(film < most && scatter < most, "sample {sample}: {film} {scatter}");
        }
        // Negative control: later surfaces and later samples are independent.
        for error in [
            coarse_error(0, |s| s.bounce(2, BouncePair::Light)),
            coarse_error(7 * REPLICATES, |s| s.bounce(0, BouncePair::Scatter)),
        ] {
            assert!((error - 1.0).abs() < 0.45, "{error}");
        }
    }
}
