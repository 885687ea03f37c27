//! Writes a volume to a file.

use std::borrow::Cow;
use std::io::Write;
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use super::layout::{Contents, ENTRY_BYTES, Encoding, Entry, HEADER_BYTES, Layout, align};
use super::{codec, nodes, voxel_pieces};
use crate::{Chunk, CompressedVolume, Error, Job, Result, VolumeInfo, WrittenFile};

/// How much time to spend to make the file small. All levels store the same volume.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CompressionLevel {
    /// Arrays as they are in memory: the largest file, with nothing to decode.
    Fast,
    /// zstd level 9 over streams.
    #[default]
    Default,
    /// The voxels that the volume was made from, with arithmetic coding: a third of the size of `Default`. Writing and opening process
    /// every voxel and take a second or two for each 10⁸ voxels.
    Small,
}

impl CompressionLevel {
    pub(super) fn zstd(self) -> i32 {
        match self {
            Self::Fast => 0,
            Self::Default => 9,
            // For the sections beside the voxels: ids and names.
            Self::Small => 19,
        }
    }
}

/// The section `INFO`, as JSON.
#[derive(Serialize)]
struct Info<'a> {
    volume: &'a VolumeInfo,
    types: &'a [String],
    /// Names of the columns of `LCOL`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    columns: Vec<&'a str>,
}

impl CompressedVolume {
    /// Writes the volume to a `.pumice` file. An existing file is replaced only once all of the new one is on disk.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Cancelled`], and [`Error::Caller`] where the volume holds chosen labels only. After an error there is no
    /// new file.
    pub fn save(&self, path: &Path, level: CompressionLevel, job: &Job) -> Result<()> {
        if !self.is_whole() {
            let path = path.display();
            let what = "only chosen labels were read of this volume; open all of it to save it";
            return Err(Error::Caller(format!("{path}: {what}")));
        }
        self.require_boxes("a file of it")?;
        if let Some(crate::FrameOf { number, .. }) = self.frame {
            let path = path.display();
            let what = format!(
                "the volume is time step {number} of a series, with the labels of all its time steps"
            );
            return Err(Error::Caller(format!(
                "{path}: {what}; write it in another format, and compress that"
            )));
        }
        let io = |source| Error::Io { path: path.to_owned(), source };
        // The temporary file comes first, so that a missing folder or permission shows before the work is done.
        let written = WrittenFile::for_place(path, |file| {
            let (layout, sections) = self.encode_sections(level, job)?;
            let mut written = 0u64;
            let mut put = |bytes: &[u8]| -> Result<()> {
                for piece in bytes.chunks(1 << 20) {
                    job.check()?;
                    file.write_all(piece).map_err(io)?;
                }
                written += bytes.len() as u64;
                file.write_all(&[0; 8][..(align(written) - written) as usize]).map_err(io)?;
                written = align(written);
                Ok(())
            };
            put(&layout.to_bytes())?;
            sections.iter().try_for_each(|bytes| put(bytes))
        })?;
        job.check()?;
        Ok(written.appear(path)?)
    }

    /// Encodes the sections; returns them with the header and table that describe them.
    pub(super) fn encode_sections(
        &self,
        level: CompressionLevel,
        job: &Job,
    ) -> Result<(Layout, Vec<Vec<u8>>)> {
        let head = head_sections(self, level, None)?;
        let number = |chunk: usize| chunk as u32;
        let streams: Vec<nodes::Streams> = match level {
            CompressionLevel::Default => (0..self.chunks.len())
                .into_par_iter()
                .map(|c| {
                    let nodes = &self.nodes[self.node_range(c)];
                    nodes::split(&self.boxes[self.box_range(c)], nodes, &self.leaves[c])
                })
                .collect(),
            CompressionLevel::Fast | CompressionLevel::Small => Vec::new(),
        };
        let voxels = match level {
            CompressionLevel::Small => voxel_pieces::encode(self, job)?,
            CompressionLevel::Fast | CompressionLevel::Default => Vec::new(),
        };

        // Name, chunk, bytes and filters of each section.
        type Plan<'a> = ([u8; 4], Option<u32>, &'a [u8], Filters);
        let mut plan: Vec<Plan<'_>> =
            head.iter().map(|(name, bytes, filters)| (*name, None, &bytes[..], *filters)).collect();
        if level == CompressionLevel::Small {
            let of_chunk = |(c, voxels)| (*b"VOXL", Some(number(c)), voxels, PLAIN);
            plan.extend(voxels.iter().map(Vec::as_slice).enumerate().map(of_chunk));
        } else {
            if level == CompressionLevel::Fast {
                plan.extend([
                    (*b"BOXS", None, bytemuck::cast_slice(&self.boxes), PLAIN),
                    (*b"NODE", None, bytemuck::cast_slice(&self.nodes), PLAIN),
                ]);
            }
            for (c, leaves) in self.leaves.iter().enumerate() {
                let (chunk, runs) = (Some(number(c)), &self.runs[self.run_range(c)]);
                plan.extend([
                    (*b"RUNS", chunk, bytemuck::cast_slice(runs), (8, true, true)),
                    (*b"LEAF", chunk, bytemuck::cast_slice(&leaves.patterns), (8, false, true)),
                    (*b"SLIC", chunk, bytemuck::cast_slice(&leaves.slices), PLAIN),
                    (*b"RARE", chunk, bytemuck::cast_slice(&leaves.rare), (8, true, true)),
                ]);
                if let Some(streams) = streams.get(c) {
                    plan.extend([
                        (*b"BCEL", chunk, &streams.cells[..], (3, true, true)),
                        (*b"BNOD", chunk, &streams.backs, PLAIN),
                        (*b"OCCU", chunk, &streams.occupied, PLAIN),
                        (*b"CLAS", chunk, &streams.classes, PLAIN),
                        (*b"REFS", chunk, &streams.references[0], PLAIN),
                        (*b"SLCR", chunk, &streams.references[1], PLAIN),
                        (*b"FLDS", chunk, &streams.references[2], PLAIN),
                    ]);
                }
            }
        }
        job.begin(plan.iter().map(|p| p.2.len() as u64).sum());
        let sections: Vec<(Entry, Vec<u8>)> = plan
            .into_par_iter()
            .map(|(name, chunk, bytes, filters)| {
                let encoding = encoding_of(name, filters, level);
                let stored = codec::encode(bytes, encoding, level.zstd(), job)?;
                job.advance(bytes.len() as u64);
                Ok((Entry::of_stored(name, chunk, encoding, &stored, bytes.len() as u64), stored))
            })
            .collect::<Result<_>>()?;

