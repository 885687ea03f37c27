//! Sample points: one Owen-scrambled Sobol sequence for each pixel and each set of dimensions.
//!
//! A path's dimensions are taken in sets of three: numbers that decide together (the choice of a light and the point on it; the choice of a
//! lobe and the direction within it) are stratified together. Each set is the first three dimensions of the Sobol sequence, whose first two
//! are a (0,2)-sequence. Its index is shuffled and its values are scrambled by hashes of (seed, pixel, set). This "padding" gives any
//! number of bounces good points (Burley 2020, *Practical Hash-based Owen Scrambling*, JCGT 9(4)).
//!
//! **Classes.** Sample i belongs to class i mod 4 ([`CLASSES`]), in every set. A class is c = Σ ωⁱ nᵢ over the bits nᵢ of a point's number
//! n in its sequence, where ω generates the field of four elements. The points of one class are a (0,2)-sequence in the first two
//! dimensions as well: for 2ᵏ consecutive points and a box of a × b digits, a + b = k − 2, the digits and c are k independent linear
//! functions of the index. (Pascal's triangle takes the powers of ω to powers of ω, and two consecutive powers are independent.) So the
//! four means of the classes are those of four stratified pictures, and their spread measures the error, while all samples together are
//! one sequence. A shuffle that keeps the classes shuffles the block of four and follows with the number within it.
//!
//! **Dithered across pixels.** For sets of the camera and the first surfaces (`SPREAD`), the first point of a pixel itself follows a
//! scrambled Sobol sequence along a Z-order curve through the picture. Neighbouring pixels draw different numbers, so that one is too
//! bright where another is too dark, and the noise of a few samples is fine grained (Ahmed and Wonka 2020, *Screen-Space Blue-Noise
//! Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels*). Only the first point is chosen, by flipping digits of the
//! pixel's own scramble at all positions where the point must differ. An Owen scramble with flipped digits is again an Owen scramble, so no
//! pixel's estimate gets worse, after any number of samples, and the final number of samples need not be known. The next three points
//! differ from the first alike in all pixels, in the first two digits, so that they follow the curve as far.

use std::cell::Cell;

use pumice_picture::film::CLASSES;

/// The purpose of a set of random numbers. The sets of bounces start at [`Dimensions::Bounce`], in steps of [`SETS_A_BOUNCE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Dimensions {
    /// Position within the pixel's filter.
    Film = 0,
    /// First set of the first bounce.
    Bounce = 1,
    /// Point of the camera's aperture. It is the last set, which no bounce reaches, so pictures without depth of field do not depend on it.
    Lens = u32::MAX,
}

/// The sets that each bounce uses, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum BounceSet {
    /// Direction towards the chosen light; choice of a light.
    Light = 0,
    /// Direction of scattering; choice of a lobe.
    Scatter = 1,
    /// Russian roulette; passing straight on through a transparent surface.
    Survival = 2,
    /// Choice of an emissive face where emission is chosen for a light.
    Emitter = 3,
}

/// Number of sets of one bounce.
pub const SETS_A_BOUNCE: u32 = 4;

/// Number of samples in a block, whose random numbers are made together: one sample of each class.
const BLOCK: usize = CLASSES as usize;

/// Number of sets whose random numbers are made for a whole block: those of the film and of four bounces, which most samples use.
const KEPT: usize = 1 + 4 * SETS_A_BOUNCE as usize;

/// The random numbers of one sample of one pixel.
#[derive(Clone, Debug)]
pub struct PixelSampler {
    base: u64,
    sample: u32,
    /// Key that all pixels share.
    shared: u64,
    /// Index of the pixel along a Z-order curve through the picture.
    place: u32,
    /// What all samples of the pixel have in common in each of the sets [`SPREAD`], from its first use on.
    spread: [Cell<Option<SpreadSet>>; SPREAD.end as usize],
    /// Whether numbers are made for a whole block of samples.
    by_blocks: bool,
    /// Bit s is set where `block` has the numbers of set s.
    known: Cell<u32>,
    /// The numbers of the block of samples that has this one, of the first sets.
    block: [[Cell<[f32; 3]>; BLOCK]; KEPT],
}

