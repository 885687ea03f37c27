//! One chunk of a part at all of its frames, read as volumes of this chunk alone, with the labels of the whole volume.

use std::fs::File;
use std::ops::Range;

use super::check::SharedNodes;
use super::format_error::{FormatError, Stop};
use super::layout::Layout;
use super::nodes::{self, Streams, Wrong};
use super::part::OpenPart;
use super::sections::read_sections_if;
use super::size_limits::check_memory;
use crate::cell::Cell;
use crate::layers::{LayerBatch, Layers, SIDE};
use crate::reserve::reserved;
use crate::{BoxRecord, Chunk, CompressedVolume, Job, LabelRun, Leaves, Result, VolumeInfo, morton};

/// Cells of a face that are added together.
const BATCH_CELLS: usize = 1 << 14;

/// A chunk of a part at all frames at which it has boxes: they share its leaves and nodes.
pub(super) struct PartChunk {
    /// The leaves and the nodes of all frames. Its runs and boxes are those of the frame that was shown last.
    volume: CompressedVolume,
    frames: Vec<OfFrame>,
}

/// What a frame has of its chunk.
struct OfFrame {
    /// Entry of the part's table of chunks.
    entry: u32,
    runs: Vec<LabelRun>,
    boxes: Vec<BoxRecord>,
    /// Words of the nodes that this frame and those before it use.
    words: usize,
    /// Number of voxels of each run; none in a volume of one frame.
    run_voxels: Option<Vec<u64>>,
}

/// One frame of a [`PartChunk`].
pub(super) struct FrameOfChunk<'c> {
    /// Entry of the part's table of chunks.
    pub(super) entry: u32,
    /// The boxes of the frame, with the nodes of all frames.
    pub(super) volume: &'c CompressedVolume,
    /// Words of the nodes that it is the first to use.
    pub(super) words: Range<usize>,
    /// Number of voxels of each run.
    pub(super) run_voxels: Vec<u64>,
    /// Whether it is the first that has boxes: its entry has the leaves.
    pub(super) is_first: bool,
}

/// Reads these entries of a part's table of chunks, which are the frames of one chunk. `global` has the number of each of the part's labels in the
/// whole volume.
pub(super) fn read_chunk(
    file: &mut File,
    part: &OpenPart,
    chunk: Range<u32>,
    global: &[u32],
    job: &Job,
) -> std::result::Result<PartChunk, Stop> {
    // Without the names, which may be many.
    let whole = &part.info.volume;
    let mut volume = CompressedVolume::empty(VolumeInfo::new(whole.dims, whole.label_type));
    let origin = part.places[chunk.start as usize].origin;
    volume.chunks = vec![Chunk { origin, first_box: 0, first_run: 0, node_base: 0 }];
    let (mut frames, mut words, mut starts) = (Vec::new(), Vec::new(), Vec::new());
    for entry in chunk {
        let own = Some(entry);
        let entries = part.layout.entries[part.entries_of(entry..entry + 1)].to_vec();
        check_memory(entries.iter())?;
        let layout = Layout { entries, ..part.layout };
        let mut sections = read_sections_if(file, None, &layout, |_| true, job)?;
        let mut runs = sections.elements_of(b"RUNS", own, |b: [u8; 8]| {
            let both = u64::from_le_bytes(b);
            LabelRun { label: both as u32, first_box: (both >> 32) as u32 }
        })?;
        for run in &mut runs {
            run.label = *global.get(run.label as usize).ok_or_else(|| {
                let what = format!("expected labels below {}, got {}", global.len(), run.label);
                sections.fault_in(*b"RUNS", entry, &what)
            })?;
        }
        let run_voxels = match part.layout.frames {
            1 => None,
            _ => Some(sections.elements_of(b"RVOX", own, u64::from_le_bytes)?),
        };
        if volume.leaves.is_empty() {
            volume.leaves.push(Leaves {
                patterns: sections.elements_of(b"LEAF", own, u64::from_le_bytes)?.into(),
                slices: sections.elements_of(b"SLIC", own, u16::from_le_bytes)?.into(),
                rare: sections.elements_of(b"RARE", own, u64::from_le_bytes)?.into(),
            });
        }
        let mut take = |name| sections.take_of(name, own);
        let streams = Streams {
            cells: take(b"BCEL")?,
            backs: take(b"BNOD")?,
            occupied: take(b"OCCU")?,
            classes: take(b"CLAS")?,
            references: [take(b"REFS")?, take(b"SLCR")?, take(b"FLDS")?],
        };
        let mut boxes = Vec::new();
        nodes::join_frame(&streams, &volume.leaves[0], &mut boxes, (0, &mut words), &mut starts)
            .map_err(|(section, what)| sections.fault_in(section, entry, &what))?;
        sections.expect_none_left()?;
        frames.push(OfFrame { entry, runs, boxes, words: words.len(), run_voxels });
    }
    volume.nodes = words.into();
    Ok(PartChunk { volume, frames })
}

