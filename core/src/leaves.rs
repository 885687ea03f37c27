//! The leaves that nodes share: a frequent occupancy field is a pattern named by 16 bits, others are put together from frequent slices.
//!
//! ```text
//! class    reference                            field
//! ranked   1 word   m:3 i:13                    patterns[i], mirrored along the axes m
//! sliced   2 words  d:8 c:8 b:8 a:8             slices[a] | slices[b] << 16 | slices[c] << 32 | slices[d] << 48
//! long     3 words  d:12 c:12 b:12 a:12         the same; where a is 4095: rare[d c b], 36 bits        with over 256 slices
//!          4 words  the field itself                                                                   otherwise
//! ```
//! A pattern represents itself and its mirror images; it is the least of them. A slice is a cell's 4 × 4 voxels of one z: surfaces cut a
//! cell in countless ways, but a slice in few. Of cortex's fields, 77 % are ranked and 18 % sliced. All tables depend on the fields alone.
//! In noise, where slices repeat no more often than fields, there are at most 256 slices.
//!
//! # How the tables were chosen
//! On 512³ voxels of cortex, 2.03 million references name leaves that are neither empty nor full. Of these, a short reference
//! reaches, with a table of these leaves:
//!
//! | leaves | references |
//! |---|---|
//! | the 65,536 most frequent | 1.60 M |
//! | the 65,536 most frequent, or the complement of one | 1.67 M |
//! | the 65,536 most frequent, mirrored on any axes | 1.82 M |
//! | both | 1.86 M |
//! | **the 8,192 most frequent, mirrored: 13 bits and 3** | **1.57 M** |
//!
//! The last takes 16 bits a reference like the first, and its tables take 119 kB instead of 524 kB. The other references take 12 bits a
//! slice. Slices across z are best: slices across another axis make references 7 % larger, differences between slices 13 %. Rendering takes
//! as much CPU time as with a dictionary of 65,536 leaves (1.36 CPU s for 480 × 270 pixels of 8 samples, both).

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::Result;
use crate::counted_fields::{Counted, CountedParts};
use crate::reserve::make_room;

/// Largest number of patterns: a reference has 13 bits beside those for mirroring.
pub const MAX_PATTERNS: usize = 1 << 13;

/// Number of slices that 8 bits can name.
pub const SHORT_SLICES: usize = 1 << 8;

/// Largest number of slices: 12 bits name a slice, and one value of the 12 bits marks a rare field.
pub const MAX_SLICES: usize = RARE as usize;

/// Value of the first slice number that marks a rare field.
pub(crate) const RARE: u64 = (1 << 12) - 1;

/// Words that a pattern occupies in its table.
const WORDS_OF_PATTERN: u64 = 4;

/// How a node refers to a field, in the order of the number of words that a reference takes: 0, 1, 2, and 3 or 4.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    Solid = 0,
    Ranked = 1,
    Sliced = 2,
    Long = 3,
}

/// The tables of leaves that the nodes of a volume share.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Leaves {
    // (Shared by the pages of a volume; an access costs what that to a `Vec` does.)
    pub(crate) patterns: Arc<[u64]>,
    pub(crate) slices: Arc<[u16]>,
    pub(crate) rare: Arc<[u64]>,
}

/// Mask that is XORed with a voxel's number in its cell to mirror the field along the axes of `mirrors` (bit 0: x).
#[inline(always)]
pub(crate) fn flip_of(mirrors: u32) -> u32 {
    let along = |axis: u32| mirrors >> axis & 1;
    along(0) * 0b11 + along(1) * 0b11_00 + along(2) * 0b11_00_00
}

/// The field whose voxel v is voxel v ^ `flip` of `field`.
#[inline]
pub fn flipped(field: u64, flip: u32) -> u64 {
    let mut f = field;
    if flip & 0b11 != 0 {
        f = (f & 0x1111_1111_1111_1111) << 3
            | (f & 0x2222_2222_2222_2222) << 1
            | f >> 1 & 0x2222_2222_2222_2222
            | f >> 3 & 0x1111_1111_1111_1111;
    }
    if flip & 0b11_00 != 0 {
        f = (f & 0x000F_000F_000F_000F) << 12
            | (f & 0x00F0_00F0_00F0_00F0) << 4
            | f >> 4 & 0x00F0_00F0_00F0_00F0
            | f >> 12 & 0x000F_000F_000F_000F;
    }
    if flip & 0b11_00_00 != 0 {
        f = f << 48 | (f & 0xFFFF_0000) << 16 | f >> 16 & 0xFFFF_0000 | f >> 48;
    }
    f
}

