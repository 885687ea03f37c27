//! Writes a volume to a file while it is compressed: what is finished of a chunk goes to disk, and memory holds one chunk at a time.
//!
//! ```text
//! finished chunk ─► its sections, encoded ─► body (scratch file)
//!                └► plain form: boxes, nodes ─► scratch file
//! at the end:       header, table, sections of the volume, [boxes, nodes,] body ─► the file, under a temporary name until it is whole
//! ```
//! The bytes are those that [`CompressedVolume::save`] writes of the same volume.

use std::io::Write;
use std::path::Path;

use xxhash_rust::xxh3::Xxh3;

use super::codec;
use super::layout::{Contents, ENTRY_BYTES, Encoding, Entry, HEADER_BYTES, Layout, align, section_checksum};
use super::nodes::{REFERENCES, Splitter};
use super::part::PartHead;
use super::part_chunk::FrameOfChunk;
use super::slices::SLAB;
use super::voxel_coder::VoxelEncoder;
use super::voxel_pieces::piece_dims;
use super::write::{Filters, Frames, PLAIN, head_sections};
use crate::chunk_boxes::ChunkBoxes;
use crate::chunk_nodes::{ChunkNodes, NodeWriter};
use crate::content_hash::of_frames;
use crate::finish::{Budget, ChunkSink, Finished, Known, finish};
use crate::layers::{Layers, SIDE};
use crate::reserve::{make_room, zeroed};
use crate::spool::{Scratch, Spool};
use crate::store::StoredParts;
use crate::{
    Chunk, CompressedVolume, CompressionLevel, Error, Job, LabelRun, Leaves, Result, VolumeInfo, WrittenFile,
};

/// What was written, and what it takes in memory once it is opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WrittenVolume {
    /// Voxels along x, y, z.
    pub dims: [u32; 3],
    /// Number of labels, without the background.
    pub labels: u64,
    /// Number of frames: 1, or those of a time series.
    pub frames: u32,
    /// Number of boxes, of all frames.
    pub boxes: u64,
    /// Bytes of the volume in memory; of a time series, of all frames together.
    pub bytes_volume: u64,
    /// Bytes of the file.
    pub bytes_disk: u64,
}

/// Bytes that are copied or compressed at once; the same as where a section is in memory, so that zstd gives the same bytes.
const PIECE: usize = codec::PIECE;

/// Takes chunks and encodes their sections.
pub(super) struct FileSink<'a> {
    pub(super) level: CompressionLevel,
    dims: [u32; 3],
    labels: u32,
    /// Sections of chunks, each at a multiple of 8; the offsets of `entries` count from the first.
    body: Spool<'a>,
    entries: Vec<Entry>,
    boxes: Spool<'a>,
    nodes: Spool<'a>,
    chunks: Vec<Chunk>,
    /// The frame of each of `chunks`.
    frames: Vec<u32>,
    /// Whether there are several frames.
    is_series: bool,
    boxes_so_far: u64,
    runs_so_far: u64,
    words: u64,
    /// Bytes of the chunks' leaves in memory.
    leaves_bytes: u64,
    scratch: &'a Scratch,
    stream_bytes: u64,
}

/// Appends to the body what an encoder writes.
struct ToBody<'s, 'a> {
    body: &'s mut Spool<'a>,
    hash: Xxh3,
    failure: Option<Error>,
}

