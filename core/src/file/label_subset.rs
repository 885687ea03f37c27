//! Reads some labels of a file without the others.
//!
//! ```text
//! RUNS ─► boxes of the chosen labels ─► their nodes, each once ─► a volume of these boxes alone
//!
//! plain form (BOXS, NODE as arrays)     reads only the ranges that are needed          costs what the labels cost
//! packed form (streams of a chunk)      inflates the streams of the chunks that have   costs inflating these, not joining
//!                                       such a label, one at a time
//! voxels                                reads all labels
//! ```
//! The label table stays whole, so dense indices, contacts and names keep their meaning. Patterns that no node uses are left out.
//!
//! Checksums cover the header, the table and each section that is read whole. The resulting volume passes the same checks as any other
//! ([`super::check`]), and its labels' voxels are counted and compared with the table. A section of which only ranges are read is not
//! compared with its checksum. The content hash is copied from the header, because it covers all labels.

use std::io::{Read, Seek};
use std::path::Path;

use super::format_error::Stop;
use super::layout::Contents;
use super::nodes::Wrong;
use super::pick::{OfChunks, Wanted, pick_packed, pick_plain, put_together};
use super::read::{HEAD_SECTIONS, assemble_head};
use super::sections::{read_layout, read_sections};
use super::{check, read};
use crate::{Chunk, CompressedVolume, Job, LabelRun, LabelTable, Result};

impl CompressedVolume {
    /// Reads the labels of a `.pumice` file that `choose` marks, by dense index. Labels beyond the end of its result are not chosen. A file
    /// of [`crate::CompressionLevel::Small`] is read whole.
    ///
    /// The volume renders like the whole one with only these labels shown, and it has the whole one's content hash. Its queries treat
    /// voxels of other labels as background. [`CompressedVolume::holds`] tells which labels it has. It cannot be saved.
    ///
    /// # Errors
    /// As [`CompressedVolume::open`].
    pub fn open_labels(
        path: &Path,
        choose: impl FnOnce(&LabelTable) -> Vec<bool>,
        job: &Job,
    ) -> Result<Self> {
        read::from_path(path, |file, file_bytes| read_subset(file, file_bytes, choose, job))
    }
}

pub(super) fn read_subset(
    file: &mut (impl Read + Seek),
    file_bytes: u64,
    choose: impl FnOnce(&LabelTable) -> Vec<bool>,
    job: &Job,
) -> std::result::Result<CompressedVolume, Stop> {
    let layout = read_layout(file, file_bytes)?;
    if layout.frames != 1 {
        return Err(Stop::Frames(layout.frames));
    }
    if layout.contents == Contents::Voxels {
        // Voxel data has no index by label: all labels are decoded, and discarding some afterwards would save nothing.
        return read::read(file, file_bytes, None, true, job);
    }
    let mut sections = read_sections(file, None, &layout, &HEAD_SECTIONS, job)?;
    let mut volume = assemble_head(&mut sections)?;
    check::check_head(&volume).map_err(|(section, what)| sections.fault(section, what))?;
    sections.unpack_contacts(&mut volume)?;

    let mut held = choose(&volume.labels);
    held.resize(volume.labels.len(), false);
    let plain = layout.entry(b"NODE").is_some();
    let boxes_in_file = match plain {
        true => layout.entry(b"BOXS").map(|entry| entry.decoded / 8),
        false => Some(layout.entries.iter().filter(|e| e.name == *b"BCEL").map(|e| e.decoded / 3).sum()),
    };
    let Some(boxes_in_file) = boxes_in_file else {
        return Err(sections.fault(*b"BOXS", "expected the section, got none"));
    };
    let wanted = wanted(&volume.chunks, &volume.runs, boxes_in_file, &held)
        .map_err(|(section, what)| sections.fault(section, what))?;
    let chunks = std::mem::take(&mut volume.chunks);
    let leaves = std::mem::take(&mut volume.leaves);
    volume.runs = Vec::with_capacity(wanted.len());
    let (mut records, mut nodes) = (Vec::new(), Vec::new());
    let of_chunks = OfChunks::of(&layout);
    for in_chunk in wanted.chunk_by(|a, b| a.chunk == b.chunk) {
        let c = in_chunk[0].chunk;
        let picked = if plain {
            let end = chunks.get(c + 1).map(|next| next.node_base);
            pick_plain(file, &layout, &chunks[c], end, &leaves[c], in_chunk, job)?
        } else {
            let own = c as u32..c as u32 + 1;
            pick_packed(file, &of_chunks, own, &chunks[c], &leaves[c], in_chunk, job)?
        };
        put_together(&mut volume, &mut records, &mut nodes, &chunks[c], &leaves[c], in_chunk, &picked)
            .map_err(|(section, what)| sections.fault(section, what))?;
    }
    (volume.boxes, volume.nodes) = (records.into(), nodes.into());
    volume.held = Some(held);
    check::check(&volume).map_err(|(section, what)| sections.fault(section, what))?;
    volume.hash = layout.content_hash.into();
    Ok(volume)
}

/// The ranges of boxes of the labels that are held.
fn wanted(
    chunks: &[Chunk],
    runs: &[LabelRun],
    boxes_in_file: u64,
    held: &[bool],
) -> std::result::Result<Vec<Wanted>, Wrong> {
    let mut wanted = Vec::new();
    for (c, chunk) in chunks.iter().enumerate() {
        let next = chunks.get(c + 1);
        let last_box = next.map_or(boxes_in_file, |n| n.first_box);
        let last_run = next.map_or(runs.len() as u64, |n| n.first_run);
        let within = runs.get(chunk.first_run as usize..last_run as usize);
        let runs = within.filter(|_| last_box <= boxes_in_file).ok_or_else(|| {
            (*b"CHNK", format!("chunk {c}: expected rising boxes and runs within the file"))
        })?;
        for (r, run) in runs.iter().enumerate() {
            let first = chunk.first_box.saturating_add(run.first_box.into());
            let end =
                runs.get(r + 1).map_or(last_box, |n| chunk.first_box.saturating_add(n.first_box.into()));
            let Some(&is_held) = held.get(run.label as usize).filter(|_| first < end && end <= last_box)
            else {
                return Err((
                    *b"RUNS",
                    format!("chunk {c}, run {r}: expected a known label and boxes within the chunk"),
                ));
            };
            if is_held {
                wanted.push(Wanted { chunk: c, label: run.label, boxes: first..end });
            }
        }
    }
    Ok(wanted)
}
