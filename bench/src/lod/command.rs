//! `pumice bench lod`

use std::path::PathBuf;

use clap::Args;
use pumice_core::Job;
use pumice_session::values::size;

use super::{LodOptions, measure_lod, write_lod};
use crate::console::{BenchResult, Console, Outcome};
use crate::files::{rising, volumes_or_shipped};
use crate::machine;

/// Levels of detail: picture error against frame time and resident bytes
///
/// Renders a figure of some labels at voxels, by distance, at cells of 4³ and at boxes of 16³, in pictures of each size, on the CPU, and
/// compares all with voxels at many samples. Writes lod.csv, lod.md and an SVG for each volume and size.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Label volumes; the shipped one by default
    #[arg(value_name = "FILE")]
    volumes: Vec<PathBuf>,
    /// Number of labels, the longest ones
    #[arg(long, value_name = "N", default_value = "30", value_parser = clap::value_parser!(u32).range(1..))]
    pick: u32,
    /// Picture sizes in pixels
    #[arg(long = "size", value_name = "WxH,…", value_delimiter = ',', default_value = "384x216,96x54", value_parser = size)]
    sizes: Vec<[u32; 2]>,
    /// Samples per pixel, in increasing order
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "1,4,16,64", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Vec<u32>,
    /// Pictures at each number of samples, over which results are averaged
    #[arg(long, value_name = "N", default_value = "3", value_parser = clap::value_parser!(u32).range(1..))]
    repeats: u32,
    /// Samples per pixel of the pictures that give each level's own error
    #[arg(long, value_name = "N", default_value = "512", value_parser = clap::value_parser!(u32).range(8..))]
    reference_spp: u32,
    /// Folder for the results, created if missing
    #[arg(long, value_name = "DIR", default_value = "pumice-lod")]
    out: PathBuf,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    rising(&flags.spp)?;
    let mut tables = Vec::new();
    for volume in volumes_or_shipped(&flags.volumes)? {
        let named = format!("{}: ", volume.display());
        let options = LodOptions {
            volume,
            pick: flags.pick as usize,
            sizes: flags.sizes.clone(),
            spp: flags.spp.clone(),
            repeats: flags.repeats,
            reference_spp: flags.reference_spp,
        };
        tables.extend(console.watch(&named, |watch| measure_lod(&options, job, watch))?);
    }
    write_lod(&flags.out, &machine::description(), &tables)?;
    console.line(flags.out.join("lod.md").display())?;
    Ok(Outcome::Holds)
}
