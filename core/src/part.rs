//! A part: what some blocks of a volume hold, as records sorted by label and place.
//!
//! ```text
//! ids      3            17        98340797          rising
//! offsets  0      2               5            6    one more than ids
//! cells    (key, mask) (key, mask) | … | …          by rising key within a label, 16 bytes each
//! ```
//! Parts of disjoint blocks merge by OR-ing the masks of the same label and cell. That is associative and commutative, and the
//! order above is canonical, so the merged part has the same bytes whatever the blocks were and in whatever order they came.

use crate::cell::{Cell, sort_and_or};

/// See the module.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Part {
    pub(crate) ids: Vec<u64>,
    pub(crate) offsets: Vec<usize>,
    pub(crate) cells: Vec<Cell>,
}

/// One label's records in one of several parts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    pub(crate) id: u64,
    pub(crate) part: u32,
    pub(crate) start: usize,
    pub(crate) end: usize,
}

impl Part {
    /// Labels with a voxel in the part, rising; background (0) is not among them.
    pub fn ids(&self) -> &[u64] {
        &self.ids
    }

    /// Records of label number `i` of [`Part::ids`], by rising key.
    pub fn cells_of(&self, i: usize) -> &[Cell] {
        &self.cells[self.offsets[i]..self.offsets[i + 1]]
    }

    /// Records of all labels.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Voxels of all labels together.
    pub fn voxels(&self) -> u64 {
        self.cells.iter().map(|c| u64::from(c.mask.count_ones())).sum()
    }

    /// Whether no label has a voxel.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Heap bytes held.
    pub fn bytes(&self) -> u64 {
        (self.ids.capacity() * 8 + self.offsets.capacity() * size_of::<usize>()) as u64
            + (self.cells.capacity() * size_of::<Cell>()) as u64
    }

    /// Merges parts into one: associative and commutative.
    pub fn merge(parts: &[Part]) -> Part {
        let runs = runs_by_id(parts.iter().map(|p| (p.ids.as_slice(), p.offsets.as_slice())));
        let mut merged =
            Part { cells: Vec::with_capacity(parts.iter().map(Part::len).sum()), ..Part::default() };
        merged.offsets.push(0);
        let mut cells = Vec::new();
        for same_id in runs.chunk_by(|a, b| a.id == b.id) {
            cells.clear();
            for run in same_id {
                cells.extend_from_slice(&parts[run.part as usize].cells[run.start..run.end]);
            }
            sort_and_or(&mut cells);
            merged.ids.push(same_id[0].id);
            merged.cells.extend_from_slice(&cells);
            merged.offsets.push(merged.cells.len());
        }
        // Pieces that were OR-ed left room; give a large waste back.
        if merged.cells.capacity() > merged.cells.len() + merged.cells.len() / 8 {
            merged.cells.shrink_to_fit();
        }
        merged
    }

    /// Whether no two labels claim one voxel: true of any part made from a volume. Costs a sort of all records.
    pub fn is_disjoint(&self) -> bool {
        let mut all = self.cells.clone();
        all.sort_unstable();
        all.chunk_by(|a, b| a.key == b.key).all(|cell| {
            let mut seen = 0;
            cell.iter().all(|c| {
                let fresh = seen & c.mask == 0;
                seen |= c.mask;
                fresh
            })
        })
    }
}

/// Each label's run of each part, by rising id, then part; of each part its ids and offsets are given.
pub(crate) fn runs_by_id<'a>(parts: impl Iterator<Item = (&'a [u64], &'a [usize])>) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (p, (ids, offsets)) in parts.enumerate() {
        runs.extend(ids.iter().zip(offsets.windows(2)).map(|(&id, bounds)| Run {
            id,
            part: p as u32,
            start: bounds[0],
            end: bounds[1],
        }));
    }
    runs.sort_by_key(|r| (r.id, r.part));
    runs
}