impl Write for ToBody<'_, '_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.hash.update(bytes);
        match self.body.write(bytes) {
            Ok(()) => Ok(bytes.len()),
            Err(error) => {
                self.failure = Some(error);
                Err(std::io::ErrorKind::Other.into())
            }
        }
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl<'a> FileSink<'a> {
    /// No chunks yet, of a volume of `dims` voxels with so many frames and labels.
    pub(super) fn new(
        level: CompressionLevel,
        dims: [u32; 3],
        frames: u32,
        labels: u32,
        scratch: &'a Scratch,
        budget: &Budget,
    ) -> Self {
        let spool = || Spool::new(scratch, budget.share(32));
        Self {
            level,
            dims,
            labels,
            body: spool(),
            entries: Vec::new(),
            boxes: spool(),
            nodes: spool(),
            chunks: Vec::new(),
            frames: Vec::new(),
            is_series: frames > 1,
            boxes_so_far: 0,
            runs_so_far: 0,
            words: 0,
            leaves_bytes: 0,
            scratch,
            stream_bytes: budget.share(64),
        }
    }

    /// Begins the chunk at this voxel at a frame: the sections that follow are its own. Its nodes begin at word `node_base`.
    pub(super) fn begin(&mut self, origin: [u32; 3], frame: u32, node_base: u64) -> Result<()> {
        make_room(&mut self.chunks, 1, "a list of the chunks")?;
        self.chunks.push(Chunk {
            origin,
            first_box: self.boxes_so_far,
            first_run: self.runs_so_far,
            node_base,
        });
        make_room(&mut self.frames, 1, "a list of the chunks")?;
        self.frames.push(frame);
        Ok(())
    }

    /// Words of the nodes of all chunks so far.
    pub(super) fn words(&self) -> u64 {
        self.words
    }

    /// Ends a chunk at a frame. The level `fast` has its boxes and nodes, as they are, for the volume's sections.
    pub(super) fn end_frame(&mut self, of_frame: &FrameOfChunk<'_>) -> Result<()> {
        let volume = of_frame.volume;
        if self.level == CompressionLevel::Fast {
            self.boxes.write(bytemuck::cast_slice(&volume.boxes))?;
            self.nodes.write(bytemuck::cast_slice(&volume.nodes[of_frame.words.clone()]))?;
        }
        self.boxes_so_far += volume.boxes.len() as u64;
        self.runs_so_far += volume.runs.len() as u64;
        self.words += of_frame.words.len() as u64;
        if of_frame.is_first {
            self.leaves_bytes += volume.leaves.iter().map(Leaves::bytes).sum::<u64>();
        }
        Ok(())
    }

    /// Encodes the runs of the last chunk and, in a time series, the number of voxels of each.
    pub(super) fn run_sections(&mut self, runs: &[LabelRun], voxels: &[u64], job: &Job) -> Result<()> {
        self.section(*b"RUNS", bytemuck::cast_slice(runs), (8, true, true), job)?;
        if self.is_series {
            self.section(*b"RVOX", bytemuck::cast_slice(voxels), (8, false, true), job)?;
        }
        Ok(())
    }

    /// Encodes the leaves of the last chunk.
    pub(super) fn leaf_sections(&mut self, leaves: &Leaves, job: &Job) -> Result<()> {
        self.section(*b"LEAF", bytemuck::cast_slice(leaves.patterns()), (8, false, true), job)?;
        self.section(*b"SLIC", bytemuck::cast_slice(leaves.slices()), PLAIN, job)?;
        self.section(*b"RARE", bytemuck::cast_slice(leaves.rare()), (8, true, true), job)
    }

    /// Appends a section of the last chunk that another file has in the same form. `read` fills pieces with its bytes in turn.
    ///
    /// # Errors
    /// Those of `read`; `None` within where the bytes have another checksum than the entry says.
    pub(super) fn stored_section(
        &mut self,
        entry: &Entry,
        mut read: impl FnMut(&mut [u8]) -> Result<()>,
    ) -> Result<Option<()>> {
        let (offset, mut left, mut hash) = (self.body.len(), entry.stored, Xxh3::new());
        let mut piece = zeroed(left.min(PIECE as u64) as usize, "a section of the file")?;
        while left > 0 {
            let piece = &mut piece[..left.min(PIECE as u64) as usize];
            read(piece)?;
            hash.update(piece);
            self.body.write(piece)?;
            left -= piece.len() as u64;
        }
        if hash.digest() != entry.checksum {
            return Ok(None);
        }
        self.entries.push(Entry { chunk: Some(self.chunks.len() as u32 - 1), offset, ..*entry });
        self.pad()?;
        Ok(Some(()))
    }

    fn pad(&mut self) -> Result<()> {
        let end = self.body.len();
        self.body.write(&[0; 8][..(align(end) - end) as usize])
    }

    /// Encodes a section of the last chunk that is in memory.
    pub(super) fn section(&mut self, name: [u8; 4], bytes: &[u8], filters: Filters, job: &Job) -> Result<()> {
        let encoding = super::write::encoding_of(name, filters, self.level);
        let stored = codec::encode(bytes, encoding, self.level.zstd(), job)?;
        let (offset, chunk) = (self.body.len(), Some(self.chunks.len() as u32 - 1));
        self.body.write(&stored)?;
        let checksum = section_checksum(&stored);
        let (stored, decoded) = (stored.len() as u64, bytes.len() as u64);
        self.entries.push(Entry { name, chunk, encoding, offset, stored, decoded, checksum });
        self.pad()
    }

    /// Encodes a section of the last chunk that need not be in memory; it has no filters.
    fn long_section(&mut self, name: [u8; 4], spool: &Spool<'_>, job: &Job) -> Result<()> {
        let encoding: Encoding = super::write::encoding_of(name, PLAIN, self.level);
        let (offset, chunk) = (self.body.len(), Some(self.chunks.len() as u32 - 1));
        let mut to = ToBody { body: &mut self.body, hash: Xxh3::new(), failure: None };
        let mut reader = spool.reader();
        let done =
            codec::encode_from(spool.len(), |piece| reader.read(piece), self.level.zstd(), &mut to, job);
        if let Some(error) = to.failure {
            return Err(error);
        }
        done?;
        let checksum = to.hash.digest();
        let stored = self.body.len() - offset;
        self.entries.push(Entry { name, chunk, encoding, offset, stored, decoded: spool.len(), checksum });
        self.pad()
    }

    /// Writes the boxes of the next frame, and the nodes that they are the first to use, as streams.
    fn streams(
        &mut self,
        boxes: &ChunkBoxes<'_>,
        writer: &mut NodeWriter<'_>,
        leaves: &Leaves,
        job: &Job,
    ) -> Result<()> {
        let (scratch, room) = (self.scratch, self.stream_bytes);
        let spool = || Spool::new(scratch, room);
        let mut cells: Vec<u8> = Vec::new();
        let [mut backs, mut occupied, mut classes] = [spool(), spool(), spool()];
        let mut references = [spool(), spool(), spool()];
        let mut splitter = Splitter::default();
        writer.frame(boxes, job, |batch| {
            make_room(&mut cells, 3 * batch.records.len(), "a list of the boxes of the volume")?;
            splitter.cells(batch.records, &mut cells);
            backs.write(bytemuck::cast_slice(batch.backs))?;
            splitter.nodes(batch.nodes, leaves);
            occupied.write(&std::mem::take(&mut splitter.occupied))?;
            classes.write(&splitter.take_classes())?;
            let written = splitter.references.iter_mut().zip(&mut references);
            written.into_iter().try_for_each(|(bytes, spool)| spool.write(&std::mem::take(bytes)))
        })?;
        classes.write(&splitter.last_classes())?;
        self.section(*b"BCEL", &cells, (3, true, true), job)?;
        drop(cells);
        for (name, spool) in [(*b"BNOD", &backs), (*b"OCCU", &occupied), (*b"CLAS", &classes)] {
            self.long_section(name, spool, job)?;
        }
        for (name, spool) in REFERENCES.into_iter().zip(&references) {
            self.long_section(*name, spool, job)?;
        }
        Ok(())
    }

    /// Codes a chunk's voxels. What is final of the stream goes to the body slab after slab.
    fn voxels(&mut self, origin: [u32; 3], layers: &Layers<'_>, job: &Job) -> Result<()> {
        let (name, offset, mut hash) = (*b"VOXL", self.body.len(), Xxh3::new());
        let encoding = super::write::encoding_of(name, PLAIN, self.level);
        let [w, h, d] = piece_dims(self.dims, origin).map(|n| n as usize);
        let mut encoder = VoxelEncoder::new([w, h], self.labels);
        let mut slab: Vec<u32> = zeroed(w * h * SLAB, "the voxels of a slab")?;
        for z in (0..d).step_by(SLAB) {
            job.check()?;
            slab.fill(0);
            let rows = layers.rows_at_once(z / SLAB)?;
            for row in (0..SIDE).step_by(rows) {
                let layer = layers.load_rows(z / SLAB, row..row + rows)?;
                for position in SIDE * row..if layer.is_empty() { 0 } else { SIDE * (row + rows) } {
                    for &(label, mut mask) in layer.at(position) {
                        let corner = 4 * (position % SIDE) + w * 4 * (position / SIDE);
                        while mask != 0 {
                            let v = mask.trailing_zeros() as usize;
                            slab[corner + (v & 3) + w * (v >> 2 & 3) + w * h * (v >> 4)] = label + 1;
                            mask &= mask - 1;
                        }
                    }
                }
            }
            slab.chunks_exact(w * h).take(d - z).for_each(|slice| encoder.slice(slice));
            let settled = encoder.take_settled();
            hash.update(&settled);
            self.body.write(&settled)?;
        }
        let rest = encoder.finish();
        hash.update(&rest);
        self.body.write(&rest)?;
        let (stored, chunk) = (self.body.len() - offset, Some(self.chunks.len() as u32 - 1));
        self.entries.push(Entry {
            name,
            chunk,
            encoding,
            offset,
            stored,
            decoded: stored,
            checksum: hash.digest(),
        });
        self.pad()
    }
}

