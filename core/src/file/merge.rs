//! Joins the parts of a volume to the volume's file, or some of them to one part: the bytes that compressing these chunks at once gives.
//!
//! ```text
//! heads of all parts ─► same volume, same source, each chunk once ─► table of all ids
//! chunk after chunk, in Morton order, frame after frame where the volume has several:
//!     sections ─► boxes ─► content hash, voxels of each label, cells at the chunk's faces ─► labels that touch across them
//!             └─► copied, but for RUNS, which has numbers of labels          level default
//!             └─► coded again: as they are in memory (fast), as voxels (small)
//! ```
//! One chunk is in memory at a time, with the nodes and boxes of all its frames, beside the table of labels, their contacts and the section
//! tables of the parts.

use std::collections::BTreeMap;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::file_sink::{FileSink, write_file};
use super::format_error::Stop;
use super::layout::Entry;
use super::part::{OpenPart, PartHead, PlaceOfChunk};
use super::part_chunk::{FrameOfChunk, add_faces, changed, read_chunk};
use super::sections::read_sections;
use super::voxel_pieces::{check_disjoint, encode_piece};
use super::write::PLAIN;
use crate::compress::on_threads;
use crate::finish::Budget;
use crate::layers::Layers;
use crate::reserve::{collected, make_room, reserved, zeroed};
use crate::spool::Scratch;
use crate::touching::Touching;
use crate::{
    ChunkGrid, ChunkSet, CompressOptions, CompressedVolume, CompressionLevel, Contacts, Error, Job,
    LabelTable, Result, WrittenVolume, content_hash,
};

/// What memory is for, in errors.
const LABELS: &str = "the table of labels";

/// Joins the parts of a volume ([`crate::compress_parts`]) or of a time series ([`crate::compress_series_parts`]), in any order, to the file that
/// [`crate::compress_to_file`] or [`crate::compress_series_to_file`] makes of the whole at once: byte for byte, at each level. Before the file
/// is written, `describe` may give names, types and numbers to the labels of a volume without boxes.
///
/// # Errors
/// [`Error::Caller`] that names the parts which do not belong together, the chunk that comes twice, or the chunks that are missing;
/// [`Error::File`] for a damaged part; those of `describe`; [`Error::Io`], [`Error::Memory`], [`Error::Cancelled`]. After an error there is no
/// new file.
pub fn merge_parts(
    parts: &[PathBuf],
    path: &Path,
    level: CompressionLevel,
    options: &CompressOptions,
    describe: &mut (dyn FnMut(&mut CompressedVolume) -> Result<()> + Send),
    job: &Job,
) -> Result<WrittenVolume> {
    let (parts, ids) = open_parts(parts, job)?;
    check_complete(&parts, &chunks_of(&parts)?)?;
    merge_open(&parts, ids, path, (level, None), options, describe, job)
}

/// Joins parts of a volume or of a time series, in any order, to one part: the file that [`crate::compress_parts`] or
/// [`crate::compress_series_parts`] makes of all of their chunks at once, byte for byte. [`CompressOptions::types`] has no effect.
///
/// # Errors
/// As [`merge_parts`]; but chunks may be missing.
pub fn merge_into_part(
    parts: &[PathBuf],
    path: &Path,
    options: &CompressOptions,
    job: &Job,
) -> Result<WrittenVolume> {
    let (parts, ids) = open_parts(parts, job)?;
    let chunks = chunks_of(&parts)?;
    let info = parts.first().map(|first| &first.info);
    let of = info.map_or(0, |info| ChunkGrid::new(info.volume.dims).chunks());
    let head = PartHead::new(chunks, of, info.map(|info| info.source.clone()).unwrap_or_default());
    let options = CompressOptions { types: None, ..options.clone() };
    let level = (CompressionLevel::Default, Some(&head));
    merge_open(&parts, ids, path, level, &options, &mut |_| Ok(()), job)
}

