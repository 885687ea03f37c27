//! A cell: 4³ voxels of one label as a 64-bit mask, at a position given by a Morton code.
//!
//! ```text
//! mask bit v: voxel v of the cell has the label     v = x + 4·y + 16·z, x y z in 0..4
//! key       : Morton code of the cell's coordinates in the volume (voxel coordinates / 4)
//! ```

/// Voxels along a cell's side.
pub const CELL: u32 = 4;

/// Mask of a cell that one label fills.
pub const SOLID: u64 = u64::MAX;

/// Cells along a box's longest side.
pub const BOX_CELLS: u32 = 4;

/// The voxels of one label in one cell, as a record of 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Cell {
    /// Morton code of the cell's coordinates.
    pub key: u64,
    /// Mask of the voxels that have the label; never 0.
    pub mask: u64,
}

/// Sorts one label's records by key and ORs records of the same cell, which come from different blocks.
///
/// The records usually form a few rising runs (one from each part), which the standard stable sort finds and merges in O(n log runs).
pub fn sort_and_or(cells: &mut Vec<Cell>) {
    cells.sort_by_key(|c| c.key);
    cells.dedup_by(|later, kept| {
        let same = later.key == kept.key;
        if same {
            kept.mask |= later.mask;
        }
        same
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_of_a_cell_are_ored() {
        let c = |key, mask| Cell { key, mask };
        let mut cells = vec![c(3, 1), c(9, 4), c(3, 2), c(1, 8), c(9, 4)];
        sort_and_or(&mut cells);
        assert_eq!(cells, [c(1, 8), c(3, 3), c(9, 4)]);
    }
}
