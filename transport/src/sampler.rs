//! Sample points: Owen-scrambled Sobol, one independent scramble for each pixel, replicate and named dimension.
//!
//! A path's dimensions are taken in pairs. Each pair is the first two dimensions of the Sobol sequence, a (0,2)-sequence, whose
//! index is shuffled and whose values are scrambled by hashes of (seed, pixel, replicate, pair): "padding", so that any number of
//! bounces has good points (Burley 2020, *Practical Hash-based Owen Scrambling*, JCGT 9(4)).
//!
//! Samples are dealt to [`REPLICATES`] scrambles in turn. Within a replicate the points are stratified, so their spread says
//! nothing of the error; the replicates are independent, so theirs does.
//!
//! **Dithered across pixels.** What pairs of the camera and the first surfaces (`SPREAD`) draw first in each replicate is itself a
//! scrambled Sobol sequence along a Z-shaped curve through the picture: neighbouring pixels draw different numbers, so that what one
//! finds too bright another finds too dark, and the noise of a few samples is fine grained (Ahmed and Wonka 2020, *Screen-Space
//! Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels*). Only the first point is chosen: all digits
//! of the pixel's own scramble are flipped so that it comes there. An Owen scramble with flipped digits is one, so no pixel's estimate
//! is any worse for it, after any number of samples, and nothing need be known of how many there will be.

use pumice_picture::film::REPLICATES;

/// What a pair of random numbers is for. Dimensions of a bounce follow [`Dimension::Bounce`] in steps of [`PAIRS_A_BOUNCE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Dimension {
    /// Position within the pixel's filter.
    Film = 0,
    /// First pair of the first bounce.
    Bounce = 1,
    /// Point of the camera's opening. The last of all: no bounce gets there, and pictures in which all is sharp do not depend on it.
    Lens = u32::MAX,
}

/// Pairs that each bounce uses, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum BouncePair {
    /// Direction towards the chosen light.
    Light = 0,
    /// Scattered direction.
    Scatter = 1,
    /// Which light, which lobe.
    Choice = 2,
    /// Russian roulette.
    Roulette = 3,
}

/// Pairs of one bounce.
pub const PAIRS_A_BOUNCE: u32 = 4;

/// Points of one sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelSampler {
    base: u64,
    index: u32,
    /// Key of what all pixels of a replicate share.
    shared: u64,
    /// The pixel's number along a Z-shaped curve through the picture.
    place: u32,
}