/// Joins open parts to a volume, or with the head of a part to a part.
fn merge_open(
    parts: &[OpenPart],
    ids: Vec<u64>,
    path: &Path,
    (level, head): (CompressionLevel, Option<&PartHead>),
    options: &CompressOptions,
    describe: &mut (dyn FnMut(&mut CompressedVolume) -> Result<()> + Send),
    job: &Job,
) -> Result<WrittenVolume> {
    let first = parts.first().ok_or_else(|| Error::Caller("expected parts of a volume, got none".into()))?;
    let dims = first.info.volume.dims;
    let folder = options.temp_folder.clone().unwrap_or_else(std::env::temp_dir);
    let frames = first.info.frames;
    let budget = Budget::new(options.memory_limit_bytes, dims, frames, &folder);
    on_threads(options, || {
        write_file(path, job, |file| {
            let scratch = Scratch::new(&folder);
            let mut sink = FileSink::new(level, dims, frames, ids.len() as u32, &scratch, &budget);
            let (labels, content_hashes) = join(parts, ids, &mut sink, &budget, job)?;
            let mut volume = CompressedVolume::empty(first.info.volume.clone());
            volume.labels = labels;
            if let Some(types) = &options.types {
                types.apply(&mut volume.labels);
            }
            describe(&mut volume)?;
            sink.write((file, path), volume, &content_hashes, head, job)
        })
    })
}

/// Opens all parts, compares them, and returns the ids of all their labels.
fn open_parts(paths: &[PathBuf], job: &Job) -> Result<(Vec<OpenPart>, Vec<u64>)> {
    let mut parts: Vec<OpenPart> = Vec::new();
    let mut ids: Vec<u64> = Vec::new();
    let mut sorted = 0;
    for path in paths {
        let (part, of_part) = OpenPart::open(path, job)?;
        if let Some(first) = parts.first() {
            check_same(first, &part)?;
        }
        make_room(&mut ids, of_part.len(), LABELS)?;
        ids.extend(of_part);
        // Most labels are in several parts, so the list is made short whenever it has doubled.
        if ids.len() > 2 * sorted + (1 << 16) {
            ids.sort_unstable();
            ids.dedup();
            sorted = ids.len();
        }
        parts.push(part);
    }
    ids.sort_unstable();
    ids.dedup();
    ids.shrink_to_fit();
    if u32::try_from(ids.len()).is_err() {
        return Err(Error::Limit { what: "labels".into(), limit: u32::MAX.into(), got: ids.len() as u64 });
    }
    Ok((parts, ids))
}

/// Returns an error unless two parts are of one volume.
fn check_same(first: &OpenPart, part: &OpenPart) -> Result<()> {
    let other = |what: String| {
        Err(Error::Caller(format!(
            "{}: expected a part of the volume that {} is of: {what}",
            part.path.display(),
            first.path.display()
        )))
    };
    let ([a, b], [x, y]) =
        ([&first.info, &part.info].map(|i| &i.source), [&first.info.volume, &part.info.volume]);
    let size = |d: [u32; 3]| format!("{} × {} × {}", d[0], d[1], d[2]);
    if x.dims != y.dims {
        return other(format!("expected {} voxels, got {}", size(x.dims), size(y.dims)));
    }
    if first.info.frames != part.info.frames {
        return other(format!("expected {} time steps, got {}", first.info.frames, part.info.frames));
    }
    if a.reading != b.reading {
        let said = |s: &str| if s.is_empty() { "no options".to_owned() } else { format!("`{s}`") };
        return other(format!(
            "its source was read with {}, expected {}",
            said(&b.reading),
            said(&a.reading)
        ));
    }
    if a.fingerprint != b.fingerprint || x != y {
        return other(format!("it was made from another source ({}, expected {})", b.name, a.name));
    }
    Ok(())
}

/// The chunks of all parts; an error where two have the same one.
fn chunks_of(parts: &[OpenPart]) -> Result<ChunkSet> {
    let of_part = |part: usize| parts[part].info.chunks.ranges().iter().map(move |&range| (range, part));
    let mut ranges: Vec<([u64; 2], usize)> = (0..parts.len()).flat_map(of_part).collect();
    ranges.sort_unstable();
    for pair in ranges.windows(2) {
        let ([_, high], [low, _]) = (pair[0].0, pair[1].0);
        if low <= high {
            let (one, other) = (parts[pair[0].1].path.display(), parts[pair[1].1].path.display());
            return Err(Error::Caller(format!(
                "{one} and {other} both have chunk {low}: expected each chunk once"
            )));
        }
    }
    Ok(ChunkSet::of_ranges(ranges.into_iter().map(|(range, _)| range)))
}

