//! Finds which labels touch while a volume is compressed: within a chunk from layer to layer, and across the faces between chunks.
//!
//! ```text
//! chunk's layers ─► pairs within cells, and across the faces of cells
//!                └► cells at the chunk's faces ─► lower faces: compared with the upper ones of the chunks before
//!                                              └► upper faces: kept for the chunks after it (Morton order: a neighbour along an axis is later)
//! ```
//! What is kept of faces goes to a scratch file, and so do pairs beyond a limit. While it works, a task holds two layers, or two strips of
//! large ones, and so many pairs that all tasks together keep to a share of the limit: then it passes them on.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::contacts::Pairs;
use crate::find_contacts::{LOW_FACE, STEP, pairs_across, pairs_within};
use crate::finish::Budget;
use crate::layers::{Layer, Layers, SIDE};
use crate::pair_set::{BYTES_A_PAIR, PairSet};
use crate::spool::{Scratch, Spool, SpoolReader};
use crate::{CHUNK_VOXELS, Contacts, Error, Job, Result};

/// Layers of a task.
const TASK_LAYERS: usize = 8;

/// Least number of pairs that a task keeps: passing them on costs a lock.
const LEAST_PAIRS: usize = 1 << 12;

/// What a label has of a cell at a face.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct FaceCell {
    /// Number of the cell in the face, by rising rank of the slower axis.
    index: u32,
    label: u32,
    mask: u64,
}

/// Cells at a chunk's faces along x, y and z: the lower ones, then the upper ones.
type Faces<'a> = [[Spool<'a>; 3]; 2];

/// The pairs found so far, and the upper faces of chunks whose upper neighbours are still to come.
pub(crate) struct Touching<'a> {
    pairs: PairSet<'a>,
    /// By frame, axis and lowest voxel of the chunk that lies behind the face.
    faces: FxHashMap<(u32, usize, [u32; 3]), Spool<'a>>,
    scratch: &'a Scratch,
    /// Bytes of a face that stay in memory.
    face_bytes: u64,
    /// Pairs that a task keeps.
    most_pairs: usize,
    dims: [u32; 3],
}

impl<'a> Touching<'a> {
    /// None yet, in a volume of `dims` voxels; `known` are pairs within chunks that were found already.
    pub(crate) fn new(dims: [u32; 3], scratch: &'a Scratch, budget: &Budget, known: &[u64]) -> Result<Self> {
        let pairs = PairSet::new(scratch, budget.share(8));
        let of_task = budget.share(16) / (BYTES_A_PAIR * rayon::current_num_threads() as u64);
        let most_pairs = usize::try_from(of_task).unwrap_or(usize::MAX).max(LEAST_PAIRS);
        let face_bytes = budget.share(4096);
        let mut all = Self { pairs, faces: FxHashMap::default(), scratch, face_bytes, most_pairs, dims };
        all.add(known)?;
        Ok(all)
    }

    /// Adds pairs that were found already.
    pub(crate) fn add(&mut self, pairs: &[u64]) -> Result<()> {
        self.pairs.add(pairs)
    }

