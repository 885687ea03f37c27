//! Turns parts into the compressed volume, chunk after chunk.
//!
//! ```text
//! for each chunk, in Morton order (all threads work on one chunk):
//!     for each frame of a time series (other volumes have one):
//!         boxes      of each label, with their contents, in their final order          chunk_boxes
//!         touching   labels within the chunk, and across the faces to earlier chunks   touching
//!     share      boxes with equal contents refer to one node                       sharing
//!     leaves     the most frequent fields and slices of the distinct nodes         counted_fields, leaves
//!     nodes      in the order of first use, and box records                        chunk_nodes
//!     sink       takes them: a volume in memory, or a file
//! ```
//! What a step leaves to the next is in memory as far as its share of the limit allows, and otherwise in a scratch file. The result of each
//! step depends on the volume alone, so it is independent of threads, blocks and their order, and of the limit.

use std::collections::BTreeMap;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::{Path, PathBuf};

use crate::chunk_boxes::{ChunkBoxes, boxes_of_chunk};
use crate::content_hash;
use crate::freed_memory::give_back;
use crate::layers::Layers;
use crate::memory::available_bytes;
use crate::reserve::{collected, reserved, zeroed};
use crate::spool::Scratch;
use crate::store::StoredParts;
use crate::touching::Touching;
use crate::{Error, Job, LabelTable, Result};

/// Bytes that finishing works with at least: with less, it would write to disk byte by byte. A program takes more for itself.
const LEAST_BYTES: u64 = 1 << 20;

/// Bytes to work with where no limit is given: what so many frames of a densely packed volume of `dims` voxels need, but at most half of what
/// is free.
pub(crate) fn bytes_without_limit(dims: [u32; 3], frames: u32) -> u64 {
    let voxels = dims.iter().fold(frames.into(), |product: u64, &d| product.saturating_mul(d.into()));
    let needed = (32 << 20_u64) + voxels.saturating_add(voxels / 4);
    available_bytes().map_or(needed, |free| needed.min(free / 2))
}

/// What finishing may take of memory.
pub(crate) struct Budget {
    /// The limit that was given, if one was.
    pub(crate) limit_bytes: Option<u64>,
    /// Bytes to work with: the limit, or [`bytes_without_limit`].
    bytes: u64,
    /// Folder for scratch files.
    pub(crate) folder: PathBuf,
    /// Seed of the hashes by which equal contents are found. It differs from run to run, so that nobody can make contents with equal hashes.
    pub(crate) seed: u64,
}

impl Budget {
    /// The budget for so many frames of a volume of `dims` voxels.
    pub(crate) fn new(limit_bytes: Option<u64>, dims: [u32; 3], frames: u32, folder: &Path) -> Self {
        let bytes =
            limit_bytes.map_or_else(|| bytes_without_limit(dims, frames), |limit| limit.max(LEAST_BYTES));
        let seed = RandomState::new().build_hasher().finish();
        Self { limit_bytes, bytes, folder: folder.to_owned(), seed }
    }

    /// A share of the bytes to work with: one of so many equal ones.
    pub(crate) fn share(&self, of: u64) -> u64 {
        self.bytes / of
    }
}

/// Takes finished chunks, in Morton order.
pub(crate) trait ChunkSink {
    /// Takes the cells of a chunk at a frame, which come before the boxes of the chunk, frame after frame.
    fn layers(&mut self, boxes: &ChunkBoxes<'_>, layers: &Layers<'_>, job: &Job) -> Result<()>;

