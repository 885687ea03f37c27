//! What a part of a volume says of itself, beside the chunks that it holds.
//!
//! ```text
//! header    contents 2
//! INFO      of the whole volume            LIDS, LVOX, LTYP, LCON, CHNK   of the part's chunks: its labels are numbered by themselves
//! FRAM      of a time series               a hash for each frame, of the part's chunks
//! PART      {"chunks": "0,4-7", "of": 12, "source": {"name", "fingerprint", "reading"}}
//! sections of its chunks, packed, as in a volume of the level `default`
//! ```
//! Of a time series a part has its chunks at all frames, because they share nodes. A chunk stands alone, so its sections are those that it has in
//! the file of the whole volume, apart from `RUNS`, which has numbers of labels.

use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::format_error::{FormatError, Stop};
use super::layout::{Contents, Layout};
use super::read::{chunk_of, from_path};
use super::sections::{Sections, info_of, read_any_layout, read_sections};
use crate::error::one_line;
use crate::{ChunkGrid, ChunkSet, Error, Job, Result, VolumeInfo};

/// What a part was made from. Parts of one volume agree in all of it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartSource {
    /// Name of the source, for messages.
    pub name: String,
    /// What tells the source from others: equal for all parts of one volume.
    pub fingerprint: String,
    /// The options with which it is read, as the command takes them; empty without any.
    pub reading: String,
}

/// The section `PART`, as JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct PartHead {
    /// Numbers of its chunks, with those that have no labels.
    chunks: ChunkSet,
    /// Number of chunks of the whole volume.
    of: u64,
    source: PartSource,
}

impl PartHead {
    pub(crate) fn new(chunks: ChunkSet, of: u64, source: PartSource) -> Self {
        Self { chunks, of, source }
    }

    /// The bytes of the section.
    pub(super) fn to_json(&self) -> Result<Vec<u8>> {
        serde_json::to_vec(self)
            .map_err(|e| Error::Caller(format!("what a part says of itself cannot be written as JSON: {e}")))
    }
}

/// What a part holds.
#[derive(Clone, Debug, PartialEq)]
pub struct PartInfo {
    /// Size, label type, matrix and names of the whole volume.
    pub volume: VolumeInfo,
    /// Numbers of the part's chunks ([`ChunkGrid`]).
    pub chunks: ChunkSet,
    /// What it was made from.
    pub source: PartSource,
    /// Number of frames: 1, or those of a time series.
    pub frames: u32,
}

/// Reads what a part says of itself.
///
/// # Errors
/// As [`crate::CompressedVolume::open`]; [`Error::File`] for a file that is no part.
pub fn read_part(path: &Path, job: &Job) -> Result<PartInfo> {
    Ok(OpenPart::open(path, job)?.0.info)
}

/// A part, open for merging.
pub(super) struct OpenPart {
    pub(super) path: PathBuf,
    pub(super) info: PartInfo,
    pub(super) layout: Layout,
    /// Each chunk with boxes, by Morton order and then by frame.
    pub(super) places: Vec<PlaceOfChunk>,
}

/// Where and when a chunk of a part is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PlaceOfChunk {
    /// Lowest voxel.
    pub(super) origin: [u32; 3],
    pub(super) frame: u32,
}