    /// Takes up the chunk at `origin` at a frame. Where `within` is false, the pairs within the chunk are known. Labels touch where they do
    /// so at some frame.
    ///
    /// # Errors
    /// [`Error::Caller`] where two labels claim one voxel.
    pub(crate) fn chunk(
        &mut self,
        frame: u32,
        origin: [u32; 3],
        layers: &Layers<'_>,
        within: bool,
        job: &Job,
    ) -> Result<()> {
        // Faces that another chunk may lie behind.
        let wanted = [origin.map(|o| o > 0), [0, 1, 2].map(|a| origin[a] + CHUNK_VOXELS < self.dims[a])];
        let tasks: Vec<usize> = (0..SIDE).step_by(TASK_LAYERS).collect();
        let Self { pairs, scratch, face_bytes, most_pairs, .. } = self;
        // A failed addition ends the work, so a set that another thread left half done is not used.
        let all_pairs = Mutex::new(pairs);
        let pass_on = |pairs: Vec<u64>| all_pairs.lock().unwrap_or_else(PoisonError::into_inner).add(&pairs);
        let search = Search { origin, layers, within, wanted, most_pairs: *most_pairs, pass_on: &pass_on };
        let spool = || Spool::new(scratch, *face_bytes);
        let found: Vec<Result<Faces<'a>>> = tasks
            .into_par_iter()
            .map(|first| {
                job.check()?;
                let mut faces = [0, 1].map(|_| [0, 1, 2].map(|_| spool()));
                search.in_layers(first, &mut faces)?;
                Ok(faces)
            })
            .collect();
        let mut faces = [0, 1].map(|_| [0, 1, 2].map(|_| spool()));
        for of_task in found {
            for (all, more) in faces.iter_mut().flatten().zip(of_task?.iter().flatten()) {
                all.append(more)?;
            }
        }
        let [lower, upper] = faces;
        for (axis, cells) in lower.into_iter().enumerate() {
            if let Some(before) = self.faces.remove(&(frame, axis, origin)) {
                across(&before, &cells, axis, self.most_pairs, &mut self.pairs)?;
            }
        }
        for (axis, cells) in upper.into_iter().enumerate().filter(|(_, cells)| cells.len() > 0) {
            let mut behind = origin;
            behind[axis] += CHUNK_VOXELS;
            self.faces.insert((frame, axis, behind), cells);
        }
        Ok(())
    }

    /// All pairs, packed, of a volume with so many labels.
    pub(crate) fn into_contacts(self, labels: u32) -> Result<Contacts> {
        self.pairs.into_contacts(labels)
    }
}

/// What the tasks of a chunk have in common.
struct Search<'s, 'l> {
    origin: [u32; 3],
    layers: &'s Layers<'l>,
    within: bool,
    wanted: [[bool; 3]; 2],
    most_pairs: usize,
    pass_on: &'s (dyn Fn(Vec<u64>) -> Result<()> + Sync),
}

impl Search<'_, '_> {
    /// Passes on the pairs of some layers from `first` on; adds the cells at the chunk's faces.
    fn in_layers(&self, first: usize, faces: &mut Faces<'_>) -> Result<()> {
        let &Self { layers, within, pass_on, .. } = self;
        let mut pairs = Pairs::new();
        // The layer behind the last one, where it is loaded as a whole.
        let mut loaded: Option<Layer> = None;
        for z in first..(first + TASK_LAYERS).min(SIDE) {
            let wants_next = within || z + 1 < first + TASK_LAYERS;
            let rows = layers.rows_at_once(z)?.min(layers.rows_at_once(z + 1)?);
            for row in (0..SIDE).step_by(rows) {
                // One row more is behind these.
                let here = match loaded.take() {
                    Some(layer) if rows == SIDE => layer,
                    _ => layers.load_rows(z, row..(row + rows + 1).min(SIDE))?,
                };
                let next =
                    if wants_next { layers.load_rows(z + 1, row..row + rows)? } else { Layer::default() };
                if !here.is_empty() {
                    let some = [&here, &next];
                    (row..row + rows).try_for_each(|y| self.in_row([y, z], some, &mut pairs, faces))?;
                }
                if rows == SIDE {
                    loaded = Some(next);
                }
            }
        }
        pairs.pass_on(pass_on)
    }

