//! `pumice bench peers`

use std::path::PathBuf;

use clap::Args;
use pumice_core::Job;

use super::{PeersOptions, measure_peers, write_peers};
use crate::console::{BenchResult, Console, Outcome};
use crate::files::volumes_or_shipped;
use crate::machine;

/// Pumice beside other programs that store label volumes: bytes, CPU seconds, time to read one voxel
///
/// Compresses and decompresses the volume with Pumice at all levels, and with crackle, compresso, compressed_segmentation, zstd, NIfTI
/// and zarr through their own Python packages. Compares the result with the volume. Writes peers.csv and peers.md; with --levels also
/// peers_levels.csv, peers_levels.md and two SVGs for each volume.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Label volumes; the shipped one by default
    #[arg(value_name = "FILE")]
    volumes: Vec<PathBuf>,
    /// Python interpreter that has the programs' packages
    #[arg(long, value_name = "PYTHON", default_value = "python3")]
    python: PathBuf,
    /// Programs to leave out
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    without: Vec<String>,
    /// Also each program at several of its settings; takes some five times as long
    #[arg(long)]
    levels: bool,
    /// Folder for the results, created if missing
    #[arg(long, value_name = "DIR", default_value = "pumice-peers")]
    out: PathBuf,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let mut tables = Vec::new();
    for volume in volumes_or_shipped(&flags.volumes)? {
        let named = format!("{}: ", volume.display());
        let options = PeersOptions {
            volume,
            python: flags.python.clone(),
            without: flags.without.clone(),
            levels: flags.levels,
        };
        tables.push(console.watch(&named, |watch| measure_peers(&options, job, watch))?);
    }
    write_peers(&flags.out, &machine::description(), &tables)?;
    console.line(flags.out.join("peers.md").display())?;
    Ok(Outcome::Holds)
}