impl PartChunk {
    /// Calls `visit` with each frame, once it is checked. The volumes have a table of `ids`, which is back in its place at the end; `voxels` gets
    /// each label with its voxels at a frame.
    pub(super) fn for_each_frame(
        mut self,
        part: &OpenPart,
        ids: &mut Vec<u64>,
        mut voxels: impl FnMut(u32, u64),
        mut visit: impl FnMut(FrameOfChunk<'_>) -> Result<()>,
    ) -> Result<()> {
        std::mem::swap(&mut self.volume.labels.ids, ids);
        let first = self.frames.first().map_or(0, |frame| frame.entry);
        let fault = |entry: u32, (section, what): Wrong| part.fault(entry, section, &what);
        let mut shared = SharedNodes::check(&self.volume).map_err(|wrong| fault(first, wrong))?;
        let (mut last, mut known) = (first, 0);
        for OfFrame { entry, runs, boxes, words, run_voxels } in self.frames {
            (self.volume.runs, self.volume.boxes) = (runs, boxes.into());
            let mut counted = reserved(self.volume.runs.len(), "the boxes of the volume")?;
            let count = |label: u32, n: u64| {
                voxels(label, n);
                counted.push(n);
            };
            shared.check_frame(&self.volume, count).map_err(|wrong| fault(entry, wrong))?;
            if run_voxels.is_some_and(|stored| stored != counted) {
                return Err(part.fault(
                    entry,
                    *b"RVOX",
                    "expected the numbers of voxels of its runs, got others",
                ));
            }
            let (is_first, volume) = (entry == first, &self.volume);
            visit(FrameOfChunk { entry, volume, words: known..words, run_voxels: counted, is_first })?;
            (last, known) = (entry, words);
        }
        shared.check_end(&self.volume).map_err(|wrong| fault(last, wrong))?;
        std::mem::swap(&mut self.volume.labels.ids, ids);
        Ok(())
    }
}

/// A fault of a section whose bytes changed between two readings.
pub(super) fn changed(section: [u8; 4], at: u64) -> Stop {
    let what = "the file changed while it was read; merge again".into();
    Stop::Fault(FormatError { section, at, what })
}

/// Adds to `layers` the cells at the faces of the chunk that `volume` holds alone.
pub(super) fn add_faces(volume: &CompressedVolume, layers: &Layers<'_>) -> Result<()> {
    let corner = volume.chunks[0].origin;
    let last = SIDE as u32 - 1;
    let (mut batch, mut cells, mut in_batch, mut of) = (LayerBatch::default(), Vec::new(), 0, 0);
    let mut result = Ok(());
    volume.for_each_box(|label, b| {
        if result.is_err() {
            return;
        }
        if label != of || cells.len() >= BATCH_CELLS {
            in_batch += cells.len();
            result = batch.add(of, &cells).map_err(Into::into);
            cells.clear();
            of = label;
        }
        if in_batch >= BATCH_CELLS && result.is_ok() {
            result = layers.add(&mut batch);
            in_batch = 0;
        }
        let low = [0, 1, 2].map(|a| (b.origin[a] - corner[a]) / 4);
        let at_face = |c: [u32; 3]| c.iter().any(|&c| c == 0 || c == last);
        // Most boxes are within.
        if !at_face(low) && !at_face([0, 1, 2].map(|a| low[a] + b.extent[a] / 4 - 1)) {
            return;
        }
        for (c, mask) in b.node.fields() {
            let cell = [0, 1, 2].map(|a| low[a] + (c >> (2 * a) & 3));
            if at_face(cell) {
                cells.push(Cell { key: morton::encode(cell), mask });
            }
        }
    });
    result?;
    batch.add(of, &cells)?;
    layers.add(&mut batch)
}
