//! One chunk of a part, read as a volume of this chunk alone, with the labels of the whole volume.

use std::fs::File;

use super::check;
use super::format_error::{FormatError, Stop};
use super::layout::Layout;
use super::nodes::{self, Streams};
use super::part::OpenPart;
use super::sections::read_sections_if;
use super::size_limits::check_memory;
use crate::cell::Cell;
use crate::layers::{LayerBatch, Layers, SIDE};
use crate::{Chunk, CompressedVolume, Elements, Job, LabelRun, Leaves, Result, VolumeInfo, morton};

/// Cells of a face that are added together.
const BATCH_CELLS: usize = 1 << 14;

/// Reads the chunk with this index. `global` has the number of each of the part's labels in the whole volume, which has the ids `ids`: they are
/// in the volume's table afterwards. `voxels` gets each label with its voxels in the chunk.
pub(super) fn read_chunk(
    file: &mut File,
    part: &OpenPart,
    chunk: u32,
    global: &[u32],
    ids: &mut Vec<u64>,
    voxels: &mut dyn FnMut(u32, u64),
    job: &Job,
) -> std::result::Result<CompressedVolume, Stop> {
    let entries = part.layout.entries[part.entries_of(chunk)].to_vec();
    check_memory(entries.iter())?;
    let layout = Layout { entries, ..part.layout };
    let mut sections = read_sections_if(file, None, &layout, |_| true, job)?;
    let own = Some(chunk);
    let mut runs = sections.elements_of(b"RUNS", own, |b: [u8; 8]| {
        let both = u64::from_le_bytes(b);
        LabelRun { label: both as u32, first_box: (both >> 32) as u32 }
    })?;
    for run in &mut runs {
        run.label = *global.get(run.label as usize).ok_or_else(|| {
            let what = format!("expected labels below {}, got {}", global.len(), run.label);
            sections.fault_in(*b"RUNS", chunk, &what)
        })?;
    }
    let leaves = Leaves {
        patterns: sections.elements_of(b"LEAF", own, u64::from_le_bytes)?.into(),
        slices: sections.elements_of(b"SLIC", own, u16::from_le_bytes)?.into(),
        rare: sections.elements_of(b"RARE", own, u64::from_le_bytes)?.into(),
    };
    let mut take = |name| sections.take_of(name, own);
    let streams = Streams {
        cells: take(b"BCEL")?,
        backs: take(b"BNOD")?,
        occupied: take(b"OCCU")?,
        classes: take(b"CLAS")?,
        references: [take(b"REFS")?, take(b"SLCR")?, take(b"FLDS")?],
    };
    sections.expect_none_left()?;
    let (mut boxes, mut words) = (Vec::new(), Vec::new());
    let wrong = |(section, what): ([u8; 4], String)| sections.fault_in(section, chunk, &what);
    nodes::join(&streams, &leaves, &mut boxes, &mut words).map_err(wrong)?;
    drop(streams);
    // Without the names, which may be many.
    let whole = &part.info.volume;
    let mut volume = CompressedVolume::empty(VolumeInfo::new(whole.dims, whole.label_type));
    let origin = part.origins[chunk as usize];
    volume.chunks = vec![Chunk { origin, first_box: 0, first_run: 0, node_base: 0 }];
    (volume.runs, volume.leaves) = (runs, vec![leaves]);
    (volume.boxes, volume.nodes) = (Elements::from(boxes), Elements::from(words));
    std::mem::swap(&mut volume.labels.ids, ids);
    let checked = check::check_chunk(&volume, voxels);
    if let Err(error) = checked {
        return Err(wrong(error));
    }
    Ok(volume)
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
