//! Binary arithmetic coding with adaptive probabilities, in integer arithmetic only, so every machine decodes what any machine wrote.
//!
//! ```text
//! 0 ─────────────────── code ───────────────────── range        64 bits, of which the stream gives 32 at a time
//! └──── bit is 1 ────┴────────── bit is 0 ──────────┘
//!     range · probability      the rest
//! ```
//! The range coder keeps an interval and splits it by the probability of the next bit (Martin, *Range encoding*, 1979). The split depends
//! on the width alone, as in I. Pavlov's LZMA, so that a decoder needs one comparison per bit. An interval narrower than 2³² is widened by
//! four bytes of the stream. The encoder propagates carries into bytes that it has already written.
//!
//! A context's probability starts at one half. After n bits, the next bit moves it by 1/(n + 1.5) of the distance to that bit, so the first
//! bits count most (the estimator of Krichevsky and Trofimov, slightly faster). n stops at 255, so the influence of old bits fades.

/// Probability that a bit is 1, in units of 1/65,536.
pub(super) type Probability = u32;

/// Lowest probability of a bit, so the least likely bit costs 12 bits.
const MIN_PROBABILITY: Probability = 16;

/// An encoder or a decoder, so that the same model code drives both.
pub(super) trait Coder {
    /// Codes one bit that is 1 with this probability, which must be above 0 and below 65,536. An encoder takes the bit from `told`; a
    /// decoder takes `None` and returns the decoded bit.
    fn code(&mut self, probability: Probability, told: Option<bool>) -> bool;
}

/// The coders widen intervals narrower than this.
const NARROW: u64 = 1 << 32;

/// Encodes bits into bytes.
#[derive(Debug)]
pub(super) struct Encoder {
    low: u64,
    range: u64,
    bytes: Vec<u8>,
}

impl Encoder {
    pub(super) fn new() -> Self {
        Self { low: 0, range: u64::MAX, bytes: Vec::new() }
    }

    /// Adds 1 to the big-endian number that `bytes` forms.
    #[cold]
    fn carry(&mut self) {
        for byte in self.bytes.iter_mut().rev() {
            *byte = byte.wrapping_add(1);
            if *byte != 0 {
                return;
            }
        }
    }

    /// Removes the bytes that no later carry changes, and returns them. A carry propagates through bytes of 255 and ends at the last byte that is
    /// not 255; after it, no second one reaches that byte, because the interval is at most as wide as `low`.
    pub(super) fn take_settled(&mut self) -> Vec<u8> {
        let end = self.bytes.iter().rposition(|&byte| byte != u8::MAX).unwrap_or(0);
        let rest = self.bytes.split_off(end);
        std::mem::replace(&mut self.bytes, rest)
    }

    /// Ends the stream and returns its bytes.
    pub(super) fn finish(mut self) -> Vec<u8> {
        self.bytes.extend(self.low.to_be_bytes());
        self.bytes
    }
}

impl Coder for Encoder {
    #[inline(always)]
    fn code(&mut self, probability: Probability, told: Option<bool>) -> bool {
        let bit = told == Some(true);
        let part = (self.range >> 16) * u64::from(probability);
        if bit {
            self.range = part;
        } else {
            let (low, carries) = self.low.overflowing_add(part);
            (self.low, self.range) = (low, self.range - part);
            if carries {
                self.carry();
            }
        }
        if self.range < NARROW {
            self.bytes.extend(((self.low >> 32) as u32).to_be_bytes());
            (self.low, self.range) = (self.low << 32, self.range << 32);
        }
        bit
    }
}

/// Decodes bytes into bits.
#[derive(Debug)]
pub(super) struct Decoder<'a> {
    code: u64,
    range: u64,
    rest: &'a [u8],
    is_past_end: bool,
}

impl<'a> Decoder<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let mut decoder = Self { code: 0, range: u64::MAX, rest: bytes, is_past_end: false };
        decoder.take();
        decoder.take();
        decoder
    }

    #[inline]
    fn take(&mut self) {
        let bytes = match self.rest.split_first_chunk::<4>() {
            Some((bytes, rest)) => {
                self.rest = rest;
                *bytes
            }
            None => {
                self.is_past_end = true;
                [0; 4]
            }
        };
        self.code = self.code << 32 | u64::from(u32::from_be_bytes(bytes));
    }

    /// Whether decoding needed more bytes than there are; if so, the bits decoded since then are meaningless.
    pub(super) fn is_past_end(&self) -> bool {
        self.is_past_end
    }

    /// Whether decoding used exactly all bytes.
    pub(super) fn is_at_end(&self) -> bool {
        self.rest.is_empty() && !self.is_past_end
    }
}

impl Coder for Decoder<'_> {
    #[inline(always)]
    fn code(&mut self, probability: Probability, _: Option<bool>) -> bool {
        let part = (self.range >> 16) * u64::from(probability);
        let bit = self.code < part;
        if bit {
            self.range = part;
        } else {
            self.code -= part;
            self.range -= part;
        }
        if self.range < NARROW {
            self.range <<= 32;
            self.take();
        }
        bit
    }
}