    /// Takes the boxes of a chunk at all frames at which it has any. They share nodes and leaves.
    fn chunk(&mut self, frames: &[ChunkBoxes<'_>], budget: &Budget, job: &Job) -> Result<()>;
}

/// What is known of a volume once all of its chunks are finished.
pub(crate) struct Finished {
    /// Ids, numbers of voxels, and contacts.
    pub(crate) labels: LabelTable,
    /// Of each frame.
    pub(crate) content_hashes: Vec<u128>,
}

/// What a caller knows of the parts.
pub(crate) struct Known {
    /// Number of labelled voxels that the parts were made from, which is compared with what they have.
    pub(crate) labelled: Option<u64>,
    /// Pairs of dense labels that touch within a chunk, where they are known.
    pub(crate) touching: Option<Vec<u64>>,
    /// The share of the time that is left of the job: less than 1 where more is finished after these parts.
    pub(crate) share: f64,
}

impl Known {
    /// What is known of parts that were made from a source's blocks.
    pub(crate) fn delivered(parts: &StoredParts) -> Self {
        Self { labelled: Some(parts.delivered()), touching: None, share: 1.0 }
    }
}

/// Finishes all chunks of a volume of `dims` voxels, at all frames.
///
/// # Errors
/// [`Error::Caller`] where blocks of the source overlap; [`Error::Limit`]; [`Error::Memory`]; [`Error::Io`]; [`Error::Cancelled`]; those of
/// the sink.
pub(crate) fn finish(
    dims: [u32; 3],
    mut parts: StoredParts,
    known: &Known,
    budget: &Budget,
    sink: &mut dyn ChunkSink,
    job: &Job,
) -> Result<Finished> {
    let ids = std::mem::take(&mut parts.ids);
    if u32::try_from(ids.len()).is_err() {
        return Err(Error::Limit { what: "labels".into(), limit: u32::MAX.into(), got: ids.len() as u64 });
    }
    let mut voxels: Vec<u64> = zeroed(ids.len(), "the table of labels")?;
    // Frames without a box have no hash of their own here: there may be many.
    let begun = content_hash::begun(dims, &ids);
    let mut contents = BTreeMap::new();
    let faces = Scratch::new(&budget.folder);
    let within = known.touching.is_none();
    let known_pairs = known.touching.as_deref().unwrap_or_default();
    let mut touching = Touching::new(dims, &faces, budget, known_pairs)?;
    job.begin_share(parts.records(), known.share);
    while let Some((_, frames)) = parts.next_chunk() {
        let scratch = Scratch::new(&budget.folder);
        let mut of_chunk: Vec<ChunkBoxes<'_>> = reserved(frames as usize, "the frames of a chunk")?;
        for _ in 0..frames {
            job.check()?;
            let of_frame = Scratch::new(&budget.folder);
            let Some((code, frame, records)) = parts.take_chunk(budget.share(16)) else { break };
            let content = contents.entry(frame).or_insert_with(|| begun.clone());
            let (place, scratch) = ((code, frame), (&scratch, &of_frame));
            let (boxes, layers) =
                boxes_of_chunk(place, records, &ids, (content, &mut voxels), scratch, frames, budget, job)?;
            touching.chunk(frame, boxes.cell.map(|c| 4 * c), &layers, within, job)?;
            sink.layers(&boxes, &layers, job)?;
            of_chunk.push(boxes);
        }
        sink.chunk(&of_chunk, budget, job)?;
        if budget.limit_bytes.is_some() {
            // What a chunk took may lie in pieces between what stays, where the next one finds no room.
            drop(of_chunk);
            give_back();
        }
    }
    // If blocks overlap in one label, the OR has fewer voxels than they delivered. (Overlap of two labels shows where cells are compared.)
    let kept: u64 = voxels.iter().sum();
    if let Some(labelled) = known.labelled.filter(|&labelled| labelled != kept) {
        return Err(Error::Caller(format!(
            "blocks of the source overlap: they delivered {labelled} labelled voxels and cover only {kept}; each voxel must come once"
        )));
    }
    let contacts = touching.into_contacts(ids.len() as u32)?;
    let labels = LabelTable { ids, voxels, contacts, ..LabelTable::default() };
    let hash = |frame| contents.get(&frame).unwrap_or(&begun).digest128();
    let content_hashes = collected(parts.frames as usize, (0..parts.frames).map(hash), "the frames")?;
    Ok(Finished { labels, content_hashes })
}