/// A set of one pixel whose first point is spread over the picture.
#[derive(Clone, Copy, Debug)]
struct SpreadSet {
    /// Key of the pixel's scramble.
    key: u64,
    /// Key of the scramble that all pixels share.
    shared: u64,
    /// Digits that are flipped in all of the pixel's points.
    flips: [u32; 3],
}

impl PixelSampler {
    /// Random numbers of sample number `sample` at `pixel` (x, y).
    pub fn new(seed: u64, pixel: [u32; 2], sample: u32) -> Self {
        // Pixels of one seed have different words (17 bits for each coordinate), and `mix` is a bijection: no two share their points, as
        // thousands would if their words were hashed to 32 bits.
        let word = u64::from(pixel[0]) | u64::from(pixel[1]) << 17;
        let seed = mix(seed);
        let (base, shared) = (mix(seed ^ word), mix(seed ^ SHARED_BY_PIXELS));
        Self {
            base,
            sample,
            shared,
            place: z_order(pixel),
            spread: [const { Cell::new(None) }; _],
            by_blocks: false,
            known: Cell::new(0),
            block: [const { [const { Cell::new([0.0; 3]) }; BLOCK] }; KEPT],
        }
    }

    /// Sets whether random numbers are made for whole blocks of samples. They are the same, for less work where a pixel gets most samples of a
    /// block, and for more where it gets one.
    #[must_use]
    pub fn by_blocks(self, by_blocks: bool) -> Self {
        Self { by_blocks, ..self }
    }

    /// Continues with sample number `sample` of the same pixel, with the numbers of [`PixelSampler::new`] for less work.
    #[inline]
    pub fn set_sample(&mut self, sample: u32) {
        if sample / CLASSES != self.sample / CLASSES {
            self.known.set(0);
        }
        self.sample = sample;
    }

    /// The numbers for `set` of bounce `bounce`, each in [0, 1).
    #[inline]
    pub fn bounce(&self, bounce: u32, set: BounceSet) -> [f32; 3] {
        self.set(Dimensions::Bounce as u32 + bounce * SETS_A_BOUNCE + set as u32)
    }

    /// The numbers for the position on the film.
    #[inline]
    pub fn film(&self) -> [f32; 2] {
        let [x, y, _] = self.set(Dimensions::Film as u32);
        [x, y]
    }

    /// The numbers for the point of the camera's aperture.
    #[inline]
    pub fn lens(&self) -> [f32; 2] {
        let [x, y, _] = self.set(Dimensions::Lens as u32);
        [x, y]
    }

    #[inline]
    fn set(&self, set: u32) -> [f32; 3] {
        let Some(block) = self.block.get(set as usize).filter(|_| self.by_blocks) else {
            return self.alone(set);
        };
        if self.known.get() & 1 << set == 0 {
            self.make_block(set, block);
        }
        block[(self.sample % CLASSES) as usize].get()
    }

    /// The numbers of one set for this sample alone.
    #[inline]
    fn alone(&self, set: u32) -> [f32; 3] {
        let Some(found) = self.spread.get(set as usize) else {
            let key = key_of(self.base, set);
            return scrambled_point(self.sample, key, key, 0).map(unit);
        };
        if self.sample == 0 {
            return self.first_place(set).map(unit);
        }
        let SpreadSet { key, shared, flips } = found.get().unwrap_or_else(|| self.spread_set(set));
        let here = scrambled_point(self.sample, key, shared, SHARED_DIGITS);
        [0, 1, 2].map(|d| unit(here[d] ^ flips[d]))
    }