/// The least of a field's mirror images, which stands for all of them.
pub(crate) fn least_image(field: u64) -> u64 {
    (0..8).map(|m| flipped(field, flip_of(m))).min().unwrap_or(field)
}

/// The four slices of a field.
#[inline]
fn slices_of(field: u64) -> [u16; 4] {
    [0, 16, 32, 48].map(|s| (field >> s) as u16)
}

/// What memory is for, in errors.
const FIELDS: &str = "a list of the distinct fields of a volume";

/// Sorts by falling weight, then by rising key.
fn rank<K: Copy>(&(weight, key): &(u64, K)) -> (std::cmp::Reverse<u64>, K) {
    (std::cmp::Reverse(weight), key)
}

/// The first `most` keys, by falling weight, then by rising key.
fn heaviest<K: Copy + Ord + Send>(mut weighed: Vec<(u64, K)>, most: usize) -> Vec<K> {
    if weighed.len() > most {
        weighed.select_nth_unstable_by_key(most, rank);
        weighed.truncate(most);
    }
    weighed.sort_unstable_by_key(rank);
    // Collected from an iterator of known length into a new vector: `into_iter` would keep the larger allocation.
    weighed.iter().map(|&(_, key)| key).collect()
}

/// The patterns of greatest weight, of those that weigh more than they take. A pattern weighs what its fields weigh.
fn heaviest_patterns(counted: &CountedParts<'_>, weight: impl Fn(&Counted) -> u64) -> Result<Vec<u64>> {
    let mut best: Vec<(u64, u64)> = Vec::new();
    counted.for_each(|part| {
        let images = part.chunk_by(|a, b| a.pattern == b.pattern);
        let weighed = || {
            let all = images.clone().map(|same| (same.iter().map(&weight).sum::<u64>(), same[0].pattern));
            all.filter(|&(n, _)| n > WORDS_OF_PATTERN)
        };
        make_room(&mut best, weighed().count(), FIELDS)?;
        best.extend(weighed());
        if best.len() > MAX_PATTERNS {
            best.select_nth_unstable_by_key(MAX_PATTERNS, rank);
            best.truncate(MAX_PATTERNS);
        }
        Ok(())
    })?;
    Ok(heaviest(best, MAX_PATTERNS))
}

/// Number of each slice in the table; `u16::MAX` where a slice is not in it.
struct SliceNumbers(Vec<u16>);

impl SliceNumbers {
    fn new(slices: &[u16]) -> Self {
        let mut numbers = vec![u16::MAX; 1 << 16];
        slices.iter().zip(0..).for_each(|(&s, i)| numbers[usize::from(s)] = i);
        Self(numbers)
    }

    /// The numbers of a field's slices, and the highest of them.
    #[inline]
    fn of(&self, field: u64) -> ([u16; 4], usize) {
        let numbers = slices_of(field).map(|s| self.0[usize::from(s)]);
        (numbers, numbers.into_iter().max().map_or(0, usize::from))
    }
}

