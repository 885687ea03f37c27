//! One 64-wide node: the voxels of a 16³ box as 4³ cells of 4³ voxels.
//!
//! The paper (§3.2, §3.3) stores an octree node in 32 bytes with eight explicit child pointers and a 64-bit occupancy field at
//! the 4³ level. Its upper levels are nearly never shared on real data (96 % of whole 16³ roots are unique), so here the two
//! octree levels above the cells are one node with bit masks, and only the cells' occupancy fields are shared.
//!
//! ```text
//! a node in the array of 16-bit words, little-endian:
//! word   0          4          8          12                        12 + D                     12 + D + 4·I
//!        ┌──────────┬──────────┬──────────┬─────────────────────────┬──────────────────────────┐
//!        │ occupied │ solid    │ ranked   │ D dictionary indices    │ I occupancy fields       │
//!        │ 64 bits  │ 64 bits  │ 64 bits  │ 16 bits each            │ 64 bits each             │
//!        └──────────┴──────────┴──────────┴─────────────────────────┴──────────────────────────┘
//! occupied  bit c: cell c has a voxel                c = x + 4·y + 16·z, x y z in 0..4, of the cell in its box
//! solid     bit c: cell c has all 64 voxels          solid ⊆ occupied
//! ranked    bit c: cell c's field is in the leaf dictionary, at the index given by this node
//!                                                    ranked ⊆ occupied ∖ solid
//! D = popcount(ranked), I = popcount(occupied ∖ solid ∖ ranked); both lists in increasing c
//! field     bit v: voxel v of the cell is there      v = x + 4·y + 16·z of the voxel in its cell
//! ```

/// Words (16 bits each) of a node before its references.
pub const NODE_HEADER_WORDS: usize = 12;

/// A node, read in place.
#[derive(Clone, Copy, Debug)]
pub struct NodeRef<'a> {
    /// Cells with a voxel.
    pub occupied: u64,
    /// Cells with all 64 voxels.
    pub solid: u64,
    /// Cells whose field is in the dictionary.
    pub ranked: u64,
    references: &'a [u16],
    dictionary: &'a [u64],
}

#[inline]
fn word64(words: &[u16], at: usize) -> u64 {
    let w = &words[at..at + 4];
    u64::from(w[0]) | u64::from(w[1]) << 16 | u64::from(w[2]) << 32 | u64::from(w[3]) << 48
}

impl<'a> NodeRef<'a> {
    /// The node at word `at` of `nodes`.
    ///
    /// # Panics
    /// When the node does not lie within `nodes`; a volume's constructor checks each of its references once.
    #[inline]
    pub fn read(nodes: &'a [u16], at: usize, dictionary: &'a [u64]) -> Self {
        let node = &nodes[at..];
        Self {
            occupied: word64(node, 0),
            solid: word64(node, 4),
            ranked: word64(node, 8),
            references: &node[NODE_HEADER_WORDS..],
            dictionary,
        }
    }

    /// Occupancy field of cell `c` in 0..64: 0 where empty, all ones where solid.
    #[inline]
    pub fn field(&self, c: u32) -> u64 {
        let bit = 1u64 << c;
        if self.occupied & bit == 0 {
            return 0;
        }
        if self.solid & bit != 0 {
            return u64::MAX;
        }
        let below = bit - 1;
        if self.ranked & bit != 0 {
            let rank = (self.ranked & below).count_ones() as usize;
            self.dictionary[usize::from(self.references[rank])]
        } else {
            let inline = self.occupied & !self.solid & !self.ranked;
            let rank = (inline & below).count_ones() as usize;
            word64(self.references, self.ranked.count_ones() as usize + 4 * rank)
        }
    }

    /// Length of the whole node in 16-bit words.
    #[inline]
    pub fn words(&self) -> usize {
        let inline = self.occupied & !self.solid & !self.ranked;
        NODE_HEADER_WORDS + self.ranked.count_ones() as usize + 4 * inline.count_ones() as usize
    }
}

/// Extent in cells of the tight box of some cells: one more than the highest coordinate along each axis.
pub(crate) fn extent_of(occupied: u64) -> [u32; 3] {
    let layer = occupied | occupied >> 32;
    let layer = (layer | layer >> 16) & 0xFFFF;
    let row = layer | layer >> 8;
    let row = (row | row >> 4) & 15;
    // Highest set position of x; of y and z in groups of 4 and 16 bits.
    [
        64 - row.leading_zeros(),
        (64 - layer.leading_zeros()).div_ceil(4),
        (64 - occupied.leading_zeros()).div_ceil(16),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

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
