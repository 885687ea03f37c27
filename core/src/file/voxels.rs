//! The voxels of a piece of volume as a stream of bits: what a voxel's neighbours are says nearly all of what it is.
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
//! (Mahoney, 2005): contexts' chances are added as log odds, weighted by what has proved right.
//!
//! Encoder and decoder are one piece of code and learn from the same bits. All of it is in whole numbers. `docs/file-format.md` has
//! every constant, since each of them decides what a file means.

use super::arithmetic::{Coder, Decoder, Encoder, Seen, bounded};

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

/// Voxels of a stretch: 8 to 32 give files of the same size within 0.3 %, shorter ones are faster where labels are thin.
const STRETCH: usize = 16;

/// Contexts of a hashed table are 2 to the power of this. 2²² would save 0.3 % and take 16 MiB.
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
    /// Bits of a label's number.
    number_bits: u32,
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

    /// Codes the next slice; `told` are its voxels where they are known. They are in `slices[0]` afterwards.
    #[inline]
    fn slice(&mut self, coder: &mut impl Coder, told: Option<&[u32]>) {
        self.slices.rotate_right(1);
        let mut slice = std::mem::take(&mut self.slices[0]);
        slice.fill(0);
        let [columns, rows] = [self.width, self.rows].map(|n| n - 2 * BORDER);
        for y in 0..rows {
            let told = told.map(|voxels| &voxels[y * columns..(y + 1) * columns]);
            for x in (0..columns).step_by(STRETCH) {
                let length = STRETCH.min(columns - x);
                let at = (y + BORDER) * self.width + x + BORDER;
                let told = told.map(|row| &row[x..x + length]);
                let label = slice[at - 1];
                if self.is_even_around(&slice, at, length)
                    && self.even_stretch.code(coder, told.map(|t| t.iter().all(|&v| v == label)))
                {
                    slice[at..at + length].fill(label);
                    continue;
                }
                for i in 0..length {
                    slice[at + i] = self.voxel(coder, &slice, at + i, told.map(|t| t[i]));
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
    fn voxel(&mut self, coder: &mut impl Coder, slice: &[u32], at: usize, told: Option<u32>) -> u32 {
        let corner = at - BORDER * self.width - BORDER;
        let around = self.neighbours.map(|(back, place)| {
            let slice = if back == 0 { slice } else { &self.slices[back] };
            slice[corner + place]
        });
        let first = around[0];
        if around.iter().fold(0, |differ, &v| differ | (v ^ first)) == 0 {
            return match self.even_voxel.code(coder, told.map(|label| label == first)) {
                true => first,
                false => self.number(coder, told),
            };
        }
        // A bit for each neighbour: whether its label was asked for.
        let (mut asked, mut order) = (0u32, 0u32);
        while asked.trailing_ones() < NEIGHBOURS as u32 {
            let label = around[asked.trailing_ones() as usize];
            let with_it = mask(&around, |v| v == label);
            asked |= with_it;
            if self.is_it(coder, &around, label, with_it, order, told.map(|t| t == label)) {
                return label;
            }
            order += 1;
        }
        self.number(coder, told)
    }

    /// Whether a voxel has a label that the neighbours of `with_it` have, and that `order` others were asked for before.
    #[inline]
    fn is_it(
        &mut self,
        coder: &mut impl Coder,
        around: &[u32; NEIGHBOURS],
        label: u32,
        with_it: u32,
        order: u32,
        told: Option<bool>,
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
        let bit = coder.code(chance, told);

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
    fn number(&mut self, coder: &mut impl Coder, told: Option<u32>) -> u32 {
        let mut number = 0u32;
        let mut context = 1usize;
        for bit in (0..self.number_bits).rev() {
            let told = told.map(|label| label >> bit & 1 != 0);
            let bit = match self.number.get_mut(context) {
                Some(seen) => seen.code(coder, told),
                None => coder.code(1 << 15, told),
            };
            number = number << 1 | u32::from(bit);
            context = (context << 1 | usize::from(bit)).min(NUMBER_CONTEXTS);
        }
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

/// Slices into a stream.
pub(super) struct VoxelEncoder {
    model: Model,
    coder: Encoder,
}

impl VoxelEncoder {
    /// For slices of `size` voxels, neither 0, with labels from 0 to `most`.
    pub(super) fn new(size: [usize; 2], most: u32) -> Self {
        Self { model: Model::new(size, most), coder: Encoder::new() }
    }

    /// The next slice, x fastest.
    pub(super) fn slice(&mut self, voxels: &[u32]) {
        self.model.slice(&mut self.coder, Some(voxels));
    }

    pub(super) fn finish(self) -> Vec<u8> {
        self.coder.finish()
    }
}

/// A stream into slices.
pub(super) struct VoxelDecoder<'a> {
    model: Model,
    coder: Decoder<'a>,
}

impl<'a> VoxelDecoder<'a> {
    /// As [`VoxelEncoder::new`].
    pub(super) fn new(size: [usize; 2], most: u32, bytes: &'a [u8]) -> Self {
        Self { model: Model::new(size, most), coder: Decoder::new(bytes) }
    }

    /// The next slice; false where the stream has ended before it. Labels of a damaged stream may be above the most.
    pub(super) fn slice(&mut self, voxels: &mut [u32]) -> bool {
        self.model.slice(&mut self.coder, None);
        self.model.copy(voxels);
        !self.coder.is_past_end()
    }

    /// Whether nothing is left of the stream.
    pub(super) fn is_at_end(&self) -> bool {
        self.coder.is_at_end()
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

    fn round_trip(size: [usize; 3], most: u32, label: impl Fn(usize, usize, usize) -> u32) -> usize {
        let [w, h, d] = size;
        let slice = |z: usize| -> Vec<u32> { (0..w * h).map(|i| label(i % w, i / w, z)).collect() };
        let mut encoder = VoxelEncoder::new([w, h], most);
        (0..d).for_each(|z| encoder.slice(&slice(z)));
        let bytes = encoder.finish();
        let mut decoder = VoxelDecoder::new([w, h], most, &bytes);
        let mut got = vec![0; w * h];
        for z in 0..d {
            assert!(decoder.slice(&mut got) && got == slice(z), "slice {z} of {size:?}");
        }
        assert!(decoder.is_at_end());
        // A stream that lacks its end says so, or has another picture in it.
        let mut short = VoxelDecoder::new([w, h], most, &bytes[..bytes.len() / 2]);
        assert!(bytes.len() < 9 || (0..d).any(|z| !short.slice(&mut got) || got != slice(z)));
        bytes.len()
    }

    #[test]
    fn voxels_come_back() {
        let noise = |most: u32| {
            move |x: usize, y: usize, z: usize| {
                let mixed =
                    (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA6B) ^ z as u32;
                let mixed = mixed.wrapping_mul(0xC2B2_AE35) ^ mixed >> 15;
                mixed.wrapping_mul(0x27D4_EB2F) >> 7 & most
            }
        };
        for size in [[1, 1, 1], [1, 1, 100], [100, 1, 1], [1, 100, 2], [17, 16, 15], [33, 5, 9]] {
            round_trip(size, 0, |_, _, _| 0);
            round_trip(size, 3, noise(3));
            round_trip(size, u32::MAX, noise(u32::MAX >> 7));
            round_trip(size, 5, |x, y, z| ((x / 5 + y / 3) as u32 + (z / 4) as u32) % 6);
        }
        // Numbers that differ in bits without contexts.
        round_trip([9, 9, 9], u32::MAX, |x, y, z| u32::MAX - (x + 9 * y + 81 * z) as u32);
    }

    /// What is to be expected of each kind.
    #[test]
    fn even_labels_take_nothing_and_noise_what_it_has() {
        // A stretch of 16 in 0.00035 bits, once the chance is as sure as it gets.
        let even = round_trip([128, 128, 64], 1, |_, _, _| 1);
        assert!(even < 200, "{even}");
        let mut state = 7u64;
        let coins: Vec<u32> = (0..64 * 64 * 16)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 40) as u32 & 1
            })
            .collect();
        let noise = round_trip([64, 64, 16], 1, |x, y, z| coins[x + 64 * (y + 64 * z)]);
        // A bit a voxel. There are more contexts than voxels, and each believes the first bits that it sees: a third more (1.32).
        let least = coins.len() / 8;
        assert!((least..least + least / 2).contains(&noise), "{noise} of {least}");
    }
}