impl Leaves {
    /// Chooses the leaves for these fields, which are neither empty nor full.
    ///
    /// The slices come first: the most frequent slices of those fields that are not among the [`MAX_PATTERNS`] most used patterns. Slices
    /// that occur at most twice are left out (a use saves half a word, and a slice takes one). Then come the patterns, by the words that
    /// each saves; one that saves no more than its own 4 words is left out. The result has up to [`MAX_SLICES`] slices or up to
    /// [`SHORT_SLICES`], whichever takes fewer words in all.
    ///
    /// # Errors
    /// [`crate::Error::Memory`], where there is too little for the lists of distinct fields; [`crate::Error::Io`], where they are on disk.
    pub(crate) fn of_counted(counted: &CountedParts<'_>) -> Result<Self> {
        let mut often = heaviest_patterns(counted, |c| c.uses)?;
        often.sort_unstable();
        let mut slice_uses = vec![0u64; 1 << 16];
        counted.for_each(|part| {
            for c in part.iter().filter(|c| often.binary_search(&c.pattern).is_err()) {
                slices_of(c.field).iter().for_each(|&s| slice_uses[usize::from(s)] += c.uses);
            }
            Ok(())
        })?;
        drop(often);
        let used = (0..=u16::MAX).zip(slice_uses).filter(|&(_, n)| n > 2).map(|(s, n)| (n, s)).collect();
        let slices = heaviest(used, MAX_SLICES);

        let few = slices[..slices.len().min(SHORT_SLICES)].to_vec();
        let (words, leaves) = Self::with_slices(few, counted)?;
        if slices.len() <= SHORT_SLICES {
            return Ok(leaves);
        }
        let (words_of_more, of_more) = Self::with_slices(slices, counted)?;
        Ok(if words_of_more < words { of_more } else { leaves })
    }

    /// The leaves with these slices, and the number of words that they and all references take.
    fn with_slices(slices: Vec<u16>, counted: &CountedParts<'_>) -> Result<(u64, Self)> {
        let numbers = SliceNumbers::new(&slices);
        let mut leaves = Self { slices: slices.into(), ..Self::default() };
        let mut rare: Vec<u64> = Vec::new();
        let long = leaves.words_of(Class::Long) as u64;
        let is_rare = |highest: usize| long == 3 && highest >= MAX_SLICES;
        // Words of a field that has no pattern.
        let words = |c: &Counted| match numbers.of(c.field).1 {
            highest if highest < SHORT_SLICES => 2 * c.uses,
            highest => long * c.uses + if is_rare(highest) { 4 } else { 0 },
        };
        let mut patterns = heaviest_patterns(counted, |c| words(c) - c.uses)?;
        leaves.patterns = patterns.as_slice().into();
        patterns.sort_unstable();
        let mut total = leaves.slices.len() as u64 + WORDS_OF_PATTERN * patterns.len() as u64;
        counted.for_each(|part| {
            for c in part {
                if patterns.binary_search(&c.pattern).is_ok() {
                    total += c.uses;
                    continue;
                }
                total += words(c);
                if is_rare(numbers.of(c.field).1) {
                    make_room(&mut rare, 1, FIELDS)?;
                    rare.push(c.field);
                }
            }
            Ok(())
        })?;
        rare.sort_unstable();
        leaves.rare = rare.into();
        Ok((total, leaves))
    }

    /// Words of a long reference: 3 or 4.
    pub fn long_words(&self) -> usize {
        self.words_of(Class::Long)
    }

    /// Words of a reference of a class.
    #[inline(always)]
    pub(crate) fn words_of(&self, class: Class) -> usize {
        match class {
            Class::Long => 3 + self.words_beyond_3(),
            class => class as usize,
        }
    }

    /// Words of a long reference beyond three: 0 or 1.
    #[inline(always)]
    pub(crate) fn words_beyond_3(&self) -> usize {
        usize::from(self.slices.len() <= SHORT_SLICES)
    }

    /// Patterns that 16 bits can name, at most [`MAX_PATTERNS`]; each is the least of its mirror images.
    pub fn patterns(&self) -> &[u64] {
        &self.patterns
    }

    /// Slices by number, at most [`MAX_SLICES`]; bit x + 4·y of a slice is its voxel (x, y).
    pub fn slices(&self) -> &[u16] {
        &self.slices
    }

    /// Fields that have slices outside of the table, where long references take 3 words.
    pub fn rare(&self) -> &[u64] {
        &self.rare
    }

    /// Bytes held on the heap.
    pub fn bytes(&self) -> u64 {
        let fields = self.patterns.len() + self.rare.len();
        (fields * size_of::<u64>() + self.slices.len() * size_of::<u16>()) as u64
    }

    /// The pattern and the flip of a ranked reference.
    #[inline(always)]
    pub(crate) fn ranked(&self, word: u16) -> (u64, u32) {
        (self.patterns[usize::from(word) % MAX_PATTERNS], flip_of(u32::from(word) / MAX_PATTERNS as u32))
    }