impl PixelSampler {
    /// Points of sample `sample` at `pixel` (x, y).
    pub fn new(seed: u64, pixel: [u32; 2], sample: u32) -> Self {
        // Pixels and replicates of one seed have different words (17 bits a coordinate) and `mix` loses nothing: no two share
        // their points, as they would by the thousand if their words were hashed to 32 bits.
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

    /// The pair for the film.
    #[inline]
    pub fn film(&self) -> [f32; 2] {
        self.pair(Dimension::Film as u32)
    }

    /// The pair for the camera's opening.
    #[inline]
    pub fn lens(&self) -> [f32; 2] {
        self.pair(Dimension::Lens as u32)
    }

    #[inline]
    fn pair(&self, dimension: u32) -> [f32; 2] {
        let key = key_of(self.base, dimension);
        let [mut x, mut y] = scrambled_point(self.index, key);
        if SPREAD.contains(&dimension) {
            // Of the first point this leaves where it shall be.
            let first = scrambled_point(0, key);
            let there = scrambled_point(self.place, key_of(self.shared, dimension));
            (x, y) = (x ^ first[0] ^ there[0], y ^ first[1] ^ there[1]);
        }
        [unit(x), unit(y)]
    }
}

/// Pairs whose first points are spread over the picture: the film's and those of the first two surfaces. Neighbours see different
/// things after those.
const SPREAD: std::ops::Range<u32> = 0..1 + 2 * PAIRS_A_BOUNCE;

/// No pixel's word has this bit: they end at the 37th.
const SHARED_BY_PIXELS: u64 = 1 << 63;

/// Key of one dimension's scramble.
#[inline]
fn key_of(base: u64, dimension: u32) -> u64 {
    mix(base.wrapping_add(u64::from(dimension).wrapping_mul(0x9E37_79B9_7F4A_7C15)))
}

/// Point `index` of the sequence, its order and its digits scrambled by `key`.
#[inline]
fn scrambled_point(index: u32, key: u64) -> [u32; 2] {
    let (low, high) = (key as u32, (key >> 32) as u32);
    let index = owen_scramble(index, low);
    let x = owen_scramble(index.reverse_bits(), high);
    let y = owen_scramble(sobol_second(index), low.rotate_left(16) ^ high.wrapping_mul(0x85EB_CA6B));
    [x, y]
}

/// The bits of x and y in turn: where a pixel comes on a curve that finishes each square of 2ⁿ × 2ⁿ pixels before the next. Pixels
/// 65,536 apart share it, and their first points.
#[inline]
fn z_order([x, y]: [u32; 2]) -> u32 {
    z_order_part(x) | z_order_part(y) << 1
}

/// 16 low bits, a gap after each.
#[inline]
fn z_order_part(v: u32) -> u32 {
    let v = v & 0xFFFF;
    let v = (v | v << 8) & 0x00FF_00FF;
    let v = (v | v << 4) & 0x0F0F_0F0F;
    let v = (v | v << 2) & 0x3333_3333;
    (v | v << 1) & 0x5555_5555
}

/// 24 high bits as a number in [0, 1): every value is exact and below 1.
#[inline]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Second dimension of the Sobol sequence. Its direction numbers are Pascal's triangle modulo 2: bit j of the value, from the top,
/// is the sum of the index's bits i whose number has all bits of j (Lucas), which is a sum over supersets in five steps.
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

/// Nested uniform scramble by a hash that lets each bit depend on the bits above it alone: Laine and Karras 2011 with the
/// constants of Burley 2020, listing 3.
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

/// A hash of 64-bit words that gives different words different values: the finaliser of SplitMix64 (Steele, Lea, Flood 2014).
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

    /// The recurrence of the direction numbers (Joe and Kuo 2008, polynomial x + 1).
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

    /// Any power of two points of a replicate, from the start, has one point in every elementary box: a (0,2)-sequence.
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
        // Independent numbers have no such order.
        let random: Vec<_> =
            (0..256).map(|i| [2 * i + 1, 2 * i + 2].map(|word| unit(mix(word) as u32))).collect();
        assert!(!boxes_hit_once(&random));
    }

    /// Pixels, replicates and dimensions do not follow each other: correlation over 4,096 pixels within 5 σ = 5/√4096. (Pixels do
    /// in the first two points of a replicate, on purpose.)
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

    /// Mean square over blocks of 8 × 8 pixels of the error of their mean of a function, one sample a pixel, times the number of
    /// pixels: 1 for white noise of unit variance.
    fn coarse_error(sample: u32, pair: impl Fn(&PixelSampler) -> [f32; 2]) -> f64 {
        // A corner of the square, and what lies under a hyperbola in it; its mean and variance in closed form.
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

    /// 64 stratified points leave some 8 cells of 64 that the curve crosses, each with less variance than a random point has: a
    /// fourth at most. Of second points the first digit alone is chosen: they fall into the other half than the first, so half of the
    /// variance goes. White noise of 256 blocks: 1 ± 0.09, so 5 σ is 0.45.
    #[test]
    fn the_first_samples_of_neighbours_cancel() {
        for sample in 0..2 * REPLICATES {
            let film = coarse_error(sample, PixelSampler::film);
            let scatter = coarse_error(sample, |s| s.bounce(1, BouncePair::Scatter));
            let most = if sample < REPLICATES { 0.25 } else { 0.75 };
            assert!(film < most && scatter < most, "sample {sample}: {film} {scatter}");
        }
        // Later surfaces and later samples are on their own.
        for error in [
            coarse_error(0, |s| s.bounce(2, BouncePair::Light)),
            coarse_error(7 * REPLICATES, |s| s.bounce(0, BouncePair::Scatter)),
        ] {
            assert!((error - 1.0).abs() < 0.45, "{error}");
        }
    }
}