impl ChunkSink for FileSink<'_> {
    fn layers(&mut self, boxes: &ChunkBoxes<'_>, layers: &Layers<'_>, job: &Job) -> Result<()> {
        if self.level == CompressionLevel::Small {
            let origin = boxes.cell.map(|c| 4 * c);
            self.begin(origin, boxes.frame, self.words)?;
            self.voxels(origin, layers, job)?;
        }
        Ok(())
    }

    fn chunk(&mut self, frames: &[ChunkBoxes<'_>], budget: &Budget, job: &Job) -> Result<()> {
        let chunk = ChunkNodes::new(frames, budget, job)?;
        let mut writer = chunk.writer()?;
        let node_base = self.words;
        for (i, boxes) in frames.iter().enumerate() {
            if self.level != CompressionLevel::Small {
                self.begin(boxes.cell.map(|c| 4 * c), boxes.frame, node_base)?;
                self.run_sections(&boxes.runs, &boxes.run_voxels, job)?;
                // All frames of a chunk have the leaves of the first.
                if i == 0 {
                    self.leaf_sections(&chunk.leaves, job)?;
                }
            }
            self.boxes_so_far += u64::from(boxes.count);
            self.runs_so_far += boxes.runs.len() as u64;
            let Self { boxes: plain_boxes, nodes: plain_nodes, level, .. } = self;
            match level {
                CompressionLevel::Small => writer.frame(boxes, job, |_| Ok(()))?,
                CompressionLevel::Fast => writer.frame(boxes, job, |batch| {
                    plain_boxes.write(bytemuck::cast_slice(batch.records))?;
                    plain_nodes.write(bytemuck::cast_slice(batch.nodes))
                })?,
                CompressionLevel::Default => self.streams(boxes, &mut writer, &chunk.leaves, job)?,
            }
        }
        self.words += writer.words;
        self.leaves_bytes += chunk.leaves.bytes();
        Ok(())
    }
}