    /// The field made of the slices with these numbers.
    #[inline(always)]
    fn of_slices(&self, numbers: [u64; 4]) -> u64 {
        let [a, b, c, d] = numbers.map(|n| u64::from(self.slices[n as usize]));
        a | b << 16 | c << 32 | d << 48
    }

    /// The field of a sliced reference.
    #[inline(always)]
    pub(crate) fn sliced(&self, words: [u16; 2]) -> u64 {
        let [a, b] = words.map(u64::from);
        self.of_slices([a & 255, a >> 8, b & 255, b >> 8])
    }

    /// The field of the long reference at the start of `words`.
    #[inline(always)]
    pub(crate) fn long(&self, words: &[u16]) -> u64 {
        let w = |i: usize| u64::from(words[i]) << (16 * i);
        let three = w(0) | w(1) | w(2);
        if self.words_beyond_3() == 1 {
            three | w(3)
        } else if three & RARE == RARE {
            self.rare[(three >> 12) as usize]
        } else {
            self.of_slices([0, 12, 24, 36].map(|s| three >> s & RARE))
        }
    }
}

/// Finds the reference of a field in a table of leaves.
pub(crate) struct LeafIndex<'a> {
    leaves: &'a Leaves,
    /// The lowest reference of each pattern and of each of its mirror images.
    ranked: FxHashMap<u64, u16>,
    slices: SliceNumbers,
}

impl<'a> LeafIndex<'a> {
    pub(crate) fn new(leaves: &'a Leaves) -> Self {
        let mut ranked = FxHashMap::with_capacity_and_hasher(8 * leaves.patterns.len(), Default::default());
        for (i, &pattern) in (0u16..).zip(leaves.patterns.iter()) {
            for mirrors in 0..8u16 {
                let image = flipped(pattern, flip_of(mirrors.into()));
                ranked.entry(image).or_insert(mirrors << 13 | i);
            }
        }
        Self { leaves, ranked, slices: SliceNumbers::new(&leaves.slices) }
    }

    /// Number of words of the reference of a field that is neither empty nor full.
    #[inline]
    pub(crate) fn words(&self, field: u64) -> usize {
        let class = if self.ranked.contains_key(&field) {
            Class::Ranked
        } else if self.slices.of(field).1 < SHORT_SLICES {
            Class::Sliced
        } else {
            Class::Long
        };
        self.leaves.words_of(class)
    }

    /// The reference of a field: its class, its words, and their number.
    #[inline]
    pub(crate) fn reference(&self, field: u64) -> (Class, [u16; 4], usize) {
        if let Some(&word) = self.ranked.get(&field) {
            return (Class::Ranked, [word, 0, 0, 0], 1);
        }
        let ([a, b, c, d], highest) = self.slices.of(field);
        let long = self.leaves.words_of(Class::Long);
        if highest < SHORT_SLICES {
            (Class::Sliced, [a | b << 8, c | d << 8, 0, 0], 2)
        } else if long == 4 {
            (Class::Long, slices_of(field), long)
        } else {
            let numbers = match highest < MAX_SLICES {
                true => [a, b, c, d].iter().rev().fold(0, |all, &n| all << 12 | u64::from(n)),
                // Every field that needs an entry has one, because the table was made from these fields.
                false => (self.leaves.rare.partition_point(|&f| f < field) as u64) << 12 | RARE,
            };
            (Class::Long, slices_of(numbers), long)
        }
    }
}

