//! Voxels as files of version 2 have them: decoded, and no longer written ([`super::voxel_coder`] is what came after).
//!
//! ```text
//! slice after slice, row after row, in stretches of 16 voxels:
//!     all around it are of one label?   ─► one bit: and so is the whole stretch
//! else voxel by voxel:
//!     for each label among the 28 neighbours that are known, nearest first:   one bit: is it this one?
//!     none of them                                                           its number, a bit at a time
//! ```
//! A bit's chance is mixed from what three contexts have seen: which of the 16 near neighbours have the label that is asked for; which
//! of the 9 nearest and the 12 far ones; the 16 with which of the nearest have a third label. The mixer is the logistic one of PAQ
//! (Mahoney, *Adaptive weighing of context models for lossless data compression*, 2005): contexts' chances are added as log odds,
//! weighted by what has proved right. It saves 3 % of the bytes against one context, and takes nine times as long.
//!
//! All of it is in whole numbers. `docs/file-format.md` has every constant, since each of them decides what a file means.

use super::arithmetic::{Chance, Coder, Seen, bounded};
use super::slices::SLAB;
use super::voxel_pieces::SliceDecoder;

/// Neighbours whose labels are asked for first and that make contexts: steps along x, y and back along z.
const NEAR: [[i8; 3]; 16] = [
    [-1, 0, 0],
    [0, -1, 0],
    [0, 0, 1],
    [-1, -1, 0],
    [1, -1, 0],
    [1, 0, 1],
    [0, 1, 1],
    [-1, 0, 1],
    [0, -1, 1],
    [-2, 0, 0],
    [0, -2, 0],
    [0, 0, 2],
    [1, 1, 1],
    [-1, 1, 1],
    [1, -1, 1],
    [-1, -1, 1],
];

/// The others.
const FAR: [[i8; 3]; 12] = [
    [-3, 0, 0],
    [0, -3, 0],
    [0, 0, 3],
    [2, 0, 1],
    [0, 2, 1],
    [1, 0, 2],
    [0, 1, 2],
    [2, -1, 0],
    [-1, 0, 2],
    [0, -1, 2],
    [-2, 0, 1],
    [0, -2, 1],
];

/// How many there are.
const NEIGHBOURS: usize = NEAR.len() + FAR.len();

/// The nearest of the near ones: those at most one step along each of two axes, of which five in the slice before.
const NEAREST: u32 = 9;

/// Rows and columns of background around a slice: as far as neighbours lie.
const BORDER: usize = 3;

/// Voxels of a stretch.
const STRETCH: usize = 16;

/// Contexts of a hashed table are 2 to the power of this.
const TABLE_BITS: u32 = 18;

/// Bits of a label's number that have contexts of their own; the lower ones of longer numbers are taken as they come.
const NUMBER_CONTEXTS: usize = 1 << 16;

/// Of 65,536 · 1/(1 + e^(−x)) for x from −8 to 8 by halves.
const SQUASHED: [i32; 33] = [
    22, 36, 60, 98, 162, 267, 439, 720, 1179, 1921, 3108, 4971, 7812, 11955, 17625, 24743, 32768, 40793,
    47911, 53581, 57724, 60565, 62428, 63615, 64357, 64816, 65097, 65269, 65374, 65438, 65476, 65500, 65514,
];

/// Log odds in 256ths: −8 to 8, both ends left out.
const MOST_ODDS: i32 = 2047;

/// Weights of a fresh mixer, in 65,536ths: three contexts that agree are believed a little more than one.
const FRESH_WEIGHT: i32 = 26_214;
const MOST_WEIGHT: i32 = 1 << 20;

/// The chance, of 65,536, of log odds in 256ths.
fn squash(odds: i32) -> i32 {
    let from_lowest = odds.clamp(-MOST_ODDS, MOST_ODDS) + 2048;
    let (i, part) = ((from_lowest >> 7) as usize, from_lowest & 127);
    (SQUASHED[i] * (128 - part) + SQUASHED[i + 1] * part) >> 7
}

/// Log odds in 256ths of each chance of 4,096: the least whose [`squash`] reaches it.
fn stretch_table() -> Vec<i16> {
    let mut table = Vec::with_capacity(4096);
    for odds in -MOST_ODDS..=MOST_ODDS {
        let reached = (squash(odds) >> 4) as usize;
        while table.len() <= reached {
            table.push(odds as i16);
        }
    }
    table.resize(4096, MOST_ODDS as i16);
    table
}

