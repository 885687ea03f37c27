//! Compression from a block source to a compressed volume.
//!
//! ```text
//! calling thread:  next block ─► queue (at most 1 block a thread) ─► workers: block ─► part ─► store
//!                  (queue full: the calling thread makes the part itself)
//! at the end:      chunk after chunk ─► a volume in memory, or a file
//! ```
//! Only the calling thread reads the source, because most sources inflate a single stream; everything else uses all threads.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, TrySendError, sync_channel};
use std::sync::{Mutex, OnceLock, PoisonError};

use crate::cell::CELL;
use crate::file;
use crate::finish::{Budget, Known, bytes_without_limit, finish};
use crate::freed_memory::{give_back, give_back_large_pieces};
use crate::sorted_cells::SortedCells;
use crate::store::{PartStore, StoredParts};
use crate::volume::MAX_DIM;
use crate::volume_sink::VolumeSink;
use crate::{
    ArraySource, BlockSource, CHUNK_VOXELS, ChunkGrid, ChunkSet, CompressedVolume, CompressionLevel, Error,
    Job, KeptRecords, LabelBlock, LabelBuffer, LayerSource, PartSource, Result, VolumeInfo, VoxelRegion,
    WrittenVolume, morton,
};

/// Options of compression. Only `types` changes the bytes of the result.
#[derive(Clone, Debug, Default)]
pub struct CompressOptions {
    /// Threads to use; 0 means one for each logical processor.
    pub threads: usize,
    /// Limit on memory in bytes. What does not fit goes to scratch files in [`CompressOptions::temp_folder`]. The limit includes the result
    /// where that is in memory ([`compress`]): a limit below twice its size is refused with the number of bytes that would suffice. It
    /// includes the table of labels, which is refused in the same way. It excludes the source's own buffers, one block a thread, whose size
    /// the source decides, and what a program takes for itself.
    pub memory_limit_bytes: Option<u64>,
    /// Folder for scratch files; `None` means the system's folder for temporary files.
    pub temp_folder: Option<std::path::PathBuf>,
    /// Types to assign to the labels.
    pub types: Option<crate::TypeTable>,
}

impl CompressOptions {
    pub(crate) fn thread_count(&self) -> usize {
        match self.threads {
            0 => std::thread::available_parallelism().map_or(1, Into::into),
            n => n,
        }
    }
}

/// Compresses a source.
///
/// # Errors
/// Those of the source; [`Error::Limit`]; [`Error::Cancelled`]; [`Error::Caller`] when the source's blocks overlap or do not cover its
/// volume.
pub fn compress(
    source: &mut dyn BlockSource,
    options: &CompressOptions,
    job: &Job,
) -> Result<CompressedVolume> {
    let folder = options.temp_folder.clone().unwrap_or_else(std::env::temp_dir);
    let expected = source.info().voxels();
    let share = reading_share(CompressionLevel::Default);
    let (info, parts) = parts_of(source, (expected, share), options, &folder, job)?;
    let known = Known::delivered(&parts);
    volume_of_parts(info, parts, &known, options, &folder, job)
}

/// Compresses a source into a `.pumice` file, which appears under its name once all of it is on disk. What memory holds does not grow with the
/// file, but with the table of labels and their contacts. Before the file is written, `describe` may give names, types and numbers to the
/// labels of a volume without boxes.
///
/// # Errors
/// As [`compress`]; those of `describe`; [`Error::Io`] where the file cannot be written. After an error there is no new file.
pub fn compress_to_file(
    source: &mut dyn BlockSource,
    path: &Path,
    level: CompressionLevel,
    options: &CompressOptions,
    describe: &mut (dyn FnMut(&mut CompressedVolume) -> Result<()> + Send),
    job: &Job,
) -> Result<WrittenVolume> {
    let folder = options.temp_folder.clone().unwrap_or_else(std::env::temp_dir);
    let expected = source.info().voxels();
    let (info, parts) = parts_of(source, (expected, reading_share(level)), options, &folder, job)?;
    write_volume(path, level, info, parts, options, &folder, describe, job)
}

