//! The compressed volume: chunks of boxes, each over a sparse voxel DAG of its own.
//!
//! ```text
//! chunk (1024³ voxels of space) ──► its boxes, sorted by (label, Morton order of the corner) ──► its nodes ──► its leaves
//!                               └─► its label runs: (label, first box), sorted by label
//! ```
//! A chunk stands alone: no box reaches beyond its faces, and its boxes refer to nodes and leaves of its own. So the bytes of a chunk depend
//! on its voxels alone, and it can be compressed, read and dropped by itself.
//!
//! A voxel belongs to at most one box. Boxes of one label never overlap; boxes of different labels may (paper §3.1).

use std::sync::{Arc, OnceLock};

use crate::grid::BoxGrid;
use crate::{BoxRecord, Elements, LabelTable, Leaves, NodeRef, Pages, VolumeInfo};

/// Side of a chunk in voxels: 256 cells, so that a box's cell fits in 8 bits an axis.
pub const CHUNK_VOXELS: u32 = 1024;

/// Cells in a chunk: a cell's Morton code divided by this is the Morton code of its chunk.
pub(crate) const CHUNK_CELLS: u64 = 1 << 24;

/// Largest extent of a volume along one axis in voxels: 21 bits of cells, so that a cell's Morton code fits in 63 bits.
pub const MAX_DIM: u32 = 1 << 23;

/// A cube of space of 1024³ voxels, with its boxes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// Lowest voxel, a multiple of [`CHUNK_VOXELS`].
    pub origin: [u32; 3],
    /// Index of its first box in [`CompressedVolume::boxes`]; its boxes end where those of the next chunk begin.
    pub first_box: u64,
    /// Index of its first run in [`CompressedVolume::runs`].
    pub first_run: u64,
    /// Its first word in [`CompressedVolume::nodes`], from which its boxes count the offsets of their nodes. Its nodes end where those of
    /// the next chunk begin.
    pub node_base: u64,
}

/// The boxes of one label in one chunk, from `first_box` up to that of the next run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct LabelRun {
    /// Dense label index.
    pub label: u32,
    /// Index of the first box, counted from the chunk's first.
    pub first_box: u32,
}

/// Position and extent of a box, without its contents.
#[derive(Clone, Copy, Debug)]
pub struct BoxPlace {
    /// Lowest voxel, as in [`BoxView::origin`].
    pub origin: [u32; 3],
    /// Extent in voxels, as in [`BoxView::extent`].
    pub extent: [u32; 3],
    /// First word of its node.
    node: u64,
    /// Index of its chunk.
    chunk: u32,
}

/// A box with its contents, unpacked.
#[derive(Clone, Copy, Debug)]
pub struct BoxView<'a> {
    /// Lowest voxel; each coordinate is a multiple of 4.
    pub origin: [u32; 3],
    /// Extent in voxels: 4, 8, 12 or 16 an axis. It may pass the volume's end by up to 3 voxels.
    pub extent: [u32; 3],
    /// Its voxels.
    pub node: NodeRef<'a>,
}

/// A segmentation volume in the canonical form: boxes for each label.
#[derive(Debug)]
pub struct CompressedVolume {
    pub(crate) info: VolumeInfo,
    pub(crate) chunks: Vec<Chunk>,
    pub(crate) runs: Vec<LabelRun>,
    pub(crate) boxes: Elements<BoxRecord>,
    pub(crate) nodes: Elements<u16>,
    /// The leaves of each chunk.
    pub(crate) leaves: Vec<Leaves>,
    pub(crate) labels: LabelTable,
    pub(crate) grid: OnceLock<BoxGrid>,
    /// Content hash, once it was computed or read from the file.
    pub(crate) hash: OnceLock<u128>,
    /// Whether each label's boxes are held, by dense index; `None` where all labels were read.
    pub(crate) held: Option<Vec<bool>>,
    /// Where the boxes are that are not in memory; `None` where all are.
    pub(crate) pages: Option<Arc<Pages>>,
    /// The frame of a time series that the volume is.
    pub(crate) frame: Option<FrameOf>,
}

/// Which frame of how many of a time series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameOf {
    /// The frame, counted from 0.
    pub number: u32,
    /// Number of frames of the series.
    pub frames: u32,
}