/// What has been learnt of a piece's voxels, and the slices that neighbours lie in.
struct Model {
    width: usize,
    rows: usize,
    /// From the border's corner to each neighbour of the voxel at its inner corner: slices back, places within.
    neighbours: [(usize, usize); NEIGHBOURS],
    /// The slice under way and the three before it, with borders.
    slices: [Vec<u32>; 4],
    /// Bits of a label's number, and the highest one that was met.
    number_bits: u32,
    highest: u32,
    even_stretch: Seen,
    even_voxel: Seen,
    near: Vec<Seen>,
    wide: Vec<Seen>,
    third: Vec<Seen>,
    number: Vec<Seen>,
    weights: Vec<[i32; 3]>,
    stretched: Vec<i16>,
}

impl Model {
    /// For slices of `size` voxels with labels from 0 to `most`.
    fn new(size: [usize; 2], most: u32) -> Self {
        let [width, rows] = size.map(|n| n + 2 * BORDER);
        let mut neighbours = [(0, 0); NEIGHBOURS];
        for (place, [x, y, back]) in neighbours.iter_mut().zip(NEAR.into_iter().chain(FAR)) {
            let [x, y] = [x, y].map(|step| (BORDER as isize + isize::from(step)) as usize);
            *place = (back as usize, y * width + x);
        }
        Self {
            width,
            rows,
            neighbours,
            slices: [0; 4].map(|_| vec![0; width * rows]),
            number_bits: u32::BITS - most.leading_zeros(),
            highest: 0,
            even_stretch: Seen::NOTHING,
            even_voxel: Seen::NOTHING,
            near: vec![Seen::NOTHING; 1 << NEAR.len()],
            wide: vec![Seen::NOTHING; 1 << TABLE_BITS],
            third: vec![Seen::NOTHING; 1 << TABLE_BITS],
            number: vec![Seen::NOTHING; NUMBER_CONTEXTS],
            weights: vec![[FRESH_WEIGHT; 3]; 3 * (NEAR.len() + 1)],
            stretched: stretch_table(),
        }
    }

    /// Decodes the next slice; it is in `slices[0]` afterwards.
    fn slice(&mut self, bits: &mut Bits<'_>) {
        self.slices.rotate_right(1);
        let mut slice = std::mem::take(&mut self.slices[0]);
        slice.fill(0);
        let [columns, rows] = [self.width, self.rows].map(|n| n - 2 * BORDER);
        for y in 0..rows {
            for x in (0..columns).step_by(STRETCH) {
                let length = STRETCH.min(columns - x);
                let at = (y + BORDER) * self.width + x + BORDER;
                let label = slice[at - 1];
                if self.is_even_around(&slice, at, length) && self.even_stretch.code(bits, None) {
                    slice[at..at + length].fill(label);
                    continue;
                }
                for i in 0..length {
                    slice[at + i] = self.voxel(bits, &slice, at + i);
                }
            }
        }
        self.slices[0] = slice;
    }

    /// Whether what is around a stretch is all of the label before it: in this slice two rows, in the one before it three, and one in
    /// the one before that.
    #[inline]
    fn is_even_around(&self, slice: &[u32], at: usize, length: usize) -> bool {
        let label = slice[at - 1];
        let is_even = |voxels: &[u32]| voxels.iter().fold(0, |differ, &v| differ | (v ^ label)) == 0;
        let [_, before, before_that, _] = &self.slices;
        let width = self.width;
        let wide = |row: usize| row - 1..row + length + 1;
        is_even(&slice[wide(at - width)])
            && is_even(&before[wide(at)])
            && is_even(&before[wide(at - width)])
            && is_even(&before[wide(at + width)])
            && is_even(&slice[at - 2 * width..at - 2 * width + length])
            && is_even(&before_that[at..at + length])
    }

    #[inline]
    fn voxel(&mut self, bits: &mut Bits<'_>, slice: &[u32], at: usize) -> u32 {
        let corner = at - BORDER * self.width - BORDER;
        let around = self.neighbours.map(|(back, place)| {
            let slice = if back == 0 { slice } else { &self.slices[back] };
            slice[corner + place]
        });
        let first = around[0];
        if around.iter().fold(0, |differ, &v| differ | (v ^ first)) == 0 {
            return match self.even_voxel.code(bits, None) {
                true => first,
                false => self.number(bits),
            };
        }
        // A bit for each neighbour: whether its label was asked for.
        let (mut asked, mut order) = (0u32, 0u32);
        while asked.trailing_ones() < NEIGHBOURS as u32 {
            let label = around[asked.trailing_ones() as usize];
            let with_it = mask(&around, |v| v == label);
            asked |= with_it;
            if self.is_it(bits, &around, label, with_it, order) {
                return label;
            }
            order += 1;
        }
        self.number(bits)
    }

