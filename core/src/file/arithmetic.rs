//! Binary arithmetic coding with chances that learn, in whole numbers alone: every machine decodes what any machine wrote.
//!
//! ```text
//! 0 ─────────────────── code ───────────────────── range        64 bits, of which the stream gives 32 at a time
//! └──── bit is 1 ────┴────────── bit is 0 ──────────┘
//!       range · chance         the rest
//! ```
//! The range coder keeps an interval and cuts it where a bit's chance says (Martin, *Range encoding*, 1979; by the width alone, as in
//! I. Pavlov's LZMA, so that a decoder compares once a bit). An interval below 2³² is widened by four bytes of the stream: seldom, and
//! at once. The encoder carries into bytes that it has already written.
//!
//! A chance is what a context has seen: it starts at a half and moves by 1/(n + 1.5) of the way towards each bit, n bits having been
//! seen, so the first ones count most (an estimator of Krichevsky and Trofimov, slightly bolder); from 255 on it forgets.

/// A chance that a bit is 1, of 65,536.
pub(super) type Chance = u32;

/// No bit is believed to be surer than this: a wrong belief costs 12 bits then.
const SUREST: Chance = 16;

/// Codes bits: an encoder is told them, a decoder tells them.
pub(super) trait Coder {
    /// A bit that is 1 by this chance, above 0 and below 65,536. `told` is `None` where it is to be decoded.
    fn code(&mut self, chance: Chance, told: Option<bool>) -> bool;
}

/// Intervals narrower than this are widened.
const NARROW: u64 = 1 << 32;

/// Bits into bytes.
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

    /// Adds 1 to the number that the bytes are.
    #[cold]
    fn carry(&mut self) {
        for byte in self.bytes.iter_mut().rev() {
            *byte = byte.wrapping_add(1);
            if *byte != 0 {
                return;
            }
        }
    }

    /// All bytes.
    pub(super) fn finish(mut self) -> Vec<u8> {
        self.bytes.extend(self.low.to_be_bytes());
        self.bytes
    }
}

impl Coder for Encoder {
    #[inline(always)]
    fn code(&mut self, chance: Chance, told: Option<bool>) -> bool {
        let bit = told == Some(true);
        let part = (self.range >> 16) * u64::from(chance);
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

/// Bytes into bits.
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
    #[inline(always)]
    fn code(&mut self, chance: Chance, _: Option<bool>) -> bool {
        let part = (self.range >> 16) * u64::from(chance);
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

/// What a context has seen: a chance in 22 bits above a count in 10.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen(u32);

/// Bits after which the count stays.
const MOST_COUNTED: u32 = 255;

/// What part of the way a context goes that has counted n bits, of 65,536: the floor of 65,536 / (n + 1.5).
const WAY: [u16; 256] = {
    let (mut parts, mut n) = ([0; 256], 0);
    while n < 256 {
        parts[n] = (131_072 / (2 * n + 3)) as u16;
        n += 1;
    }
    parts
};

impl Seen {
    /// Nothing.
    pub(super) const NOTHING: Self = Self(1 << 31);

    #[inline(always)]
    fn learn(&mut self, bit: bool) {
        let (chance, count) = (self.0 >> 10, self.0 & 1023);
        let target = if bit { (1 << 22) - 1 } else { 0 };
        let way = i64::from(target) - i64::from(chance);
        let part = i64::from(WAY[count as usize & 255]);
        let chance = (i64::from(chance) + ((way * part) >> 16)) as u32;
        self.0 = chance << 10 | (count + u32::from(count < MOST_COUNTED));
    }

    /// Codes a bit by this chance alone, and learns it.
    #[inline(always)]
    pub(super) fn code(&mut self, coder: &mut impl Coder, told: Option<bool>) -> bool {
        let bit = coder.code(bounded(self.0 >> 16), told);
        self.learn(bit);
        bit
    }
}

/// A chance that both bits have one by.
#[inline]
fn bounded(chance: Chance) -> Chance {
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
