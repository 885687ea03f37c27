//! Measures the CPU time of compressing and of tracing rays: compression as a whole from a file, its steps from memory on one thread.

mod compression;
mod rays;

use std::path::Path;
use std::sync::Arc;

use clap::Args;
use pumice_core::{CompressionLevel, Job};
use pumice_formats::OpenOptions;
use pumice_session::error::Result;
use pumice_session::{CompressRequest, Residence, compress_file, open_volume};
use serde::Serialize;

use crate::console::{BenchResult, Console, Outcome};
use crate::files::{file_name, scratch};
use crate::table::{Row, TableFlags};

pub use compression::{CompressionSpeed, LevelSpeed, measure_compression};
pub use rays::{RaySpeed, measure_rays};

/// Speed of compressing and of rays, in CPU seconds
///
/// From memory on one thread: making records, merging them, finding contacts, saving and opening at each level, comparing every voxel;
/// camera rays, diffuse rays from their hits, shadow rays. Labels must fit 32 bits.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    #[command(flatten)]
    table: TableFlags,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let rows: Vec<Speeds> =
        flags.table.volumes.iter().map(|v| measure_speeds(v, job)).collect::<Result<_>>()?;
    flags.table.show("speeds", &rows, console)?;
    Ok(Outcome::Holds)
}

/// Speeds of one volume.
#[derive(Clone, Debug, Serialize)]
pub struct Speeds {
    /// The volume's file name.
    pub volume: String,
    /// CPU seconds of all threads from the volume's file to a `.pumice` file.
    pub from_file_cpu_seconds: f64,
    /// Steps of compression from an array in memory, on one thread.
    pub compression: CompressionSpeed,
    /// Camera rays, diffuse rays from their hits, and shadow rays from the same hits.
    pub rays: [RaySpeed; 3],
}

/// Measures one volume.
///
/// # Errors
/// Errors of the volume; ids that need more than 32 bits; the job's cancellation.
pub fn measure_speeds(path: &Path, job: &Job) -> Result<Speeds> {
    let folder = scratch()?;
    let request = CompressRequest {
        inputs: vec![path.to_owned()],
        time_steps: None,
        output: folder.path().join("volume.pumice"),
        reading: OpenOptions::default(),
        level: CompressionLevel::Default,
        threads: None,
        memory_limit_bytes: None,
        types: None,
        table: None,
    };
    let outcome = compress_file(&request, job)?;
    let volume = open_volume(&request.output, &OpenOptions::default(), Residence::Copied, job)?;
    Ok(Speeds {
        volume: file_name(path),
        from_file_cpu_seconds: outcome.cpu_seconds,
        compression: measure_compression(&volume, job)?,
        rays: measure_rays(&Arc::clone(&volume), rays::SHOWN_PERCENT, rays::SIDE, job)?,
    })
}

impl Row for Speeds {
    fn cells(&self) -> Vec<(&'static str, String)> {
        let c = &self.compression;
        let [one, two] = c.thread_seconds;
        let levels = |of: fn(&LevelSpeed) -> f64| {
            c.levels.iter().map(|l| format!("{:.3}", of(l))).collect::<Vec<_>>().join(", ")
        };
        let [camera, diffuse, shadow] = self.rays.map(|r| format!("{:.3}", r.millions_per_cpu_second));
        vec![
            ("volume", self.volume.clone()),
            ("whole compression from the file, CPU s", format!("{:.2}", self.from_file_cpu_seconds)),
            ("parts, MVoxel per CPU s", format!("{:.1}", c.parts_mvoxels_per_cpu_second)),
            ("finish, CPU s", format!("{:.3}", c.finish_cpu_seconds)),
            ("contacts, CPU s", format!("{:.3}", c.contacts_cpu_seconds)),
            ("verify, CPU s", format!("{:.3}", c.verify_cpu_seconds)),
            (
                "one thread, two threads, wall s",
                format!("{one:.3}, {two:.3} ({:.2} times as fast)", one / two),
            ),
            ("saving: fast, default, small, CPU s", levels(|l| l.save_cpu_seconds)),
            ("opening: fast, default, small, CPU s", levels(|l| l.open_cpu_seconds)),
            ("primary rays, M per CPU s", camera),
            ("diffuse rays, M per CPU s", diffuse),
            ("occlusion rays, M per CPU s", shadow),
        ]
    }
}
