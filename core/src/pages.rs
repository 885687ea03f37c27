//! A volume whose boxes are not in memory: they are in a temporary file, in pages that are read alone.
//!
//! ```text
//! page      a cube of 64³, 128³ or 256³ voxels, with all boxes that reach into it and their nodes
//! volume    size, labels and leaves, in memory; its boxes come from the pages
//! ```
//! A box that reaches into several pages is in each of them; the page of its lowest voxel is its own. The file has no name, so that no other
//! program can change it and nothing remains however the process ends. Reading a page compares a checksum.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;
use rustc_hash::FxHashMap;
use xxhash_rust::xxh3::xxh3_64;

use crate::node::solid_node;
use crate::reserve::{reserved, zeroed};
use crate::residency::Residency;
use crate::spool::Scratch;
use crate::stored::{put, take};
use crate::{
    BoxPlace, BoxRecord, BoxView, CHUNK_VOXELS, Chunk, CompressedVolume, Error, Job, LabelRun, Leaves,
    NodeRef, Result, VolumeInfo,
};

/// What memory is for, in errors.
const WHAT: &str = "a page of the volume";

/// Bytes with a checksum in a temporary file.
#[derive(Clone, Copy, Debug)]
pub struct StoredBytes {
    at: u64,
    length: u64,
    checksum: u64,
}

impl StoredBytes {
    /// Appends bytes to a temporary file.
    ///
    /// # Errors
    /// [`Error::Io`] with the folder of the file, as where the disk is full.
    pub fn append(to: &Scratch, bytes: &[u8]) -> Result<Self> {
        Ok(Self { at: to.append(bytes)?, length: bytes.len() as u64, checksum: xxh3_64(bytes) })
    }

    /// Reads them back.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Memory`].
    pub fn read(&self, from: &Scratch) -> Result<Vec<u8>> {
        let mut bytes = zeroed(self.length as usize, WHAT)?;
        from.read(&mut bytes, self.at)?;
        if xxh3_64(&bytes) == self.checksum { Ok(bytes) } else { Err(damaged(from)) }
    }

    /// Number of bytes.
    pub fn bytes(&self) -> u64 {
        self.length
    }
}

fn damaged(file: &Scratch) -> Error {
    file.error(std::io::Error::other("a temporary file has changed while it was in use"))
}

/// How much of its node a box keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeDetail {
    /// Everything.
    Voxels,
    /// Which cells have a voxel.
    Cells,
    /// That it has one.
    Nothing,
}

/// Where a page is.
#[derive(Debug)]
struct Page {
    /// Its place: x + along_x·(y + along_y·z), in pages.
    number: u64,
    chunk: u32,
    stored: StoredBytes,
    /// Labels of its boxes, each once, rising.
    labels: Box<[u32]>,
}

/// The pages of a volume (see the module).
pub struct Pages {
    side: u32,
    along: [u64; 3],
    /// Without names of labels.
    info: VolumeInfo,
    /// By rising number.
    pages: Vec<Page>,
    /// Lowest voxel and leaves of each chunk.
    chunks: Vec<([u32; 3], Leaves)>,
    scratch: Scratch,
    memory: Arc<Residency>,
    boxes: u64,
    /// The first error that a caller without a result of its own met.
    failure: Mutex<Option<String>>,
}

impl std::fmt::Debug for Pages {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Pages")
            .field("side", &self.side)
            .field("pages", &self.pages.len())
            .finish_non_exhaustive()
    }
}

impl Pages {
    /// No page yet, of a volume of this size, in pages of `side` voxels, with a temporary file in `folder`.
    pub(crate) fn new(info: &VolumeInfo, side: u32, folder: &Path, memory: Arc<Residency>) -> Self {
        let info = without_notes(info);
        Self {
            side,
            along: info.dims.map(|d| u64::from(d.div_ceil(side))),
            info,
            pages: Vec::new(),
            chunks: Vec::new(),
            scratch: Scratch::new(folder),
            memory,
            boxes: 0,
            failure: Mutex::default(),
        }
    }

