//! Voxels of the shown labels, counted in cells of several voxels: what a coarse surface is made of.
//!
//! ```text
//!   field of 4³ voxels         cells of 3 voxels       a cell of 4³ voxels of a box lies in up to 8 cells of the grid, or 64 where
//!   ┌─┬─┬─┬─┐                  ┌─────┬─────┐           those are voxels; a mask for each axis picks its bits there, and their number
//!   │ │■│■│■│   bits           │  2  │  1  │           is what the cell gets. No voxel is decoded.
//!   └─┴─┴─┴─┘                  └─────┴─────┘
//! ```
//! Beside the number of its voxels a cell keeps one label, by the vote of Boyer and Moore (1981, *MJRTY*): that of more than half of its
//! shown voxels, where one label has so many.

use pumice_core::{BoxView, CompressedVolume, Error, Job};

/// Bits of a field (x + 4 y + 16 z) that are below a coordinate of 0 to 4, by axis.
const BELOW: [[u64; 5]; 3] = [
    [0, 0x1111_1111_1111_1111, 0x3333_3333_3333_3333, 0x7777_7777_7777_7777, u64::MAX],
    [0, 0x000F_000F_000F_000F, 0x00FF_00FF_00FF_00FF, 0x0FFF_0FFF_0FFF_0FFF, u64::MAX],
    [0, 0xFFFF, 0xFFFF_FFFF, 0xFFFF_FFFF_FFFF, u64::MAX],
];

/// Least share of a cell that is inside, and share at which the surface lies, both of the greatest share among the cell and its 26 neighbours.
/// Where no cell is full, as along a fibre thinner than one, they are lower, or fibres would break into beads.
///
/// They were found with 32 neurites of the cortex in `data/`, in cells of 5 × 5 × 4 voxels from three views: with halves, silhouettes overlap by
/// 0.86 to 0.89, and nearly all of what differs is lost; with these by 0.92 to 0.94. They also put flat surfaces a fifth of a cell outside.
/// With less the faces become more, and what differs is added.
const INSIDE: f32 = 0.35;
const SURFACE: f32 = 0.3;

/// How far cells that are not inside are below the surface at least, in the same unit: the surface stays away from their middles.
const OUTSIDE: f32 = 0.1;

/// Cells in the box of some voxels, with a margin of one empty cell on each side.
pub(crate) struct CellGrid {
    /// The lowest voxel of the first cell after the margin.
    low: [u32; 3],
    /// Voxels of a cell along each axis.
    pub(crate) side: [u32; 3],
    /// Cells along each axis, with the margin.
    pub(crate) size: [usize; 3],
    /// Number of shown voxels of each cell, x fastest.
    filled: Vec<u32>,
    /// Dense index of a label of each cell that has one.
    pub(crate) labels: Vec<u32>,
}

