//! Reads one frame of a time series without the others.
//!
//! ```text
//! CHNK   (chunk 0, frame 0) (chunk 0, frame 1) … (chunk 1, frame 0) …      by chunk, then by frame; without those that have no box
//! frame  its RUNS, RVOX, boxes ─► their nodes, of this and of earlier frames of the chunk ─► a volume of this frame alone
//! ```
//! In the plain form this reads only the ranges of boxes and nodes that the frame needs; in the packed form the frame's own streams, and
//! those of earlier frames of its chunks that have nodes of it; of a file of voxels the frame's own streams. Checksums, the checks of every
//! volume ([`super::check`]), the frame's numbers of voxels and its content hash are compared with the file.

use std::collections::BTreeSet;
use std::io::{Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::format_error::Stop;
use super::layout::{Contents, Entry, Layout};
use super::paged::{check_side, divided};
use super::pick::{OfChunks, Wanted, pick_packed, pick_plain, put_together};
use super::read::{chunk_of, from_path, leaves_of, runs_of, table_of};
use super::sections::{Sections, info_of, read_layout, read_sections_if};
use super::{check, size_limits, voxel_pieces};
use crate::volume::CHUNK_CELLS;
use crate::{
    CHUNK_VOXELS, Chunk, CompressedVolume, Contacts, FrameOf, Job, LabelTable, Pages, Residency, Result,
    VolumeInfo, morton,
};

/// Number of frames of a `.pumice` file: 1, or those of a time series. Only the header is read.
///
/// # Errors
/// [`crate::Error::Io`]; [`crate::Error::File`]; [`crate::Error::Version`].
pub fn frames_in_file(path: &Path) -> Result<u32> {
    from_path(path, |file, file_bytes| Ok(read_layout(file, file_bytes)?.frames))
}

/// A `.pumice` file of a time series: what all frames have in common, and its frames one by one. The file must stay as it is while the
/// series is in use.
#[derive(Debug)]
pub struct Series {
    path: PathBuf,
    layout: Layout,
    info: VolumeInfo,
    labels: LabelTable,
    content_hashes: Vec<u128>,
    /// Chunks of all frames, by chunk and then by frame.
    chunks: Vec<Chunk>,
    /// The frame of each chunk.
    of_frame: Vec<u32>,
    boxes: u64,
}

impl Series {
    /// Opens a time series.
    ///
    /// # Errors
    /// As [`CompressedVolume::open`]; [`crate::Error::Caller`] for a file that is no time series.
    pub fn open(path: &Path, job: &Job) -> Result<Self> {
        from_path(path, |file, file_bytes| Self::read(file, file_bytes, path, job))
    }

    pub(super) fn read(
        file: &mut (impl Read + Seek),
        file_bytes: u64,
        path: &Path,
        job: &Job,
    ) -> std::result::Result<Self, Stop> {
        let layout = read_layout(file, file_bytes)?;
        if layout.frames == 1 {
            let what = format!("{}: the file has one volume, and no time steps", path.display());
            return Err(crate::Error::Caller(what).into());
        }
        const NAMES: [&[u8; 4]; 9] =
            [b"INFO", b"FRAM", b"LIDS", b"LVOX", b"LTYP", b"LCON", b"LCOL", b"CHNK", b"PIEC"];
        let is_wanted = |entry: &Entry| entry.chunk.is_none() && NAMES.contains(&&entry.name);
        let mut sections = read_sections_if(file, None, &layout, is_wanted, job)?;
        let (info, names) = info_of(&mut sections)?;
        let content_hashes = sections.elements(b"FRAM", u128::from_le_bytes)?;
        if content_hashes.len() != layout.frames as usize {
            let what = format!("frames: expected {}, got {}", layout.frames, content_hashes.len());
            return Err(sections.fault(*b"FRAM", what));
        }
        let mut head = CompressedVolume::empty(info);
        head.labels = table_of(&mut sections, names)?;
        head.labels.contacts = Contacts { bytes: sections.take(b"LCON")?, pairs: 0 };
        check::check_head(&head).map_err(|(section, what)| sections.fault(section, what))?;
        sections.unpack_contacts(&mut head)?;

        let voxels = layout.contents == Contents::Voxels;
        let table = match voxels {
            true => b"PIEC",
            false => b"CHNK",
        };
        let (of_frame, chunks): (Vec<u32>, Vec<Chunk>) = if voxels {
            let place = |b: [u8; 16]| {
                let mut entry = [0; 40];
                entry[..16].copy_from_slice(&b);
                chunk_of(entry)
            };
            sections.elements(table, place)?.into_iter().unzip()
        } else {
            sections.elements(table, chunk_of)?.into_iter().unzip()
        };
        sections.expect_none_left()?;
        let boxes = boxes_in(&layout);
        check_chunks(&chunks, &of_frame, layout.frames, head.info.dims, (!voxels).then_some(boxes))
            .map_err(|what| sections.fault(*table, what))?;
        let CompressedVolume { info, labels, .. } = head;
        Ok(Self { path: path.to_owned(), layout, info, labels, content_hashes, chunks, of_frame, boxes })
    }

    /// Size, label type, matrix and names, which all frames have in common.
    pub fn info(&self) -> &VolumeInfo {
        &self.info
    }

    /// The labels of all frames; their numbers of voxels are those of all frames together, and labels touch that do so at some frame.
    pub fn labels(&self) -> &LabelTable {
        &self.labels
    }

    /// Number of frames, at least 2.
    pub fn frames(&self) -> u32 {
        self.layout.frames
    }

    /// Number of boxes of all frames; 0 in a file of voxels, which has none.
    pub fn boxes(&self) -> u64 {
        self.boxes
    }

    /// Content hash of the whole series.
    pub fn content_hash(&self) -> u128 {
        self.layout.content_hash
    }

    /// Bytes of the file by what they hold: `nodes`, which the frames share, `boxes`, `voxels`, and `labels` with everything else.
    pub fn stored_parts(&self) -> [(&'static str, u64); 4] {
        let mut parts = [("nodes", 0), ("boxes", 0), ("voxels", 0), ("labels", 0)];
        for entry in &self.layout.entries {
            let part = match &entry.name {
                b"NODE" | b"OCCU" | b"CLAS" | b"REFS" | b"SLCR" | b"FLDS" | b"LEAF" | b"SLIC" | b"RARE" => 0,
                b"BOXS" | b"BCEL" | b"BNOD" | b"RUNS" | b"RVOX" => 1,
                b"VOXL" => 2,
                _ => 3,
            };
            parts[part].1 += entry.stored;
        }
        parts
    }

    /// Reads a frame, counted from 0.
    ///
    /// # Errors
    /// As [`CompressedVolume::open`]; [`crate::Error::Caller`] for a frame that the series does not have.
    pub fn frame(&self, frame: u32, job: &Job) -> Result<CompressedVolume> {
        self.frame_of(frame, None::<fn(&LabelTable) -> Vec<bool>>, job)
    }

    /// Reads the labels of a frame that `choose` marks, by dense index, as [`CompressedVolume::open_labels`] does. It sees the voxels that
    /// labels have at this frame. A file of voxels is read with all labels of the frame.
    ///
    /// # Errors
    /// As [`Series::frame`].
    pub fn frame_labels(
        &self,
        frame: u32,
        choose: impl FnOnce(&LabelTable) -> Vec<bool>,
        job: &Job,
    ) -> Result<CompressedVolume> {
        self.frame_of(frame, Some(choose), job)
    }

    /// Reads a frame for drawing from disk, as [`CompressedVolume::open_paged`] does: one chunk of the frame is in memory at a time. Of a file
    /// of voxels all of the frame is.
    ///
    /// # Errors
    /// As [`Series::frame`] and [`CompressedVolume::open_paged`].
    pub fn frame_paged(
        &self,
        frame: u32,
        page_voxels: u32,
        folder: &Path,
        memory: &Arc<Residency>,
        job: &Job,
    ) -> Result<CompressedVolume> {
        check_side(page_voxels)?;
        self.check_frame(frame)?;
        if self.layout.contents == Contents::Voxels {
            return divided(self.frame(frame, job)?, page_voxels, folder, memory, job);
        }
        from_path(&self.path, |file, _| {
            let own = self.chunks_of(frame);
            job.begin(own.len() as u64);
            let mut volume = self.without_boxes();
            volume.frame = Some(FrameOf { number: frame, frames: self.frames() });
            let mut pages = Pages::new(&volume.info, page_voxels, folder, Arc::clone(memory));
            for &c in &own {
                job.check()?;
                let (mut chunk, faults) =
                    self.pick_frame(file, &[c], None::<fn(&LabelTable) -> Vec<bool>>, job)?;
                chunk.frame = volume.frame;
                let mut counts = vec![0; self.labels.len()];
                check::check_chunk(&chunk, |label, voxels| counts[label as usize] += voxels)
                    .and_then(|()| check::check_counts(&chunk, &counts))
                    .map_err(|(section, what)| faults.fault_in(section, c as u32, &what))?;
                for (all, of_chunk) in volume.labels.voxels.iter_mut().zip(counts) {
                    *all = all.saturating_add(of_chunk);
                }
                pages.add_chunk(&chunk, job)?;
            }
            volume.hash = self.content_hashes[frame as usize].into();
            volume.pages = Some(Arc::new(pages));
            Ok(volume)
        })
    }

    fn frame_of(
        &self,
        frame: u32,
        choose: Option<impl FnOnce(&LabelTable) -> Vec<bool>>,
        job: &Job,
    ) -> Result<CompressedVolume> {
        self.check_frame(frame)?;
        from_path(&self.path, |file, _| self.read_frame(file, frame, choose, true, job))
    }

    fn check_frame(&self, frame: u32) -> Result<()> {
        if frame < self.frames() {
            return Ok(());
        }
        let (path, frames) = (self.path.display(), self.frames());
        Err(crate::Error::Caller(format!(
            "{path}: --time-step {frame} is out of range, counted from 0; the number of time steps is {frames}: 0 to {}",
            frames - 1
        )))
    }

    /// The entries of the table of chunks that are of a frame.
    fn chunks_of(&self, frame: u32) -> Vec<usize> {
        (0..self.chunks.len()).filter(|&c| self.of_frame[c] == frame).collect()
    }

    /// Reads a frame. `check_hash` is false only in tests that want to reach the code behind the hash check.
    pub(super) fn read_frame(
        &self,
        file: &mut (impl Read + Seek),
        frame: u32,
        choose: Option<impl FnOnce(&LabelTable) -> Vec<bool>>,
        check_hash: bool,
        job: &Job,
    ) -> std::result::Result<CompressedVolume, Stop> {
        let own = self.chunks_of(frame);
        job.begin(own.len() as u64);
        let is_chosen = choose.is_some();
        let (mut volume, faults) = match self.layout.contents {
            Contents::Voxels => self.decode_frame(file, &own, job)?,
            // (A part has been refused with its layout.)
            Contents::Boxes | Contents::Part => self.pick_frame(file, &own, choose, job)?,
        };
        volume.frame = Some(FrameOf { number: frame, frames: self.frames() });
        check::check(&volume).map_err(|(section, what)| faults.fault(section, what))?;
        let expected = self.content_hashes[frame as usize];
        if is_chosen && self.layout.contents == Contents::Boxes {
            volume.hash = expected.into();
        } else if check_hash && volume.content_hash() != expected {
            let got = volume.content_hash();
            let what = format!("frame {frame}: content hash: expected {expected:032x}, got {got:032x}");
            return Err(faults.fault(*b"FRAM", what));
        }
        Ok(volume)
    }

    /// A frame without boxes and without numbers of voxels.
    fn without_boxes(&self) -> CompressedVolume {
        let mut volume = CompressedVolume::empty(self.info.clone());
        volume.labels = self.labels.clone();
        volume.labels.voxels = vec![0; self.labels.len()];
        volume
    }

    /// The frames of the chunk of entry `c` of the table up to that one.
    fn frames_before(&self, c: usize) -> std::ops::Range<usize> {
        let origin = self.chunks[c].origin;
        let before = self.chunks[..c].iter().rev().take_while(|chunk| chunk.origin == origin).count();
        c - before..c + 1
    }

    /// Reads the boxes of these entries of the table of chunks with their nodes.
    fn pick_frame(
        &self,
        file: &mut (impl Read + Seek),
        own: &[usize],
        choose: Option<impl FnOnce(&LabelTable) -> Vec<bool>>,
        job: &Job,
    ) -> std::result::Result<(CompressedVolume, Sections), Stop> {
        let mut needed: BTreeSet<([u8; 4], u32)> = BTreeSet::new();
        for &c in own {
            let first = self.frames_before(c).start as u32;
            needed.extend([*b"RUNS", *b"RVOX"].map(|name| (name, c as u32)));
            needed.extend([*b"LEAF", *b"SLIC", *b"RARE"].map(|name| (name, first)));
        }
        let is_needed = |e: &Entry| e.chunk.is_some_and(|chunk| needed.contains(&(e.name, chunk)));
        size_limits::check_memory(self.layout.entries.iter().filter(|e| is_needed(e)))?;
        let mut sections = read_sections_if(file, None, &self.layout, is_needed, job)?;

        let mut volume = self.without_boxes();
        let (mut all_runs, mut leaves) = (Vec::new(), Vec::new());
        for &c in own {
            let (runs, voxels) = self.runs_of(&mut sections, c)?;
            for (run, more) in runs.iter().zip(voxels) {
                let of_label = &mut volume.labels.voxels[run.label as usize];
                *of_label = of_label.saturating_add(more);
            }
            all_runs.push(runs);
            // Of this chunk alone; it was not read for another entry, because a frame has a chunk once.
            let of_chunk = leaves_of(&mut sections, self.frames_before(c).start as u32)?;
            check::check_leaves(&of_chunk)
                .map_err(|(section, what)| sections.fault_in(section, c as u32, &what))?;
            leaves.push(of_chunk);
        }
        volume.held = choose.map(|choose| {
            let mut held = choose(&volume.labels);
            held.resize(volume.labels.len(), false);
            held
        });

        let of_chunks = OfChunks::of(&self.layout);
        let plain = self.layout.entry(b"NODE").is_some();
        let (mut records, mut nodes) = (Vec::new(), Vec::new());
        for ((&c, runs), leaves) in own.iter().zip(&all_runs).zip(&leaves) {
            let chunk = &self.chunks[c];
            let end = self.chunks.get(c + 1).map_or(self.boxes, |next| next.first_box);
            let mut wanted: Vec<Wanted> = Vec::new();
            for (r, run) in runs.iter().enumerate() {
                let until = runs.get(r + 1).map_or(end, |next| chunk.first_box + u64::from(next.first_box));
                if volume.holds(run.label) {
                    let boxes = chunk.first_box + u64::from(run.first_box)..until;
                    wanted.push(Wanted { chunk: c, label: run.label, boxes });
                }
            }
            if wanted.is_empty() {
                continue;
            }
            let picked = if plain {
                // The nodes of the chunk end where those of the next one begin.
                let behind = self.chunks[c..].iter().find(|next| next.origin != chunk.origin);
                let end = behind.map(|next| next.node_base);
                pick_plain(file, &self.layout, chunk, end, leaves, &wanted, job)?
            } else {
                let frames = self.frames_before(c);
                let frames = frames.start as u32..frames.end as u32;
                pick_packed(file, &of_chunks, frames, chunk, leaves, &wanted, job)?
            };
            put_together(&mut volume, &mut records, &mut nodes, chunk, leaves, &wanted, &picked)
                .map_err(|(section, what)| sections.fault_in(section, c as u32, &what))?;
            job.advance(1);
        }
        (volume.boxes, volume.nodes) = (records.into(), nodes.into());
        Ok((volume, sections))
    }

    /// The runs of an entry of the table of chunks, checked, and the voxels of each.
    fn runs_of(
        &self,
        sections: &mut Sections,
        c: usize,
    ) -> std::result::Result<(Vec<crate::LabelRun>, Vec<u64>), Stop> {
        let number = c as u32;
        let runs = runs_of(sections, number)?;
        let voxels = sections.elements_of(b"RVOX", Some(number), u64::from_le_bytes)?;
        let next = self.chunks.get(c + 1);
        let boxes = next.map_or(self.boxes, |n| n.first_box) - self.chunks[c].first_box;
        let count = next.map_or(runs.len() as u64, |n| n.first_run - self.chunks[c].first_run);
        let rises = runs.is_sorted_by(|a, b| a.label < b.label && a.first_box < b.first_box)
            && runs.first().is_some_and(|run| run.first_box == 0)
            && runs.last().is_some_and(|run| {
                u64::from(run.first_box) < boxes && (run.label as usize) < self.labels.len()
            });
        if !rises || count != runs.len() as u64 {
            let labels = self.labels.len();
            let what = format!(
                "expected {count} runs with rising labels below {labels} and boxes below {boxes}, got others"
            );
            return Err(sections.fault_in(*b"RUNS", number, &what));
        }
        if voxels.len() != runs.len() {
            let what = format!("expected {} numbers of voxels, got {}", runs.len(), voxels.len());
            return Err(sections.fault_in(*b"RVOX", number, &what));
        }
        Ok((runs, voxels))
    }

    /// Decodes the voxels of these entries of the table of chunks.
    fn decode_frame(
        &self,
        file: &mut (impl Read + Seek),
        own: &[usize],
        job: &Job,
    ) -> std::result::Result<(CompressedVolume, Sections), Stop> {
        let is_needed = |e: &Entry| {
            e.name == *b"VOXL" && e.chunk.is_some_and(|c| own.binary_search(&(c as usize)).is_ok())
        };
        size_limits::check_memory(self.layout.entries.iter().filter(|e| is_needed(e)))?;
        let mut sections = read_sections_if(file, None, &self.layout, is_needed, job)?;
        let mut streams = Vec::new();
        for &c in own {
            streams.push((self.chunks[c].origin, sections.take_of(b"VOXL", Some(c as u32))?));
        }
        let number = self.labels.len() as u32;
        let made = voxel_pieces::decode(self.info.clone(), streams, number, &sections, job)?;
        // In the decoded volume, the id of each label is its dense index plus 1.
        let mut volume = self.without_boxes();
        let label = |of_made: u32| (made.labels.ids[of_made as usize] - 1) as u32;
        for (i, &voxels) in (0..).zip(&made.labels.voxels) {
            volume.labels.voxels[label(i) as usize] = voxels;
        }
        let runs = made.runs.iter().map(|run| crate::LabelRun { label: label(run.label), ..*run });
        volume.runs = runs.collect();
        let CompressedVolume { chunks, boxes, nodes, leaves, .. } = made;
        (volume.chunks, volume.boxes, volume.nodes, volume.leaves) = (chunks, boxes, nodes, leaves);
        Ok((volume, sections))
    }
}

/// Number of boxes that a file of boxes has.
fn boxes_in(layout: &Layout) -> u64 {
    match layout.entry(b"BOXS") {
        Some(entry) => entry.decoded / 8,
        None => {
            let of_chunks = layout.entries.iter().filter(|e| e.name == *b"BCEL");
            of_chunks.fold(0, |sum, e| sum.saturating_add(e.decoded / 3))
        }
    }
}

/// Checks the order and the bounds of a table of chunks. `boxes` is the number of all boxes; none in a file of voxels.
fn check_chunks(
    chunks: &[Chunk],
    of_frame: &[u32],
    frames: u32,
    dims: [u32; 3],
    boxes: Option<u64>,
) -> std::result::Result<(), String> {
    if u32::try_from(chunks.len()).is_err() {
        return Err(format!("chunks: expected below 2^32, got {}", chunks.len()));
    }
    let mut before: Option<((u64, u32), &Chunk)> = None;
    for (i, (chunk, &frame)) in chunks.iter().zip(of_frame).enumerate() {
        let origin = chunk.origin;
        let inside = (0..3).all(|a| origin[a].is_multiple_of(CHUNK_VOXELS) && origin[a] < dims[a]);
        if !inside || frame >= frames {
            return Err(format!(
                "chunk {i}: expected an origin in {dims:?} voxels and a frame below {frames}, got {origin:?}, {frame}"
            ));
        }
        let place = (morton::encode(origin.map(|o| o / 4)) / CHUNK_CELLS, frame);
        let rises = match before {
            None => chunk.first_box == 0 && chunk.first_run == 0 && chunk.node_base == 0,
            Some((last, other)) => {
                let nodes = match last.0 == place.0 {
                    true => chunk.node_base == other.node_base,
                    false => boxes.is_none() || chunk.node_base > other.node_base,
                };
                let starts = chunk.first_box > other.first_box && chunk.first_run > other.first_run;
                place > last && nodes && (boxes.is_none() || starts)
            }
        };
        if !rises || boxes.is_some_and(|boxes| chunk.first_box >= boxes) {
            return Err(format!(
                "chunk {i}: expected a place, a frame and starts after the chunk before, got frame {frame} of {origin:?}"
            ));
        }
        before = Some((place, chunk));
    }
    Ok(())
}

impl CompressedVolume {
    /// Reads one frame of a `.pumice` file of a time series, counted from 0 ([`Series::frame`]).
    ///
    /// # Errors
    /// As [`Series::open`] and [`Series::frame`].
    pub fn open_frame(path: &Path, frame: u32, job: &Job) -> Result<Self> {
        Series::open(path, job)?.frame(frame, job)
    }
}
