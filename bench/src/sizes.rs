//! Measures the bytes of a volume, in memory by part and on disk by level, also in per cent of 4 bytes per voxel.

use std::collections::BTreeMap;
use std::path::Path;

use clap::Args;
use pumice_core::{CompressionLevel, Job, Verification};
use pumice_formats::OpenOptions;
use pumice_session::error::{Result, SessionError};
use pumice_session::file_info::{FileInfo, file_info};
use pumice_session::{CompressRequest, compress_file, verify_file};
use serde::Serialize;

use crate::console::{BenchResult, Console, Outcome};
use crate::files::{file_name, scratch};
use crate::table::{Row, TableFlags};

/// Bytes in memory by part and on disk by level, also in per cent of 4 bytes per voxel
///
/// Compresses each volume at each level and compares the file with the volume, voxel by voxel.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    #[command(flatten)]
    table: TableFlags,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let rows: Vec<Sizes> =
        flags.table.volumes.iter().map(|v| measure_sizes(v, job)).collect::<Result<_>>()?;
    flags.table.show("sizes", &rows, console)?;
    Ok(Outcome::Holds)
}

/// Sizes of one volume.
#[derive(Clone, Debug, Serialize)]
pub struct Sizes {
    /// The volume's file name.
    pub volume: String,
    /// Bytes of the volume at 4 bytes per voxel.
    pub bytes_raw: u64,
    /// Number of labels without background.
    pub labels: u64,
    /// Number of boxes.
    pub boxes: u64,
    /// Bytes in memory by part, with what rays need of all labels.
    pub resident_parts: BTreeMap<String, u64>,
    /// Bytes of the file at the levels fast, default and small.
    pub bytes_disk: [u64; 3],
}

/// Measures one volume.
///
/// # Errors
/// Errors of the volume; a file that differs from the volume; the job's cancellation.
pub fn measure_sizes(volume: &Path, job: &Job) -> Result<Sizes> {
    let folder = scratch()?;
    let file = folder.path().join("volume.pumice");
    let mut bytes_disk = [0; 3];
    for (bytes, level) in bytes_disk.iter_mut().zip([
        CompressionLevel::Fast,
        CompressionLevel::Default,
        CompressionLevel::Small,
    ]) {
        let request = CompressRequest {
            inputs: vec![volume.to_owned()],
            time_steps: None,
            output: file.clone(),
            reading: OpenOptions::default(),
            level,
            threads: None,
            memory_limit_bytes: None,
            types: None,
            table: None,
        };
        *bytes = compress_file(&request, job)?.bytes_disk;
        let verified = verify_file(&file, &[volume.to_owned()], None, &OpenOptions::default(), job)?;
        if !matches!(verified.found, Verification::Same { .. }) {
            return Err(SessionError::Caller(format!(
                "{}: the file compressed at level {level:?} differs: {verified}",
                volume.display()
            )));
        }
    }
    let FileInfo::Pumice(info) = file_info(&file, &OpenOptions::default(), job)? else {
        return Err(SessionError::Caller(format!("{}: expected a .pumice file", file.display())));
    };
    Ok(Sizes {
        volume: file_name(volume),
        bytes_raw: info.bytes_raw,
        labels: info.labels,
        boxes: info.boxes,
        resident_parts: info.resident_parts,
        bytes_disk,
    })
}

impl Row for Sizes {
    fn cells(&self) -> Vec<(&'static str, String)> {
        let share = |bytes: u64| format!("{bytes} ({:.3} %)", 100.0 * bytes as f64 / self.bytes_raw as f64);
        let part = |name: &str| self.resident_parts.get(name).copied().unwrap_or(0);
        let (bricks, acceleration) = (part("bricks"), part("acceleration"));
        let all: u64 = self.resident_parts.values().sum();
        let [fast, default, small] = self.bytes_disk;
        vec![
            ("volume", self.volume.clone()),
            ("voxels", (self.bytes_raw / 4).to_string()),
            ("labels", self.labels.to_string()),
            ("boxes", self.boxes.to_string()),
            ("box bytes", share(part("boxes"))),
            ("node bytes", share(part("nodes"))),
            ("leaf bytes", share(part("leaves"))),
            ("label bytes", share(part("labels"))),
            ("together", share(all - bricks - acceleration)),
            ("brick bytes", share(bricks)),
            ("acceleration bytes", share(acceleration)),
            ("disk, fast", share(fast)),
            ("disk, default", share(default)),
            ("disk, small", share(small)),
        ]
    }
}