/// Finishes parts into a file.
#[expect(clippy::too_many_arguments, reason = "each is another thing")]
pub(crate) fn write_volume(
    path: &Path,
    level: CompressionLevel,
    info: VolumeInfo,
    parts: StoredParts,
    options: &CompressOptions,
    folder: &Path,
    describe: &mut (dyn FnMut(&mut CompressedVolume) -> Result<()> + Send),
    job: &Job,
) -> Result<WrittenVolume> {
    let known = Known::delivered(&parts);
    let budget = Budget::new(options.memory_limit_bytes, info.dims, parts.frames, folder);
    let mut describe = |volume: &mut CompressedVolume| {
        if let Some(types) = &options.types {
            types.apply(&mut volume.labels);
        }
        describe(volume)
    };
    on_threads(options, || {
        file::finish_into_file(path, level, info, parts, &known, &budget, None, &mut describe, job)
    })
}

/// Compresses some chunks of a volume into files that [`crate::merge_parts`] joins with those of the others: each of `parts` has chunks of its own,
/// and a path. `source` describes the whole volume and delivers the voxels of these chunks alone; it is read once. A part appears as soon as its
/// chunks are finished. Names and types are given when parts are joined; [`CompressOptions::types`] has no effect.
///
/// # Errors
/// As [`compress_to_file`]; [`Error::Caller`] for chunks that the volume does not have or that two parts have, and for voxels of another chunk.
/// Parts that were finished before stay.
pub fn compress_parts(
    source: &mut dyn BlockSource,
    parts: &[(ChunkSet, &Path)],
    from: &PartSource,
    options: &CompressOptions,
    job: &Job,
) -> Result<Vec<WrittenVolume>> {
    let chunks = checked_chunks(parts, &ChunkGrid::new(source.info().dims))?;
    let folder = options.temp_folder.clone().unwrap_or_else(std::env::temp_dir);
    let expected = (chunks, reading_share(CompressionLevel::Default));
    let (info, stored) = parts_of(source, expected, options, &folder, job)?;
    write_parts(parts, info, stored, from, options, &folder, job)
}

/// As [`compress_parts`], of a source that is read from its beginning and whose chunks of these parts end one layer. What was read is kept in
/// `kept`, slab after slab, and what is there already is not read again: the source then begins with the voxels from
/// [`KeptRecords::reached`] on.
///
/// # Errors
/// As [`compress_parts`]; what was read before stays.
pub fn compress_layer_parts(
    source: &mut LayerSource,
    parts: &[(ChunkSet, &Path)],
    from: &PartSource,
    kept: &mut KeptRecords,
    options: &CompressOptions,
    job: &Job,
) -> Result<Vec<WrittenVolume>> {
    let info = checked(source.info().clone())?;
    let (grid, axis) = (ChunkGrid::new(info.dims), source.axis());
    let expected = checked_chunks(parts, &grid)?;
    let regions =
        || parts.iter().flat_map(|(chunks, _)| chunks.iter()).filter_map(|number| grid.region(number));
    let end = regions().map(|region| region[axis][1]).max().unwrap_or(0);
    // Of these chunks alone: others of the layer, which were read with them, may have become parts since.
    let read_before = |mut region: VoxelRegion| {
        region[axis][1] = region[axis][1].min(kept.reached()).max(region[axis][0]);
        region.iter().map(|[begin, end]| u64::from(end - begin)).product::<u64>()
    };
    let mut voxels = regions().map(read_before).sum();
    let folder = options.temp_folder.clone().unwrap_or_else(std::env::temp_dir);
    let store = store_over(Some(kept), info.dims, 1, options, &folder)?;
    begin_reading(expected, reading_share(CompressionLevel::Default), options, job);
    job.advance(voxels);
    let across: u64 = (0..3).filter(|&a| a != axis).map(|a| u64::from(info.dims[a])).product();
    let slab = (kept.slab_voxels() / across.max(1)).max(1).next_multiple_of(CELL.into());
    let mut at = kept.reached();
    while at < end {
        source.up_to((u64::from(at) / slab * slab + slab).min(end.into()) as u32);
        let (threads, limit) = (options.thread_count(), options.memory_limit_bytes);
        voxels += read_blocks(source, &store, threads, limit, job)?;
        at = source.next_begin().map_or(end, |next| next.min(end));
        if at == end {
            check_delivered(expected, voxels)?;
        }
        // (Blocks beside each other may end at different places.)
        if at >= source.reached() {
            kept.keep(&store, at, 0)?;
        }
    }
    write_parts(parts, info, stored(store, options)?, from, options, &folder, job)
}

