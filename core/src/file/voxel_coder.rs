//! Codes the voxels of one piece of the volume as a bit stream; a voxel's neighbours nearly always predict its label.
//!
//! ```text
//! slice after slice, row after row:
//!     a run of voxels amid one label        ─► one bit: whether the whole run has that label; if not, where it breaks
//!     any other voxel, and one that breaks a run:
//!         each label among 20 decoded neighbours, nearest first             one bit: whether the voxel has it
//!         if none matches: each label among 36 farther neighbours           one bit
//!         if none matches                                                   the label's number, bit by bit
//! ```
//! Most voxels lie in runs, which are found 64 voxels at a time ([`super::equal_neighbours`]). Each bit has one context: which of 17
//! neighbours have the label that is tried. Mixing three such contexts by a logistic mixer (Mahoney, *Adaptive weighing of context models
//! for lossless data compression*, 2005) makes the file 3 % smaller and takes nine times as long.
//!
//! Encoder and decoder are the same code and adapt to the same bits, in integer arithmetic only. `docs/file-format.md` lists every
//! constant, because each of them decides how a file decodes.

use super::arithmetic::{BitModel, Coder, Decoder, Encoder};
use super::equal_neighbours::{SliceLinks, end_of_ones};
use super::neighbours::{CONTEXTS, FIRST, NEIGHBOURS, Neighbours};
use super::slices::{Around, BORDER, Slices, fill, words};
use crate::contacts::Pairs;

/// Neighbours whose labels are tried where no near neighbour has the voxel's label, as offsets: along x, along y, slices back.
const FAR: [[i8; 3]; 36] = [
    [-2, 0, 1],
    [0, 2, 1],
    [0, -2, 1],
    [3, 0, 1],
    [-1, 0, 2],
    [1, 0, 2],
    [0, 1, 2],
    [0, -1, 2],
    [3, -1, 0],
    [-2, -1, 0],
    [-1, -2, 0],
    [1, -2, 0],
    [-1, -2, 1],
    [1, -2, 1],
    [-1, 2, 1],
    [1, 2, 1],
    [-2, -1, 1],
    [-2, 1, 1],
    [-3, 0, 1],
    [4, 0, 1],
    [5, 0, 1],
    [-4, 0, 1],
    [0, 3, 1],
    [0, -3, 1],
    [2, 2, 1],
    [-2, 2, 1],
    [2, -2, 1],
    [-2, -2, 1],
    [6, 0, 1],
    [-5, 0, 1],
    [4, -1, 0],
    [5, -1, 0],
    [3, 0, 2],
    [-3, 0, 2],
    [8, 0, 1],
    [-7, 0, 1],
];

/// Number of classes of run lengths. The class is the number of bits of the length, 1 to 11; a run has at most 1,024 voxels.
const LENGTHS: usize = 12;

/// Contexts for the position of a break; the first seven bits of the position have their own.
const PLACE_CONTEXTS: usize = 1 << 7;

/// Contexts for a label's number. Lower bits of longer numbers have none and are coded with a probability of one half.
const NUMBER_CONTEXTS: usize = 1 << 16;

/// The contexts of one piece.
struct Models {
    /// By the class of a run's length: whether the whole run has one label, and where it breaks.
    whole: [BitModel; LENGTHS],
    place: Vec<[BitModel; PLACE_CONTEXTS]>,
    /// For the first label that is tried, the second, and all later ones.
    near: [Vec<BitModel>; 3],
    far: [BitModel; FAR.len()],
    number: Vec<BitModel>,
    /// Number of bits of a label's number, and the highest number so far.
    number_bits: u32,
    highest: u32,
}

impl Models {
    fn new(most: u32) -> Self {
        Self {
            whole: [BitModel::NEW; LENGTHS],
            place: vec![[BitModel::NEW; PLACE_CONTEXTS]; LENGTHS],
            near: [0; 3].map(|_| vec![BitModel::NEW; CONTEXTS]),
            far: [BitModel::NEW; FAR.len()],
            number: vec![BitModel::NEW; NUMBER_CONTEXTS],
            number_bits: u32::BITS - most.leading_zeros(),
            highest: 0,
        }
    }