/// Returns an error unless `chunks`, those of the parts, are all chunks of the volume.
fn check_complete(parts: &[OpenPart], chunks: &ChunkSet) -> Result<()> {
    let Some(first) = parts.first() else { return Ok(()) };
    let total = ChunkGrid::new(first.info.volume.dims).chunks();
    let mut missing = Vec::new();
    let mut next = 0;
    for [low, high] in chunks.ranges().iter().copied().chain([[total, total]]) {
        if low > next {
            missing.push([next, low - 1]);
        }
        next = high + 1;
    }
    if missing.is_empty() {
        return Ok(());
    }
    let missing = ChunkSet::of_ranges(missing);
    Err(Error::Caller(format!(
        "the parts lack {} of the volume's {total} chunks: {missing} (pumice compress --chunks makes them)",
        missing.len()
    )))
}

/// Hands all chunks to the sink; returns the table of labels and the content hash of each frame.
fn join(
    parts: &[OpenPart],
    mut ids: Vec<u64>,
    sink: &mut FileSink<'_>,
    budget: &Budget,
    job: &Job,
) -> Result<(LabelTable, Vec<u128>)> {
    let Some(first) = parts.first() else { return Ok(Default::default()) };
    let dims = first.info.volume.dims;
    let grid = ChunkGrid::new(dims);
    let mut voxels: Vec<u64> = zeroed(ids.len(), LABELS)?;
    // Frames without a box have no hash of their own here: there may be many.
    let begun = content_hash::begun(dims, &ids);
    let mut contents = BTreeMap::new();
    let faces = Scratch::new(&budget.folder);
    let mut touching = Touching::new(dims, &faces, budget, &[])?;
    // The labels of the part that was read last.
    let mut numbers: Option<(usize, Vec<u32>)> = None;
    for (i, part) in parts.iter().enumerate() {
        let of_part = numbers_of(part, &ids, job)?;
        add_contacts(part, &of_part, &mut touching, job)?;
        numbers = Some((i, of_part));
    }
    // By the number of the chunk: its part, and its frames in the part's table.
    let mut order: Vec<(u64, usize, Range<u32>)> = Vec::new();
    for (i, part) in parts.iter().enumerate() {
        for of_chunk in part.places.chunk_by(|a, b| a.origin == b.origin) {
            let first = order.last().filter(|last| last.1 == i).map_or(0, |last| last.2.end);
            make_room(&mut order, 1, "a list of the chunks")?;
            order.push((grid.number(of_chunk[0].origin), i, first..first + of_chunk.len() as u32));
        }
    }
    order.sort_unstable_by_key(|(number, ..)| *number);
    let bytes = |part: &OpenPart, chunk: &Range<u32>| -> u64 {
        part.layout.entries[part.entries_of(chunk.clone())].iter().map(|entry| entry.stored).sum()
    };
    job.begin(order.iter().map(|(_, i, chunk)| bytes(&parts[*i], chunk)).sum());
    for (_, i, frames) in order {
        job.check()?;
        let part = &parts[i];
        let of_part = match numbers.take().filter(|(known, _)| *known == i) {
            Some((_, of_part)) => of_part,
            None => numbers_of(part, &ids, job)?,
        };
        let chunk = part.with_file(|file| read_chunk(file, part, frames.clone(), &of_part, &Job::new()))?;
        let node_base = sink.words();
        let count = |label: u32, n: u64| voxels[label as usize] += n;
        chunk.for_each_frame(part, &mut ids, count, |of_frame| {
            job.check()?;
            let PlaceOfChunk { origin, frame } = part.places[of_frame.entry as usize];
            let volume = of_frame.volume;
            volume.add_boxes(contents.entry(frame).or_insert_with(|| begun.clone()));
            let scratch = Scratch::new(&budget.folder);
            let layers = Layers::new(&scratch, budget.share(8));
            add_faces(volume, &layers)?;
            touching.chunk(frame, origin, &layers, false, job)?;
            sink.begin(origin, frame, node_base)?;
            match sink.level {
                CompressionLevel::Small => {
                    let grid = volume.new_grid()?;
                    let (stream, labelled) = encode_piece(volume, &grid, origin, &Job::new())?;
                    check_disjoint(of_frame.run_voxels.iter().sum(), labelled)?;
                    sink.section(*b"VOXL", &stream, PLAIN, job)?;
                }
                CompressionLevel::Fast => plain_sections(&of_frame, sink, job)?,
                CompressionLevel::Default => copy_sections(part, &of_frame, sink, job)?,
            }
            sink.end_frame(&of_frame)
        })?;
        numbers = Some((i, of_part));
        job.advance(bytes(part, &frames));
    }
    if let Some(empty) = voxels.iter().position(|&n| n == 0) {
        let what = format!("label {} of the parts has no voxels: a part is damaged", ids[empty]);
        return Err(Error::Caller(what));
    }
    let contacts = touching.into_contacts(ids.len() as u32)?;
    let hash = |frame| contents.get(&frame).unwrap_or(&begun).digest128();
    let content_hashes =
        collected(first.info.frames as usize, (0..first.info.frames).map(hash), "the frames")?;
    Ok((LabelTable { ids, voxels, contacts, ..LabelTable::default() }, content_hashes))
}