impl CompressedVolume {
    /// A volume without labels.
    pub(crate) fn empty(info: VolumeInfo) -> Self {
        Self {
            info,
            chunks: Vec::new(),
            runs: Vec::new(),
            boxes: Elements::default(),
            nodes: Elements::default(),
            leaves: Vec::new(),
            labels: LabelTable::default(),
            grid: OnceLock::new(),
            hash: OnceLock::new(),
            held: None,
            pages: None,
            frame: None,
        }
    }

    /// Whether the volume holds the boxes of this label; after [`CompressedVolume::open_labels`] it may hold a subset.
    #[inline]
    pub fn holds(&self, label: u32) -> bool {
        self.held.as_ref().is_none_or(|held| held.get(label as usize).is_some_and(|&h| h))
    }

    /// The frame of a time series that the volume is; `None` of other volumes. Its table has the labels of all frames, with the voxels that
    /// each has at this frame, which may be none, and with all pairs that touch at some frame.
    pub fn frame(&self) -> Option<FrameOf> {
        self.frame
    }

    /// Whether the volume holds all labels of its table.
    pub fn is_whole(&self) -> bool {
        self.held.as_ref().is_none_or(|held| held.iter().all(|&h| h))
    }

    /// Bytes held on the heap or mapped, by part of the volume. `index` is present once a query has built it ([`CompressedVolume::grid`]).
    pub fn resident_parts(&self) -> Vec<(&'static str, u64)> {
        fn bytes<T>(v: &Vec<T>) -> u64 {
            (v.capacity() * size_of::<T>()) as u64
        }
        fn of<T>(e: &Elements<T>) -> u64 {
            e.heap_bytes() + e.mapped_bytes()
        }
        let names: usize = self.info.notes.iter().filter_map(|n| n.name.as_ref()).map(String::capacity).sum();
        let notes = self.info.notes.capacity() * size_of::<crate::LabelNote>() + names;
        let mut parts = vec![
            ("boxes", of(&self.boxes) + bytes(&self.runs) + bytes(&self.chunks)),
            ("nodes", of(&self.nodes)),
            ("leaves", bytes(&self.leaves) + self.leaves.iter().map(Leaves::bytes).sum::<u64>()),
            ("labels", self.labels.bytes() + notes as u64),
        ];
        if let Some(grid) = self.grid.get() {
            parts.push(("index", grid.bytes()));
        }
        if let Some(pages) = &self.pages {
            parts.push(("pages", pages.bytes()));
        }
        parts
    }

    /// How many of the bytes of [`CompressedVolume::resident_parts`] are pages of a mapped file rather than memory of this process
    /// ([`CompressedVolume::open_mapped`]).
    pub fn mapped_bytes(&self) -> u64 {
        self.boxes.mapped_bytes() + self.nodes.mapped_bytes()
    }

    /// Size, label type, matrix and names, as in the source.
    pub fn info(&self) -> &VolumeInfo {
        &self.info
    }

    /// Label table: ids, types, voxel counts and contacts by dense label index.
    pub fn labels(&self) -> &LabelTable {
        &self.labels
    }

    /// Chunks with boxes, in Morton order.
    pub fn chunks(&self) -> &[Chunk] {
        &self.chunks
    }

    /// Label runs of all chunks, chunk after chunk.
    pub fn runs(&self) -> &[LabelRun] {
        &self.runs
    }

    /// Boxes of all chunks, chunk after chunk.
    pub fn boxes(&self) -> &[BoxRecord] {
        &self.boxes
    }

    /// Words of all nodes, in the form that [`crate::node`] draws.
    pub fn nodes(&self) -> &[u16] {
        &self.nodes
    }

    /// The patterns, slices and rare fields to which the nodes of each chunk refer; by the index of the chunk.
    pub fn leaves(&self) -> &[Leaves] {
        &self.leaves
    }

    /// Name and colour of a label in the source, if it has either.
    pub fn note(&self, label: u32) -> Option<&crate::LabelNote> {
        let id = *self.labels.ids.get(label as usize)?;
        self.info.notes.binary_search_by_key(&id, |n| n.id).ok().map(|i| &self.info.notes[i])
    }