        let (mut entries, sections): (Vec<Entry>, Vec<Vec<u8>>) = sections.into_iter().unzip();
        let mut end = (HEADER_BYTES + ENTRY_BYTES * entries.len()) as u64;
        for entry in &mut entries {
            entry.offset = align(end);
            end = entry.offset + entry.stored;
        }
        let contents = if level == CompressionLevel::Small { Contents::Voxels } else { Contents::Boxes };
        let content_hash = self.content_hash();
        Ok((Layout { contents, frames: 1, file_bytes: align(end), content_hash, entries }, sections))
    }
}

/// Filters of a section: width of its elements in bytes, delta, planes.
pub(super) type Filters = (u8, bool, bool);

/// No filters.
pub(super) const PLAIN: Filters = (1, false, false);

/// How a section is encoded at a level.
pub(super) fn encoding_of(
    name: [u8; 4],
    (width, delta, planes): Filters,
    level: CompressionLevel,
) -> Encoding {
    // Coded voxels and hashes cannot be compressed any further.
    let packed = level != CompressionLevel::Fast && ![*b"VOXL", *b"FRAM"].contains(&name);
    Encoding { zstd: packed, width, delta: packed && delta, planes: packed && planes }
}

/// A section of the volume, not encoded: its name, its bytes and its filters.
pub(super) type HeadSection<'a> = ([u8; 4], Cow<'a, [u8]>, Filters);

/// What a file of a time series says beside the volume.
pub(super) struct Frames {
    /// The frame of each chunk of the volume.
    pub(super) of_chunk: Vec<u32>,
    /// Content hash of each frame.
    pub(super) content_hashes: Vec<u128>,
}

/// The sections of a volume as a whole, apart from boxes and nodes. Of a time series it has the chunks of all frames.
pub(super) fn head_sections<'v>(
    volume: &'v CompressedVolume,
    level: CompressionLevel,
    series: Option<&Frames>,
) -> Result<Vec<HeadSection<'v>>> {
    let labels = &volume.labels;
    let columns = labels.columns.iter().map(|c| c.name.as_str()).collect();
    let info = Info { volume: &volume.info, types: &labels.type_names, columns };
    let info = serde_json::to_vec(&info)
        .map_err(|e| Error::Caller(format!("the volume's notes cannot be written as JSON: {e}")))?;
    let mut sections: Vec<HeadSection<'_>> = vec![
        (*b"INFO", info.into(), PLAIN),
        (*b"LIDS", bytemuck::cast_slice(&labels.ids).into(), (8, true, true)),
        (*b"LTYP", bytemuck::cast_slice(&labels.types).into(), PLAIN),
    ];
    // Volumes without columns of numbers have no such section.
    if !labels.columns.is_empty() {
        let numbers: Vec<u8> =
            labels.columns.iter().flat_map(|c| &c.values).flat_map(|v| v.to_le_bytes()).collect();
        sections.push((*b"LCOL", numbers.into(), (8, false, true)));
    }
    if let Some(series) = series {
        let hashes = series.content_hashes.iter().flat_map(|hash| hash.to_le_bytes());
        sections.push((*b"FRAM", hashes.collect::<Vec<u8>>().into(), PLAIN));
    }
    let frame = |c: usize| series.map_or(0, |series| series.of_chunk[c]);
    let origin = |(c, chunk): (usize, &Chunk)| {
        chunk.origin.into_iter().chain([frame(c)]).flat_map(u32::to_le_bytes).collect::<Vec<u8>>()
    };
    let whole_table: [HeadSection<'_>; 2] = [
        (*b"LVOX", bytemuck::cast_slice(&labels.voxels).into(), (8, false, true)),
        (*b"LCON", (&labels.contacts.bytes[..]).into(), PLAIN),
    ];
    if level == CompressionLevel::Small {
        // The table of all frames follows from no frame alone.
        if series.is_some() {
            sections.extend(whole_table);
        }
        let pieces: Vec<u8> = volume.chunks.iter().enumerate().flat_map(origin).collect();
        sections.push((*b"PIEC", pieces.into(), PLAIN));
        return Ok(sections);
    }
    let chunk = |(c, chunk): (usize, &Chunk)| {
        let starts = [chunk.first_box, chunk.first_run, chunk.node_base];
        let starts = starts.into_iter().flat_map(u64::to_le_bytes);
        origin((c, chunk)).into_iter().chain(starts).collect::<Vec<u8>>()
    };
    let chunks: Vec<u8> = volume.chunks.iter().enumerate().flat_map(chunk).collect();
    sections.extend(whole_table);
    sections.push((*b"CHNK", chunks.into(), PLAIN));
    Ok(sections)
}