    /// Makes the numbers of all samples of the block in one set.
    #[inline(never)]
    fn make_block(&self, set: u32, block: &[Cell<[f32; 3]>; BLOCK]) {
        let number = self.sample / CLASSES;
        let points = match self.spread.get(set as usize) {
            Some(found) => {
                let SpreadSet { key, shared, flips } = found.get().unwrap_or_else(|| self.spread_set(set));
                scrambled_block(number, key, shared, SHARED_DIGITS, flips)
            }
            None => {
                let key = key_of(self.base, set);
                scrambled_block(number, key, key, 0, [0; 3])
            }
        };
        for (i, sample) in block.iter().enumerate() {
            sample.set([0, 1, 2].map(|d| unit(points[d][i])));
        }
        self.known.set(self.known.get() | 1 << set);
    }

    /// Where the first point of a set lies that is spread over the picture.
    #[inline]
    fn first_place(&self, set: u32) -> [u32; 3] {
        let shared = key_of(self.shared, set);
        scrambled_point(self.place, shared, shared, 0)
    }

    /// Finds the digits that move the pixel's first point to its place in the sequence across pixels, and keeps them for its other samples.
    #[inline(never)]
    fn spread_set(&self, set: u32) -> SpreadSet {
        let (key, shared) = (key_of(self.base, set), key_of(self.shared, set));
        let first = scrambled_point(0, key, shared, SHARED_DIGITS);
        let there = self.first_place(set);
        let found = SpreadSet { key, shared, flips: [0, 1, 2].map(|d| first[d] ^ there[d]) };
        if let Some(known) = self.spread.get(set as usize) {
            known.set(Some(found));
        }
        found
    }
}

/// Sets whose first points are spread over the picture: those of the film and of the first two surfaces. After these, neighbouring pixels
/// see different things.
const SPREAD: std::ops::Range<u32> = 0..1 + 2 * SETS_A_BOUNCE;

/// The digits in which the first four points differ alike in all pixels.
const SHARED_DIGITS: u32 = 0xC000_0000;

/// A bit that is 0 in the word of every pixel, since these words have 34 bits.
const SHARED_BY_PIXELS: u64 = 1 << 63;

/// Key of the scramble of one set.
#[inline]
fn key_of(base: u64, set: u32) -> u64 {
    mix(base.wrapping_add(u64::from(set).wrapping_mul(0x9E37_79B9_7F4A_7C15)))
}

/// Point of a sample, with order and digits scrambled by `key`, but for the digits `kept`; `turn` orders the classes.
#[inline]
fn scrambled_point(sample: u32, key: u64, turn: u64, kept: u32) -> [u32; 3] {
    let index = shuffled(sample, key as u32, turn);
    let values = [index, sobol_second(index).reverse_bits(), sobol_fourth(index).reverse_bits()];
    let seeds = seeds_of(key);
    [0, 1, 2].map(|d| scrambled_upward(values[d], seeds[d], kept.reverse_bits()).reverse_bits())
}

/// [`scrambled_point`] of the four samples of a block, with the digits `flips` flipped: the digits of each dimension, sample by sample.
///
/// The numbers of a block's points differ in their two lowest bits, and both Sobol dimensions are linear over the field of two elements. So
/// the high bits are taken through the sequence once. The rest is arithmetic on four numbers at a time, which the compiler turns into SIMD
/// instructions.
fn scrambled_block(block: u32, key: u64, turn: u64, kept: u32, flips: [u32; 3]) -> [[u32; BLOCK]; 3] {
    let block = owen_scramble(block, key as u32);
    let class = class_of_block(block);
    let low = [0, 1, 2, 3].map(|sample| turned(sample, turn) ^ class);
    let high = block << 2;
    let (second, fourth) = (sobol_second(high).reverse_bits(), sobol_fourth(high).reverse_bits());
    let values = [
        low.map(|low| high | low),
        low.map(|low| second ^ AT_LOW[low as usize]),
        low.map(|low| fourth ^ AT_LOW[low as usize]),
    ];
    let (seeds, kept) = (seeds_of(key), kept.reverse_bits());
    let mut points = [[0; BLOCK]; 3];
    for d in 0..3 {
        for i in 0..BLOCK {
            points[d][i] = scrambled_upward(values[d][i], seeds[d], kept).reverse_bits() ^ flips[d];
        }
    }
    points
}