impl CellGrid {
    /// Cells of `side` voxels over the voxels from `low` up to, and without, `high`, which must have the boxes of all visible labels.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub(crate) fn new(
        volume: &CompressedVolume,
        visible: &[bool],
        [low, high]: [[u32; 3]; 2],
        side: [u32; 3],
        job: &Job,
    ) -> Result<Self, Error> {
        let size = [0, 1, 2].map(|a| (high[a] - low[a]).div_ceil(side[a]) as usize + 2);
        let cells = size.iter().product();
        let mut grid = Self { low, side, size, filled: vec![0; cells], labels: vec![0; cells] };
        // Votes by which the label of a cell leads.
        let mut leads = vec![0; cells];
        volume.for_each_box(|label, view| {
            if visible[label as usize] && !job.is_cancelled() {
                grid.add(label, &view, &mut leads);
            }
        });
        job.check()?;
        volume.check_pages()?;
        Ok(grid)
    }

    /// Numbers of cells along each axis from a cell to the next.
    pub(crate) fn steps(&self) -> [usize; 3] {
        [1, self.size[0], self.size[0] * self.size[1]]
    }

    /// Middle of a cell, by its place along each axis, in index space.
    pub(crate) fn middle(&self, at: [usize; 3]) -> [f32; 3] {
        // The margin's first cell lies before the lowest voxel.
        [0, 1, 2].map(|a| self.low[a] as f32 + (at[a] as f32 - 0.5) * self.side[a] as f32)
    }

    /// For each cell the shown share of its voxels, less the share at which the surface lies there: above zero in cells that are inside.
    pub(crate) fn excess(&self) -> Vec<f32> {
        let mut greatest = self.filled.clone();
        let mut before = Vec::new();
        for step in self.steps() {
            before.clone_from(&greatest);
            // A cell of the margin may meet one of another row there, which is of the margin too and empty so far.
            for (most, other) in greatest[step..].iter_mut().zip(&before) {
                *most = (*most).max(*other);
            }
            for (most, other) in greatest.iter_mut().zip(&before[step..]) {
                *most = (*most).max(*other);
            }
        }
        let excess = |(&filled, &most): (&u32, &u32)| {
            let (filled, most) = (filled as f32, most as f32);
            let excess = filled - SURFACE * most;
            if filled > 0.0 && filled >= INSIDE * most { excess } else { excess.min(-OUTSIDE * most) }
        };
        self.filled.iter().zip(&greatest).map(excess).collect()
    }

    /// Counts the voxels of a box.
    fn add(&mut self, label: u32, view: &BoxView<'_>, leads: &mut [u32]) {
        let ([_, row, plane], side) = (self.steps(), self.side);
        for (c, field) in view.node.fields() {
            let first = [0, 1, 2].map(|a| view.origin[a] + 4 * (c >> (2 * a) & 3) - self.low[a]);
            for (z, of_z) in parts(first[2], side[2], 2) {
                for (y, of_y) in parts(first[1], side[1], 1) {
                    for (x, of_x) in parts(first[0], side[0], 0) {
                        let voxels = (field & of_x & of_y & of_z).count_ones();
                        if voxels > 0 {
                            self.vote(x + y * row + z * plane, label, voxels, leads);
                        }
                    }
                }
            }
        }
    }

    fn vote(&mut self, cell: usize, label: u32, voxels: u32, leads: &mut [u32]) {
        self.filled[cell] += voxels;
        let lead = &mut leads[cell];
        if self.labels[cell] == label {
            *lead += voxels;
        } else if *lead >= voxels {
            *lead -= voxels;
        } else {
            *lead = voxels - *lead;
            self.labels[cell] = label;
        }
    }
}

/// The cells of `side` voxels in which the four voxels from `first` are, along an axis: place of each, with the margin, and the bits of a
/// field that are in it.
fn parts(first: u32, side: u32, axis: usize) -> impl Iterator<Item = (usize, u64)> {
    (first / side..=(first + 3) / side).map(move |cell| {
        let from = (cell * side).saturating_sub(first) as usize;
        let to = ((cell + 1) * side - first).min(4) as usize;
        (cell as usize + 1, BELOW[axis][to] & !BELOW[axis][from])
    })
}

#[cfg(test)]
mod tests {
    use pumice_oracle::volumes;

    use super::*;

    #[test]
    fn cells_of_any_size_count_their_voxels_and_have_the_label_of_most() {
        let dims = [21, 18, 15];
        let (dense, volume) = volumes::blobs(dims, 30, 20, 4);
        let labels = volume.labels().len();
        let visible: Vec<bool> = (0..labels).map(|label| label % 3 != 1).collect();
        for side in [[1, 1, 1], [2, 3, 1], [5, 4, 7], [16, 16, 16]] {
            let grid = CellGrid::new(&volume, &visible, [[0; 3], [24, 20, 16]], side, &Job::new()).unwrap();
            for cell in 0..grid.filled.len() {
                let at = [0, 1, 2].map(|a| cell / grid.steps()[a] % grid.size[a]);
                // Naive: look at each voxel of the cell.
                let mut counts = vec![0u32; labels];
                let in_cell = |v: [u32; 3]| (0..3).all(|a| (v[a] / side[a]) as usize + 1 == at[a]);
                for z in 0..dims[2] {
                    for y in 0..dims[1] {
                        for x in (0..dims[0]).filter(|&x| in_cell([x, y, z])) {
                            let label = dense.at([x, y, z].map(i64::from)) as usize;
                            if label > 0 && visible[label - 1] {
                                counts[label - 1] += 1;
                            }
                        }
                    }
                }
                let sum: u32 = counts.iter().sum();
                assert_eq!(grid.filled[cell], sum, "{side:?} {at:?}");
                if let Some(row) = counts.iter().position(|&n| 2 * n > sum) {
                    assert_eq!(grid.labels[cell], row as u32, "{side:?} {at:?}");
                }
            }
        }
    }
}