    /// Codes a row whose even voxels are marked in `even`. An encoder passes the row's voxels in `told`.
    #[inline(always)]
    fn row(
        &mut self,
        coder: &mut impl Coder,
        row: &mut [u32],
        around: &Around<'_>,
        even: &[u64],
        told: Option<&[u32]>,
        columns: usize,
    ) {
        let mut x = 0;
        while x < columns {
            let label = row[BORDER + x - 1];
            let begins = even[x / 64] >> (x % 64) & 1 != 0 && around.back[BORDER + x] == label;
            if begins {
                let end = end_of_ones(even, x).min(columns);
                let breaks = told.map(|t| t[x..end].iter().position(|&v| v != label).unwrap_or(end - x));
                let until = x + self.run(coder, end - x, breaks);
                fill(row, x, until, label);
                x = until;
                if x == end {
                    continue;
                }
            }
            let told = told.map(|t| t[x]);
            let context = Neighbours::of(row, around, x).mask_of(label) as usize % CONTEXTS;
            if !begins && self.near[0][context].code(coder, told.map(|t| t == label)) {
                row[BORDER + x] = label;
            } else {
                row[BORDER + x] = self.other(coder, row, around, x, told);
            }
            x += 1;
        }
    }

    /// Codes how many voxels at the start of a run of `length` have its label.
    #[inline(always)]
    fn run(&mut self, coder: &mut impl Coder, length: usize, breaks: Option<usize>) -> usize {
        let class = ((usize::BITS - length.leading_zeros()) as usize).min(LENGTHS - 1);
        match self.whole[class].code(coder, breaks.map(|b| b == length)) {
            true => length,
            false => self.place(coder, length, class, breaks),
        }
    }

    /// Codes the position at which a run breaks.
    #[cold]
    fn place(&mut self, coder: &mut impl Coder, length: usize, class: usize, breaks: Option<usize>) -> usize {
        let bits = usize::BITS - (length - 1).leading_zeros();
        let told = breaks.map(|b| b as u32);
        let place = number(coder, &mut self.place[class], bits, told) as usize;
        // A damaged stream may yield a position beyond the run.
        place.min(length - 1)
    }

    /// Codes a voxel whose label differs from that of the voxel to its left.
    #[inline(never)]
    fn other(
        &mut self,
        coder: &mut impl Coder,
        row: &[u32],
        around: &Around<'_>,
        x: usize,
        told: Option<u32>,
    ) -> u32 {
        // The neighbours are gathered again: passing them on would store them in memory for each voxel, including those that end at the
        // first bit.
        let near = Neighbours::of(row, around, x);
        let labels = near.in_order();
        let all = (1 << NEIGHBOURS) - 1;
        let (mut rest, mut order) = (all & !near.mask_of(row[BORDER + x - 1]), 1);
        while rest != 0 {
            let first = if rest & FIRST != 0 { rest & FIRST } else { rest };
            let label = labels[first.trailing_zeros() as usize % labels.len()];
            let mask = near.mask_of(label);
            if self.near[order][mask as usize % CONTEXTS].code(coder, told.map(|t| t == label)) {
                return label;
            }
            rest &= !mask;
            order = 2;
        }
        let mut asked = [0; FAR.len()];
        for (i, step) in FAR.into_iter().enumerate() {
            let label = around.at(x, step);
            asked[i] = label;
            if near.mask_of(label) == 0
                && !asked[..i].contains(&label)
                && self.far[i].code(coder, told.map(|t| t == label))
            {
                return label;
            }
        }
        let number = number(coder, &mut self.number, self.number_bits, told);
        self.highest = self.highest.max(number);
        number
    }
}

/// Codes a number of `bits` bits, highest first; the context of each bit is the bits above it.
fn number(coder: &mut impl Coder, contexts: &mut [BitModel], bits: u32, told: Option<u32>) -> u32 {
    let (mut number, mut context) = (0u32, 1usize);
    for bit in (0..bits).rev() {
        let told = told.map(|number| number >> bit & 1 != 0);
        let bit = match contexts.get_mut(context) {
            Some(seen) => seen.code(coder, told),
            None => coder.code(1 << 15, told),
        };
        number = number << 1 | u32::from(bit);
        context = (context << 1 | usize::from(bit)).min(contexts.len());
    }
    number
}

/// The state that encoder and decoder have in common.
struct Model {
    slices: Slices,
    links: [SliceLinks; 2],
    even: Vec<u64>,
    models: Models,
}

impl Model {
    /// A model of slices of `columns` × `rows` voxels with labels from 0 to `most`.
    fn new([columns, rows]: [usize; 2], most: u32) -> Self {
        Self {
            slices: Slices::new(columns, rows),
            links: [0; 2].map(|_| SliceLinks::empty(columns, rows)),
            even: vec![0; words(columns)],
            models: Models::new(most),
        }
    }