#[cfg(test)]
impl Leaves {
    /// The leaves for these fields, one entry a use; the same in one part and in many.
    pub(crate) fn of_fields(uses: Vec<u64>) -> Self {
        use crate::counted_fields::CountedFields;
        use crate::spool::Scratch;
        let scratch = Scratch::new(&std::env::temp_dir());
        let with = |most_bytes| {
            let mut fields = CountedFields::new(&scratch, uses.len() as u64, most_bytes);
            uses.chunks(100).for_each(|some| fields.add(some).unwrap());
            Self::of_counted(&fields.counted().unwrap()).unwrap()
        };
        let leaves = with(u64::MAX);
        assert!(uses.len() < 40_000 || leaves == with(1));
        leaves
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(state: &mut u64) -> u64 {
        *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        *state ^ *state >> 31
    }

    #[test]
    fn flipped_moves_each_voxel() {
        let mut s = 1;
        for _ in 0..200 {
            let field = random(&mut s);
            for mirrors in 0..8 {
                let image = flipped(field, flip_of(mirrors));
                for v in 0..64u32 {
                    let [x, y, z] = [v & 3, v >> 2 & 3, v >> 4];
                    let m = |c: u32, a: u32| if mirrors >> a & 1 != 0 { 3 - c } else { c };
                    let from = m(x, 0) + 4 * m(y, 1) + 16 * m(z, 2);
                    assert_eq!(image >> v & 1, field >> from & 1);
                }
            }
        }
    }

    /// Refers to every field by the leaves and checks that it is read back. Returns the leaves and the number of references of each class.
    fn named(uses: Vec<u64>) -> (Leaves, [usize; 4]) {
        let leaves = Leaves::of_fields(uses.clone());
        assert!(leaves.patterns.len() <= MAX_PATTERNS && leaves.slices.len() <= MAX_SLICES);
        assert!(leaves.patterns.iter().all(|&p| p == least_image(p)));
        let index = LeafIndex::new(&leaves);
        let mut seen = [0; 4];
        for field in uses {
            let (class, words, count) = index.reference(field);
            assert_eq!((count, count), (index.words(field), leaves.words_of(class)));
            seen[class as usize] += 1;
            let back = match class {
                Class::Ranked => {
                    let (pattern, flip) = leaves.ranked(words[0]);
                    flipped(pattern, flip)
                }
                Class::Sliced => leaves.sliced([words[0], words[1]]),
                Class::Long | Class::Solid => leaves.long(&words[..count]),
            };
            assert_eq!(back, field);
        }
        (leaves, seen)
    }

    /// More fields, made of `slices` kinds of slices, than there can be patterns, and a random field after every `noise` of them.
    fn fields(slices: u64, noise: u64) -> Vec<u64> {
        let mut s = 7;
        let slice = |s: &mut u64| 0xFFFE - 37 * ((random(s) >> 40) % slices);
        let mut uses = Vec::new();
        for i in 0..30_000u64 {
            let field = (0..4).fold(0, |f, _| f << 16 | slice(&mut s));
            uses.extend(std::iter::repeat_n(field, 1 + (i % 5) as usize));
            if i % noise == 0 {
                uses.push(random(&mut s) | 1);
            }
        }
        uses
    }

    #[test]
    fn references_give_their_fields_back() {
        let (leaves, seen) = named(fields(24, 7));
        assert!(leaves.slices.len() <= SHORT_SLICES && leaves.rare.is_empty());
        assert!(seen[1] > 1000 && seen[2] > 1000 && seen[3] > 1000, "{seen:?}");
        // Now with slices of 12 bits, and a few fields whose slices are not in the table.
        let (leaves, seen) = named(fields(700, 70));
        assert!(leaves.slices.len() > SHORT_SLICES && leaves.rare.len() > 100, "{}", leaves.rare.len());
        assert!(seen[1] > 1000 && seen[2] > 1000 && seen[3] > 1000, "{seen:?}");
    }

    #[test]
    fn in_noise_fields_are_not_made_longer() {
        let mut s = 11;
        let (leaves, seen) = named((0..50_000).map(|_| random(&mut s) | 1).collect());
        assert_eq!((leaves.words_of(Class::Long), leaves.rare.len(), seen[3]), (4, 0, 50_000));
    }

    #[test]
    fn a_pattern_must_save_more_than_it_takes() {
        // A use saves three words where a slice is not in the table, otherwise one; a pattern takes four.
        let leaves = Leaves::of_fields([vec![0xF0; 4], vec![0xF; 5]].concat());
        assert_eq!(leaves.patterns(), [0xF]);
        // Fields mirrored along y have one pattern.
        let leaves = Leaves::of_fields([vec![0xF000; 3], vec![0xF; 2], vec![0x8]].concat());
        assert_eq!(leaves.patterns(), [0xF]);
    }

    #[test]
    fn no_more_than_references_reach() {
        let mut s = 3;
        let uses: Vec<u64> = (0..9000).flat_map(|_| [random(&mut s) | 1; 5]).collect();
        let leaves = Leaves::of_fields(uses);
        assert_eq!(leaves.patterns.len(), MAX_PATTERNS);
    }
}