/// The number of voxels of the chunks of all parts, which exist and are each of one part.
pub(crate) fn checked_chunks(parts: &[(ChunkSet, &Path)], grid: &ChunkGrid) -> Result<u64> {
    let mut voxels = 0;
    for (i, (chunks, path)) in parts.iter().enumerate() {
        chunks.check(grid)?;
        voxels += chunks.voxels(grid);
        for (others, other) in &parts[..i] {
            if let Some(chunk) = chunks.iter().find(|&chunk| others.contains(chunk)) {
                let [path, other] = [path.display(), other.display()];
                return Err(Error::Caller(format!(
                    "parts: expected each chunk in one of them, got chunk {chunk} for {other} and {path}"
                )));
            }
        }
    }
    Ok(voxels)
}

/// Finishes what was read of the chunks of some parts, which exist, into these parts.
pub(crate) fn write_parts(
    parts: &[(ChunkSet, &Path)],
    info: VolumeInfo,
    stored: StoredParts,
    from: &PartSource,
    options: &CompressOptions,
    folder: &Path,
    job: &Job,
) -> Result<Vec<WrittenVolume>> {
    let grid = ChunkGrid::new(info.dims);
    let number = |code| grid.number(morton::decode(code).map(|c| c * CHUNK_VOXELS));
    for code in stored.codes() {
        if !parts.iter().any(|(chunks, _)| chunks.contains(number(code))) {
            let chunks = ChunkSet::of(parts.iter().flat_map(|(chunks, _)| chunks.iter()));
            return Err(Error::Caller(format!(
                "the source's blocks: expected voxels of chunks {chunks} alone, got some of chunk {}",
                number(code)
            )));
        }
    }
    // As for the whole volume: what one chunk needs depends on the chunk.
    let budget = Budget::new(options.memory_limit_bytes, info.dims, stored.frames, folder);
    let level = CompressionLevel::Default;
    let mut describe = |_: &mut CompressedVolume| Ok(());
    let mut left = stored;
    let mut written = Vec::with_capacity(parts.len());
    for (i, (chunks, path)) in parts.iter().enumerate() {
        let all = left.records();
        let is_last = i + 1 == parts.len();
        let of_part = left.take(|code| chunks.contains(number(code)))?;
        let share = if is_last { 1.0 } else { of_part.records() as f64 / all.max(1) as f64 };
        let known = Known { share, ..Known::delivered(&of_part) };
        let head = file::PartHead::new(chunks.clone(), grid.chunks(), from.clone());
        let (info, head) = (info.clone(), Some(&head));
        written.push(on_threads(options, || {
            file::finish_into_file(path, level, info, of_part, &known, &budget, head, &mut describe, job)
        })?);
    }
    Ok(written)
}

/// The share of the time of compressing that reading takes, for [`Job::fraction`]: measured on dense and sparse volumes, where it is 0.21 to 0.60,
/// 0.09 to 0.25 and 0.30 to 0.37.
pub(crate) fn reading_share(level: CompressionLevel) -> f64 {
    match level {
        CompressionLevel::Default => 0.4,
        CompressionLevel::Small => 0.15,
        CompressionLevel::Fast => 0.35,
    }
}

/// Reads all blocks of a source, which have `expected` voxels and take this share of the job's time; returns the volume's info, and what its
/// chunks have.
fn parts_of(
    source: &mut dyn BlockSource,
    (expected, share): (u64, f64),
    options: &CompressOptions,
    folder: &Path,
    job: &Job,
) -> Result<(VolumeInfo, StoredParts)> {
    let info = checked(source.info().clone())?;
    let store = store_over(None, info.dims, 1, options, folder)?;
    begin_reading(expected, share, options, job);
    make_parts(source, expected, &store, options.thread_count(), options.memory_limit_bytes, job)?;
    Ok((info, stored(store, options)?))
}

