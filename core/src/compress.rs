//! The whole way from a block source to a compressed volume.
//!
//! ```text
//! calling thread:  next block ─► queue (at most 1 block a thread) ─► workers: block ─► part ─► store
//!                  (queue full: make a part itself)
//! at the end:      finish(store)
//! ```
//! The source is read on the calling thread alone, because most inflate one stream; everything else uses all threads.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, TrySendError, sync_channel};
use std::sync::{Mutex, PoisonError};

use crate::cell::CELL;
use crate::finish::{Budget, boxes_of_parts, finish};
use crate::part::Part;
use crate::store::PartStore;
use crate::volume::MAX_DIM;
use crate::{
    ArraySource, BlockSource, CompressedVolume, Error, Job, LabelBlock, LabelBuffer, Result, VolumeInfo,
};

/// How to compress. Nothing but `types` changes the result by a byte.
#[derive(Clone, Debug, Default)]
pub struct CompressOptions {
    /// Threads to use; 0 means one for each logical processor.
    pub threads: usize,
    /// Bytes of memory to stay below: records that do not fit are spilled to [`CompressOptions::temp_folder`]. A limit that is too
    /// small even for the result is refused with the figure that would do. The result itself counts; the source's own buffers
    /// and one block a thread, whose size the source decides, come on top.
    pub memory_limit_bytes: Option<u64>,
    /// Where to spill; the system's folder for temporary files where `None`.
    pub temp_folder: Option<std::path::PathBuf>,
    /// Types to give to the labels.
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
/// Those of the source, [`Error::Limit`], [`Error::Cancelled`], and [`Error::Caller`] when the source's blocks do not make up
/// its volume.
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
    // A quarter for records, a quarter at most for blocks that wait; finishing may use all but the records' quarter.
    let store = PartStore::new(options.memory_limit_bytes.map(|limit| limit / 4), folder);
    let labelled = make_parts(source, &store, threads, options.memory_limit_bytes, job)?;
    volume_of_parts(info, store, Some(labelled), None, options, job)
}

/// The volume of all parts in a store; `labelled` is how many voxels with a label they were made from, where that is to be
/// checked, and `touching` the pairs of dense indices that touch within a chunk, where they are known.
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
    let budget = Budget { limit_bytes: options.memory_limit_bytes, threads };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::Caller(format!("cannot start {threads} threads: {e}")))?;
    pool.install(|| {
        let (raw, labels) = boxes_of_parts(&parts, &budget, job)?;
        // Blocks that overlap in one label are OR-ed into fewer voxels than they delivered. (Overlap in two labels shows when
        // contacts are looked for.)
        let kept: u64 = labels.voxels().iter().sum();
        if let Some(labelled) = labelled.filter(|&labelled| labelled != kept) {
            return Err(Error::Caller(format!(
                "blocks of the source overlap: they delivered {labelled} labelled voxels, {kept} places are labelled"
            )));
        }
        // Their memory, and the spill file, before finishing needs its own.
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

/// Compresses labels that lie in memory, x fastest.
///
/// # Errors
/// As [`compress`].
pub fn compress_labels(info: VolumeInfo, labels: LabelBuffer) -> Result<CompressedVolume> {
    compress(&mut ArraySource::new(info, labels)?, &CompressOptions::default(), &Job::new())
}

fn check(info: &VolumeInfo) -> Result<()> {
    if !info.world_from_index.is_finite() {
        return Err(Error::Caller(
            "the matrix from index space to the world has entries that are no numbers".into(),
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

/// Puts the parts of all blocks of a source into a store; returns how many voxels had a label.
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
        let result = job.check().and_then(|()| Part::from_block(&block, dims)).and_then(|part| {
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
            scope.spawn(|| {
                while let Some(block) = next(&receive) {
                    work(block);
                }
            });
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
        // Closes the queue: the workers end once it is empty.
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
        return Err(Error::Caller(format!("the source delivered {delivered} voxels of {expected}")));
    }
    Ok(labelled.into_inner())
}

/// Whether a block cuts through cells other than at the volume's end.
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

/// A lock whose holder panicked guards nothing that could be half done here: every critical section is one step.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn voxels(block: &LabelBlock) -> u64 {
    block.dims.iter().fold(1, |n, &d| n * u64::from(d))
}
