//! A node with 64 children: the voxels of a 16³ box as 4³ cells of 4³ voxels.
//!
//! The paper (§3.2, §3.3) stores an octree node in 32 bytes with eight explicit child pointers and a 64-bit occupancy field at
//! the 4³ level. On real data the upper levels are hardly ever shared (96 % of whole 16³ roots are unique), so here the two octree levels
//! above the cells are one node with bit masks, and only the cells' occupancy fields are shared.
//!
//! ```text
//! a node in the array of 16-bit words, little-endian:
//! word   0          4                4 + ⌈2n / 16⌉
//!        ┌──────────┬────────────────┬──────────────────────────────────────────┐
//!        │ occupied │ low    high    │ references, of 0 to 4 words,             │
//!        │ 64 bits  │ n bits n bits  │ of the occupied cells by rising c        │
//!        └──────────┴────────────────┴──────────────────────────────────────────┘
//! occupied   bit c: cell c has a voxel              c = x + 4·y + 16·z, x y z in 0..4, of the cell in its box
//! n          popcount(occupied)
//! low, high  bit r: class of the occupied cell of rank r; then zeros up to a whole word
//!            low high
//!             0   0   solid: all 64 voxels          no reference
//!             1   0   ranked                        1 word    ([`crate::leaves`])
//!             0   1   sliced                        2 words
//!             1   1   long                          3 words, in some volumes 4
//! field      bit v: voxel v of the cell is set      v = x + 4·y + 16·z of the voxel in its cell
//! ```
//! So the reference of the cell of rank r begins popcount(low) + 2·popcount(high) words after the first reference, counted over the ranks
//! below r; where long references have 4 words, popcount(low ∧ high) words are added.
//!
//! # Forms that were measured
//! Megabytes in memory without the bounding volume hierarchy (in per cent of 4 bytes a voxel), for 512³ voxels: *cortex*, 2,523 labels,
//! 99 % solid; *cells*, 17,001 synthetic labels, 15 % solid.
//!
//! | form | cortex | cells |
//! |---|---|---|
//! | octree with compact pointers, 8-byte records | 19.9 (3.71) | 7.0 (1.31) |
//! | the same, mirrored nodes shared | 18.0 | 6.1 |
//! | 64-wide nodes, u32 references, re-tightened boxes | 14.7 (2.74) | 6.2 (1.15) |
//! | 64-wide nodes, dictionary of 65,536 leaves, other leaves inline | 11.1 (2.07) | 4.6 (0.86) |
//! | the same on a grid without snapping (a prototype) | 11.3 (2.10) | 4.1 (0.77) |
//! | several labels a box, in priority order (a prototype) | 10.2 (1.89) | 5.0 (0.93) |
//! | 64-wide nodes, 8,192 leaves and their mirror images, other leaves by slices of 8 bits | 8.4 (1.57) | |
//! | **the same, slices of 12 bits too, and a separate table of rare leaves: the form in use** | **8.2 (1.54)** | **5.2 (0.98)** |
//!
//! A box of several labels cannot leave out a hidden label, and takes more bytes than the form in use.

use crate::leaves::{Class, LeafIndex, Leaves, flipped};

/// Words (16 bits each) of a node before its classes.
pub(crate) const OCCUPIED_WORDS: usize = 4;

/// Largest number of words of a node: every cell has a long reference of 4 words.
pub(crate) const MOST_NODE_WORDS: usize = OCCUPIED_WORDS + 8 + 4 * 64;

/// Number of words of a node before its references, by its number of occupied cells.
#[inline(always)]
pub(crate) fn header_words(occupied_cells: u32) -> usize {
    OCCUPIED_WORDS + (2 * occupied_cells as usize).div_ceil(16)
}

/// A node, read in place from the array of words.
#[derive(Clone, Copy, Debug)]
pub struct NodeRef<'a> {
    /// Bit c is set when cell c has a voxel.
    pub occupied: u64,
    /// Class of each occupied cell by rank: lower and upper bits.
    low: u64,
    high: u64,
    /// Words from the first reference on.
    references: &'a [u16],
    leaves: &'a Leaves,
}