    /// Adds the pages of a chunk: those of a volume of this chunk alone.
    ///
    /// # Errors
    /// [`Error::Io`] where they cannot be written; [`Error::Caller`] where the chunk has pages already; [`Error::Memory`];
    /// [`Error::Cancelled`].
    pub(crate) fn add_chunk(&mut self, volume: &CompressedVolume, job: &Job) -> Result<()> {
        let [chunk] = volume.chunks.as_slice() else { return Ok(()) };
        if self.chunks.iter().any(|(origin, _)| *origin == chunk.origin) {
            return Err(Error::Caller(format!("the chunk at {:?} comes twice", chunk.origin)));
        }
        let number = self.chunks.len() as u32;
        self.chunks.push((chunk.origin, volume.leaves[0].clone()));
        self.boxes += volume.boxes.len() as u64;
        let (first, along) = (chunk.origin.map(|v| v / self.side), CHUNK_VOXELS / self.side);
        let mut items: Vec<Vec<u32>> = vec![Vec::new(); (along * along * along) as usize];
        for (item, record) in (0u32..).zip(volume.boxes.iter()) {
            let low = record.cell().map(|c| 4 * c / self.side);
            let (cell, extent) = (record.cell(), record.extent());
            let high = [0, 1, 2].map(|a| (4 * (cell[a] + extent[a]) - 1) / self.side);
            for z in low[2]..=high[2] {
                for y in low[1]..=high[1] {
                    for x in low[0]..=high[0] {
                        items[(x + along * (y + along * z)) as usize].push(item);
                    }
                }
            }
        }
        let page = |(place, items): (usize, &Vec<u32>)| -> Result<Option<Page>> {
            job.check()?;
            let place = place as u32;
            let at = [place % along, place / along % along, place / (along * along)];
            let at = [0, 1, 2].map(|a| u64::from(first[a] + at[a]));
            // A box may end beyond the volume, where there is no page.
            if items.is_empty() || (0..3).any(|a| at[a] >= self.along[a]) {
                return Ok(None);
            }
            let mut bytes = Vec::new();
            let of_page = volume.with_boxes(items)?;
            encode(&of_page, &mut bytes)?;
            let stored = StoredBytes::append(&self.scratch, &bytes)?;
            // (A chunk has the runs of its labels in their order.)
            let labels = of_page.runs.iter().map(|run| run.label).collect();
            let number_of_page = at[0] + self.along[0] * (at[1] + self.along[1] * at[2]);
            Ok(Some(Page { number: number_of_page, chunk: number, stored, labels }))
        };
        let made: Vec<Option<Page>> = items.par_iter().enumerate().map(page).collect::<Result<_>>()?;
        self.pages.extend(made.into_iter().flatten());
        self.pages.sort_unstable_by_key(|page| page.number);
        Ok(())
    }

    /// Voxels along the side of a page.
    pub fn side(&self) -> u32 {
        self.side
    }

    /// Number of pages along each axis, empty ones included.
    pub fn along(&self) -> [u64; 3] {
        self.along
    }

    /// Number of pages that have a box.
    pub fn len(&self) -> usize {
        self.pages.len()
    }

    /// Whether no page has a box.
    pub fn is_empty(&self) -> bool {
        self.pages.is_empty()
    }

    /// Boxes of the volume, each counted once.
    pub fn boxes(&self) -> u64 {
        self.boxes
    }

    /// The memory that pages share.
    pub fn memory(&self) -> &Arc<Residency> {
        &self.memory
    }

    /// A temporary file beside this one.
    pub fn another_file(&self) -> Scratch {
        self.scratch.another()
    }

    /// Number of the page at `index` of those that have a box: x + along·(y + along·z).
    ///
    /// # Panics
    /// When `index` is out of range.
    pub fn number(&self, index: usize) -> u64 {
        self.pages[index].number
    }

    /// Labels of the boxes of the page at `index`, each once: what of the labels that are drawn changes it.
    ///
    /// # Panics
    /// When `index` is out of range.
    pub fn labels(&self, index: usize) -> &[u32] {
        &self.pages[index].labels
    }

