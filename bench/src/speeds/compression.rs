//! Measures each step from labels in memory to a compressed volume, to files and back, on one thread.

use pumice_core::{
    ArraySource, CompressOptions, CompressedVolume, CompressionLevel, Job, LabelBlock, LabelBuffer,
    LabelType, SortedCells, Verification, VolumeInfo, compress, verify,
};
use pumice_session::error::{Result, SessionError, io};
use serde::Serialize;

use crate::files::scratch;
use crate::timing::clocked;
use crate::voxels::decoded;

/// Rounds of making records, over which the time is averaged.
const PART_ROUNDS: u32 = 3;
/// Rounds on one and on two threads, of which the fastest counts.
const THREAD_ROUNDS: u32 = 3;

/// Measurements of saving and opening a file at one level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LevelSpeed {
    /// Bytes of the file.
    pub bytes: u64,
    /// CPU seconds of writing the file.
    pub save_cpu_seconds: f64,
    /// CPU seconds of opening the file.
    pub open_cpu_seconds: f64,
}

/// Measurements of compressing an array.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CompressionSpeed {
    /// Number of records of all voxels, one per pair of label and cell.
    pub records: u64,
    /// Millions of voxels that become records per CPU second.
    pub parts_mvoxels_per_cpu_second: f64,
    /// CPU seconds from records to a compressed volume: the whole compression minus making records and finding contacts.
    pub finish_cpu_seconds: f64,
    /// Number of pairs of labels that touch.
    pub contacts: u64,
    /// CPU seconds of finding those pairs.
    pub contacts_cpu_seconds: f64,
    /// CPU seconds of comparing every voxel with the array.
    pub verify_cpu_seconds: f64,
    /// Wall seconds of the whole compression on one thread and on two.
    pub thread_seconds: [f64; 2],
    /// Files at the levels fast, default and small.
    pub levels: [LevelSpeed; 3],
}

/// Compresses the voxels of a volume again, from an array of 32-bit labels.
///
/// # Errors
/// Ids that need more than 32 bits; a volume without voxels; voxels that differ after compression; the job's cancellation.
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

    // Make the records of all voxels.
    let (records, parts) = clocked(|| {
        let mut records = 0;
        for _ in 0..PART_ROUNDS {
            job.check()?;
            records = SortedCells::from_block(&block, dims)?.len();
        }
        Ok(records as u64)
    })?;
    let parts_seconds = parts.cpu_seconds / f64::from(PART_ROUNDS);

    // Compress as a whole, on one thread and on two.
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

    // Find the pairs of labels that touch.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .map_err(|e| SessionError::Caller(format!("a pool of one thread could not be made: {e}")))?;
    let (contacts, finding) = clocked(|| Ok(pool.install(|| volume.find_contacts(job))?))?;

    // Save and open a file at each level.
    let folder = scratch()?;
    let path = folder.path().join("volume.pumice");
    let mut levels = [LevelSpeed { bytes: 0, save_cpu_seconds: 0.0, open_cpu_seconds: 0.0 }; 3];
    for (speed, level) in
        levels.iter_mut().zip([CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small])
    {
        let ((), saving) = clocked(|| Ok(volume.save(&path, level, job)?))?;
        let (_, opening) = clocked(|| Ok(CompressedVolume::open(&path, job)?))?;
        *speed = LevelSpeed {
            bytes: std::fs::metadata(&path).map_err(io(&path))?.len(),
            save_cpu_seconds: saving.cpu_seconds,
            open_cpu_seconds: opening.cpu_seconds,
        };
    }

    // Compare every voxel with the array.
    let (verified, comparing) =
        clocked(|| Ok(pool.install(|| verify(&volume, &mut source.rewound(), job))?))?;
    if !matches!(verified, Verification::Same { .. }) {
        return Err(SessionError::Caller(format!("the volume compressed from an array differs: {verified}")));
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
