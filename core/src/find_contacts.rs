//! Finds which labels touch, which means that they share a face of two voxels (6-neighbourhood).
//!
//! ```text
//! for each 16³ brick with boxes, in parallel:
//!     list (label, mask) for its 4³ cells and for the layer of cells behind its upper faces
//!     two labels in one cell touch       if one's mask, grown by a voxel along each axis, meets the other's
//!     two labels in adjacent cells touch if the facing layers of their masks meet
//! ```
//! The time is linear in the number of cells that have labels; in a cell with many labels, voxels are compared instead of masks.

use rayon::prelude::*;

use crate::contacts::{PAIRS, Pairs};
use crate::grid::{BRICK_VOXELS, BoxGrid, cells_between};
use crate::reserve::make_room;
use crate::{CompressedVolume, Contacts, Error, Job, Result, morton};

/// Masks of the voxels of a cell with x = 0, with y = 0, with z = 0.
pub(crate) const LOW_FACE: [u64; 3] = [0x1111_1111_1111_1111, 0x000F_000F_000F_000F, 0xFFFF];
/// Distance in bits of one step along x, y, z within a cell.
pub(crate) const STEP: [u32; 3] = [1, 4, 16];

/// The mask, extended by the neighbours of its voxels within the cell.
#[inline]
fn grow(mask: u64) -> u64 {
    (0..3).fold(mask, |grown, a| {
        let up = (mask << STEP[a]) & !LOW_FACE[a];
        let down = (mask & !LOW_FACE[a]) >> STEP[a];
        grown | up | down
    })
}

/// Whether the mask of a cell touches the mask of the next cell along an axis.
#[inline]
fn touch_across(low: u64, high: u64, axis: usize) -> bool {
    (low >> (3 * STEP[axis])) & LOW_FACE[axis] & high != 0
}

/// Labels and masks in 5³ cells: a brick's own 4³ cells, and one layer of its neighbours' cells behind its upper faces.
struct Neighbourhood {
    cells: Vec<Vec<(u32, u64)>>,
}

/// Index of a cell in a [`Neighbourhood`]; each coordinate is 0..=4.
fn slot(p: [u32; 3]) -> usize {
    (p[0] + 5 * p[1] + 25 * p[2]) as usize
}

impl Neighbourhood {
    /// Adds the labels and masks of `boxes` in the cells from `first` to `last`, counted from the brick's first cell.
    fn list(
        &mut self,
        volume: &CompressedVolume,
        boxes: &[u32],
        brick_cell: [u32; 3],
        first: [u32; 3],
        last: [u32; 3],
    ) {
        for &i in boxes {
            let b = volume.get_box(i as usize);
            let origin = b.origin.map(|o| i64::from(o / 4));
            let mut range = [(0u32, 0u32); 3];
            let mut empty = false;
            for a in 0..3 {
                let corner = i64::from(brick_cell[a]);
                let low = (corner + i64::from(first[a])).max(origin[a]);
                let high = (corner + i64::from(last[a])).min(origin[a] + i64::from(b.extent[a] / 4) - 1);
                empty |= low > high;
                range[a] = ((low - origin[a]) as u32, (high - origin[a]) as u32);
            }
            if empty {
                continue;
            }
            // This is a search among all labels of the chunk, and most boxes of a neighbouring brick have no cell in range; so it comes
            // late.
            let label = volume.label_of_box(i as usize);
            for p in cells_between(range.map(|r| r.0), range.map(|r| r.1)) {
                let field = b.node.field(p[0] + 4 * p[1] + 16 * p[2]);
                if field != 0 {
                    let at = [0, 1, 2].map(|a| (origin[a] + i64::from(p[a])) as u32 - brick_cell[a]);
                    self.cells[slot(at)].push((label, field));
                }
            }
        }
    }
}

/// Bricks of one task: a 64³ region where space is full.
const TASK_BRICKS: usize = 64;

impl CompressedVolume {
    /// Finds the touching pairs again; [`crate::compress()`] has stored them in [`crate::LabelTable::contacts`].
    ///
    /// # Errors
    /// [`Error::Cancelled`]; [`Error::Memory`]; [`Error::Caller`] when two labels claim one voxel, which this search detects.
    pub fn find_contacts(&self, job: &Job) -> Result<Contacts> {
        // A grid for this call only: most volumes never need one again.
        let grid = self.new_grid()?;
        let pairs = find(self, &grid, grid.bricks(), job)?;
        Ok(Contacts::pack(&pairs, self.labels().len() as u32)?)
    }
}

/// Sorts the pairs and removes duplicates.
fn rising(mut pairs: Vec<u64>) -> Vec<u64> {
    pairs.par_sort_unstable();
    pairs.dedup();
    pairs
}

