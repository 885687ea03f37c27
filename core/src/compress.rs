//! Compression from a block source to a compressed volume.
//!
//! ```text
//! calling thread:  next block ─► queue (at most 1 block a thread) ─► workers: block ─► part ─► store
//!                  (queue full: the calling thread makes the part itself)
//! at the end:      finish(store)
//! ```
//! Only the calling thread reads the source, because most sources inflate a single stream; everything else uses all threads.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, TrySendError, sync_channel};
use std::sync::{Mutex, PoisonError};

use crate::cell::CELL;
use crate::finish::{Budget, boxes_of_parts, finish};
use crate::sorted_cells::SortedCells;
use crate::store::PartStore;
use crate::volume::MAX_DIM;
use crate::{
    ArraySource, BlockSource, CompressedVolume, Error, Job, LabelBlock, LabelBuffer, Result, VolumeInfo,
};

/// Options of compression. Only `types` changes the bytes of the result.
#[derive(Clone, Debug, Default)]
pub struct CompressOptions {
    /// Threads to use; 0 means one for each logical processor.
    pub threads: usize,
    /// Limit on memory in bytes. Records that do not fit are spilled to [`CompressOptions::temp_folder`]. A limit below the size of the
    /// result is refused with the number of bytes that would suffice. The limit includes the result; it excludes the source's own buffers
    /// and one block a thread, whose size the source decides.
    pub memory_limit_bytes: Option<u64>,
    /// Folder for spilled records; `None` means the system's folder for temporary files.
    pub temp_folder: Option<std::path::PathBuf>,
    /// Types to assign to the labels.
    pub types: Option<crate::TypeTable>,
}

impl CompressOptions {
    fn thread_count(&self) -> usize {
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
    let mut info = source.info().clone();
    check(&info)?;
    info.notes.sort_by_key(|n| n.id);
    info.notes.dedup_by_key(|n| n.id);
    let threads = options.thread_count();
    let folder = options.temp_folder.clone().unwrap_or_else(std::env::temp_dir);
    // Records get a quarter of the limit, and waiting blocks at most another quarter; finishing may use all but the records' quarter.
    let store = PartStore::new(options.memory_limit_bytes.map(|limit| limit / 4), folder);
    let labelled = make_parts(source, &store, threads, options.memory_limit_bytes, job)?;
    volume_of_parts(info, store, Some(labelled), None, options, job)
}

/// Builds the volume from all parts in a store. Where `labelled`, the number of labelled voxels that the parts were made from, is given, it
/// is checked. `touching` holds the pairs of dense indices that touch within a chunk, where they are known.
pub(crate) fn volume_of_parts(
    info: VolumeInfo,
    store: PartStore,
    labelled: Option<u64>,
    touching: Option<Vec<u64>>,
    options: &CompressOptions,
    job: &Job,
) -> Result<CompressedVolume> {
    let threads = options.thread_count();
    let parts = store.into_parts();
    let budget = Budget::new(options.memory_limit_bytes, threads);
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| no_threads(threads, e))?;
    pool.install(|| {
        let (raw, labels) = boxes_of_parts(&parts, &budget, job)?;
        // If blocks overlap in one label, the OR has fewer voxels than they delivered. Overlap of two labels shows later, in the search for
        // contacts.
        let kept: u64 = labels.voxels().iter().sum();
        if let Some(labelled) = labelled.filter(|&labelled| labelled != kept) {
            return Err(Error::Caller(format!(
                "blocks of the source overlap: they delivered {labelled} labelled voxels and cover only {kept}; each voxel must come once"
            )));
        }
        // Frees the parts' memory and the spill file before finishing needs its own.
        drop(parts);
        let mut volume = finish(info, raw, labels, job)?;
        volume.labels.contacts = match touching {
            Some(known) => volume.find_contacts_across_chunks(known, job)?,
            None => volume.find_contacts(job)?,
        };
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

/// Adds the parts of all blocks of a source to a store and returns the number of labelled voxels.
fn make_parts(
    source: &mut dyn BlockSource,
    store: &PartStore,
    threads: usize,
    limit_bytes: Option<u64>,
    job: &Job,
) -> Result<u64> {
    let dims = source.info().dims;
    let expected = source.info().voxels();
    job.begin(expected);
    let (send, receive) = sync_channel::<LabelBlock>(threads);
    let receive = Mutex::new(receive);
    let failure: Mutex<Option<Error>> = Mutex::default();
    let queued_bytes = AtomicU64::new(0);
    let labelled = AtomicU64::new(0);
    let work = |block: LabelBlock| {
        let ragged = is_ragged(&block, dims);
        let (bytes, voxels) = (block_bytes(&block), voxels(&block));
        let result = job.check().and_then(|()| SortedCells::from_block(&block, dims)).and_then(|part| {
            drop(block);
            labelled.fetch_add(part.voxels(), Relaxed);
            store.add(part, ragged)
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
    if delivered != expected {
        return Err(Error::Caller(format!(
            "the source's blocks: expected {expected} voxels in all, got {delivered}"
        )));
    }
    Ok(labelled.into_inner())
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