#[inline(always)]
fn word64(words: &[u16], at: usize) -> u64 {
    let w = &words[at..at + 4];
    u64::from(w[0]) | u64::from(w[1]) << 16 | u64::from(w[2]) << 32 | u64::from(w[3]) << 48
}

/// Number of words of the references with these classes; a long reference has 3 + `beyond_3` words.
#[inline(always)]
fn reference_words(low: u64, high: u64, beyond_3: usize) -> usize {
    let three = (low.count_ones() + 2 * high.count_ones()) as usize;
    if beyond_3 == 0 { three } else { three + (low & high).count_ones() as usize }
}

/// Appends a node with these cells, all of them solid, which have no references.
pub(crate) fn solid_node(cells: u64, nodes: &mut Vec<u16>) {
    nodes.extend((0..4).map(|part| (cells >> (16 * part)) as u16));
    nodes.resize(nodes.len() + header_words(cells.count_ones()) - OCCUPIED_WORDS, Class::Solid as u16);
}

impl<'a> NodeRef<'a> {
    /// The node at word `at` of `nodes`.
    ///
    /// # Panics
    /// When the node does not lie within `nodes`; the constructor of a volume checks each of its references once.
    #[inline(always)]
    pub fn read(nodes: &'a [u16], at: usize, leaves: &'a Leaves) -> Self {
        let node = &nodes[at..];
        let occupied = word64(node, 0);
        let n = occupied.count_ones();
        // The classes of all 64 cells take 128 bits. Reading that many may pass the node's end; after the last node there are fewer words.
        let classes = match node.get(OCCUPIED_WORDS..OCCUPIED_WORDS + 8) {
            Some(words) => u128::from(word64(words, 0)) | u128::from(word64(words, 4)) << 64,
            None => node[OCCUPIED_WORDS..].iter().rev().fold(0, |bits, &w| bits << 16 | u128::from(w)),
        };
        let mask = u64::MAX.checked_shr(64 - n).unwrap_or(0);
        Self {
            occupied,
            low: classes as u64 & mask,
            high: (classes >> n) as u64 & mask,
            references: &node[header_words(n)..],
            leaves,
        }
    }

    /// Occupancy field of cell `c` in 0..64: 0 for an empty cell, all ones for a solid one.
    #[inline]
    pub fn field(&self, c: u32) -> u64 {
        let (field, flip) = self.flipped_field(c);
        flipped(field, flip)
    }

    /// Whether voxel `voxel` of cell `c` is set.
    #[inline]
    pub fn has(&self, c: u32, voxel: u32) -> bool {
        let (field, flip) = self.flipped_field(c);
        field >> (voxel ^ flip) & 1 != 0
    }

    /// A field and a flip: voxel v of cell `c` is voxel v ^ flip of the field.
    #[inline(always)]
    pub fn flipped_field(&self, c: u32) -> (u64, u32) {
        let bit = 1u64 << c;
        if self.occupied & bit == 0 {
            return (0, 0);
        }
        let rank = (self.occupied & (bit - 1)).count_ones();
        let below = (1u64 << rank) - 1;
        let at = reference_words(self.low & below, self.high & below, self.leaves.words_beyond_3());
        match (self.low >> rank & 1, self.high >> rank & 1) {
            (0, 0) => (u64::MAX, 0),
            (1, 0) => self.leaves.ranked(self.references[at]),
            (0, _) => (self.leaves.sliced([self.references[at], self.references[at + 1]]), 0),
            _ => (self.leaves.long(&self.references[at..]), 0),
        }
    }

    /// Length of the whole node in 16-bit words.
    #[inline]
    pub fn words(&self) -> usize {
        header_words(self.occupied.count_ones())
            + reference_words(self.low, self.high, self.leaves.words_beyond_3())
    }

    /// Mask of the cells that have all 64 voxels.
    pub fn solid(&self) -> u64 {
        self.classes().filter(|&(_, class)| class == Class::Solid).fold(0, |mask, (c, _)| mask | 1 << c)
    }

