//! One box in 8 bytes: the position and extent of its voxels, and the node that holds them.
//!
//! ```text
//! bit   63      56 55      48 47      40 39  36 37   35 34   33 32  31                     0
//!       ┌─────────┬──────────┬──────────┬──────┬───────┬───────┬─────┬──────────────────────┐
//!       │ z cell  │ y cell   │ x cell   │ free │ dz−1  │ dy−1  │ dx−1│ node, in 16-bit words│
//!       │ 8 bits  │ 8 bits   │ 8 bits   │ 2    │ 2     │ 2     │ 2   │ from the chunk's base│
//!       └─────────┴──────────┴──────────┴──────┴───────┴───────┴─────┴──────────────────────┘
//! ```
//! Cells (4 voxels) are counted from the corner of the box's chunk ([`crate::CHUNK_VOXELS`] voxels a side); dx, dy, dz are the extent in
//! cells, 1 to 4. The record does not store the label: a chunk's boxes are sorted by label, and the chunk's label runs say where each label
//! begins.

/// A packed box; the module documentation draws its bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct BoxRecord(pub u64);

impl BoxRecord {
    /// Packs a box: its lowest cell within the chunk (each below 256), extent in cells (each 1 to 4), node word offset.
    pub fn new(cell: [u32; 3], extent: [u32; 3], node: u32) -> Self {
        debug_assert!(cell.iter().all(|&c| c < 256) && extent.iter().all(|&e| (1..=4).contains(&e)));
        let pack = |v: [u32; 3], bits: u32| -> u64 {
            u64::from(v[0]) | u64::from(v[1]) << bits | u64::from(v[2]) << (2 * bits)
        };
        Self(pack(cell, 8) << 40 | pack(extent.map(|e| e - 1), 2) << 32 | u64::from(node))
    }

    /// Lowest cell, counted from the chunk's corner.
    #[inline(always)]
    pub fn cell(self) -> [u32; 3] {
        [(self.0 >> 40) as u32 & 255, (self.0 >> 48) as u32 & 255, (self.0 >> 56) as u32]
    }

    /// Extent in cells, 1 to 4 each.
    #[inline(always)]
    pub fn extent(self) -> [u32; 3] {
        [(self.0 >> 32) as u32 & 3, (self.0 >> 34) as u32 & 3, (self.0 >> 36) as u32 & 3].map(|e| e + 1)
    }

    /// Word offset of the node from the chunk's node base.
    #[inline(always)]
    pub fn node(self) -> u32 {
        self.0 as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layout_is_as_drawn() {
        assert_eq!(size_of::<BoxRecord>(), 8);
        let b = BoxRecord::new([1, 2, 255], [1, 2, 4], 0xDEAD_BEEF);
        assert_eq!(b.0, 0xFF02_0134_DEAD_BEEF);
        assert_eq!((b.cell(), b.extent(), b.node()), ([1, 2, 255], [1, 2, 4], 0xDEAD_BEEF));
    }
}
