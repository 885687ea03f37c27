//! `pumice bench extremes`

use std::path::PathBuf;

use clap::Args;
use pumice_core::Job;
use pumice_session::values::bytes;

use super::{ExtremesOptions, measure_extremes, write_extremes};
use crate::console::{BenchResult, Console, Outcome};
use crate::machine;

/// Generated worst-case volumes: bytes, memory, time, and how the time grows with the volume
///
/// A label of 2³² voxels, 10⁷ labels of one voxel, a line, a checkerboard, noise: each is compressed, saved, opened and compared with
/// its generator. Writes extremes.csv and extremes.md. Exit code 1 if a case takes more bytes than its bound, or its time grows too fast
/// with its voxels.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Cases to measure, all by default: runs, full, labels, checkerboard, noise-2, noise-256
    #[arg(long = "case", value_name = "NAME,…", value_delimiter = ',')]
    cases: Vec<String>,
    /// Use a 64th of the voxels, which takes seconds instead of minutes
    #[arg(long)]
    reduced: bool,
    /// Limit of memory while compressing, in bytes
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    memory_limit: Option<u64>,
    /// Folder for the results, created if missing
    #[arg(long, value_name = "DIR", default_value = "pumice-extremes")]
    out: PathBuf,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let options = ExtremesOptions {
        cases: flags.cases.clone(),
        reduced: flags.reduced,
        memory_limit_bytes: flags.memory_limit,
    };
    let cases = console.watch("", |watch| measure_extremes(&options, job, watch))?;
    write_extremes(&flags.out, &machine::description(), &cases)?;
    for case in cases.iter().filter(|c| !c.holds()) {
        console.line(format_args!("{}: beyond its bound", case.name))?;
    }
    console.line(flags.out.join("extremes.md").display())?;
    Ok(Outcome::of(cases.iter().all(|c| c.holds())))
}