/// Second dimension of the Sobol sequence at the indices 0 to 3, with digits that count from the lowest bit. The fourth dimension has the same
/// numbers there, because both begin with the initial values 1 and 3.
const AT_LOW: [u32; BLOCK] = [
    sobol_second(0).reverse_bits(),
    sobol_second(1).reverse_bits(),
    sobol_second(2).reverse_bits(),
    sobol_second(3).reverse_bits(),
];

/// Seeds of the scrambles of the three dimensions.
#[inline]
fn seeds_of(key: u64) -> [u32; 3] {
    let (low, high) = (key as u32, (key >> 32) as u32);
    [
        high,
        low.rotate_left(16) ^ high.wrapping_mul(0x85EB_CA6B),
        high.rotate_left(16) ^ low.wrapping_mul(0xC2B2_AE35),
    ]
}

/// Owen scramble of digits that count from the lowest bit; the digits in the mask `kept` stay as they are.
#[inline]
fn scrambled_upward(value: u32, seed: u32, kept: u32) -> u32 {
    value & kept | hashed_upward(value, seed) & !kept
}

/// Index in the sequence of a sample: an Owen scramble that takes samples of a class to points of a class.
#[inline]
fn shuffled(sample: u32, key: u32, turn: u64) -> u32 {
    let block = owen_scramble(sample / CLASSES, key);
    block << 2 | turned(sample % CLASSES, turn) ^ class_of_block(block)
}

/// A class times 1, ω or ω², by the key. The low bit counts 1, the high bit ω; ω² = ω + 1.
#[inline]
fn turned(class: u32, key: u64) -> u32 {
    let (low, high) = (class & 1, class >> 1);
    match (key >> 32) % 3 {
        0 => class,
        1 => (low ^ high) << 1 | high,
        _ => low << 1 | low ^ high,
    }
}

