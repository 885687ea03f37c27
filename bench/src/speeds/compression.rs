//! Labels in memory to a compressed volume, to files and back, step by step on one thread.

use pumice_core::{
    ArraySource, CompressOptions, CompressedVolume, Job, LabelBlock, LabelBuffer, LabelType, Level, Part,
    Verification, VolumeInfo, compress, verify,
};
use pumice_session::error::{Result, SessionError, io};
use serde::Serialize;

use crate::files::scratch;
use crate::timing::clocked;
use crate::voxels::decoded;

/// Rounds of making parts, averaged.
const PART_ROUNDS: u32 = 3;
/// Rounds on one and on two threads, of which the fastest counts.
const THREAD_ROUNDS: u32 = 3;

/// Saving and opening at one level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LevelSpeed {
    /// Bytes of the file.
    pub bytes: u64,
    /// CPU seconds of writing it.
    pub save_cpu_seconds: f64,
    /// CPU seconds of opening it.
    pub open_cpu_seconds: f64,
}

/// What compressing an array takes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CompressionSpeed {
    /// Records of all voxels: pairs of a label and a cell.
    pub records: u64,
    /// Voxels that become records in a CPU second, in millions.
    pub parts_mvoxels_per_cpu_second: f64,
    /// CPU seconds from records to a compressed volume: the whole less parts and contacts.
    pub finish_cpu_seconds: f64,
    /// Pairs of labels that touch.
    pub contacts: u64,
    /// CPU seconds of finding them.
    pub contacts_cpu_seconds: f64,
    /// CPU seconds of comparing every voxel with the array's.
    pub verify_cpu_seconds: f64,
    /// Wall seconds of the whole on one thread and on two.
    pub thread_seconds: [f64; 2],
    /// At the levels fast, default and small.
    pub levels: [LevelSpeed; 3],
}

/// Compresses the voxels of a volume again, from an array of 32-bit labels.
///
/// # Errors
/// Ids that need more than 32 bits; a volume without voxels; voxels that do not come back; the job's cancellation.
pub fn measure_compression(volume: &CompressedVolume, job: &Job) -> Result<CompressionSpeed> {
    let dims = volume.info().dims;
    let labels = decoded(volume, job)?;
    if !matches!(labels, LabelBuffer::U32(_)) || labels.is_empty() {
        return Err(SessionError::Caller(format!(
            "speeds are measured on 32-bit labels: expected voxels with ids up to {}, got {} voxels with ids up to {}",
            u32::MAX,
            labels.len(),
            volume.labels().ids().iter().max().copied().unwrap_or(0)
        )));
    }
    let mvoxels = labels.len() as f64 / 1e6;
    let block = LabelBlock::x_fastest([0; 3], dims, labels);

    // Records of all voxels.
    let (records, parts) = clocked(|| {
        let mut records = 0;
        for _ in 0..PART_ROUNDS {
            job.check()?;
            records = Part::from_block(&block, dims)?.len();
        }
        Ok(records as u64)
    })?;
    let parts_seconds = parts.cpu_seconds / f64::from(PART_ROUNDS);

    // All of it, on one thread and on two.
    let mut source = ArraySource::new(VolumeInfo::new(dims, LabelType::U32), block.labels)?;
    let on = |threads| CompressOptions { threads, ..CompressOptions::default() };
    let (volume, whole) = clocked(|| Ok(compress(&mut source, &on(1), job)?))?;
    let mut thread_seconds = [f64::INFINITY; 2];
    for _ in 0..THREAD_ROUNDS {
        for (threads, least) in (1..).zip(&mut thread_seconds) {
            source = source.rewound();
            let (_, took) = clocked(|| Ok(compress(&mut source, &on(threads), job)?))?;
            *least = least.min(took.seconds);
        }
    }

    // Pairs of labels that touch.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .map_err(|e| SessionError::Caller(format!("a pool of one thread: {e}")))?;
    let (contacts, finding) = clocked(|| Ok(pool.install(|| volume.find_contacts(job))?))?;

    // Files of each level, and back.
    let folder = scratch()?;
    let path = folder.path().join("volume.pumice");
    let mut levels = [LevelSpeed { bytes: 0, save_cpu_seconds: 0.0, open_cpu_seconds: 0.0 }; 3];
    for (speed, level) in levels.iter_mut().zip([Level::Fast, Level::Default, Level::Small]) {
        let ((), saving) = clocked(|| Ok(volume.save(&path, level, job)?))?;
        let (_, opening) = clocked(|| Ok(CompressedVolume::open(&path, job)?))?;
        *speed = LevelSpeed {
            bytes: std::fs::metadata(&path).map_err(io(&path))?.len(),
            save_cpu_seconds: saving.cpu_seconds,
            open_cpu_seconds: opening.cpu_seconds,
        };
    }

    // Every voxel against the array's.
    let (verified, comparing) =
        clocked(|| Ok(pool.install(|| verify(&volume, &mut source.rewound(), job))?))?;
    if !matches!(verified, Verification::Same { .. }) {
        return Err(SessionError::Caller(format!("compressed from an array: {verified}")));
    }
    Ok(CompressionSpeed {
        records,
        parts_mvoxels_per_cpu_second: mvoxels / parts_seconds,
        finish_cpu_seconds: whole.cpu_seconds - parts_seconds - finding.cpu_seconds,
        contacts: contacts.len(),
        contacts_cpu_seconds: finding.cpu_seconds,
        verify_cpu_seconds: comparing.cpu_seconds,
        thread_seconds,
        levels,
    })
}
