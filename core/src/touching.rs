//! Finds which labels touch while a volume is compressed: within a chunk from layer to layer, and across the faces between chunks.
//!
//! ```text
//! chunk's layers ─► pairs within cells, and across the faces of cells
//!                └► cells at the chunk's faces ─► lower faces: compared with the upper ones of the chunks before
//!                                              └► upper faces: kept for the chunks after it (Morton order: a neighbour along an axis is later)
//! ```
//! What is kept of faces goes to a scratch file, and so do pairs beyond a limit.

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::contacts::{PAIRS, Pairs};
use crate::find_contacts::{LOW_FACE, STEP, pairs_across, pairs_within};
use crate::finish::Budget;
use crate::layers::{Layer, Layers, SIDE};
use crate::pair_set::PairSet;
use crate::reserve::make_room;
use crate::spool::{Scratch, Spool};
use crate::{CHUNK_VOXELS, Contacts, Error, Job, Result};

/// Layers of a task.
const TASK_LAYERS: usize = 8;

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
type Faces = [[Vec<FaceCell>; 3]; 2];

/// The pairs found so far, and the upper faces of chunks whose upper neighbours are still to come.
pub(crate) struct Touching<'a> {
    pairs: PairSet<'a>,
    /// By frame, axis and lowest voxel of the chunk that lies behind the face.
    faces: FxHashMap<(u32, usize, [u32; 3]), Spool<'a>>,
    scratch: &'a Scratch,
    /// Bytes of a face that stay in memory.
    face_bytes: u64,
    dims: [u32; 3],
}

impl<'a> Touching<'a> {
    /// None yet, in a volume of `dims` voxels; `known` are pairs within chunks that were found already.
    pub(crate) fn new(dims: [u32; 3], scratch: &'a Scratch, budget: &Budget, known: &[u64]) -> Result<Self> {
        let pairs = PairSet::new(scratch, budget.share(8));
        let mut all =
            Self { pairs, faces: FxHashMap::default(), scratch, face_bytes: budget.share(4096), dims };
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
        let found: Vec<Result<(Vec<u64>, Faces)>> = tasks
            .into_par_iter()
            .map(|first| {
                job.check()?;
                in_layers(first, origin, layers, within, wanted)
            })
            .collect();
        let mut faces = Faces::default();
        for task in found {
            let (pairs, of_task) = task?;
            self.add(&pairs)?;
            for (all, more) in faces.iter_mut().flatten().zip(of_task.into_iter().flatten()) {
                make_room(all, more.len(), PAIRS)?;
                all.extend(more);
            }
        }
        let [lower, upper] = faces;
        for (axis, cells) in lower.into_iter().enumerate() {
            if let Some(other) = self.faces.remove(&(frame, axis, origin)) {
                let mut before = Vec::new();
                other.reader().values((other.len() / size_of::<FaceCell>() as u64) as usize, &mut before)?;
                let pairs = across(&before, &cells, axis)?;
                self.add(&pairs)?;
            }
        }
        for (axis, cells) in upper.into_iter().enumerate().filter(|(_, cells)| !cells.is_empty()) {
            let mut behind = origin;
            behind[axis] += CHUNK_VOXELS;
            let mut face = Spool::new(self.scratch, self.face_bytes);
            face.write(bytemuck::cast_slice(&cells))?;
            self.faces.insert((frame, axis, behind), face);
        }
        Ok(())
    }

    /// All pairs, packed, of a volume with so many labels.
    pub(crate) fn into_contacts(self, labels: u32) -> Result<Contacts> {
        self.pairs.into_contacts(labels)
    }
}

/// The pairs of some layers from `first` on, and the cells at the chunk's faces.
fn in_layers(
    first: usize,
    origin: [u32; 3],
    layers: &Layers<'_>,
    within: bool,
    wanted: [[bool; 3]; 2],
) -> Result<(Vec<u64>, Faces)> {
    let mut pairs = Pairs::new();
    let mut faces = Faces::default();
    let mut here = layers.load(first)?;
    for z in first..(first + TASK_LAYERS).min(SIDE) {
        let next = if within || z + 1 < first + TASK_LAYERS { layers.load(z + 1)? } else { Layer::default() };
        for position in 0..if here.is_empty() { 0 } else { SIDE * SIDE } {
            let cells = here.at(position);
            if cells.is_empty() {
                continue;
            }
            let (x, y) = (position % SIDE, position / SIDE);
            if within {
                let corner = [x, y, z].map(|c| 4 * c as u32);
                pairs_within(cells, [0, 1, 2].map(|a| origin[a] + corner[a]), &mut pairs);
                if x + 1 < SIDE {
                    pairs_across(cells, here.at(position + 1), 0, &mut pairs);
                }
                if y + 1 < SIDE {
                    pairs_across(cells, here.at(position + SIDE), 1, &mut pairs);
                }
                pairs_across(cells, next.at(position), 2, &mut pairs);
            }
            for (axis, (c, index)) in
                [(x, y + SIDE * z), (y, x + SIDE * z), (z, position)].into_iter().enumerate()
            {
                for (side, at) in [(0, 0), (1, SIDE - 1)] {
                    if c == at && wanted[side][axis] {
                        let face = &mut faces[side][axis];
                        make_room(face, cells.len(), PAIRS)?;
                        let of_face = |mask: u64| match side {
                            0 => mask & LOW_FACE[axis],
                            _ => mask >> (3 * STEP[axis]) & LOW_FACE[axis],
                        };
                        let cells = cells.iter().filter(|&&(_, mask)| of_face(mask) != 0);
                        face.extend(cells.map(|&(label, mask)| FaceCell {
                            index: index as u32,
                            label,
                            mask,
                        }));
                    }
                }
            }
        }
        here = next;
    }
    match pairs.claimed_twice {
        None => Ok((pairs.into_vec()?, faces)),
        Some(cell) => Err(Error::Caller(format!(
            "two labels claim one voxel of the cell at {cell:?}: blocks of the source overlap, each voxel must come once"
        ))),
    }
}

/// The pairs across a face between two chunks; both lists come by rising index.
fn across(low: &[FaceCell], high: &[FaceCell], axis: usize) -> Result<Vec<u64>> {
    let mut pairs = Pairs::new();
    let plain = |cells: &[FaceCell]| cells.iter().map(|c| (c.label, c.mask)).collect::<Vec<_>>();
    let mut rest = high;
    for here in low.chunk_by(|a, b| a.index == b.index) {
        let index = here[0].index;
        rest = &rest[rest.partition_point(|c| c.index < index)..];
        let there = &rest[..rest.partition_point(|c| c.index == index)];
        if !there.is_empty() {
            pairs_across(&plain(here), &plain(there), axis, &mut pairs);
        }
    }
    Ok(pairs.into_vec()?)
}