    /// Number of the chunk that the page at `index` lies in.
    ///
    /// # Panics
    /// When `index` is out of range.
    pub fn chunk(&self, index: usize) -> usize {
        self.pages[index].chunk as usize
    }

    /// Lowest voxel and leaves of each chunk.
    pub fn chunks(&self) -> &[([u32; 3], Leaves)] {
        &self.chunks
    }

    /// Lowest voxel of a page.
    pub fn origin(&self, number: u64) -> [u32; 3] {
        let [x, y, _] = self.along;
        [number % x, number / x % y, number / (x * y)].map(|at| at as u32 * self.side)
    }

    /// Reads the page at `index`: a volume of its boxes, in places of the whole volume, without a label table.
    ///
    /// # Errors
    /// [`Error::Io`], as where the file was damaged; [`Error::Memory`].
    ///
    /// # Panics
    /// When `index` is out of range.
    pub fn read(&self, index: usize) -> Result<CompressedVolume> {
        let bytes = self.pages[index].stored.read(&self.scratch)?;
        self.decode(index, &mut bytes.as_slice()).ok_or_else(|| damaged(&self.scratch))
    }

    /// The page at `index` from the front of `bytes`, which [`encode`] made of it or of some of its boxes.
    pub fn decode(&self, index: usize, bytes: &mut &[u8]) -> Option<CompressedVolume> {
        let (origin, leaves) = &self.chunks[self.pages[index].chunk as usize];
        let mut volume = CompressedVolume::empty(self.info.clone());
        volume.chunks = vec![Chunk { origin: *origin, first_box: 0, first_run: 0, node_base: 0 }];
        volume.runs = take(bytes)?;
        volume.boxes = take::<BoxRecord>(bytes)?.into();
        volume.nodes = take::<u16>(bytes)?.into();
        volume.leaves = vec![leaves.clone()];
        Some(volume)
    }

    /// Calls `visit` with every box and its label, in the order of pages. Where a page cannot be read, its boxes are left out, and
    /// [`Pages::failure`] says why.
    pub(crate) fn for_each_box(&self, mut visit: impl FnMut(u32, BoxView<'_>)) {
        for index in 0..self.len() {
            let origin = self.origin(self.number(index));
            match self.read(index) {
                Ok(page) => page.for_each_box_in_memory(|label, b| {
                    if (0..3).all(|a| b.origin[a] / self.side == origin[a] / self.side) {
                        visit(label, b);
                    }
                }),
                Err(error) => self.fail(&error),
            }
        }
    }

    /// Remembers the first failure.
    pub fn fail(&self, error: &Error) {
        let mut failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.get_or_insert_with(|| error.to_string());
    }

    /// The first failure of reading a page, in one line.
    pub fn failure(&self) -> Option<String> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Bytes in memory: the table of pages, and the leaves, which no page has a copy of.
    pub fn bytes(&self) -> u64 {
        let leaves: u64 = self.chunks.iter().map(|(_, leaves)| leaves.bytes()).sum();
        self.table_bytes() + leaves
    }

    /// The part of [`Pages::bytes`] that the table of pages takes.
    pub fn table_bytes(&self) -> u64 {
        let labels: usize = self.pages.iter().map(|page| size_of_val(&*page.labels)).sum();
        (self.pages.capacity() * size_of::<Page>() + labels) as u64
    }
}

/// Size, type and place of a volume, without the names of its labels, of which there may be many.
fn without_notes(info: &VolumeInfo) -> VolumeInfo {
    let mut slim = VolumeInfo::new(info.dims, info.label_type);
    (slim.world_from_index, slim.unit, slim.frame) = (info.world_from_index, info.unit, info.frame);
    slim
}

/// Appends the boxes of a page, which [`Pages::decode`] takes back.
///
/// # Errors
/// [`Error::Memory`].
pub fn encode(page: &CompressedVolume, bytes: &mut Vec<u8>) -> Result<()> {
    put(bytes, &page.runs)?;
    put::<BoxRecord>(bytes, &page.boxes)?;
    put::<u16>(bytes, &page.nodes)?;
    Ok(())
}

impl CompressedVolume {
    /// The pages of a volume whose boxes are not in memory ([`CompressedVolume::open_paged`]); `None` of any other. Such a volume has no
    /// box that could be asked for by its number.
    pub fn pages(&self) -> Option<&Arc<Pages>> {
        self.pages.as_ref()
    }

