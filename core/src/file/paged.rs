//! Reads a file chunk by chunk into [`Pages`], so that only one chunk is in memory at a time.
//!
//! The same checks are made as where a file is read whole, except for the content hash, which covers all boxes in one order: it is taken
//! from the header, and the checksums of the sections stand for it. A file of voxels is read whole and then divided.

use std::io::{Read, Seek};
use std::path::Path;
use std::sync::Arc;

use xxhash_rust::xxh3::Xxh3;

use super::format_error::{FormatError, Stop};
use super::layout::{Contents, Entry, Layout};
use super::nodes::{self, Streams};
use super::pick::Ranges;
use super::read::{self, HEAD_SECTIONS, assemble_head};
use super::sections::{read_layout, read_sections, read_sections_if};
use super::{check, check::check_head};
use crate::reserve::collected;
use crate::residency::Residency;
use crate::{BoxRecord, CHUNK_VOXELS, Chunk, CompressedVolume, Error, Job, LabelRun, Leaves, Pages, Result};

/// What memory is for, in errors.
const WHAT: &str = "a chunk of the volume";

impl CompressedVolume {
    /// Opens a `.pumice` file for drawing from disk: its boxes go into pages of `page_voxels` along a side, in a temporary file in `folder`,
    /// and are loaded into `memory` when rays meet them. Of the file, one chunk of 1024³ voxels is in memory at a time; a file of
    /// [`crate::CompressionLevel::Small`] is read whole first. What happens to the file afterwards does not matter.
    ///
    /// The volume has its label table, and [`CompressedVolume::for_each_box`] visits all its boxes, but none has a number.
    ///
    /// # Errors
    /// As [`CompressedVolume::open`]; [`Error::Io`] with `folder`, as where its disk is full; [`Error::Caller`] where `page_voxels` is not
    /// 64, 128, 256, 512 or 1024.
    pub fn open_paged(
        path: &Path,
        page_voxels: u32,
        folder: &Path,
        memory: &Arc<Residency>,
        job: &Job,
    ) -> Result<Self> {
        check_side(page_voxels)?;
        read::from_path(path, |file, file_bytes| {
            read_pages(file, file_bytes, page_voxels, folder, memory, job)
        })
    }
}

/// Checks the voxels along a side of a page.
pub(super) fn check_side(page_voxels: u32) -> Result<()> {
    if (64..=CHUNK_VOXELS).contains(&page_voxels) && page_voxels.is_power_of_two() {
        return Ok(());
    }
    Err(Error::Caller(format!(
        "pages: expected 64, 128, 256, 512 or 1024 voxels along a side, got {page_voxels}"
    )))
}