/// The number of each of a part's labels among all ids.
fn numbers_of(part: &OpenPart, ids: &[u64], job: &Job) -> Result<Vec<u32>> {
    let of_part = part.ids(job)?;
    let mut numbers = reserved(of_part.len(), LABELS)?;
    let mut from = 0;
    for id in of_part {
        from += ids[from..].partition_point(|&other| other < id);
        if ids.get(from) != Some(&id) {
            let (path, what) =
                (part.path.clone(), "the file changed while it was read; merge again".to_owned());
            return Err(Error::File { path, section: "LIDS".into(), at: 0, what });
        }
        numbers.push(from as u32);
    }
    Ok(numbers)
}

/// Adds the pairs of labels that touch within a part.
fn add_contacts(part: &OpenPart, numbers: &[u32], touching: &mut Touching<'_>, job: &Job) -> Result<()> {
    let contacts = part.with_file(|file| {
        let mut sections = read_sections(file, None, &part.layout, &[b"LCON"], job)?;
        let packed = sections.take(b"LCON")?;
        Contacts::from_packed(packed, numbers.len() as u32).map_err(|(at, what)| {
            sections.fault(*b"LCON", format!("{what} (byte {at} of the decoded section)"))
        })
    })?;
    // Both lists of labels rise, so the first of a pair stays the lower one.
    contacts.iter().try_for_each(|(a, b)| {
        touching.add(&[u64::from(numbers[a as usize]) << 32 | u64::from(numbers[b as usize])])
    })
}

/// The sections of a chunk at a frame as they are in memory.
fn plain_sections(of_frame: &FrameOfChunk<'_>, sink: &mut FileSink<'_>, job: &Job) -> Result<()> {
    let volume = of_frame.volume;
    sink.run_sections(&volume.runs, &of_frame.run_voxels, job)?;
    match &volume.leaves[..] {
        [leaves] if of_frame.is_first => sink.leaf_sections(leaves, job),
        _ => Ok(()),
    }
}

/// Copies the sections of a chunk at a frame, but for its runs.
fn copy_sections(
    part: &OpenPart,
    of_frame: &FrameOfChunk<'_>,
    sink: &mut FileSink<'_>,
    job: &Job,
) -> Result<()> {
    let entries: Vec<Entry> =
        part.layout.entries[part.entries_of(of_frame.entry..of_frame.entry + 1)].to_vec();
    part.with_file(|file| {
        for entry in &entries {
            if entry.name == *b"RUNS" {
                let runs = &of_frame.volume.runs;
                sink.section(*b"RUNS", bytemuck::cast_slice(runs), (8, true, true), job)?;
                continue;
            }
            file.seek(SeekFrom::Start(entry.offset)).map_err(Stop::Io)?;
            let read = |piece: &mut [u8]| {
                let io = |source| Error::Io { path: part.path.clone(), source };
                file.read_exact(piece).map_err(io)
            };
            if sink.stored_section(entry, read)?.is_none() {
                return Err(changed(entry.name, entry.offset));
            }
        }
        Ok(())
    })
}