/// Finishes a volume into a file, or with `part` a part of one. `describe` may give names, types and numbers to the labels of a volume that has
/// no boxes.
///
/// # Errors
/// As [`finish`]; those of `describe`; [`Error::Io`] of the file.
#[expect(clippy::too_many_arguments, reason = "each is another thing")]
pub(crate) fn finish_into_file(
    path: &Path,
    level: CompressionLevel,
    info: VolumeInfo,
    parts: StoredParts,
    known: &Known,
    budget: &Budget,
    part: Option<&PartHead>,
    describe: &mut (dyn FnMut(&mut CompressedVolume) -> Result<()> + Send),
    job: &Job,
) -> Result<WrittenVolume> {
    write_file(path, job, |file| {
        let scratch = Scratch::new(&budget.folder);
        let (dims, labels) = (info.dims, parts.ids.len() as u32);
        let mut sink = FileSink::new(level, dims, parts.frames, labels, &scratch, budget);
        let mut volume = CompressedVolume::empty(info);
        let Finished { labels, content_hashes } =
            finish(volume.info.dims, parts, known, budget, &mut sink, job)?;
        volume.labels = labels;
        describe(&mut volume)?;
        sink.write((file, path), volume, &content_hashes, part, job)
    })
}

/// Calls `write` with a temporary file, which gets its name once all of it is on disk.
///
/// # Errors
/// Those of `write`; [`Error::Io`] of the file.
pub(super) fn write_file(
    path: &Path,
    job: &Job,
    write: impl FnOnce(&mut dyn Write) -> Result<WrittenVolume>,
) -> Result<WrittenVolume> {
    let mut written_volume = None;
    // The temporary file comes first, so that a missing folder or permission shows before the work is done.
    let written = WrittenFile::for_place(path, |file| -> Result<()> {
        written_volume = Some(write(file)?);
        Ok(())
    })?;
    job.check()?;
    written.appear(path)?;
    let missing = || std::io::ErrorKind::UnexpectedEof.into();
    written_volume.ok_or_else(|| Error::Io { path: path.to_owned(), source: missing() })
}

