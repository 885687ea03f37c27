//! A spatial index: the boxes that overlap each 16³ brick of space. It answers which label a voxel has without a walk over all boxes.
//!
//! ```text
//! bricks  7        9        12        Morton codes of the bricks that some box touches, rising
//! starts  0        2        3     5   one more than bricks
//! boxes   4 11     4        0 4 9     box indices, rising within a brick; a box that overlaps two bricks is listed in both
//! ```
//! Only bricks with boxes are listed, so the index of a long thin or nearly empty volume is no larger than its boxes require.

use rayon::prelude::*;

use crate::reserve::{collected_by_threads, reserved, zeroed};
use crate::{NoMemory, morton};

/// Side of a brick in voxels.
pub const BRICK_VOXELS: u32 = 16;

/// Boxes of one task while the index is built.
const TASK_BOXES: usize = 4096;

/// What is said to need the memory.
const WHAT: &str = "the index of a volume's boxes by place";

/// Spatial index of boxes by brick; the module documentation draws its arrays.
#[derive(Clone, Debug, Default)]
pub struct BoxGrid {
    bricks: Vec<u64>,
    starts: Vec<u32>,
    boxes: Vec<u32>,
}

impl BoxGrid {
    /// Builds the index of `boxes` boxes; `place` returns the lowest voxel and the extent in voxels of a box.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub(crate) fn new(
        boxes: usize,
        place: impl Fn(usize) -> ([u32; 3], [u32; 3]) + Sync,
    ) -> Result<Self, NoMemory> {
        // The lowest and the highest brick that a box touches.
        let ends = |index: usize| {
            let (origin, extent) = place(index);
            [origin, [0, 1, 2].map(|a| origin[a] + extent[a] - 1)]
                .map(|voxel| voxel.map(|c| c / BRICK_VOXELS))
        };
        let tasks = boxes.div_ceil(TASK_BOXES);
        let boxes_of = |task: usize| task * TASK_BOXES..boxes.min((task + 1) * TASK_BOXES);

        // Count the pairs of a brick and a box that each task finds, so that each writes to its own part of one list.
        let pairs_of_box = |index: usize| {
            let [first, last] = ends(index);
            (0..3).map(|a| (last[a] - first[a] + 1) as usize).product::<usize>()
        };
        let count = |task: usize| boxes_of(task).map(pairs_of_box).sum::<usize>();
        let counts = collected_by_threads((0..tasks).into_par_iter().map(count), WHAT)?;
        let mut pairs: Vec<(u64, u32)> = zeroed(counts.iter().sum(), WHAT)?;
        let mut parts = reserved(tasks, WHAT)?;
        let mut rest = pairs.as_mut_slice();
        for count in counts {
            let (part, after) = rest.split_at_mut(count);
            parts.push(part);
            rest = after;
        }
        parts.into_par_iter().enumerate().for_each(|(task, part)| {
            let found = boxes_of(task).flat_map(|index| {
                let [first, last] = ends(index);
                cells_between(first, last).map(move |brick| (morton::encode(brick), index as u32))
            });
            part.iter_mut().zip(found).for_each(|(to, pair)| *to = pair);
        });
        pairs.par_sort_unstable();

        let bricks = pairs.chunk_by(|a, b| a.0 == b.0).count();
        let mut grid = Self {
            bricks: reserved(bricks, WHAT)?,
            starts: reserved(bricks + 1, WHAT)?,
            boxes: reserved(pairs.len(), WHAT)?,
        };
        for of_brick in pairs.chunk_by(|a, b| a.0 == b.0) {
            grid.bricks.push(of_brick[0].0);
            grid.starts.push(grid.boxes.len() as u32);
            grid.boxes.extend(of_brick.iter().map(|pair| pair.1));
        }
        grid.starts.push(grid.boxes.len() as u32);
        Ok(grid)
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