/// Adaptive probability of one context: 22 bits of probability above 10 bits of count.
#[derive(Clone, Copy, Debug)]
pub(super) struct BitModel(u32);

/// Largest count of bits that a context keeps.
const MOST_COUNTED: u32 = 255;

/// Step of a context that has counted n bits, as a fraction of 65,536 of the distance to the next bit: the floor of 65,536 / (n + 1.5).
const WAY: [u16; 256] = {
    let (mut parts, mut n) = ([0; 256], 0);
    while n < 256 {
        parts[n] = (131_072 / (2 * n + 3)) as u16;
        n += 1;
    }
    parts
};

impl BitModel {
    /// A context that has seen no bit.
    pub(super) const NEW: Self = Self(1 << 31);

    #[inline(always)]
    fn learn(&mut self, bit: bool) {
        let (probability, count) = (self.0 >> 10, self.0 & 1023);
        let target = if bit { (1 << 22) - 1 } else { 0 };
        let way = i64::from(target) - i64::from(probability);
        let part = i64::from(WAY[count as usize & 255]);
        let probability = (i64::from(probability) + ((way * part) >> 16)) as u32;
        self.0 = probability << 10 | (count + u32::from(count < MOST_COUNTED));
    }

    /// Codes a bit with this probability and adapts to it.
    #[inline(always)]
    pub(super) fn code(&mut self, coder: &mut impl Coder, told: Option<bool>) -> bool {
        let bit = coder.code(clamped(self.0 >> 16), told);
        self.learn(bit);
        bit
    }
}

/// Clamps a probability so that either bit can still be coded.
#[inline]
fn clamped(probability: Probability) -> Probability {
    probability.clamp(MIN_PROBABILITY, 65_536 - MIN_PROBABILITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bits that are 1 with a probability of 1 in 20 decode to themselves and take their entropy (Shannon): the sum of −log₂ of the
    /// probabilities.
    #[test]
    fn bits_come_back_and_take_their_entropy() {
        let mut state = 1u64;
        let bits: Vec<bool> = (0..200_000)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33).is_multiple_of(20)
            })
            .collect();
        let (mut encoder, mut seen) = (Encoder::new(), BitModel::NEW);
        bits.iter().for_each(|&b| _ = seen.code(&mut encoder, Some(b)));
        let bytes = encoder.finish();
        let ones = bits.iter().filter(|&&b| b).count() as f64 / bits.len() as f64;
        let entropy = -(ones * ones.log2() + (1.0 - ones) * (1.0 - ones).log2()) * bits.len() as f64 / 8.0;
        // A probability with a memory of 255 bits fluctuates, which costs 0.5 to 1 bit for each 255 bits (Krichevsky and Trofimov).
        let most = entropy + bits.len() as f64 / 255.0 / 8.0;
        assert!((entropy - 20.0..most).contains(&(bytes.len() as f64)), "{} of {entropy}", bytes.len());

        let (mut decoder, mut seen) = (Decoder::new(&bytes), BitModel::NEW);
        assert!(bits.iter().all(|&b| seen.code(&mut decoder, None) == b));
        assert!(decoder.is_at_end());
        // One more bit may still fit into the last bytes; some hundred more do not.
        (0..20_000).for_each(|_| _ = seen.code(&mut decoder, None));
        assert!(decoder.is_past_end());
    }

    /// A stream of many carries is the same however often the bytes that no carry changes are taken from it.
    #[test]
    fn settled_bytes_are_those_of_the_stream() {
        let probability = 65_536 - MIN_PROBABILITY;
        for every in [1, 7, 100] {
            let (mut whole, mut pieces) = (Encoder::new(), Encoder::new());
            let (mut state, mut bytes) = (5u64, Vec::new());
            for i in 0..200_000 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let bit = state >> 62 != 0;
                whole.code(probability, Some(bit));
                pieces.code(probability, Some(bit));
                if i % every == 0 {
                    bytes.extend(pieces.take_settled());
                }
            }
            assert!(bytes.len() > 50_000);
            bytes.extend(pieces.finish());
            assert!(bytes == whole.finish(), "{every}");
        }
    }

    #[test]
    fn the_surest_probabilitys_code_both_bits() {
        for bit in [false, true] {
            for probability in [MIN_PROBABILITY, 65_536 - MIN_PROBABILITY] {
                let mut encoder = Encoder::new();
                (0..300).for_each(|i| _ = encoder.code(probability, Some(bit ^ (i % 3 == 0))));
                let bytes = encoder.finish();
                let mut decoder = Decoder::new(&bytes);
                assert!((0..300).all(|i| decoder.code(probability, None) == bit ^ (i % 3 == 0)));
            }
        }
    }
}