    /// Whether a voxel has a label that the neighbours of `with_it` have, and that `order` others were asked for before.
    #[inline]
    fn is_it(
        &mut self,
        bits: &mut Bits<'_>,
        around: &[u32; NEIGHBOURS],
        label: u32,
        with_it: u32,
        order: u32,
    ) -> bool {
        let (near, far) = (with_it & 0xFFFF, with_it >> NEAR.len());
        let nearest = (1 << NEAREST) - 1;
        // The nearest that have neither this label nor that of the first without it.
        let without = !with_it & nearest;
        let third = match around.get(without.trailing_zeros() as usize) {
            Some(&second) if without != 0 => mask(around, |v| v != label && v != second) & nearest,
            _ => 0,
        };
        let order = order.min(2);
        let wide = (near & nearest) | far << 9 | order.min(1) << 21;
        let third = near.wrapping_mul(0x9E37_79B1)
            ^ third.wrapping_mul(0x85EB_CA6B)
            ^ (far & 7).wrapping_mul(0xC2B2_AE35)
            ^ (order * 77_777);
        let hashed = |key: u32, by: u32| (key.wrapping_mul(by) >> (32 - TABLE_BITS)) as usize;
        let places = [near as usize, hashed(wide, 0x9E37_79B1), hashed(third, 0x27D4_EB2F)];

        let seen = [self.near[places[0]], self.wide[places[1]], self.third[places[2]]];
        let odds = seen.map(|s| i32::from(self.stretched[s.twelve_bits()]));
        let weights = &mut self.weights[(3 * near.count_ones() + order) as usize];
        let sum: i64 = weights.iter().zip(odds).map(|(&w, odds)| i64::from(w) * i64::from(odds)).sum();
        // At most 3 · 16 · 2047 after the shift.
        let chance = bounded(squash((sum >> 16) as i32) as u32);
        let bit = bits.code(chance, None);

        let error = (i32::from(bit) << 16) - chance as i32;
        for (weight, odds) in weights.iter_mut().zip(odds) {
            *weight = (*weight + ((error * odds + (1 << 13)) >> 14)).clamp(-MOST_WEIGHT, MOST_WEIGHT);
        }
        self.near[places[0]].learn(bit);
        self.wide[places[1]].learn(bit);
        self.third[places[2]].learn(bit);
        bit
    }

    /// A label that no neighbour has: its number from the highest bit, each bit's context the bits above it.
    #[cold]
    fn number(&mut self, bits: &mut Bits<'_>) -> u32 {
        let mut number = 0u32;
        let mut context = 1usize;
        for _ in 0..self.number_bits {
            let bit = match self.number.get_mut(context) {
                Some(seen) => seen.code(bits, None),
                None => bits.code(1 << 15, None),
            };
            number = number << 1 | u32::from(bit);
            context = (context << 1 | usize::from(bit)).min(NUMBER_CONTEXTS);
        }
        self.highest = self.highest.max(number);
        number
    }

    /// The slice that was coded last, row after row.
    fn copy(&self, voxels: &mut [u32]) {
        let columns = self.width - 2 * BORDER;
        for (y, row) in voxels.chunks_exact_mut(columns).enumerate() {
            let at = (y + BORDER) * self.width + BORDER;
            row.copy_from_slice(&self.slices[0][at..at + columns]);
        }
    }
}

fn mask(around: &[u32; NEIGHBOURS], has: impl Fn(u32) -> bool) -> u32 {
    around.iter().enumerate().fold(0, |mask, (i, &v)| mask | u32::from(has(v)) << i)
}

/// Bytes into bits: the interval from `low` to `high`, both within, in the carryless form of Mahoney, §3.
struct Bits<'a> {
    low: u32,
    high: u32,
    code: u32,
    rest: &'a [u8],
    is_past_end: bool,
}

impl<'a> Bits<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let mut bits = Self { low: 0, high: u32::MAX, code: 0, rest: bytes, is_past_end: false };
        (0..4).for_each(|_| bits.take());
        bits
    }

    fn take(&mut self) {
        let byte = self.rest.split_off_first();
        self.is_past_end |= byte.is_none();
        self.code = self.code << 8 | u32::from(byte.copied().unwrap_or(0));
    }
}