    /// Codes the next slice. An encoder passes its voxels in `told`. Calls `met` with the labels of neighbours that differ.
    #[inline(always)]
    fn slice(&mut self, coder: &mut impl Coder, told: Option<&[u32]>, mut met: impl FnMut(u32, u32)) {
        let (columns, rows) = (self.slices.columns(), self.slices.rows());
        self.slices.begin();
        self.links.swap(0, 1);
        let [links, before] = &mut self.links;
        let mut slices = self.slices.three();
        for y in 0..rows {
            let told = told.map(|voxels| &voxels[y * columns..][..columns]);
            let (row, around) = slices.row(y);
            links.even(before, y, &mut self.even);
            self.models.row(coder, row, &around, &self.even, told, columns);
            row[BORDER + columns..].fill(0);
            links.learn(y, row, &around);
            links.unlike(before, y, row, &around, &mut met);
        }
        let (row, around) = slices.row(rows);
        links.learn(rows, row, &around);
    }
}

/// Encodes slices as a stream.
pub(super) struct VoxelEncoder {
    model: Model,
    coder: Encoder,
}

impl VoxelEncoder {
    /// An encoder of slices of `size` voxels (columns, rows; neither is 0) with labels from 0 to `most`.
    pub(super) fn new(size: [usize; 2], most: u32) -> Self {
        Self { model: Model::new(size, most), coder: Encoder::new() }
    }

    /// Encodes the next slice, given in x-fastest order.
    pub(super) fn slice(&mut self, voxels: &[u32]) {
        self.model.slice(&mut self.coder, Some(voxels), |_, _| ());
    }

    /// The bytes of the stream so far that are final and were not taken before.
    pub(super) fn take_settled(&mut self) -> Vec<u8> {
        self.coder.take_settled()
    }

    /// The rest of the stream.
    pub(super) fn finish(self) -> Vec<u8> {
        self.coder.finish()
    }
}

/// Decodes slices from a stream.
pub(super) struct VoxelDecoder<'a> {
    model: Model,
    coder: Decoder<'a>,
    touching: Pairs,
}

impl<'a> VoxelDecoder<'a> {
    /// A decoder of the stream `bytes`; `size` and `most` must be those of [`VoxelEncoder::new`].
    pub(super) fn new(size: [usize; 2], most: u32, bytes: &'a [u8]) -> Self {
        Self { model: Model::new(size, most), coder: Decoder::new(bytes), touching: Pairs::new() }
    }

    /// Decodes the next slice; returns false where the stream ends too early.
    pub(super) fn slice(&mut self) -> bool {
        let touching = &mut self.touching;
        // A damaged stream may yield any label; then these pairs are wrong, which does no other harm.
        self.model.slice(&mut self.coder, None, |a, b| {
            if a != 0 && b != 0 {
                touching.add(a - 1, b - 1);
            }
        });
        !self.coder.is_past_end()
    }

    /// The slices since the last multiple of [`super::slices::SLAB`]: their labels from the first voxel on, and the distances between
    /// voxels along x, y and z.
    pub(super) fn slab(&self) -> (&[u32], [usize; 3]) {
        self.model.slices.slab()
    }

    /// The highest label so far. A damaged stream may yield one above the number of labels.
    pub(super) fn highest(&self) -> u32 {
        self.model.models.highest
    }

    /// Whether the whole stream has been used.
    pub(super) fn is_at_end(&self) -> bool {
        self.coder.is_at_end()
    }