/// Begins the stage of reading.
fn begin_reading(expected: u64, share: f64, options: &CompressOptions, job: &Job) {
    job.begin_share(expected, share);
    if let Some(limit_bytes) = options.memory_limit_bytes {
        give_back_large_pieces(limit_bytes);
    }
}

/// What a store has, after the last block.
fn stored(store: PartStore, options: &CompressOptions) -> Result<StoredParts> {
    let parts = store.into_parts()?;
    if options.memory_limit_bytes.is_some() {
        // The memory of records lies in the arenas of threads that have ended.
        give_back();
    }
    Ok(parts)
}

/// A store for the parts of so many frames of a volume of `dims` voxels: empty, or over what was kept.
pub(crate) fn store_over(
    kept: Option<&KeptRecords>,
    dims: [u32; 3],
    frames: u32,
    options: &CompressOptions,
    folder: &Path,
) -> Result<PartStore> {
    // Records get a quarter of the limit, and waiting blocks at most another quarter.
    let limit = options.memory_limit_bytes;
    let bytes = limit.unwrap_or_else(|| bytes_without_limit(dims, frames)) / 4;
    match kept {
        None => Ok(PartStore::new(bytes, limit, folder)),
        Some(kept) => PartStore::continuing(bytes, limit, kept),
    }
}

/// The description of a volume with its notes in order, once it is checked.
pub(crate) fn checked(mut info: VolumeInfo) -> Result<VolumeInfo> {
    check(&info)?;
    info.notes.sort_by_key(|n| n.id);
    info.notes.dedup_by_key(|n| n.id);
    Ok(info)
}

/// Runs work on as many threads as the options say.
pub(crate) fn on_threads<T: Send>(
    options: &CompressOptions,
    work: impl FnOnce() -> Result<T> + Send,
) -> Result<T> {
    let threads = options.thread_count();
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| no_threads(threads, e))?;
    pool.install(work)
}

/// Builds the volume from all parts.
pub(crate) fn volume_of_parts(
    info: VolumeInfo,
    parts: StoredParts,
    known: &Known,
    options: &CompressOptions,
    folder: &Path,
    job: &Job,
) -> Result<CompressedVolume> {
    let budget = Budget::new(options.memory_limit_bytes, info.dims, 1, folder);
    on_threads(options, || {
        let dims = info.dims;
        let mut sink = VolumeSink::new(info, options.memory_limit_bytes);
        let finished = finish(dims, parts, known, &budget, &mut sink, job)?;
        let mut volume = sink.into_volume()?;
        volume.labels = finished.labels;
        volume.hash = finished.content_hashes.first().map_or_else(OnceLock::new, |&hash| hash.into());
        if let Some(types) = &options.types {
            types.apply(&mut volume.labels);
        }
        Ok(volume)
    })
}

/// Compresses labels that lie in memory in x-fastest order.
///
/// # Errors
/// As [`compress`].
pub fn compress_labels(info: VolumeInfo, labels: LabelBuffer) -> Result<CompressedVolume> {
    compress(&mut ArraySource::new(info, labels)?, &CompressOptions::default(), &Job::new())
}

fn check(info: &VolumeInfo) -> Result<()> {
    if !info.world_from_index.is_finite() {
        return Err(Error::Caller(
            "world_from_index: expected finite entries, got one that is infinite or not a number".into(),
        ));
    }
    for (axis, size) in ["x", "y", "z"].iter().zip(info.dims) {
        if size > MAX_DIM {
            return Err(Error::Limit {
                what: format!("voxels along {axis}"),
                limit: MAX_DIM.into(),
                got: size.into(),
            });
        }
    }
    Ok(())
}

/// Adds the parts of all blocks of a source, which have `expected` voxels, to a store. The job has begun.
pub(crate) fn make_parts(
    source: &mut dyn BlockSource,
    expected: u64,
    store: &PartStore,
    threads: usize,
    limit_bytes: Option<u64>,
    job: &Job,
) -> Result<()> {
    check_delivered(expected, read_blocks(source, store, threads, limit_bytes, job)?)
}

