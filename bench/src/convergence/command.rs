//! `pumice bench convergence`

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use pumice_core::Job;
use pumice_session::error::{Result, SessionError};
use pumice_session::shipped_volume;
use pumice_session::values::size;

use super::real_light::{
    LEAST_SPP, LightScene, RealLightOptions, measure_real_light, volumes_or_those_of_real_light,
    write_real_light,
};
use super::{ConvergenceOptions, measure_convergence, write_convergence};
use crate::console::{BenchResult, Console, Outcome};
use crate::files::{rising, scratch};
use crate::machine;

/// What is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Scenes {
    /// A Lambert figure under a constant sky and a sun, against a common reference
    Figure,
    /// Six scenes in the light that artists use, by the variance between seeds
    RealLight,
}

/// Error against CPU seconds, beside Cycles if --with-blender names a Python with Blender
///
/// Renders a figure of some labels with increasing numbers of samples, and the same voxels as a mesh with Cycles on the same cores.
/// Compares both with a reference of many samples by both programs. Writes convergence.csv, convergence.md and an SVG for each number
/// of bounces.
///
/// With --scenes real-light, renders six scenes with skies, suns, lamps, emissive labels, metal, glass and coat, and compares the
/// variance of pixels between seeds. Writes convergence_real_light.csv, .md and an SVG for each scene.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Label volumes: one for a figure, any number for real light; the shipped ones by default
    #[arg(value_name = "FILE")]
    volumes: Vec<PathBuf>,
    /// Python interpreter that has Blender as the module bpy
    #[arg(long, value_name = "PYTHON", visible_alias = "with-blender")]
    cycles: Option<PathBuf>,
    /// What is rendered
    #[arg(long, value_enum, default_value = "figure")]
    scenes: Scenes,
    /// Number of labels, the longest ones
    #[arg(long, value_name = "N", default_value = "30", value_parser = clap::value_parser!(u32).range(1..))]
    pick: u32,
    /// Picture size in pixels
    #[arg(long, value_name = "WxH", default_value = "240x135", value_parser = size)]
    size: [u32; 2],
    /// Samples per pixel, in increasing order [default: 1,4,16,64; real light 4,16,64,256, from 4 on]
    #[arg(long, value_name = "N,…", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<Vec<u32>>,
    /// Numbers of bounces, each a scene of its own; one for real light [default: 1,8; real light 8]
    #[arg(long, value_name = "N,…", value_delimiter = ',')]
    bounces: Option<Vec<u32>>,
    /// Pictures at each number of samples, each with its own seed [default: 3; real light 8, from 2 on]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    repeats: Option<u32>,
    /// Samples per pixel of the reference, by each program [default: 4096]; not for real light, which needs none
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(8..))]
    reference_spp: Option<u32>,
    /// Only these scenes in real light
    #[arg(long, value_name = "NAME,…", value_enum, value_delimiter = ',')]
    only: Option<Vec<LightScene>>,
    /// Also measure kinds of light one by one, direct light, and matte and unfiltered pictures, with N samples; in real light
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..))]
    parts: Option<u32>,
    /// Keep the scenes and their skies in this folder, for pumice verify-render; in real light
    #[arg(long, value_name = "DIR")]
    keep_scenes: Option<PathBuf>,
    /// Folder for the results, created if missing
    #[arg(long, value_name = "DIR", default_value = "pumice-convergence")]
    out: PathBuf,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    match flags.scenes {
        Scenes::Figure => run_figure(flags, job, console),
        Scenes::RealLight => run_real_light(flags, job, console),
    }
}

fn run_figure(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    for (flag, is_given) in [
        ("only", flags.only.is_some()),
        ("parts", flags.parts.is_some()),
        ("keep-scenes", flags.keep_scenes.is_some()),
    ] {
        if is_given {
            return Err(wrong(format!("--{flag}: expected --scenes real-light, got figure")).into());
        }
    }
    let spp = flags.spp.clone().unwrap_or_else(|| vec![1, 4, 16, 64]);
    rising(&spp)?;
    let volume = match &flags.volumes[..] {
        [] => shipped_volume()?,
        [path] => path.clone(),
        more => return Err(wrong(format!("FILE: expected one volume, got {}", more.len())).into()),
    };
    let mut scenes = Vec::new();
    for &bounces in flags.bounces.as_deref().unwrap_or(&[1, 8]) {
        let options = ConvergenceOptions {
            volume: volume.clone(),
            cycles: flags.cycles.clone(),
            pick: flags.pick as usize,
            size: flags.size,
            spp: spp.clone(),
            repeats: flags.repeats.unwrap_or(3),
            bounces,
            reference_spp: flags.reference_spp.unwrap_or(4096),
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

fn run_real_light(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let options = real_light_options(flags)?;
    // Without a folder to keep them in, the scenes disappear with this value.
    let temporary = scratch()?;
    let folder = flags.keep_scenes.as_deref().unwrap_or(temporary.path());
    let results = console.watch("", |watch| measure_real_light(&options, folder, job, watch))?;
    write_real_light(&flags.out, &machine::description(), &results)?;
    console.line(flags.out.join("convergence_real_light.md").display())?;
    Ok(Outcome::Holds)
}

fn real_light_options(flags: &Flags) -> Result<RealLightOptions> {
    let spp = flags.spp.clone().unwrap_or_else(|| vec![4, 16, 64, 256]);
    rising(&spp)?;
    if let Some(few) = spp.first().filter(|&&n| n < LEAST_SPP) {
        return Err(wrong(format!("--spp: expected at least {LEAST_SPP} samples in real light, got {few}")));
    }
    let repeats = flags.repeats.unwrap_or(8);
    if repeats < 2 {
        return Err(wrong(format!("--repeats: expected at least 2 seeds in real light, got {repeats}")));
    }
    if let Some(n) = flags.reference_spp {
        return Err(wrong(format!(
            "--reference-spp: expected none in real light, which has no reference, got {n}"
        )));
    }
    let bounces = match flags.bounces.as_deref() {
        None => 8,
        Some([one]) => *one,
        Some(more) => {
            return Err(wrong(format!("--bounces: expected one number in real light, got {}", more.len())));
        }
    };
    Ok(RealLightOptions {
        volumes: volumes_or_those_of_real_light(&flags.volumes)?,
        cycles: flags.cycles.clone(),
        scenes: flags.only.clone().unwrap_or_else(|| LightScene::value_variants().to_vec()),
        pick: flags.pick as usize,
        size: flags.size,
        spp,
        repeats,
        bounces,
        parts_spp: flags.parts,
    })
}

fn wrong(text: String) -> SessionError {
    SessionError::Caller(text)
}