/// Σ ωⁱ nᵢ over the bits of n = 4 · block.
#[inline]
fn class_of_block(block: u32) -> u32 {
    let ones = (block & 0xDB6D_B6DB).count_ones() & 1;
    let omegas = (block & 0x6DB6_DB6D).count_ones() & 1;
    omegas << 1 | ones
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
const fn sobol_second(index: u32) -> u32 {
    let mut x = index;
    x ^= x >> 16;
    x ^= (x >> 8) & 0x00FF_00FF;
    x ^= (x >> 4) & 0x0F0F_0F0F;
    x ^= (x >> 2) & 0x3333_3333;
    x ^= (x >> 1) & 0x5555_5555;
    x.reverse_bits()
}

/// Fourth dimension of the Sobol sequence (Joe and Kuo 2008, polynomial p = T³ + T + 1, initial values 1, 3, 1).
///
/// Its direction numbers follow v(i) = v(i−2) + v(i−3) + v(i−3)/8: with T for the next number and S for a shift by a digit, p(T) = S³. So
/// the index, as a polynomial in T, is expanded in powers of p: Σ p^q (a + b T + c T²) stands for three digits shifted by 3q, a·100 + b·110
/// + c·001 in binary. Four levels do that, by T^3n = p^n + T^n + 1 for n = 8, 4, 2, 1.
#[inline]
fn sobol_fourth(index: u32) -> u32 {
    let mut x = index;
    x ^= (x >> 24) & 0x0000_00FF;
    x ^= (x >> 16) & 0x0000_FF00;
    x ^= (x >> 8) & 0x0000_F000;
    x ^= (x >> 12) & 0x0000_0FFF;
    x ^= (x >> 8) & 0x0000_0FF0;
    x ^= (x >> 4) & 0x000C_00C0;
    x ^= (x >> 6) & 0x3F03_F03F;
    x ^= (x >> 4) & 0x3C03_C03C;
    x ^= (x >> 2) & 0x0820_8208;
    x ^= (x >> 3) & 0x071C_71C7;
    x ^= (x >> 2) & 0x0618_6186;
    x ^= (x >> 1) & 0x4924_9249;
    x.reverse_bits()
}

/// Nested uniform scramble by a hash in which each bit depends only on the bits above it: Laine and Karras 2011 with the constants of
/// Burley 2020, listing 3.
#[inline]
fn owen_scramble(value: u32, seed: u32) -> u32 {
    hashed_upward(value.reverse_bits(), seed).reverse_bits()
}

/// The hash of [`owen_scramble`], in which each bit depends only on the bits below it.
#[inline]
fn hashed_upward(value: u32, seed: u32) -> u32 {
    let mut x = value.wrapping_add(seed);
    x ^= x.wrapping_mul(0x6C50_B47C);
    x ^= x.wrapping_mul(0xB82F_1E52);
    x ^= x.wrapping_mul(0xC7AF_E638);
    x ^= x.wrapping_mul(0x8D22_F6E6);
    x
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
        // 1920 × 1080 words hashed to 32 bits would collide some 500 times.
        let mut bases: Vec<u64> = (0..1080)
            .flat_map(|y| (0..1920).map(move |x| [x, y]))
            .map(|pixel| PixelSampler::new(7, pixel, 0).base)
            .collect();
        let all = bases.len();
        bases.sort_unstable();
        bases.dedup();
        assert_eq!(bases.len(), all);
    }

    /// A sampler that goes from sample to sample, by blocks or not, has the numbers of one made for each, in any order of sets. The numbers
    /// of another sample are others.
    #[test]
    fn going_from_sample_to_sample_changes_no_number() {
        let all = |s: &PixelSampler| {
            let sets =
                (0..5).flat_map(|b| [BounceSet::Survival, BounceSet::Light].map(|set| s.bounce(b, set)));
            let mut numbers: Vec<f32> = sets.flatten().collect();
            numbers.extend(s.film().into_iter().chain(s.lens()));
            numbers
        };
        for (pixel, by_blocks) in
            [[0, 0], [3, 9], [1000, 700]].into_iter().flat_map(|p| [(p, false), (p, true)])
        {
            let mut going = PixelSampler::new(5, pixel, 0).by_blocks(by_blocks);
            for sample in [0, 1, 7, 2, 4096, 4098, 3] {
                going.set_sample(sample);
                let made = all(&PixelSampler::new(5, pixel, sample));
                assert_eq!(all(&going), made);
                assert_ne!(all(&PixelSampler::new(5, pixel, sample + 1)), made);
            }
        }
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

    /// Compares with the recurrence of the direction numbers (Joe and Kuo 2008, polynomial x³ + x + 1, initial values 1, 3, 1).
    #[test]
    fn fourth_dimension_follows_its_direction_numbers() {
        let mut directions = vec![1u32 << 31, 3 << 30, 1 << 29];
        for i in 3..32 {
            let (two, three) = (directions[i - 2], directions[i - 3]);
            directions.push(two ^ three ^ three >> 3);
        }
        for i in (0..4096u32).chain([u32::MAX, 0x8000_0000, 0xDEAD_BEEF, 0x1234_5678]) {
            let value = (0..32).filter(|b| i >> b & 1 != 0).fold(0, |v, b| v ^ directions[b]);
            assert_eq!(sobol_fourth(i), value, "{i}");
        }
    }

    /// The class of a point is the first two digits of the Sobol sequence's third dimension (polynomial x² + x + 1, initial values 1, 3),
    /// whose direction numbers are written out here.
    #[test]
    fn a_class_is_a_quarter_of_the_third_dimension() {
        let mut directions = vec![1u32 << 31, 3 << 30];
        for i in 2..32 {
            let (one, two) = (directions[i - 1], directions[i - 2]);
            directions.push(one ^ two ^ two >> 2);
        }
        let mut classes = std::collections::BTreeSet::new();
        for i in (0..4096u32).chain([u32::MAX, 0x8000_0000, 0xDEAD_BEEF, 0x1234_5678]) {
            let value = (0..32).filter(|b| i >> b & 1 != 0).fold(0, |v, b| v ^ directions[b]);
            classes.insert((value >> 30, i & 3 ^ class_of_block(i >> 2)));
        }
        assert_eq!(classes.len(), 4, "{classes:?}");
    }

    /// Whether `points`, as many as a power of two, have one point in every box of the unit square of that power's area.
    fn boxes_hit_once(points: &[[f32; 3]]) -> bool {
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

    /// Whether the third numbers of `points` lie in as many intervals.
    fn third_is_stratified(points: &[[f32; 3]]) -> bool {
        let mut seen = vec![false; points.len()];
        points.iter().all(|p| !std::mem::replace(&mut seen[(p[2] * points.len() as f32) as usize], true))
    }

    /// The first 2ⁿ points of a pixel (four at least), and those of each class, have one point in every elementary box of the first two numbers and one in
    /// every interval of the third, for sets that are dithered over the picture and for later ones.
    #[test]
    fn samples_and_their_classes_are_zero_two_sequences() {
        let set = BounceSet::Light;
        for (seed, bounce) in (0..20).flat_map(|seed| [(seed, 0), (seed, 5)]) {
            let all: Vec<_> =
                (0..1024).map(|i| PixelSampler::new(seed, [3, 9], i).bounce(bounce, set)).collect();
            for n in [4, 8, 16, 64, 256, 1024] {
                assert!(boxes_hit_once(&all[..n]) && third_is_stratified(&all[..n]), "{seed} {bounce}: {n}");
            }
            for class in 0..CLASSES as usize {
                let of_class: Vec<_> = all.iter().skip(class).step_by(CLASSES as usize).copied().collect();
                for n in [1, 2, 4, 8, 16, 64, 256] {
                    assert!(boxes_hit_once(&of_class[..n]), "{seed} {bounce}: {n} of class {class}");
                }
            }
            // Negative control: every third point, which are of all classes, has no such order.
            let other: Vec<_> = all.iter().skip(1).step_by(3).copied().take(256).collect();
            assert!(!boxes_hit_once(&other));
        }
        // Negative control: independent numbers have no such order.
        let random: Vec<_> =
            (0..256).map(|i| [3 * i + 1, 3 * i + 2, 3 * i + 3].map(|word| unit(mix(word) as u32))).collect();
        assert!(!boxes_hit_once(&random) && !third_is_stratified(&random));
    }

    /// The first 256 points have four in each of 4 × 4 × 4 boxes: these dimensions of the Sobol sequence have t ≤ 2, the sum of their
    /// polynomials' degrees less one (Niederreiter 1992, theorem 4.49), and 2 + 2 + 2 digits are 8 − t.
    #[test]
    fn the_three_numbers_of_a_set_are_stratified_together() {
        let in_box = |p: [f32; 3]| p.map(|v| (4.0 * v) as usize).iter().fold(0, |all, i| 4 * all + i);
        let counts = |points: &mut dyn Iterator<Item = [f32; 3]>| {
            points.fold([0; 64], |mut counts, p| {
                counts[in_box(p)] += 1;
                counts
            })
        };
        for (seed, bounce) in (0..20).flat_map(|seed| [(seed, 0), (seed, 5)]) {
            let point = |i| PixelSampler::new(seed, [3, 9], i).bounce(bounce, BounceSet::Light);
            assert_eq!(counts(&mut (0..256).map(point)), [4; 64], "{seed} {bounce}");
        }
        // Negative control: with the second number twice, most boxes are empty.
        let twice = |i| {
            let [u, v, _] = PixelSampler::new(1, [3, 9], i).bounce(0, BounceSet::Light);
            [u, v, v]
        };
        assert_ne!(counts(&mut (0..256).map(twice)), [4; 64]);
    }

    /// Pixels and dimensions are uncorrelated: the correlation over 4,096 pixels is within 5 σ = 5/√4096. (Neighbours are correlated in
    /// their first points, on purpose.)
    #[test]
    fn scrambles_are_independent() {
        let mut sums = [0f64; 3];
        for p in 0..4096u32 {
            let at =
                |x, s| f64::from(PixelSampler::new(7, [x, p / 64], s).bounce(0, BounceSet::Scatter)[0]) - 0.5;
            let other = PixelSampler::new(7, [p % 64, p / 64], 0);
            let here = at(p % 64, 0);
            sums[0] += at(p % 64, 2 * CLASSES) * at(p % 64 + 1, 2 * CLASSES);
            sums[1] += here * (f64::from(other.bounce(0, BounceSet::Light)[0]) - 0.5);
            sums[2] += here * (f64::from(other.bounce(0, BounceSet::Scatter)[1]) - 0.5);
        }
        for s in sums {
            assert!((s / 4096.0 * 12.0).abs() < 5.0 / 64.0, "{sums:?}");
        }
    }

    /// Mean square, over blocks of 8 × 8 pixels, of the error of their mean of a function with these samples for each pixel, times the
    /// number of samples: 1 for white noise of unit variance.
    fn coarse_error(samples: std::ops::Range<u32>, pair: impl Fn(&PixelSampler) -> [f32; 2]) -> f64 {
        // The function is 1 under a hyperbola in a corner of the square; its mean and variance have closed forms.
        let mean = 0.25 * (1.0 + 4f64.ln());
        let variance = mean - mean * mean;
        let f = |[u, v]: [f32; 2]| f64::from(u8::from(f64::from(u) * f64::from(v) < 0.25));
        let n = 64.0 * f64::from(samples.end - samples.start);
        let blocks = (0..256u32).map(|block| {
            let pixels = (0..64).map(|p| [8 * (block % 16) + p % 8, 8 * (block / 16) + p / 8]);
            let points =
                pixels.flat_map(|pixel| samples.clone().map(move |s| PixelSampler::new(3, pixel, s)));
            let sum: f64 = points.map(|point| f(pair(&point))).sum();
            (sum / n - mean).powi(2)
        });
        blocks.sum::<f64>() / 256.0 * n / variance
    }

    /// 64 stratified points leave about 8 of 64 cells that the curve crosses, each with less variance than a random point has: a fourth at
    /// most. The second to fourth points are chosen in two digits: 16 cells, of which the curve crosses 5. Their mean is stratified within
    /// the pixel besides. White noise of 256 blocks: 1 ± 0.09, so 5 σ is 0.45.
    #[test]
    fn the_first_samples_of_neighbours_cancel() {
        let set = |bounce| {
            move |s: &PixelSampler| s.bounce(bounce, BounceSet::Scatter).first_chunk().copied().unwrap()
        };
        for samples in [0..1, 1..2, 2..3, 3..4, 0..4] {
            let film = coarse_error(samples.clone(), PixelSampler::film);
            let scatter = coarse_error(samples.clone(), set(1));
            assert!(film < 0.25 && scatter < 0.25, "samples {samples:?}: {film} {scatter}");
        }
        // Negative control: later surfaces and later samples are independent.
        for error in [coarse_error(0..1, set(2)), coarse_error(28..29, set(0))] {
            assert!((error - 1.0).abs() < 0.45, "{error}");
        }
    }
}
