//! Binary arithmetic coding with chances that learn, in whole numbers alone: every machine decodes what any machine wrote.
//!
//! The range coder keeps an interval of 32 bits and cuts it where a bit's chance says (Martin, *Range encoding*, 1979, in the
//! carryless form of M. Mahoney's PAQ, *Adaptive weighing of context models for lossless data compression*, 2005, §3). A chance is what
//! a context has seen: it starts at a half and moves by 1/(n + 1.5) of the way towards each bit, n bits having been seen, so the first
//! ones count most (an estimator of Krichevsky and Trofimov, slightly bolder); from 255 on it forgets.

/// A chance that a bit is 1, of 65,536.
pub(super) type Chance = u32;

/// No bit is believed to be surer than this: a wrong belief costs 12 bits then.
const SUREST: Chance = 16;

/// Codes bits: an encoder is told them, a decoder tells them.
pub(super) trait Coder {
    /// A bit that is 1 by this chance, above 0 and below 65,536. `told` is `None` where it is to be decoded.
    fn code(&mut self, chance: Chance, told: Option<bool>) -> bool;
}

/// The interval from `low` to `high`, both within.
#[derive(Clone, Copy, Debug)]
struct Interval {
    low: u32,
    high: u32,
}

impl Interval {
    const ALL: Self = Self { low: 0, high: u32::MAX };

    /// Last place of the part that stands for 1.
    fn middle(self, chance: Chance) -> u32 {
        self.low + ((u64::from(self.high - self.low) * u64::from(chance)) >> 16) as u32
    }

    fn cut(&mut self, middle: u32, bit: bool) {
        if bit { self.high = middle } else { self.low = middle + 1 }
    }

    /// The first byte of all its places, where they have one; the interval is what follows it then.
    fn settled(&mut self) -> Option<u8> {
        let byte = (self.high >> 24) as u8;
        if self.low >> 24 != self.high >> 24 {
            return None;
        }
        (self.low, self.high) = (self.low << 8, self.high << 8 | 255);
        Some(byte)
    }
}

/// Bits into bytes.
#[derive(Debug)]
pub(super) struct Encoder {
    interval: Interval,
    bytes: Vec<u8>,
}

impl Encoder {
    pub(super) fn new() -> Self {
        Self { interval: Interval::ALL, bytes: Vec::new() }
    }

    /// All bytes.
    pub(super) fn finish(mut self) -> Vec<u8> {
        self.bytes.extend(self.interval.low.to_be_bytes());
        self.bytes
    }
}

impl Coder for Encoder {
    #[inline]
    fn code(&mut self, chance: Chance, told: Option<bool>) -> bool {
        let bit = told == Some(true);
        self.interval.cut(self.interval.middle(chance), bit);
        while let Some(byte) = self.interval.settled() {
            self.bytes.push(byte);
        }
        bit
    }
}

/// Bytes into bits.
#[derive(Debug)]
pub(super) struct Decoder<'a> {
    interval: Interval,
    code: u32,
    rest: &'a [u8],
    is_past_end: bool,
}

impl<'a> Decoder<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let mut decoder = Self { interval: Interval::ALL, code: 0, rest: bytes, is_past_end: false };
        (0..4).for_each(|_| decoder.take());
        decoder
    }

    fn take(&mut self) {
        let byte = self.rest.split_off_first();
        self.is_past_end |= byte.is_none();
        self.code = self.code << 8 | u32::from(byte.copied().unwrap_or(0));
    }

    /// Whether more bytes were needed than there are: what was decoded since means nothing.
    pub(super) fn is_past_end(&self) -> bool {
        self.is_past_end
    }

    /// Whether all bytes were needed.
    pub(super) fn is_at_end(&self) -> bool {
        self.rest.is_empty() && !self.is_past_end
    }
}

impl Coder for Decoder<'_> {
    #[inline]
    fn code(&mut self, chance: Chance, _: Option<bool>) -> bool {
        let middle = self.interval.middle(chance);
        let bit = self.code <= middle;
        self.interval.cut(middle, bit);
        while self.interval.settled().is_some() {
            self.take();
        }
        bit
    }
}

/// What a context has seen: a chance in 22 bits above a count in 10.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen(u32);

/// Bits after which the count stays.
const MOST_COUNTED: u32 = 255;

impl Seen {
    /// Nothing.
    pub(super) const NOTHING: Self = Self(1 << 31);

    /// The chance of 1 in 12 bits.
    #[inline]
    pub(super) fn twelve_bits(self) -> usize {
        (self.0 >> 20) as usize
    }

    #[inline]
    pub(super) fn learn(&mut self, bit: bool) {
        let (chance, count) = (self.0 >> 10, self.0 & 1023);
        let target = if bit { (1 << 22) - 1 } else { 0 };
        let way = i64::from(target) - i64::from(chance);
        // Floor of 65,536 / (n + 1.5).
        let part = i64::from(131_072 / (2 * count + 3));
        let chance = (i64::from(chance) + ((way * part) >> 16)) as u32;
        self.0 = chance << 10 | (count + u32::from(count < MOST_COUNTED));
    }

    /// Codes a bit by this chance alone, and learns it.
    #[inline]
    pub(super) fn code(&mut self, coder: &mut impl Coder, told: Option<bool>) -> bool {
        let bit = coder.code(bounded(self.0 >> 16), told);
        self.learn(bit);
        bit
    }
}

/// A chance that both bits have one by.
#[inline]
pub(super) fn bounded(chance: Chance) -> Chance {
    chance.clamp(SUREST, 65_536 - SUREST)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bits with a chance of 1 in 20 each come back, and take what Shannon says: −log₂ of the chances.
    #[test]
    fn bits_come_back_and_take_their_entropy() {
        let mut state = 1u64;
        let bits: Vec<bool> = (0..200_000)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33).is_multiple_of(20)
            })
            .collect();
        let (mut encoder, mut seen) = (Encoder::new(), Seen::NOTHING);
        bits.iter().for_each(|&b| _ = seen.code(&mut encoder, Some(b)));
        let bytes = encoder.finish();
        let ones = bits.iter().filter(|&&b| b).count() as f64 / bits.len() as f64;
        let entropy = -(ones * ones.log2() + (1.0 - ones) * (1.0 - ones).log2()) * bits.len() as f64 / 8.0;
        // A chance that forgets after 255 bits wavers: 0.5 to 1 bit for each of these (Krichevsky and Trofimov).
        let most = entropy + bits.len() as f64 / 255.0 / 8.0;
        assert!((entropy - 20.0..most).contains(&(bytes.len() as f64)), "{} of {entropy}", bytes.len());

        let (mut decoder, mut seen) = (Decoder::new(&bytes), Seen::NOTHING);
        assert!(bits.iter().all(|&b| seen.code(&mut decoder, None) == b));
        assert!(decoder.is_at_end());
        // One bit more may still fit into the last bytes; some hundred do not.
        (0..20_000).for_each(|_| _ = seen.code(&mut decoder, None));
        assert!(decoder.is_past_end());
    }

    #[test]
    fn the_surest_chances_code_both_bits() {
        for bit in [false, true] {
            for chance in [SUREST, 65_536 - SUREST] {
                let mut encoder = Encoder::new();
                (0..300).for_each(|i| _ = encoder.code(chance, Some(bit ^ (i % 3 == 0))));
                let bytes = encoder.finish();
                let mut decoder = Decoder::new(&bytes);
                assert!((0..300).all(|i| decoder.code(chance, None) == bit ^ (i % 3 == 0)));
            }
        }
    }
}
