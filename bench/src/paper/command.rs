//! `pumice bench paper`

use std::path::PathBuf;

use clap::Args;
use pumice_core::Job;

use super::{PaperOptions, measure_paper, write_paper};
use crate::console::{BenchResult, Console, Outcome};
use crate::files::volumes_or_shipped;
use crate::machine;

/// The encodings of the paper that Pumice implements, in the paper's layouts, beside Pumice's own form
///
/// Encodes a volume as SVOs, as SVDAGs per type and as one shared SVDAG, without and with occupancy fields. Decodes each and traces the same
/// rays through it. Writes paper.csv, paper.md with the paper's tables 1, 3, 4 and 5 and section 5.6, and the curves of its figure 6 as
/// SVG. Takes minutes and some 4 GB for 512³ voxels.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Label volumes; the shipped one by default
    #[arg(value_name = "FILE")]
    volumes: Vec<PathBuf>,
    /// Number of types to which labels are assigned round robin; by default the volume's own types, or one for each label
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    types: Option<u32>,
    /// Share of the labels that rays meet, in per cent
    #[arg(long, value_name = "PERCENT", default_value = "15", value_parser = clap::value_parser!(u32).range(1..=100))]
    show: u32,
    /// Pixels of the camera along each side
    #[arg(long, value_name = "N", default_value = "512", value_parser = clap::value_parser!(u32).range(8..=8192))]
    side: u32,
    /// Rounds of rays, of which the fastest counts
    #[arg(long, value_name = "N", default_value = "3", value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
    /// Folder for the results, created if missing
    #[arg(long, value_name = "DIR", default_value = "pumice-paper")]
    out: PathBuf,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let mut tables = Vec::new();
    for volume in volumes_or_shipped(&flags.volumes)? {
        let named = format!("{}: ", volume.display());
        let options = PaperOptions {
            volume,
            types: flags.types,
            show: flags.show,
            side: flags.side,
            rounds: flags.rounds,
        };
        tables.push(console.watch(&named, |watch| measure_paper(&options, job, watch))?);
    }
    write_paper(&flags.out, &machine::description(), &tables)?;
    console.line(flags.out.join("paper.md").display())?;
    Ok(Outcome::Holds)
}