pub(super) fn read_pages(
    file: &mut (impl Read + Seek),
    file_bytes: u64,
    page_voxels: u32,
    folder: &Path,
    memory: &Arc<Residency>,
    job: &Job,
) -> std::result::Result<CompressedVolume, Stop> {
    let layout = read_layout(file, file_bytes)?;
    if layout.frames != 1 {
        return Err(Stop::Frames(layout.frames));
    }
    if layout.contents == Contents::Voxels {
        let volume = read::read(file, file_bytes, None, true, job)?;
        return Ok(divided(volume, page_voxels, folder, memory, job)?);
    }
    let mut sections = read_sections(file, None, &layout, &HEAD_SECTIONS, job)?;
    let mut volume = assemble_head(&mut sections)?;
    let wrong = |(section, what)| sections.fault(section, what);
    check_head(&volume).map_err(wrong)?;
    sections.unpack_contacts(&mut volume)?;

    let (chunks, runs) = (std::mem::take(&mut volume.chunks), std::mem::take(&mut volume.runs));
    let leaves = std::mem::take(&mut volume.leaves);
    let mut pages = Pages::new(&volume.info, page_voxels, folder, Arc::clone(memory));
    let mut counts = vec![0u64; volume.labels.len()];
    let mut plain = match layout.entry(b"NODE") {
        Some(_) => Some(Plain::open(file, &layout, job)?),
        None => None,
    };
    job.begin(layout.file_bytes);
    for (c, (chunk, leaves)) in chunks.iter().zip(leaves).enumerate() {
        job.check()?;
        let next = chunks.get(c + 1);
        let of_chunk = chunk.first_run as usize..next.map_or(runs.len(), |n| n.first_run as usize);
        let runs: &[LabelRun] = runs
            .get(of_chunk)
            .ok_or_else(|| wrong((*b"CHNK", format!("chunk {c}: expected rising runs within the file"))))?;
        let (boxes, words) = match &mut plain {
            Some(plain) => plain.chunk(file, &layout, chunk, next, job)?,
            None => packed(file, &layout, c as u32, &leaves, job)?,
        };
        job.advance(8 * boxes.len() as u64 + 2 * words.len() as u64);
        volume.chunks = vec![Chunk { origin: chunk.origin, first_box: 0, first_run: 0, node_base: 0 }];
        volume.runs = runs.to_vec();
        (volume.boxes, volume.nodes, volume.leaves) = (boxes.into(), words.into(), vec![leaves]);
        let in_chunk =
            |(section, what): ([u8; 4], String)| wrong((section, format!("in chunk {c} alone: {what}")));
        check::check_chunk(&volume, |label, n| counts[label as usize] += n).map_err(in_chunk)?;
        pages.add_chunk(&volume, job)?;
    }
    if let Some(plain) = plain {
        plain.check()?;
    }
    (volume.chunks, volume.runs, volume.leaves) = (Vec::new(), Vec::new(), Vec::new());
    (volume.boxes, volume.nodes) = (Vec::new().into(), Vec::new().into());
    check::check_counts(&volume, &counts).map_err(wrong)?;
    volume.hash = layout.content_hash.into();
    volume.pages = Some(Arc::new(pages));
    Ok(volume)
}

/// A volume in memory, divided into pages.
pub(super) fn divided(
    mut volume: CompressedVolume,
    page_voxels: u32,
    folder: &Path,
    memory: &Arc<Residency>,
    job: &Job,
) -> Result<CompressedVolume> {
    let hash = volume.content_hash();
    let mut pages = Pages::new(&volume.info, page_voxels, folder, Arc::clone(memory));
    for c in 0..volume.chunks.len() {
        let mut chunk =
            CompressedVolume::empty(crate::VolumeInfo::new(volume.info.dims, volume.info.label_type));
        let origin = volume.chunks[c].origin;
        chunk.chunks = vec![Chunk { origin, first_box: 0, first_run: 0, node_base: 0 }];
        chunk.runs = volume.runs[volume.run_range(c)].to_vec();
        let (boxes, nodes) = (&volume.boxes[volume.box_range(c)], &volume.nodes[volume.node_range(c)]);
        chunk.boxes = collected(boxes.len(), boxes.iter().copied(), WHAT)?.into();
        chunk.nodes = collected(nodes.len(), nodes.iter().copied(), WHAT)?.into();
        chunk.leaves = vec![volume.leaves[c].clone()];
        pages.add_chunk(&chunk, job)?;
    }
    (volume.chunks, volume.runs, volume.leaves) = (Vec::new(), Vec::new(), Vec::new());
    (volume.boxes, volume.nodes) = (Vec::new().into(), Vec::new().into());
    volume.hash = hash.into();
    volume.pages = Some(Arc::new(pages));
    Ok(volume)
}

/// Boxes and words of nodes of a chunk.
type OfChunk = (Vec<BoxRecord>, Vec<u16>);

/// The arrays of a file in the plain form, read chunk after chunk, with their checksums so far.
struct Plain {
    arrays: [Array; 2],
}

struct Array {
    entry: Entry,
    hash: Xxh3,
    read: u64,
}

impl Plain {
    fn open(file: &mut (impl Read + Seek), layout: &Layout, job: &Job) -> std::result::Result<Self, Stop> {
        let mut array = |name| -> std::result::Result<Array, Stop> {
            // (A missing section is an error here.)
            let _ = Ranges::open(file, layout, name, job)?;
            let missing =
                || FormatError { section: *name, at: 0, what: "expected the section, got none".into() };
            let entry = *layout.entry(name).ok_or_else(|| Stop::Fault(missing()))?;
            Ok(Array { entry, hash: Xxh3::new(), read: 0 })
        };
        Ok(Self { arrays: [array(b"BOXS")?, array(b"NODE")?] })
    }

