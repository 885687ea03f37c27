//! A part: the content of some blocks of a volume, as records sorted by label and cell.
//!
//! ```text
//! ids      3            17        98340797          rising
//! offsets  0      2               5            6    one more than ids
//! cells    (key, mask) (key, mask) | … | …          by rising key within a label, 16 bytes each
//! ```
//! Parts of disjoint blocks are merged by ORing the masks of the same label and cell. OR is associative and commutative, and the order
//! above is canonical, so the merged part has the same bytes however the volume was divided into blocks and in whatever order they came.

use crate::NoMemory;
use crate::cell::{Cell, sort_and_or};
use crate::reserve::{make_room, reserved};

/// Records of some blocks, sorted by label and cell; the module documentation draws its arrays.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SortedCells {
    pub(crate) ids: Vec<u64>,
    pub(crate) offsets: Vec<usize>,
    pub(crate) cells: Vec<Cell>,
}

/// Range of one label's records in one of several parts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    pub(crate) id: u64,
    pub(crate) part: u32,
    pub(crate) start: usize,
    pub(crate) end: usize,
}

impl SortedCells {
    /// Ids of the labels with a voxel in the part, in rising order; without background (0).
    pub fn ids(&self) -> &[u64] {
        &self.ids
    }

    /// Records of the label at index `i` of [`SortedCells::ids`], by rising key.
    pub fn cells_of(&self, i: usize) -> &[Cell] {
        &self.cells[self.offsets[i]..self.offsets[i + 1]]
    }

    /// Number of records of all labels.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Number of voxels of all labels together.
    pub fn voxels(&self) -> u64 {
        self.cells.iter().map(|c| u64::from(c.mask.count_ones())).sum()
    }

    /// Whether no label has a voxel.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Bytes held on the heap.
    pub fn bytes(&self) -> u64 {
        (self.ids.capacity() * 8 + self.offsets.capacity() * size_of::<usize>()) as u64
            + (self.cells.capacity() * size_of::<Cell>()) as u64
    }

    /// Merges parts into one. The operation is associative and commutative.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn merge(parts: &[SortedCells]) -> Result<SortedCells, NoMemory> {
        const WHAT: &str = "a part of the volume, merged from several";
        let runs = runs_by_id(parts.iter().map(|p| (p.ids.as_slice(), p.offsets.as_slice())))?;
        let labels = runs.chunk_by(|a, b| a.id == b.id).count();
        let mut merged = SortedCells {
            ids: reserved(labels, WHAT)?,
            offsets: reserved(labels + 1, WHAT)?,
            cells: reserved(parts.iter().map(SortedCells::len).sum(), WHAT)?,
        };
        merged.offsets.push(0);
        let mut cells = Vec::new();
        for same_id in runs.chunk_by(|a, b| a.id == b.id) {
            cells.clear();
            make_room(&mut cells, same_id.iter().map(|run| run.end - run.start).sum(), WHAT)?;
            for run in same_id {
                cells.extend_from_slice(&parts[run.part as usize].cells[run.start..run.end]);
            }
            sort_and_or(&mut cells)?;
            merged.ids.push(same_id[0].id);
            merged.cells.extend_from_slice(&cells);
            merged.offsets.push(merged.cells.len());
        }
        // Records of the same cell were merged, so there may be unused capacity; release it where it is large.
        if merged.cells.capacity() > merged.cells.len() + merged.cells.len() / 8 {
            merged.cells.shrink_to_fit();
        }
        Ok(merged)
    }

    /// Whether no two labels claim the same voxel, which holds for every part made from a volume. This sorts all records.
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

/// The runs of all labels in all parts, sorted by id, then part; each part is given by its ids and offsets.
///
/// # Errors
/// [`NoMemory`].
pub(crate) fn runs_by_id<'a>(
    parts: impl Iterator<Item = (&'a [u64], &'a [usize])>,
) -> Result<Vec<Run>, NoMemory> {
    let mut runs: Vec<Run> = Vec::new();
    for (p, (ids, offsets)) in parts.enumerate() {
        make_room(&mut runs, ids.len(), "a list of the labels of the parts of a volume")?;
        runs.extend(ids.iter().zip(offsets.windows(2)).map(|(&id, bounds)| Run {
            id,
            part: p as u32,
            start: bounds[0],
            end: bounds[1],
        }));
    }
    runs.sort_unstable_by_key(|r| (r.id, r.part));
    Ok(runs)
}
