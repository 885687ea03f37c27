//! `pumice bench export`

use std::path::{Path, PathBuf};

use clap::Args;
use pumice_core::Job;

use super::{ExportBenchOptions, measure_export, one, write_export};
use crate::console::{BenchResult, Console, Outcome};
use crate::machine;

/// Exports: bytes, seconds and memory by format, beside other writers of USD, and their import into Blender
///
/// Exports generated cubes as instances and as the surface of their boxes, and the visible surface of VOLUMEs. usd-core and the program of
/// bench/openusd write the same arrays as USD. Writes export.md, export.csv and export-import.csv. A million cubes take about 2 GB of disk.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Label volumes whose visible surface is exported besides
    #[arg(value_name = "VOLUME")]
    volumes: Vec<PathBuf>,
    /// Numbers of cubes
    #[arg(
        long,
        value_name = "N,…",
        value_delimiter = ',',
        default_value = "10000,100000,1000000",
        value_parser = clap::value_parser!(u32).range(1..=4_000_000)
    )]
    boxes: Vec<u32>,
    /// Rounds of each measurement; the least times count
    #[arg(long, value_name = "N", default_value = "3", value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
    /// Python interpreter that has usd-core
    #[arg(long, value_name = "PYTHON", default_value = "python3")]
    python: PathBuf,
    /// Leave out other writers of USD
    #[arg(long, value_name = "NAME", value_parser = ["usd-core"])]
    without: Option<String>,
    /// The crate openusd's writer, which bench/openusd/Cargo.toml says how to build
    #[arg(long, value_name = "PROGRAM", conflicts_with = "without")]
    openusd: Option<PathBuf>,
    /// Blender, or a Python that has it as a module, to import files
    #[arg(long, value_name = "PROGRAM")]
    blender: Option<PathBuf>,
    /// Seconds after which an import is given up
    #[arg(long, value_name = "SECONDS", default_value = "300", value_parser = clap::value_parser!(u32).range(1..))]
    most_seconds: u32,
    /// Folder for the results, created if missing
    #[arg(long, value_name = "DIR", default_value = "pumice-export")]
    out: PathBuf,
    /// What the bench starts itself with: exports once and prints the figures
    #[arg(long, hide = true, num_args = 3, value_names = ["INPUT", "OUT", "FORM"])]
    one: Option<Vec<PathBuf>>,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    if let Some([input, out, form]) = flags.one.as_deref() {
        console.line(one::measured(input, out, &form.to_string_lossy(), job)?)?;
        return Ok(Outcome::Holds);
    }
    let options = ExportBenchOptions {
        volumes: flags.volumes.clone(),
        boxes: flags.boxes.clone(),
        rounds: flags.rounds,
        python: flags.without.is_none().then(|| flags.python.clone()),
        openusd: flags.openusd.clone(),
        blender: flags.blender.clone(),
        most_seconds: flags.most_seconds,
    };
    let figures = console.watch("", |watch| measure_export(&options, job, watch))?;
    write_export(&flags.out, &machine::description(), &figures)?;
    console.line(page_in(&flags.out))?;
    Ok(Outcome::of(figures.holds()))
}

fn page_in(folder: &Path) -> String {
    folder.join("export.md").display().to_string()
}