    fn chunk(
        &mut self,
        file: &mut (impl Read + Seek),
        layout: &Layout,
        chunk: &Chunk,
        next: Option<&Chunk>,
        job: &Job,
    ) -> std::result::Result<OfChunk, Stop> {
        let [boxes, nodes] = &mut self.arrays;
        let boxes = boxes.part(file, layout, b"BOXS", chunk.first_box, next.map(|n| n.first_box), 8, job)?;
        let nodes = nodes.part(file, layout, b"NODE", chunk.node_base, next.map(|n| n.node_base), 2, job)?;
        let (boxes, nodes) = (boxes.as_chunks::<8>().0, nodes.as_chunks::<2>().0);
        let record = |&b: &[u8; 8]| BoxRecord(u64::from_le_bytes(b));
        let boxes = collected(boxes.len(), boxes.iter().map(record), WHAT).map_err(Error::from)?;
        let words = nodes.iter().map(|&b| u16::from_le_bytes(b));
        Ok((boxes, collected(nodes.len(), words, WHAT).map_err(Error::from)?))
    }

    /// Compares the checksums, now that all was read.
    fn check(self) -> std::result::Result<(), Stop> {
        for Array { entry, hash, read } in self.arrays {
            let e = entry.encoding;
            let (expected, got) = (entry.checksum, hash.digest());
            // (An encoded section was compared when it was decoded.)
            let is_stored = !(e.zstd || e.delta || e.planes);
            let what = if read != entry.decoded {
                format!("expected chunks up to its end, byte {}, got them up to {read}", entry.decoded)
            } else if is_stored && expected != got {
                format!("checksum: expected {expected:016x}, got {got:016x}")
            } else {
                continue;
            };
            return Err(Stop::Fault(FormatError { section: entry.name, at: entry.offset, what }));
        }
        Ok(())
    }
}

impl Array {
    /// The elements from `from` up to `to`, or up to the end, of `size` bytes each.
    #[expect(clippy::too_many_arguments, reason = "the file, and a range of it")]
    fn part(
        &mut self,
        file: &mut (impl Read + Seek),
        layout: &Layout,
        name: &'static [u8; 4],
        from: u64,
        to: Option<u64>,
        size: u64,
        job: &Job,
    ) -> std::result::Result<Vec<u8>, Stop> {
        let mut ranges = Ranges::open(file, layout, name, job)?;
        let (start, end) = (from.saturating_mul(size), to.map_or(ranges.bytes, |to| to.saturating_mul(size)));
        if start != self.read || end < start {
            let what = format!(
                "expected the chunks one after another, got bytes {start} to {end} after {}",
                self.read
            );
            return Err(Stop::Fault(FormatError { section: *name, at: self.entry.offset, what }));
        }
        let bytes = ranges.read(start, end - start)?.to_vec();
        self.hash.update(&bytes);
        self.read = end;
        Ok(bytes)
    }
}

/// Boxes and nodes of a chunk in the packed form.
fn packed(
    file: &mut (impl Read + Seek),
    layout: &Layout,
    chunk: u32,
    leaves: &Leaves,
    job: &Job,
) -> std::result::Result<OfChunk, Stop> {
    let names = [b"BCEL", b"BNOD", b"OCCU", b"CLAS", b"REFS", b"SLCR", b"FLDS"];
    let is_of_chunk = |entry: &Entry| entry.chunk == Some(chunk) && names.contains(&&entry.name);
    let mut sections = read_sections_if(file, None, layout, is_of_chunk, job)?;
    let mut take = |name| sections.take_of(name, Some(chunk));
    let streams = Streams {
        cells: take(b"BCEL")?,
        backs: take(b"BNOD")?,
        occupied: take(b"OCCU")?,
        classes: take(b"CLAS")?,
        references: [take(b"REFS")?, take(b"SLCR")?, take(b"FLDS")?],
    };
    let (mut boxes, mut nodes) = (Vec::new(), Vec::new());
    nodes::join(&streams, leaves, &mut boxes, &mut nodes)
        .map_err(|(section, what)| sections.fault_in(section, chunk, &what))?;
    Ok((boxes, nodes))
}