    /// Refuses a volume whose boxes are not in memory; `what` needs them there.
    ///
    /// # Errors
    /// [`Error::Caller`].
    pub fn require_boxes(&self, what: &str) -> Result<()> {
        match self.pages {
            None => Ok(()),
            Some(_) => Err(Error::Caller(format!(
                "memory limit: {what} needs the whole volume in memory: leave the limit out"
            ))),
        }
    }

    /// Whether every page so far could be read, which a caller of [`CompressedVolume::for_each_box`] asks afterwards: it leaves out boxes that
    /// it cannot read.
    ///
    /// # Errors
    /// [`Error::Source`] with the reason.
    pub fn check_pages(&self) -> Result<()> {
        let failure = self.pages.as_ref().and_then(|pages| pages.failure());
        failure.map_or(Ok(()), |why| Err(Error::Source(why.into())))
    }

    /// The same volume with these boxes alone, given by rising numbers, without a label table. The volume must have one chunk.
    ///
    /// # Errors
    /// [`Error::Memory`].
    ///
    /// # Panics
    /// When a number is out of range.
    pub fn with_boxes(&self, items: &[u32]) -> Result<Self> {
        self.with_coarser_boxes(items, |_| NodeDetail::Voxels)
    }

    /// [`CompressedVolume::with_boxes`] of which each keeps only so much of its node. What is left out is solid.
    ///
    /// # Errors
    /// As [`CompressedVolume::with_boxes`].
    ///
    /// # Panics
    /// As [`CompressedVolume::with_boxes`].
    pub fn with_coarser_boxes(
        &self,
        items: &[u32],
        detail: impl Fn(&BoxPlace) -> NodeDetail,
    ) -> Result<Self> {
        let mut part = Self::empty(without_notes(&self.info));
        let [chunk] = self.chunks.as_slice() else { return Ok(part) };
        let mut runs: Vec<LabelRun> = Vec::new();
        let mut boxes: Vec<BoxRecord> = reserved(items.len(), WHAT)?;
        let mut nodes: Vec<u16> = Vec::new();
        // Places of nodes by their number here, and of those without voxels by their cells.
        let (mut placed, mut coarse) = (FxHashMap::<u32, u32>::default(), FxHashMap::<u64, u32>::default());
        let mut run = 0;
        for (place, &item) in (0u32..).zip(items) {
            while self.runs.get(run + 1).is_some_and(|next| next.first_box <= item) {
                run += 1;
            }
            let label = self.runs[run].label;
            if runs.last().is_none_or(|last| last.label != label) {
                runs.push(LabelRun { label, first_box: place });
            }
            let record = self.boxes[item as usize];
            let (next, from) = (nodes.len() as u32, chunk.node_base as usize + record.node() as usize);
            let of_box = || NodeRef::read(&self.nodes, from, &self.leaves[0]);
            let cells = match detail(&self.place_of_box(item as usize)) {
                NodeDetail::Voxels => None,
                NodeDetail::Cells => Some(of_box().occupied),
                NodeDetail::Nothing => Some(1),
            };
            let node = match cells {
                None => *placed.entry(record.node()).or_insert_with(|| {
                    nodes.extend_from_slice(&self.nodes[from..from + of_box().words()]);
                    next
                }),
                Some(cells) => *coarse.entry(cells).or_insert_with(|| {
                    solid_node(cells, &mut nodes);
                    next
                }),
            };
            boxes.push(BoxRecord::new(record.cell(), record.extent(), node));
        }
        nodes.shrink_to_fit();
        runs.shrink_to_fit();
        part.chunks = vec![Chunk { origin: chunk.origin, first_box: 0, first_run: 0, node_base: 0 }];
        (part.runs, part.boxes, part.nodes) = (runs, boxes.into(), nodes.into());
        part.leaves = vec![self.leaves[0].clone()];
        Ok(part)
    }
}