fn check_delivered(expected: u64, delivered: u64) -> Result<()> {
    if delivered != expected {
        return Err(Error::Caller(format!(
            "the source's blocks: expected {expected} voxels in all, got {delivered}"
        )));
    }
    Ok(())
}

/// Adds the parts of all blocks of a source to a store; returns the number of voxels that were delivered. The job has begun.
fn read_blocks(
    source: &mut dyn BlockSource,
    store: &PartStore,
    threads: usize,
    limit_bytes: Option<u64>,
    job: &Job,
) -> Result<u64> {
    let dims = source.info().dims;
    let (send, receive) = sync_channel::<LabelBlock>(threads);
    let receive = Mutex::new(receive);
    let failure: Mutex<Option<Error>> = Mutex::default();
    let queued_bytes = AtomicU64::new(0);
    let work = |block: LabelBlock| {
        let ragged = is_ragged(&block, dims);
        let (bytes, voxels) = (block_bytes(&block), voxels(&block));
        let result = job.check().and_then(|()| {
            let mut last: Option<SortedCells> = None;
            let add = |part| store.add_delivered(part, ragged);
            SortedCells::of_block(&block, dims, &mut |part| last.replace(part).map_or(Ok(()), add))?;
            // The store may merge parts: the block's own memory is free by then.
            drop(block);
            last.map_or(Ok(()), add)
        });
        queued_bytes.fetch_sub(bytes, Relaxed);
        match result {
            Ok(()) => job.advance(voxels),
            Err(error) => *lock(&failure) = Some(error),
        }
    };
    let delivered = std::thread::scope(|scope| {
        for _ in 1..threads {
            let worker = || {
                while let Some(block) = next(&receive) {
                    work(block);
                }
            };
            if let Err(error) = std::thread::Builder::new().spawn_scoped(scope, worker) {
                // Ends the workers that have started.
                drop(send);
                return Err(no_threads(threads, error));
            }
        }
        let mut delivered = 0u64;
        let result = loop {
            if lock(&failure).is_some() {
                break Ok(());
            }
            match job.check().and_then(|()| source.next_block()) {
                Ok(None) => break Ok(()),
                Err(error) => break Err(error),
                Ok(Some(block)) => {
                    delivered = delivered.saturating_add(voxels(&block));
                    let queued = queued_bytes.fetch_add(block_bytes(&block), Relaxed);
                    let crowded = limit_bytes.is_some_and(|limit| queued > limit / 4);
                    if threads == 1 || crowded {
                        work(block);
                    } else if let Err(TrySendError::Full(block) | TrySendError::Disconnected(block)) =
                        send.try_send(block)
                    {
                        work(block);
                    }
                }
            }
        };
        // Closes the queue, so that the workers end once it is empty.
        drop(send);
        while let Some(block) = next(&receive) {
            work(block);
        }
        result.map(|()| delivered)
    })?;
    if let Some(error) = lock(&failure).take() {
        return Err(error);
    }
    Ok(delivered)
}

fn no_threads(threads: usize, error: impl std::fmt::Display) -> Error {
    Error::Caller(format!("cannot start {threads} threads: {error}"))
}

/// Whether a block cuts through cells at a face that is not the volume's end.
fn is_ragged(block: &LabelBlock, dims: [u32; 3]) -> bool {
    (0..3).any(|a| {
        let end = block.origin[a].saturating_add(block.dims[a]);
        !block.origin[a].is_multiple_of(CELL) || (!end.is_multiple_of(CELL) && end != dims[a])
    })
}

fn block_bytes(block: &LabelBlock) -> u64 {
    let labels = &block.labels;
    let width = match labels {
        LabelBuffer::U8(_) => 1,
        LabelBuffer::U16(_) => 2,
        LabelBuffer::U32(_) => 4,
        LabelBuffer::U64(_) => 8,
    };
    labels.len() as u64 * width
}

fn next(queue: &Mutex<Receiver<LabelBlock>>) -> Option<LabelBlock> {
    lock(queue).recv().ok()
}

/// Locks a mutex even if a holder panicked: every critical section here is a single step, so it leaves nothing half done.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn voxels(block: &LabelBlock) -> u64 {
    block.dims.iter().fold(1, |n, &d| n * u64::from(d))
}