impl Coder for Bits<'_> {
    #[inline]
    fn code(&mut self, chance: Chance, _: Option<bool>) -> bool {
        // The last place of the part that stands for 1.
        let middle = self.low + ((u64::from(self.high - self.low) * u64::from(chance)) >> 16) as u32;
        let bit = self.code <= middle;
        if bit {
            self.high = middle;
        } else {
            self.low = middle + 1;
        }
        // The first byte of all places of the interval, where they have one, is settled.
        while self.low >> 24 == self.high >> 24 {
            (self.low, self.high) = (self.low << 8, self.high << 8 | 255);
            self.take();
        }
        bit
    }
}

/// A stream into slices.
pub(super) struct FormerVoxelDecoder<'a> {
    model: Model,
    bits: Bits<'a>,
    /// Slices without borders, and how many were decoded.
    slab: Vec<u32>,
    decoded: usize,
}

impl<'a> FormerVoxelDecoder<'a> {
    /// For slices of `size` voxels, neither 0, with labels from 0 to `most`.
    pub(super) fn new(size: [usize; 2], most: u32, bytes: &'a [u8]) -> Self {
        let slab = vec![0; SLAB * size[0] * size[1]];
        Self { model: Model::new(size, most), bits: Bits::new(bytes), slab, decoded: 0 }
    }
}

impl SliceDecoder for FormerVoxelDecoder<'_> {
    fn slice(&mut self) -> bool {
        self.model.slice(&mut self.bits);
        let area = self.slab.len() / SLAB;
        self.model.copy(&mut self.slab[self.decoded % SLAB * area..][..area]);
        self.decoded += 1;
        !self.bits.is_past_end
    }

    fn slab(&self) -> (&[u32], [usize; 3]) {
        let columns = self.model.width - 2 * BORDER;
        (&self.slab, [1, columns, self.slab.len() / SLAB])
    }

    fn highest(&self) -> u32 {
        self.model.highest
    }

    fn is_at_end(&self) -> bool {
        self.bits.rest.is_empty() && !self.bits.is_past_end
    }

    fn touching(self) -> Option<Vec<u64>> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table of chances is what its formula gives, and the other table its inverse.
    #[test]
    fn tables_are_what_their_formulas_give() {
        for (i, &value) in SQUASHED.iter().enumerate() {
            let x = 0.5 * (i as f64 - 16.0);
            assert_eq!(value, (65_536.0 / (1.0 + (-x).exp())).round() as i32, "{x}");
        }
        let table = stretch_table();
        assert_eq!(table.len(), 4096);
        for (chance, &odds) in table.iter().enumerate().filter(|(_, odds)| odds.abs() < 2047) {
            let exact = 256.0 * ((chance as f64 + 0.5) / (4095.5 - chance as f64)).ln();
            // Straight lines between halves are off by 0.5²/8 of the second derivative, and steps at the ends are wide.
            let step = 256.0 * 4096.0 / ((chance as f64 + 0.5) * (4095.5 - chance as f64));
            assert!((f64::from(odds) - exact).abs() < 8.0 + step, "{chance}: {odds}, {exact}");
        }
    }

    /// Bytes that look random, as 3 × 2 × 3 voxels with numbers of 21 bits, of which five have no contexts. What is expected is from
    /// `tests/python/decode_voxels_of_version_2.py`, which was written from the page alone.
    #[test]
    fn long_numbers_are_those_of_the_independent_decoder() {
        let mut state = 1400u32;
        let mut byte = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let bytes: Vec<u8> = (0..200).map(|_| byte()).collect();
        let expected = [
            [1859147, 0, 504194, 1474235, 121818, 504194],
            [0, 325501, 0, 1859147, 325501, 325501],
            [0, 0, 0, 515670, 325501, 325376],
        ];
        let mut decoder = FormerVoxelDecoder::new([3, 2], 1 << 20, &bytes);
        for (z, expected) in expected.into_iter().enumerate() {
            assert!(decoder.slice());
            let (labels, strides) = decoder.slab();
            assert_eq!(labels[z * strides[2]..][..6], expected);
        }
        assert_eq!(decoder.highest(), 1859147);
        assert!(!decoder.is_at_end() && (0..500).any(|_| !decoder.slice()));
    }
}
