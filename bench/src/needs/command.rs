//! `pumice bench needs`

use std::path::PathBuf;

use clap::Args;
use pumice_core::Job;
use pumice_session::SavingsOptions;

use super::{NeedsOptions, measure_needs, write_needs};
use crate::console::{BenchResult, Console, Outcome};
use crate::files::volumes_or_shipped;
use crate::machine;

/// Savings of leaving out parts that a scene does not need, without and with each part in turn
///
/// Renders two minimal scenes of a volume, with all labels and with some, without and with each part that a renderer leaves out when the
/// scene does not need it. Writes needs.csv and needs.md. Exit code 1 if a part changes the picture.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Label volumes; the shipped one by default
    #[arg(value_name = "FILE")]
    volumes: Vec<PathBuf>,
    /// Backend that renders: auto, cpu, vulkan-rt, vulkan-query or vulkan-compute
    #[arg(long, value_name = "NAME", default_value = "auto")]
    backend: String,
    /// Number of labels in the scene that shows some, the longest ones
    #[arg(long, value_name = "N", default_value = "10", value_parser = clap::value_parser!(u32).range(1..))]
    show: u32,
    /// Rounds; each renders without and with every part
    #[arg(long, value_name = "N", default_value = "21", value_parser = clap::value_parser!(u32).range(2..=10_000))]
    rounds: u32,
    /// Width of the pictures in pixels
    #[arg(long, value_name = "N", default_value = "320", value_parser = clap::value_parser!(u32).range(16..=4096))]
    side: u32,
    /// Folder for the results, created if missing
    #[arg(long, value_name = "DIR", default_value = "pumice-needs")]
    out: PathBuf,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let mut scenes = Vec::new();
    for volume in volumes_or_shipped(&flags.volumes)? {
        let how = SavingsOptions { rounds: flags.rounds, side: flags.side };
        let options = NeedsOptions { volume, backend: flags.backend.clone(), show: flags.show as usize, how };
        let measured = console.watch("", |watch| measure_needs(&options, job, watch))?;
        for scene in &measured {
            console.line(format_args!("{}: {}", scene.volume, scene.scene))?;
            for line in scene.savings.lines() {
                console.line(format_args!("    {line}"))?;
            }
        }
        scenes.extend(measured);
    }
    write_needs(&flags.out, &machine::description(), &scenes)?;
    console.line(flags.out.join("needs.md").display())?;
    Ok(Outcome::of(scenes.iter().all(|s| s.savings.holds())))
}
