//! Sample points: Owen-scrambled Sobol, one independent scramble for each pixel, replicate and named dimension.
//!
//! A path's dimensions are taken in pairs. Each pair is the first two dimensions of the Sobol sequence, a (0,2)-sequence, whose
//! index is shuffled and whose values are scrambled by hashes of (seed, pixel, replicate, pair): "padding", so that any number of
//! bounces has good points (Burley 2020, *Practical Hash-based Owen Scrambling*, JCGT 9(4)).
//!
//! Samples are dealt to [`REPLICATES`] scrambles in turn. Within a replicate the points are stratified, so their spread says
//! nothing of the error; the replicates are independent, so theirs does.

/// Independent scrambles that a pixel's samples are dealt to.
pub const REPLICATES: u32 = 4;

/// What a pair of random numbers is for. Dimensions of a bounce follow [`Dimension::Bounce`] in steps of [`PAIRS_A_BOUNCE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Dimension {
    /// Position within the pixel's filter.
    Film = 0,
    /// First pair of the first bounce.
    Bounce = 1,
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
    base: u32,
    index: u32,
}

impl PixelSampler {
    /// Points of sample `sample` at `pixel` (x, y).
    pub fn new(seed: u64, pixel: [u32; 2], sample: u32) -> Self {
        let mut base = mix(seed as u32 ^ mix((seed >> 32) as u32));
        for word in [pixel[0], pixel[1], sample % REPLICATES] {
            base = mix(base ^ word.wrapping_mul(0x9E37_79B9)).wrapping_add(0x7F4A_7C15);
        }
        Self { base, index: sample / REPLICATES }
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

    #[inline]
    fn pair(&self, dimension: u32) -> [f32; 2] {
        let key = mix(self.base ^ dimension.wrapping_mul(0x85EB_CA6B));
        let index = owen_scramble(self.index, key);
        let x = owen_scramble(index.reverse_bits(), mix(key ^ 0xA511_E9B3));
        let y = owen_scramble(sobol_second(index), mix(key ^ 0x63D8_3595));
        [unit(x), unit(y)]
    }
}

/// 24 high bits as a number in [0, 1): every value is exact and below 1.
#[inline]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Second dimension of the Sobol sequence (its direction numbers are the rows of Pascal's triangle modulo 2).
#[inline]
fn sobol_second(mut index: u32) -> u32 {
    let (mut direction, mut value) = (1u32 << 31, 0);
    while index != 0 {
        if index & 1 != 0 {
            value ^= direction;
        }
        index >>= 1;
        direction ^= direction >> 1;
    }
    value
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

/// A 32-bit integer hash (Wellons' lowbias32).
#[inline]
fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7FEB_352D);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846C_A68B);
    x ^ (x >> 16)
}
