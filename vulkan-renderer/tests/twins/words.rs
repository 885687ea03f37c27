//! Rows of words for the probe, and reproducible random numbers to fill them.

/// SplitMix64 with its own increments.
pub(crate) struct Random(pub u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut x = self.0;
        x = (x ^ x >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ x >> 31
    }

    pub(crate) fn below(&mut self, end: u32) -> u32 {
        (((self.next() >> 32) * u64::from(end)) >> 32) as u32
    }

    /// In [0, 1), 24 bits.
    pub(crate) fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / 16_777_216.0
    }

    /// In [-1, 1).
    pub(crate) fn signed(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A row that is being written.
#[derive(Default)]
pub(crate) struct Row(pub Vec<u32>);

impl Row {
    pub(crate) fn word(mut self, w: u32) -> Self {
        self.0.push(w);
        self
    }

    pub(crate) fn long(self, v: u64) -> Self {
        self.word(v as u32).word((v >> 32) as u32)
    }

    pub(crate) fn float(self, v: f32) -> Self {
        self.word(v.to_bits())
    }

    pub(crate) fn double(self, v: f64) -> Self {
        self.long(v.to_bits())
    }

    pub(crate) fn doubles(self, v: impl IntoIterator<Item = f64>) -> Self {
        v.into_iter().fold(self, Self::double)
    }
}

/// A row that is being read.
pub(crate) struct Reader<'a>(pub &'a [u32]);

impl Reader<'_> {
    pub(crate) fn word(&mut self) -> u32 {
        let (first, rest) = self.0.split_first().expect("a word");
        self.0 = rest;
        *first
    }

    pub(crate) fn long(&mut self) -> u64 {
        u64::from(self.word()) | u64::from(self.word()) << 32
    }

    pub(crate) fn float(&mut self) -> f32 {
        f32::from_bits(self.word())
    }

    pub(crate) fn double(&mut self) -> f64 {
        f64::from_bits(self.long())
    }
}

/// Fails where two numbers differ by more than `relative` times the larger.
#[track_caller]
pub(crate) fn close(got: f32, expected: f32, relative: f32, what: &str) {
    close_beside(got, expected, relative, 1e-30, what);
}

/// As [`close`], with an `absolute` tolerance in addition.
#[track_caller]
pub(crate) fn close_beside(got: f32, expected: f32, relative: f32, absolute: f32, what: &str) {
    let limit = relative * got.abs().max(expected.abs()) + absolute;
    assert!((got - expected).abs() <= limit, "{what}: expected {expected}, got {got}");
}