    /// Visits all boxes in order, with their labels; cheaper than [`CompressedVolume::get_box`] for each. Those of a volume whose boxes
    /// are not in memory come page by page ([`Pages`]).
    pub fn for_each_box(&self, visit: impl FnMut(u32, BoxView<'_>)) {
        match &self.pages {
            Some(pages) => pages.for_each_box(visit),
            None => self.for_each_box_in_memory(visit),
        }
    }

    /// [`CompressedVolume::for_each_box`] of a volume without pages.
    pub(crate) fn for_each_box_in_memory(&self, mut visit: impl FnMut(u32, BoxView<'_>)) {
        for (c, chunk) in self.chunks.iter().enumerate() {
            let next = self.chunks.get(c + 1);
            let last_box = next.map_or(self.boxes.len() as u64, |n| n.first_box);
            let last_run = next.map_or(self.runs.len() as u64, |n| n.first_run);
            let runs = &self.runs[chunk.first_run as usize..last_run as usize];
            for (r, run) in runs.iter().enumerate() {
                let start = chunk.first_box + u64::from(run.first_box);
                let end = runs.get(r + 1).map_or(last_box, |n| chunk.first_box + u64::from(n.first_box));
                for record in &self.boxes[start as usize..end as usize] {
                    visit(run.label, self.box_at(&place_of(c, chunk, *record)));
                }
            }
        }
    }

    /// Range of a chunk's words in [`CompressedVolume::nodes`].
    pub(crate) fn node_range(&self, chunk: usize) -> std::ops::Range<usize> {
        let end = self.chunks.get(chunk + 1).map_or(self.nodes.len() as u64, |next| next.node_base);
        self.chunks[chunk].node_base as usize..end as usize
    }

    /// Range of a chunk's boxes in [`CompressedVolume::boxes`].
    pub(crate) fn box_range(&self, chunk: usize) -> std::ops::Range<usize> {
        let end = self.chunks.get(chunk + 1).map_or(self.boxes.len() as u64, |next| next.first_box);
        self.chunks[chunk].first_box as usize..end as usize
    }

    /// Range of a chunk's runs in [`CompressedVolume::runs`].
    pub(crate) fn run_range(&self, chunk: usize) -> std::ops::Range<usize> {
        let end = self.chunks.get(chunk + 1).map_or(self.runs.len() as u64, |next| next.first_run);
        self.chunks[chunk].first_run as usize..end as usize
    }

    /// Index of the chunk that holds box `index`.
    #[inline(always)]
    fn chunk_of_box(&self, index: usize) -> usize {
        self.chunks.partition_point(|c| c.first_box <= index as u64) - 1
    }

    /// The box at `index` of [`CompressedVolume::boxes`], with its contents.
    ///
    /// # Panics
    /// When `index` is out of range.
    #[inline]
    pub fn get_box(&self, index: usize) -> BoxView<'_> {
        self.box_at(&self.place_of_box(index))
    }

    /// Position and extent of the box at `index`; cheaper than [`CompressedVolume::get_box`] where the contents may not be needed.
    ///
    /// # Panics
    /// When `index` is out of range.
    #[inline(always)]
    pub fn place_of_box(&self, index: usize) -> BoxPlace {
        let chunk = self.chunk_of_box(index);
        place_of(chunk, &self.chunks[chunk], self.boxes[index])
    }

    /// The box at a position that [`CompressedVolume::place_of_box`] of this volume returned.
    #[inline(always)]
    pub fn box_at(&self, place: &BoxPlace) -> BoxView<'_> {
        BoxView {
            origin: place.origin,
            extent: place.extent,
            node: NodeRef::read(&self.nodes, place.node as usize, &self.leaves[place.chunk as usize]),
        }
    }

    /// Dense label index of the box at `index`.
    ///
    /// # Panics
    /// When `index` is out of range.
    #[inline]
    pub fn label_of_box(&self, index: usize) -> u32 {
        let c = self.chunk_of_box(index);
        let end = self.chunks.get(c + 1).map_or(self.runs.len(), |next| next.first_run as usize);
        let runs = &self.runs[self.chunks[c].first_run as usize..end];
        let local = (index as u64 - self.chunks[c].first_box) as u32;
        runs[runs.partition_point(|r| r.first_box <= local) - 1].label
    }
}

#[inline(always)]
fn place_of(index: usize, chunk: &Chunk, record: BoxRecord) -> BoxPlace {
    let cell = record.cell();
    BoxPlace {
        origin: [0, 1, 2].map(|a| chunk.origin[a] + 4 * cell[a]),
        extent: record.extent().map(|e| 4 * e),
        node: chunk.node_base + u64::from(record.node()),
        chunk: index as u32,
    }
}
