//! `pumice bench convergence`

use std::path::PathBuf;

use clap::Args;
use pumice_core::Job;
use pumice_session::shipped_volume;
use pumice_session::values::size;

use super::{ConvergenceOptions, measure_convergence, write_convergence};
use crate::console::{BenchResult, Console, Outcome};
use crate::files::rising;
use crate::machine;

/// Error against CPU seconds, beside Cycles if --cycles names a Python with Blender
///
/// Renders a figure of some labels with increasing numbers of samples, and the same voxels as a mesh with Cycles on the same cores.
/// Compares both with a reference of many samples by both programs. Writes convergence.csv, convergence.md and an SVG for each number
/// of bounces.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Label volume; the shipped one by default
    #[arg(value_name = "FILE")]
    volume: Option<PathBuf>,
    /// Python interpreter that has Blender as the module bpy
    #[arg(long, value_name = "PYTHON")]
    cycles: Option<PathBuf>,
    /// Number of labels, the longest ones
    #[arg(long, value_name = "N", default_value = "30", value_parser = clap::value_parser!(u32).range(1..))]
    pick: u32,
    /// Picture size in pixels
    #[arg(long, value_name = "WxH", default_value = "240x135", value_parser = size)]
    size: [u32; 2],
    /// Samples per pixel, in increasing order
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "1,4,16,64", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Vec<u32>,
    /// Numbers of bounces; each is a scene of its own
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "1,8")]
    bounces: Vec<u32>,
    /// Pictures at each number of samples, over which results are averaged
    #[arg(long, value_name = "N", default_value = "3", value_parser = clap::value_parser!(u32).range(1..))]
    repeats: u32,
    /// Samples per pixel of the reference, by each program
    #[arg(long, value_name = "N", default_value = "4096", value_parser = clap::value_parser!(u32).range(8..))]
    reference_spp: u32,
    /// Folder for the results, created if missing
    #[arg(long, value_name = "DIR", default_value = "pumice-convergence")]
    out: PathBuf,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    rising(&flags.spp)?;
    let volume = match &flags.volume {
        Some(path) => path.clone(),
        None => shipped_volume()?,
    };
    let mut scenes = Vec::new();
    for &bounces in &flags.bounces {
        let options = ConvergenceOptions {
            volume: volume.clone(),
            cycles: flags.cycles.clone(),
            pick: flags.pick as usize,
            size: flags.size,
            spp: flags.spp.clone(),
            repeats: flags.repeats,
            bounces,
            reference_spp: flags.reference_spp,
        };
        let named = format!("{bounces} bounces: ");
        let scene = console.watch(&named, |watch| measure_convergence(&options, job, watch))?;
        if let Some(ratio) = scene.cpu_ratio_at_equal_error() {
            console
                .line(format_args!("{named}{:.0} % of Cycles' CPU seconds at equal error", 100.0 * ratio))?;
        }
        scenes.push(scene);
    }
    write_convergence(&flags.out, &machine::description(), &scenes)?;
    console.line(flags.out.join("convergence.md").display())?;
    Ok(Outcome::Holds)
}