    /// The occupied cells by rising c, with the class of each.
    pub(crate) fn classes(&self) -> impl Iterator<Item = (u32, Class)> + use<> {
        let (mut cells, mut low, mut high) = (self.occupied, self.low, self.high);
        std::iter::from_fn(move || {
            let c = cells.trailing_zeros();
            let class = match (low & 1, high & 1) {
                (0, 0) => Class::Solid,
                (1, 0) => Class::Ranked,
                (0, _) => Class::Sliced,
                _ => Class::Long,
            };
            cells &= cells.wrapping_sub(1);
            (low, high) = (low >> 1, high >> 1);
            (c < 64).then_some((c, class))
        })
    }

    /// The occupied cells by rising c with their fields; faster than one call of [`NodeRef::field`] for each.
    #[inline]
    pub fn fields(&self) -> impl Iterator<Item = (u32, u64)> + use<'a> {
        self.flipped_fields().map(|(c, field, flip)| (c, flipped(field, flip)))
    }

    /// Like [`NodeRef::fields`], with fields and flips as [`NodeRef::flipped_field`] returns them.
    #[inline]
    pub(crate) fn flipped_fields(&self) -> FlippedFields<'a> {
        FlippedFields(*self)
    }

    /// The occupied cells by rising c, with class and offset in words of the reference from the node's start.
    pub(crate) fn references(&self) -> impl Iterator<Item = (u32, Class, usize)> + use<'a> {
        let (mut at, leaves) = (header_words(self.occupied.count_ones()), self.leaves);
        self.classes().map(move |(c, class)| {
            let from = at;
            at += leaves.words_of(class);
            (c, class, from)
        })
    }
}

/// Iterator of [`NodeRef::flipped_fields`]; holds the node without the cells that it has returned.
pub(crate) struct FlippedFields<'a>(NodeRef<'a>);

impl Iterator for FlippedFields<'_> {
    type Item = (u32, u64, u32);

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        let node = &mut self.0;
        if node.occupied == 0 {
            return None;
        }
        let c = node.occupied.trailing_zeros();
        let words = node.references;
        let (field, flip, used) = match (node.low & 1, node.high & 1) {
            (0, 0) => (u64::MAX, 0, 0),
            (1, 0) => {
                let (pattern, flip) = node.leaves.ranked(words[0]);
                (pattern, flip, 1)
            }
            (0, _) => (node.leaves.sliced([words[0], words[1]]), 0, 2),
            _ => (node.leaves.long(words), 0, node.leaves.words_of(Class::Long)),
        };
        node.references = &words[used..];
        node.occupied &= node.occupied - 1;
        (node.low, node.high) = (node.low >> 1, node.high >> 1);
        Some((c, field, flip))
    }
}

/// Number of words of a node with these contents.
pub(crate) fn node_words(occupied: u64, fields: &[u64], index: &LeafIndex) -> usize {
    let references: usize = fields.iter().map(|&f| index.words(f)).sum();
    header_words(occupied.count_ones()) + references
}

/// Writes a node into `node`, which has [`node_words`] words. `fields` are those of its occupied, not solid cells by rising c.
pub(crate) fn write_node(occupied: u64, solid: u64, fields: &[u64], index: &LeafIndex, node: &mut [u16]) {
    let n = occupied.count_ones();
    let (header, mut references) = node.split_at_mut(header_words(n));
    let (mut classes, mut rank) = (0u128, 0);
    let (mut cells, mut fields) = (occupied, fields.iter());
    while cells != 0 {
        let is_solid = solid & (cells & cells.wrapping_neg()) != 0;
        cells &= cells - 1;
        if let Some(&field) = fields.as_slice().first().filter(|_| !is_solid) {
            fields.next();
            let (class, words, count) = index.reference(field);
            classes |= (class as u128 & 1) << rank | (class as u128 >> 1) << (n + rank);
            let (these, rest) = std::mem::take(&mut references).split_at_mut(count);
            these.copy_from_slice(&words[..count]);
            references = rest;
        }
        rank += 1;
    }
    let (mask, bits) = header.split_at_mut(OCCUPIED_WORDS);
    mask.iter_mut().zip(0..).for_each(|(w, i)| *w = (occupied >> (16 * i)) as u16);
    bits.iter_mut().zip(0..).for_each(|(w, i)| *w = (classes >> (16 * i)) as u16);
}