    /// Pairs of labels that touch within the piece, in any order, as dense indices in the form of [`crate::contacts`].
    ///
    /// # Errors
    /// [`crate::NoMemory`].
    pub(super) fn touching(self) -> Result<Vec<u64>, crate::NoMemory> {
        self.touching.into_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::super::slices::SLAB;
    use super::*;

    /// The voxels of slice `z` in the decoder's slab, row after row.
    fn slice_of(decoder: &VoxelDecoder<'_>, [w, h]: [usize; 2], z: usize) -> Vec<u32> {
        let (labels, [_, row, slice]) = decoder.slab();
        (0..h).flat_map(|y| labels[z % SLAB * slice + y * row..][..w].to_vec()).collect()
    }

    fn round_trip(size: [usize; 3], most: u32, label: impl Fn(usize, usize, usize) -> u32) -> usize {
        let [w, h, d] = size;
        let slice = |z: usize| -> Vec<u32> { (0..w * h).map(|i| label(i % w, i / w, z)).collect() };
        let mut encoder = VoxelEncoder::new([w, h], most);
        (0..d).for_each(|z| encoder.slice(&slice(z)));
        let bytes = encoder.finish();
        let mut decoder = VoxelDecoder::new([w, h], most, &bytes);
        for z in 0..d {
            assert!(decoder.slice() && slice_of(&decoder, [w, h], z) == slice(z), "slice {z} of {size:?}");
        }
        assert!(decoder.is_at_end() && decoder.highest() <= most);
        // Half a stream must either be reported as too short or decode to other voxels.
        let mut short = VoxelDecoder::new([w, h], most, &bytes[..bytes.len() / 2]);
        let differs = (0..d).any(|z| !short.slice() || slice_of(&short, [w, h], z) != slice(z));
        assert!(differs, "{size:?}");
        bytes.len()
    }

    /// A pseudorandom number that is the same on every machine.
    fn noise(x: usize, y: usize, z: usize) -> u32 {
        let mixed = (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA6B) ^ z as u32;
        let mixed = mixed.wrapping_mul(0xC2B2_AE35) ^ mixed >> 15;
        mixed.wrapping_mul(0x27D4_EB2F) >> 7
    }

    #[test]
    fn voxels_come_back() {
        let sizes = [[1, 1, 1], [1, 1, 100], [100, 1, 1], [1, 100, 2], [17, 16, 15], [33, 5, 9]];
        // Rows that end exactly with a word, one voxel before it or one after it; and the longest possible row.
        let rows = [[63, 4, 3], [64, 4, 3], [65, 4, 3], [128, 3, 6], [1024, 2, 5]];
        for size in sizes.into_iter().chain(rows) {
            round_trip(size, 0, |_, _, _| 0);
            round_trip(size, 1, |_, _, _| 1);
            round_trip(size, 3, |x, y, z| noise(x, y, z) & 3);
            round_trip(size, u32::MAX, |x, y, z| noise(x, y, z) & u32::MAX >> 7);
            round_trip(size, 5, |x, y, z| ((x / 5 + y / 3) as u32 + (z / 4) as u32) % 6);
            // Long runs that seldom break.
            round_trip(size, 2, |x, y, z| 1 + u32::from(noise(x, y, z) % 97 == 5));
        }
        // Numbers that differ only in bits without contexts.
        round_trip([9, 9, 9], u32::MAX, |x, y, z| u32::MAX - (x + 9 * y + 81 * z) as u32);
    }

    /// The size of the stream is what theory expects, for constant labels and for noise.
    #[test]
    fn even_labels_take_nothing_and_noise_what_it_has() {
        // A run takes 0.00035 bits once its probability is as high as it gets; the voxels at the ends of rows lie outside of runs.
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
        // A coin takes one bit a voxel. There are more contexts than voxels, and each adapts strongly to its first bits, so that the second
        // bit costs 1.42 bits. Where a voxel differs from the one before it, a second bit carries no information, and each context has to
        // learn that.
        let least = coins.len() / 8;
        assert!((least..2 * least).contains(&noise), "{noise} of {least}");
    }

    /// A control of the tests above: a decoder with other parameters yields other voxels or reports an error.
    #[test]
    fn another_size_or_number_of_labels_is_another_picture() {
        let label = |x: usize, y: usize, z: usize| ((x / 5 + y / 3 + z / 4) % 6) as u32;
        let slice = |z: usize| -> Vec<u32> { (0..33 * 17).map(|i| label(i % 33, i / 33, z)).collect() };
        let mut encoder = VoxelEncoder::new([33, 17], 5);
        (0..9).for_each(|z| encoder.slice(&slice(z)));
        let bytes = encoder.finish();
        let is_same = |size: [usize; 2], most: u32| {
            let mut decoder = VoxelDecoder::new(size, most, &bytes);
            (0..9).all(|z| decoder.slice() && slice_of(&decoder, size, z) == slice(z)) && decoder.is_at_end()
        };
        assert!(is_same([33, 17], 5) && !is_same([17, 33], 5) && !is_same([33, 17], 8));
        // A stream with four bytes too many is as wrong as one with four too few.
        for wrong in [[&bytes[..], &[0; 4]].concat(), bytes[..bytes.len() - 4].to_vec()] {
            let mut decoder = VoxelDecoder::new([33, 17], 5, &wrong);
            assert!((0..9).any(|_| !decoder.slice()) || !decoder.is_at_end());
        }
    }
}