impl FileSink<'_> {
    /// Writes all chunks and what `volume` says of them, which holds no boxes, into `file`; errors name its final path. There is a content hash
    /// for each frame. With `part`, the chunks are a part of the volume.
    pub(super) fn write(
        self,
        (file, path): (&mut dyn Write, &Path),
        mut volume: CompressedVolume,
        content_hashes: &[u128],
        part: Option<&PartHead>,
        job: &Job,
    ) -> Result<WrittenVolume> {
        let io = |source| Error::Io { path: path.to_owned(), source };
        let FileSink { level, body, mut entries, boxes, nodes, mut chunks, frames: of_chunk, .. } = self;
        let FileSink { boxes_so_far, runs_so_far, words, leaves_bytes, .. } = self;
        chunks.shrink_to_fit();
        volume.chunks = chunks;

        // The sections of the volume, then its boxes and nodes in the plain form, then those of the chunks.
        let mut head: Vec<(Entry, Vec<u8>)> = Vec::new();
        let of_part =
            part.map(|part| Ok::<_, Error>((*b"PART", part.to_json()?.into(), PLAIN))).transpose()?;
        let frames = content_hashes.len() as u32;
        let (content_hash, series) = match *content_hashes {
            [of_volume] => (of_volume, None),
            _ => {
                let content_hashes = content_hashes.to_vec();
                (of_frames(&content_hashes), Some(Frames { of_chunk, content_hashes }))
            }
        };
        for (name, bytes, filters) in
            head_sections(&volume, level, series.as_ref())?.into_iter().chain(of_part)
        {
            let encoding = super::write::encoding_of(name, filters, level);
            let stored = codec::encode(&bytes, encoding, level.zstd(), job)?;
            head.push((Entry::of_stored(name, None, encoding, &stored, bytes.len() as u64), stored));
        }
        let mut arrays: Vec<(Entry, &Spool<'_>)> = Vec::new();
        if level == CompressionLevel::Fast {
            for (name, spool) in [(*b"BOXS", &boxes), (*b"NODE", &nodes)] {
                let encoding = super::write::encoding_of(name, PLAIN, level);
                let mut hash = Xxh3::new();
                for_each_piece(spool, |piece| {
                    hash.update(piece);
                    job.check()
                })?;
                let (stored, checksum) = (spool.len(), hash.digest());
                let entry =
                    Entry { name, chunk: None, encoding, offset: 0, stored, decoded: stored, checksum };
                arrays.push((entry, spool));
            }
        }
        let count = head.len() + arrays.len() + entries.len();
        let mut end = (HEADER_BYTES + ENTRY_BYTES * count) as u64;
        let before = head.iter_mut().map(|(e, _)| e).chain(arrays.iter_mut().map(|(e, _)| e));
        for entry in before {
            entry.offset = align(end);
            end = entry.offset + entry.stored;
        }
        let first = align(end);
        for entry in &mut entries {
            entry.offset += first;
            end = entry.offset + entry.stored;
        }
        let contents = match level {
            _ if part.is_some() => Contents::Part,
            CompressionLevel::Small => Contents::Voxels,
            CompressionLevel::Fast | CompressionLevel::Default => Contents::Boxes,
        };
        let table: Vec<Entry> =
            head.iter().map(|(e, _)| *e).chain(arrays.iter().map(|(e, _)| *e)).chain(entries).collect();
        let layout = Layout { contents, frames, file_bytes: align(end), content_hash, entries: table };

        let mut written = 0u64;
        let mut put = |bytes: &[u8]| -> Result<()> {
            job.check()?;
            written += bytes.len() as u64;
            file.write_all(bytes).map_err(io)
        };
        put(&layout.to_bytes())?;
        let padding = |length: u64| &[0u8; 8][..(align(length) - length) as usize];
        for (entry, bytes) in &head {
            bytes.chunks(PIECE).try_for_each(&mut put)?;
            put(padding(entry.stored))?;
        }
        for (entry, spool) in &arrays {
            for_each_piece(spool, &mut put)?;
            put(padding(entry.stored))?;
        }
        for_each_piece(&body, &mut put)?;
        debug_assert_eq!(written, layout.file_bytes);
        // What the arrays of boxes take; the rest is counted as for any volume.
        let arrays = 8 * boxes_so_far
            + size_of::<crate::LabelRun>() as u64 * runs_so_far
            + size_of::<crate::Leaves>() as u64 * volume.chunks.len() as u64
            + 2 * words
            + leaves_bytes;
        let rest: u64 = volume.resident_parts().iter().map(|part| part.1).sum();
        Ok(WrittenVolume {
            dims: volume.info.dims,
            labels: volume.labels.len() as u64,
            frames,
            boxes: boxes_so_far,
            bytes_volume: arrays + rest,
            bytes_disk: layout.file_bytes,
        })
    }
}

/// Calls `visit` with the bytes of a spool, in pieces.
fn for_each_piece(spool: &Spool<'_>, mut visit: impl FnMut(&[u8]) -> Result<()>) -> Result<()> {
    let (mut reader, mut left) = (spool.reader(), spool.len());
    let mut piece = vec![0; PIECE.min(left as usize)];
    while left > 0 {
        let n = left.min(PIECE as u64) as usize;
        reader.read(&mut piece[..n])?;
        visit(&piece[..n])?;
        left -= n as u64;
    }
    Ok(())
}