impl OpenPart {
    /// Reads a part's head; returns the ids of its labels too.
    pub(super) fn open(path: &Path, job: &Job) -> Result<(Self, Vec<u64>)> {
        from_path(path, |file, file_bytes| {
            let layout = read_any_layout(file, file_bytes)?;
            if layout.contents != Contents::Part {
                let what = "contents: expected a part of a volume, got a volume (pumice compress --chunks makes parts)";
                return Err(FormatError::in_header(12, what.into()).into());
            }
            let mut sections =
                read_sections(file, None, &layout, &[b"INFO", b"PART", b"CHNK", b"LIDS"], job)?;
            let (volume, _) = info_of(&mut sections)?;
            let head: PartHead = serde_json::from_slice(&sections.take(b"PART")?)
                .map_err(|e| sections.fault(*b"PART", one_line(&format!("JSON: {e}"))))?;
            let ids = ids_of(&mut sections)?;
            let grid = ChunkGrid::new(volume.dims);
            let places = sections.elements(b"CHNK", |b| {
                let (frame, chunk) = chunk_of(b);
                PlaceOfChunk { origin: chunk.origin, frame }
            })?;
            check_head(&volume, &head, &grid, &places, layout.frames)
                .map_err(|(s, what)| sections.fault(s, what))?;
            if !layout.entries.is_sorted_by_key(|entry| entry.chunk)
                || layout
                    .entries
                    .last()
                    .and_then(|entry| entry.chunk)
                    .is_some_and(|c| c as usize >= places.len())
            {
                let what =
                    format!("expected the sections of {} chunks in their order, got others", places.len());
                return Err(sections.fault(*b"CHNK", what));
            }
            let info = PartInfo { volume, chunks: head.chunks, source: head.source, frames: layout.frames };
            Ok((Self { path: path.to_owned(), info, layout, places }, ids))
        })
    }

    /// Calls `read` with the file.
    pub(super) fn with_file<T>(
        &self,
        read: impl FnOnce(&mut File) -> std::result::Result<T, Stop>,
    ) -> Result<T> {
        from_path(&self.path, |file, _| read(file))
    }

    /// Where the sections of some chunks are in the table.
    pub(super) fn entries_of(&self, chunks: Range<u32>) -> Range<usize> {
        let from = |first: u32| self.layout.entries.partition_point(|entry| entry.chunk < Some(first));
        from(chunks.start)..from(chunks.end)
    }

    /// A fault in a section of a chunk.
    pub(super) fn fault(&self, chunk: u32, section: [u8; 4], what: &str) -> Error {
        let entries = &self.layout.entries;
        let own = entries.iter().find(|entry| entry.name == section && entry.chunk == Some(chunk));
        Error::File {
            path: self.path.clone(),
            section: section.escape_ascii().to_string(),
            at: own.map_or(0, |entry| entry.offset),
            what: format!("chunk {chunk}: {what}"),
        }
    }

    /// Reads the ids of its labels again.
    pub(super) fn ids(&self, job: &Job) -> Result<Vec<u64>> {
        self.with_file(|file| {
            // Without `INFO`, since it was read and compared with the sizes of the sections.
            ids_of(&mut read_sections(file, None, &self.layout, &[b"LIDS"], job)?)
        })
    }
}

/// The ids of a part's labels.
fn ids_of(sections: &mut Sections) -> std::result::Result<Vec<u64>, Stop> {
    let ids = sections.elements(b"LIDS", u64::from_le_bytes)?;
    if ids.first() == Some(&0) || !ids.is_sorted_by(|a, b| a < b) || u32::try_from(ids.len()).is_err() {
        return Err(sections.fault(*b"LIDS", "expected less than 2^32 rising ids without 0"));
    }
    Ok(ids)
}

/// Checks that a part's chunks are those of its volume.
fn check_head(
    volume: &VolumeInfo,
    head: &PartHead,
    grid: &ChunkGrid,
    places: &[PlaceOfChunk],
    frames: u32,
) -> std::result::Result<(), ([u8; 4], String)> {
    super::check::check_info(volume)?;
    head.chunks.check(grid).map_err(|e| (*b"PART", e.to_string()))?;
    if head.of != grid.chunks() {
        return Err((*b"PART", format!("chunks of the volume: expected {}, got {}", grid.chunks(), head.of)));
    }
    let mut before = None;
    for (i, &PlaceOfChunk { origin, frame }) in places.iter().enumerate() {
        let inside =
            (0..3).all(|a| origin[a].is_multiple_of(crate::CHUNK_VOXELS) && origin[a] < volume.dims[a]);
        let place = (inside && frame < frames).then(|| (grid.number(origin), frame));
        if place <= before || !place.is_some_and(|(number, _)| head.chunks.contains(number)) {
            let (chunks, what) = (&head.chunks, format!("the one at {origin:?}, frame {frame}"));
            let what =
                format!("chunk {i}: expected rising chunks of {chunks} at {frames} frames, got {what}");
            return Err((*b"CHNK", what));
        }
        before = place;
    }
    Ok(())
}