/// Extent in cells of the box that starts at cell 0 and is tight at its end: the highest coordinate along each axis, plus 1.
pub(crate) fn extent_of(occupied: u64) -> [u32; 3] {
    let layer = occupied | occupied >> 32;
    let layer = (layer | layer >> 16) & 0xFFFF;
    let row = layer | layer >> 8;
    let row = (row | row >> 4) & 15;
    // Highest set bit along x; for y and z, in groups of 4 and 16 bits.
    [
        64 - row.leading_zeros(),
        (64 - layer.leading_zeros()).div_ceil(4),
        (64 - occupied.leading_zeros()).div_ceil(16),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Random contents of a node: each cell is occupied with a probability of `often` per cent, one in four of these solid.
    fn contents(s: &mut u64, often: u64) -> (u64, u64, Vec<u64>) {
        let mut random = || {
            *s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            *s >> 33
        };
        let (mut occupied, mut solid, mut fields) = (0u64, 0u64, Vec::new());
        for c in 0..64 {
            if random() % 100 >= often {
                continue;
            }
            occupied |= 1 << c;
            match random() % 4 {
                0 => solid |= 1 << c,
                1 => fields.push([0xF, 0x00FF_00FF, 0x8888_8888_8888_8888][random() as usize % 3]),
                2 => fields.push((0..4).fold(0, |f, _| f << 16 | (3 + 500 * (random() % 40)))),
                _ => fields.push(random() << 33 ^ random() << 9 | 1),
            }
        }
        (occupied, solid, fields)
    }

    #[test]
    fn written_nodes_are_read_back() {
        let mut s = 5;
        let all: Vec<_> = (0..400).map(|i| contents(&mut s, [3, 40, 100][i % 3])).collect();
        let leaves = Leaves::of_fields(all.iter().flat_map(|(_, _, f)| f).copied().collect());
        let index = LeafIndex::new(&leaves);
        let (mut nodes, mut starts, mut seen) = (Vec::new(), Vec::new(), [0; 4]);
        for (occupied, solid, fields) in &all {
            let at = nodes.len();
            starts.push(at);
            nodes.resize(at + node_words(*occupied, fields, &index), 0);
            write_node(*occupied, *solid, fields, &index, &mut nodes[at..]);
        }
        for (at, (occupied, solid, fields)) in starts.iter().zip(&all) {
            let node = NodeRef::read(&nodes, *at, &leaves);
            assert_eq!((node.occupied, node.solid()), (*occupied, *solid));
            assert_eq!(node.words(), node_words(*occupied, fields, &index));
            let mut expected = fields.iter();
            assert!(node.fields().eq((0..64).map(|c| (c, node.field(c))).filter(|&(_, f)| f != 0)));
            for c in 0..64 {
                let field = match (occupied >> c & 1, solid >> c & 1) {
                    (0, _) => 0,
                    (_, 1) => u64::MAX,
                    _ => *expected.next().unwrap(),
                };
                assert_eq!(node.field(c), field);
                let (image, flip) = node.flipped_field(c);
                assert!(
                    (0..64).all(|v| image >> (v ^ flip) & 1 == field >> v & 1
                        && node.has(c, v) == (field >> v & 1 != 0))
                );
            }
            node.classes().for_each(|(_, class)| seen[class as usize] += 1);
        }
        assert!(seen.iter().all(|&n| n > 500), "{seen:?}");
    }

    #[test]
    fn extent_matches_naive() {
        let mut s = 1u64;
        for i in 0..3000 {
            s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let occupied = (s ^ s >> 29) >> (i % 64) & u64::MAX.checked_shl(64 - i % 65).unwrap_or(u64::MAX)
                | 1 << (i % 64);
            let mut naive = [0; 3];
            for c in (0..64).filter(|c| occupied >> c & 1 != 0) {
                for (a, e) in naive.iter_mut().enumerate() {
                    *e = (*e).max((c >> (2 * a) & 3) + 1);
                }
            }
            assert_eq!(extent_of(occupied), naive, "{occupied:016x}");
        }
    }
}
