//! Sizes, speeds, and error against time of given volumes, as Markdown and CSV.
//!
//! It drives the programs that users run (`pumice`, and the examples `build_speed`, `ray_rate`, `live_latency`, `backend_speed`, `instance_speed` and `embree_rays`, which measure
//! what no command reports) and puts their figures into tables: so it measures what is shipped, and has no second copy of anything.
//!
//! ```text
//! cargo run --release -p pumice-bench -- sizes|speeds|live|backends|instances|embree|convergence VOLUME… [--out bench/results]
//! ```
#![forbid(unsafe_code)]

mod backends;
mod convergence;
mod embree;
mod instances;
mod live;
mod machine;
mod programs;
mod sizes;
mod speeds;
mod table;

use std::path::PathBuf;
use std::process::ExitCode;

use crate::programs::Programs;

/// Why a bench stopped: one line.
type Result<T> = std::result::Result<T, String>;

const USAGE: &str = "\
Usage: cargo run --release -p pumice-bench -- BENCH VOLUME… [--backends NAME,NAME…] [--size WxH] [--spp N] [--embree PREFIX] [--side N] [--out FOLDER]

  sizes         bytes in memory by part, on disk by level, in per cent of 4 bytes a voxel
  speeds        parts, finish, saving, opening, rays: per CPU-second (volumes of u32 labels)
  live          how soon a live 1920 × 1080 picture follows an edit, and what the edit costs its caller
  backends      rays and frames on each backend (or those that are named), of 1920x1080 or the size; bytes on the device
  instances     what many instances of a volume (or of a mesh: `mesh`) cost a sample, in turn and by a hierarchy over them
  embree        the same rays through Embree, by the voxels' faces as quads (15 % of the labels shown; N × N primary rays)
  convergence   relMSE against a reference of 64 times as many samples (128 or N at most), by CPU-seconds, on the CPU
  errors        the same on each backend (or those that are named), by seconds

Prints Markdown; with --out also writes BENCH.md and BENCH.csv there, with the machine's description.";

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("pumice-bench: {what}");
            ExitCode::from(2)
        }
    }
}

fn run() -> Result<()> {
    let mut args = std::env::args().skip(1);
    let bench = args.next().ok_or(USAGE)?;
    let (mut volumes, mut out, mut backends) = (Vec::new(), None, Vec::new());
    let (mut size, mut most_spp) = ("1920x1080".to_owned(), 128);
    let (mut embree, mut side) = (None, "1024".to_owned());
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--out" => out = Some(PathBuf::from(args.next().ok_or("--out needs a folder")?)),
            "--backends" => {
                let list = args.next().ok_or("--backends needs names, with commas between them")?;
                backends = list.split(',').map(str::to_owned).collect();
            }
            "--size" => size = args.next().ok_or("--size needs WIDTHxHEIGHT")?,
            "--embree" => embree = Some(PathBuf::from(args.next().ok_or("--embree needs a folder")?)),
            "--side" => {
                let number = args.next().filter(|n| n.parse::<u32>().is_ok_and(|n| n >= 8 && n % 8 == 0));
                side = number.ok_or("--side needs a multiple of 8")?;
            }
            "--spp" => {
                let number = args.next().and_then(|n| n.parse().ok()).filter(|&n: &u32| n > 0);
                most_spp = number.ok_or("--spp needs a number of samples")?;
            }
            _ => volumes.push(PathBuf::from(arg)),
        }
    }
    if volumes.is_empty() {
        return Err("name at least one volume".into());
    }
    const PUMICE: [&str; 3] = ["pumice", "--bin", "pumice"];
    let example = |package, name| [package, "--example", name];
    let build = || {
        Programs::build(&match bench.as_str() {
            "speeds" => {
                vec![PUMICE, example("pumice-core", "build_speed"), example("pumice-cpu", "ray_rate")]
            }
            "live" => vec![example("pumice-session", "live_latency")],
            "instances" => vec![example("pumice-session", "instance_speed")],
            "embree" => vec![example("pumice-session", "embree_rays")],
            // Who names the backends need not ask what is here.
            "backends" if !backends.is_empty() => vec![example("pumice-session", "backend_speed")],
            "backends" => vec![PUMICE, example("pumice-session", "backend_speed")],
            _ => vec![PUMICE],
        })
    };
    let named = |programs: &Programs| match backends.is_empty() {
        true => backends::usable(programs),
        false => Ok(backends.clone()),
    };
    let table = match bench.as_str() {
        "sizes" => sizes::measure(&build()?, &volumes)?,
        "speeds" => speeds::measure(&build()?, &volumes)?,
        "live" => live::measure(&build()?, &volumes)?,
        "instances" => instances::measure(&build()?, &volumes)?,
        "embree" => embree::measure(&build()?, &volumes, embree.as_deref(), &side)?,
        "convergence" => convergence::measure(&build()?, &volumes, &["cpu".to_owned()], most_spp)?,
        "backends" => {
            let programs = build()?;
            backends::measure(&programs, &volumes, &named(&programs)?, &size)?
        }
        "errors" => {
            let programs = build()?;
            convergence::measure(&programs, &volumes, &named(&programs)?, most_spp)?
        }
        _ => return Err(USAGE.into()),
    };
    let page = format!("# {bench}\n\n{}\n\n{}", machine::description(), table.markdown());
    println!("{page}");
    if let Some(folder) = out {
        std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        for (ending, text) in [("md", page), ("csv", table.csv())] {
            let path = folder.join(format!("{bench}.{ending}"));
            std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
        }
    }
    Ok(())
}
