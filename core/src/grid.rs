//! A spatial index: the boxes that overlap each 16³ brick of space. It answers which label a voxel has without a walk over all boxes.
//!
//! ```text
//! bricks  7        9        12        Morton codes of the bricks that some box touches, rising
//! starts  0        2        3     5   one more than bricks
//! boxes   4 11     4        0 4 9     box indices, rising within a brick; a box that overlaps two bricks is listed in both
//! ```
//! Only bricks with boxes are listed, so the index of a long thin or nearly empty volume is no larger than its boxes require.

use rayon::prelude::*;

use crate::morton;

/// Side of a brick in voxels.
pub const BRICK_VOXELS: u32 = 16;

/// Spatial index of boxes by brick; the module documentation draws its arrays.
#[derive(Clone, Debug, Default)]
pub struct BoxGrid {
    bricks: Vec<u64>,
    starts: Vec<u32>,
    boxes: Vec<u32>,
}

impl BoxGrid {
    /// Builds the index of `boxes` boxes; `place` returns the lowest voxel and the extent in voxels of a box.
    pub(crate) fn new(boxes: usize, place: impl Fn(usize) -> ([u32; 3], [u32; 3]) + Sync) -> Self {
        let mut pairs: Vec<(u64, u32)> = (0..boxes as u32)
            .into_par_iter()
            .flat_map_iter(|i| {
                let (origin, extent) = place(i as usize);
                let first = origin.map(|o| o / BRICK_VOXELS);
                let last = [0, 1, 2].map(|a| (origin[a] + extent[a] - 1) / BRICK_VOXELS);
                cells_between(first, last).map(move |brick| (morton::encode(brick), i))
            })
            .collect();
        pairs.par_sort_unstable();
        let mut grid = Self::default();
        grid.boxes.reserve_exact(pairs.len());
        for &(brick, index) in &pairs {
            if grid.bricks.last() != Some(&brick) {
                grid.bricks.push(brick);
                grid.starts.push(grid.boxes.len() as u32);
            }
            grid.boxes.push(index);
        }
        grid.starts.push(grid.boxes.len() as u32);
        grid.bricks.shrink_to_fit();
        grid.starts.shrink_to_fit();
        grid
    }

    /// Indices of the boxes that overlap a brick (voxel coordinates / 16), in rising order.
    pub fn boxes_in(&self, brick: [u32; 3]) -> &[u32] {
        match self.bricks.binary_search(&morton::encode(brick)) {
            Ok(i) => self.boxes_of(i),
            Err(_) => &[],
        }
    }

    /// Morton codes of the bricks that have boxes, in rising order.
    pub fn bricks(&self) -> &[u64] {
        &self.bricks
    }

    /// Boxes of the brick at index `i` of [`BoxGrid::bricks`].
    pub fn boxes_of(&self, i: usize) -> &[u32] {
        &self.boxes[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    /// Bytes held on the heap.
    pub fn bytes(&self) -> u64 {
        (self.bricks.capacity() * 8 + self.starts.capacity() * 4 + self.boxes.capacity() * 4) as u64
    }
}

/// All points from `first` to `last`, both inclusive.
pub(crate) fn cells_between(first: [u32; 3], last: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (first[2]..=last[2]).flat_map(move |z| {
        (first[1]..=last[1]).flat_map(move |y| (first[0]..=last[0]).map(move |x| [x, y, z]))
    })
}