    /// Finds the pairs of a row of cells, and passes on what is found where it is much.
    fn in_row(
        &self,
        [y, z]: [usize; 2],
        [here, next]: [&Layer; 2],
        pairs: &mut Pairs,
        faces: &mut Faces<'_>,
    ) -> Result<()> {
        for x in 0..SIDE {
            let position = x + SIDE * y;
            let cells = here.at(position);
            if cells.is_empty() {
                continue;
            }
            if self.within {
                let corner = [x, y, z].map(|c| 4 * c as u32);
                pairs_within(cells, [0, 1, 2].map(|a| self.origin[a] + corner[a]), pairs);
                if x + 1 < SIDE {
                    pairs_across(cells, here.at(position + 1), 0, pairs);
                }
                if y + 1 < SIDE {
                    pairs_across(cells, here.at(position + SIDE), 1, pairs);
                }
                pairs_across(cells, next.at(position), 2, pairs);
            }
            for (axis, (c, index)) in
                [(x, y + SIDE * z), (y, x + SIDE * z), (z, position)].into_iter().enumerate()
            {
                for (side, at) in [(0, 0), (1, SIDE - 1)] {
                    if c == at && self.wanted[side][axis] {
                        add_to_face(&mut faces[side][axis], cells, (side, axis), index as u32)?;
                    }
                }
            }
        }
        if let Some(cell) = pairs.claimed_twice {
            return Err(Error::Caller(format!(
                "two labels claim one voxel of the cell at {cell:?}: blocks of the source overlap, each voxel must come once"
            )));
        }
        if pairs.len() >= self.most_pairs { pairs.pass_on(self.pass_on) } else { Ok(()) }
    }
}

/// Adds what the labels of a cell have at a face.
fn add_to_face(
    face: &mut Spool<'_>,
    cells: &[(u32, u64)],
    (side, axis): (usize, usize),
    index: u32,
) -> Result<()> {
    // A cell has at most 64 labels that do not overlap.
    let mut of_face = [FaceCell { index, label: 0, mask: 0 }; 64];
    for some in cells.chunks(of_face.len()) {
        let mut count = 0;
        for &(label, mask) in some {
            let at_face = if side == 0 { mask } else { mask >> (3 * STEP[axis]) };
            if at_face & LOW_FACE[axis] != 0 {
                of_face[count] = FaceCell { index, label, mask };
                count += 1;
            }
        }
        face.write(bytemuck::cast_slice(&of_face[..count]))?;
    }
    Ok(())
}

/// Reads the cells of a face.
struct FaceReader<'f> {
    reader: SpoolReader<'f>,
    left: u64,
    next: Option<FaceCell>,
    /// The index and the labels and masks of the cell that was read last.
    index: u32,
    cell: Vec<(u32, u64)>,
}

impl<'f> FaceReader<'f> {
    fn new(face: &'f Spool<'_>) -> Result<Self> {
        let left = face.len() / size_of::<FaceCell>() as u64;
        let mut reader = Self { reader: face.reader(), left, next: None, index: 0, cell: Vec::new() };
        reader.read()?;
        Ok(reader)
    }

    fn read(&mut self) -> Result<()> {
        self.next = None;
        if self.left > 0 {
            self.left -= 1;
            self.next = Some(self.reader.value()?);
        }
        Ok(())
    }

    /// Goes on to the next cell; returns false after the last.
    fn advance(&mut self) -> Result<bool> {
        self.cell.clear();
        let Some(FaceCell { index, .. }) = self.next else { return Ok(false) };
        self.index = index;
        while let Some(of_cell) = self.next.filter(|next| next.index == index) {
            self.cell.push((of_cell.label, of_cell.mask));
            self.read()?;
        }
        Ok(true)
    }
}

/// Adds the pairs across a face between two chunks; the cells of both sides come by rising index.
fn across(
    low: &Spool<'_>,
    high: &Spool<'_>,
    axis: usize,
    most_pairs: usize,
    all: &mut PairSet<'_>,
) -> Result<()> {
    let mut pairs = Pairs::new();
    let (mut low, mut high) = (FaceReader::new(low)?, FaceReader::new(high)?);
    let (mut has_low, mut has_high) = (low.advance()?, high.advance()?);
    while has_low && has_high {
        let (here, there) = (low.index, high.index);
        if here == there {
            pairs_across(&low.cell, &high.cell, axis, &mut pairs);
        }
        if here <= there {
            has_low = low.advance()?;
        }
        if there <= here {
            has_high = high.advance()?;
        }
        if pairs.len() >= most_pairs {
            pairs.pass_on(|pairs| all.add(&pairs))?;
        }
    }
    pairs.pass_on(|pairs| all.add(&pairs))
}