/// The touching pairs of some bricks, as `a << 32 | b` with a < b, in rising order.
fn find(volume: &CompressedVolume, grid: &BoxGrid, bricks: &[u64], job: &Job) -> Result<Vec<u64>> {
    job.begin(bricks.len() as u64);
    let tasks = bricks.len().div_ceil(TASK_BRICKS);
    let found: Vec<Result<Vec<u64>>> = (0..tasks)
        .into_par_iter()
        .map(|task| {
            job.check()?;
            let range = task * TASK_BRICKS..((task + 1) * TASK_BRICKS).min(bricks.len());
            job.advance(range.len() as u64);
            let mut pairs = Pairs::new();
            let mut around = Neighbourhood { cells: vec![Vec::new(); 125] };
            for &brick in &bricks[range] {
                find_in_brick(volume, grid, morton::decode(brick), &mut around, &mut pairs);
            }
            match pairs.claimed_twice {
                None => Ok(pairs.into_vec()?),
                Some(cell) => Err(Error::Caller(format!(
                    "two labels claim one voxel of the cell at {cell:?}: blocks of the source overlap, each voxel must come once"
                ))),
            }
        })
        .collect();
    let found = found.into_iter().collect::<Result<Vec<_>>>()?;
    let mut all = Vec::new();
    make_room(&mut all, found.iter().map(Vec::len).sum(), PAIRS)?;
    found.into_iter().for_each(|pairs| all.extend(pairs));
    Ok(rising(all))
}

fn find_in_brick(
    volume: &CompressedVolume,
    grid: &BoxGrid,
    brick: [u32; 3],
    around: &mut Neighbourhood,
    pairs: &mut Pairs,
) {
    let brick_cell = brick.map(|b| b * (BRICK_VOXELS / 4));
    around.cells.iter_mut().for_each(Vec::clear);
    around.list(volume, grid.boxes_in(brick), brick_cell, [0; 3], [3; 3]);
    for axis in 0..3 {
        let (mut next, mut first, mut last) = (brick, [0; 3], [3; 3]);
        next[axis] += 1;
        (first[axis], last[axis]) = (4, 4);
        if next[axis] >> morton::AXIS_BITS == 0 {
            around.list(volume, grid.boxes_in(next), brick_cell, first, last);
        }
    }
    for p in cells_between([0; 3], [3; 3]) {
        let here = &around.cells[slot(p)];
        if here.is_empty() {
            continue;
        }
        let corner = [0, 1, 2].map(|a| 4 * (brick_cell[a] + p[a]));
        pairs_within(here, corner, pairs);
        for axis in 0..3 {
            let mut q = p;
            q[axis] += 1;
            pairs_across(here, &around.cells[slot(q)], axis, pairs);
        }
    }
}

/// From this many pairs of labels on, comparing 64 voxels is cheaper than comparing masks. This keeps the time of crowded cells linear.
const CROWDED_PAIRS: usize = 32;

/// Label of each voxel of a cell, plus 1; 0 where there is none.
fn expand(cell: &[(u32, u64)]) -> [u32; 64] {
    let mut voxels = [0; 64];
    for &(label, mut mask) in cell {
        while mask != 0 {
            voxels[mask.trailing_zeros() as usize] = label + 1;
            mask &= mask - 1;
        }
    }
    voxels
}

/// Adds the pair of labels of two touching voxels, unless they are equal or one is background.
#[inline]
fn add_voxels(a: u32, b: u32, pairs: &mut Pairs) {
    if a != b && a != 0 && b != 0 {
        pairs.add(a - 1, b - 1);
    }
}

/// Adds the pairs within a cell, and records when two labels claim one voxel.
pub(crate) fn pairs_within(here: &[(u32, u64)], corner: [u32; 3], pairs: &mut Pairs) {
    let mut claimed = 0;
    for &(_, mask) in here {
        if claimed & mask != 0 {
            pairs.claimed_twice = Some(corner);
        }
        claimed |= mask;
    }
    if here.len() * here.len() > 2 * CROWDED_PAIRS {
        let voxels = expand(here);
        for v in 0..64 {
            for (axis, step) in STEP.map(|s| s as usize).into_iter().enumerate() {
                if v >> (2 * axis) & 3 != 3 {
                    add_voxels(voxels[v], voxels[v + step], pairs);
                }
            }
        }
        return;
    }
    for (k, &(a, mask)) in here.iter().enumerate() {
        if k + 1 < here.len() {
            let grown = grow(mask);
            for &(b, other) in &here[k + 1..] {
                if other & grown != 0 && a != b {
                    pairs.add(a, b);
                }
            }
        }
    }
}

/// Adds the pairs across the face between a cell and the next one along an axis.
pub(crate) fn pairs_across(here: &[(u32, u64)], there: &[(u32, u64)], axis: usize, pairs: &mut Pairs) {
    if here.len() * there.len() > CROWDED_PAIRS {
        let (low, high) = (expand(here), expand(there));
        let step = STEP[axis] as usize;
        for v in (0..64).filter(|v| v >> (2 * axis) & 3 == 0) {
            add_voxels(low[v + 3 * step], high[v], pairs);
        }
        return;
    }
    for &(a, mask) in here {
        for &(b, other) in there {
            if a != b && touch_across(mask, other, axis) {
                pairs.add(a, b);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growing_matches_naive() {
        let place = |v: i32| [v & 3, v >> 2 & 3, v >> 4];
        for v in 0..64 {
            let near = |w: &i32| (0..3).map(|a| (place(*w)[a] - place(v)[a]).abs()).sum::<i32>() <= 1;
            let naive = (0..64).filter(near).fold(0u64, |m, w| m | 1 << w);
            assert_eq!(grow(1 << v), naive, "voxel {v}");
        }
    }
}
