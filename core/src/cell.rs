//! A cell: 4³ voxels of one label as a 64-bit mask, at a position given by a Morton code.
//!
//! ```text
//! mask bit v: voxel v of the cell has the label     v = x + 4·y + 16·z, x y z in 0..4
//! key       : Morton code of the cell's coordinates in the volume (voxel coordinates / 4)
//! ```

use crate::NoMemory;
use crate::reserve::{make_room, reserved};

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
/// The records usually form a few rising runs (one from each part), which are found and merged in pairs, in O(n log runs). The standard
/// stable sort does the same and ends the process where it has no memory; the unstable one needs none and takes two to four times as long.
///
/// # Errors
/// [`NoMemory`] where there is none for half of the records beside them; they are in no order then.
pub fn sort_and_or(cells: &mut Vec<Cell>) -> Result<(), NoMemory> {
    const WHAT: &str = "the cells of a label, while they are sorted,";
    let mut ends = Vec::new();
    let mut end = 0;
    for run in cells.chunk_by(|a, b| a.key <= b.key) {
        end += run.len();
        make_room(&mut ends, 1, WHAT)?;
        ends.push(end);
    }
    if ends.len() > 1 {
        let mut aside = reserved(cells.len() / 2, WHAT)?;
        while ends.len() > 1 {
            let mut start = 0;
            for pair in 0..ends.len() / 2 {
                let [middle, end] = [ends[2 * pair], ends[2 * pair + 1]];
                merge(&mut cells[start..end], middle - start, &mut aside);
                ends[pair] = end;
                start = end;
            }
            // A last run without a partner waits for the next round.
            if ends.len() % 2 == 1 {
                let last = ends.len() - 1;
                ends[last / 2] = ends[last];
            }
            ends.truncate(ends.len().div_ceil(2));
        }
    }
    cells.dedup_by(|later, kept| {
        let same = later.key == kept.key;
        if same {
            kept.mask |= later.mask;
        }
        same
    });
    Ok(())
}

/// Merges two runs, the second of which begins at `middle`; the shorter one is moved to `aside`, which has room for half of both.
fn merge(cells: &mut [Cell], middle: usize, aside: &mut Vec<Cell>) {
    aside.clear();
    let (mut place, len) = (0, cells.len());
    if middle <= len / 2 {
        aside.extend_from_slice(&cells[..middle]);
        let (mut left, mut right) = (0, middle);
        while left < middle && right < len {
            let is_right = cells[right].key < aside[left].key;
            cells[place] = if is_right { cells[right] } else { aside[left] };
            right += usize::from(is_right);
            left += usize::from(!is_right);
            place += 1;
        }
        cells[place..place + middle - left].copy_from_slice(&aside[left..]);
    } else {
        // From the highest down.
        aside.extend_from_slice(&cells[middle..]);
        let (mut left, mut right) = (middle, aside.len());
        place = len;
        while left > 0 && right > 0 {
            let is_left = cells[left - 1].key > aside[right - 1].key;
            place -= 1;
            cells[place] = if is_left { cells[left - 1] } else { aside[right - 1] };
            left -= usize::from(is_left);
            right -= usize::from(!is_left);
        }
        cells[..right].copy_from_slice(&aside[..right]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_of_a_cell_are_ored() {
        let c = |key, mask| Cell { key, mask };
        let mut cells = vec![c(3, 1), c(9, 4), c(3, 2), c(1, 8), c(9, 4)];
        sort_and_or(&mut cells).unwrap();
        assert_eq!(cells, [c(1, 8), c(3, 3), c(9, 4)]);
    }

    /// Runs of many lengths, against a map; the order of a run that is turned around is none that could pass unsorted.
    #[test]
    fn runs_of_all_lengths_come_out_as_from_a_map() {
        let mut state = 7u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        for round in 0..400 {
            let mut cells = Vec::new();
            let mut expected = std::collections::BTreeMap::new();
            for _ in 0..random(9) {
                let (count, mut key) = (random(40), random(30));
                for _ in 0..count {
                    // Every tenth round has no runs.
                    key = if round % 10 == 0 { random(50) } else { key + random(4) };
                    let mask = 1 << random(64);
                    cells.push(Cell { key, mask });
                    *expected.entry(key).or_insert(0) |= mask;
                }
            }
            sort_and_or(&mut cells).unwrap();
            let expected: Vec<Cell> = expected.into_iter().map(|(key, mask)| Cell { key, mask }).collect();
            assert_eq!(cells, expected, "round {round}");
        }
    }
}
