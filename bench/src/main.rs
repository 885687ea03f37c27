//! Sizes, speeds, and error against time of given volumes, as Markdown and CSV.
//!
//! It drives the programs that users run (`pumice`, and the examples `build_speed`, `ray_rate`, `live_latency` and `backend_speed`, which measure what no
//! command reports) and puts their figures into tables: so it measures what is shipped, and has no second copy of anything.
//!
//! ```text
//! cargo run --release -p pumice-bench -- sizes|speeds|live|backends|convergence VOLUME… [--out bench/results]
//! ```
#![forbid(unsafe_code)]

mod backends;
mod convergence;
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
Usage: cargo run --release -p pumice-bench -- BENCH VOLUME… [--backends NAME,NAME…] [--out FOLDER]

  sizes         bytes in memory by part, on disk by level, in per cent of 4 bytes a voxel
  speeds        parts, finish, saving, opening, rays: per CPU-second (volumes of u32 labels)
  live          how soon a live 1920 × 1080 picture follows an edit, and what the edit costs its caller
  backends      rays and frames per second on each backend (or those that are named), bytes on the device
  convergence   relMSE against a reference of 64 times as many samples, by CPU-seconds (on the first backend that is named, or the CPU)

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
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--out" => out = Some(PathBuf::from(args.next().ok_or("--out needs a folder")?)),
            "--backends" => {
                let list = args.next().ok_or("--backends needs names, with commas between them")?;
                backends = list.split(',').map(str::to_owned).collect();
            }
            _ => volumes.push(PathBuf::from(arg)),
        }
    }
    if volumes.is_empty() {
        return Err("name at least one volume".into());
    }
    let build = Programs::build;
    let table = match bench.as_str() {
        "sizes" => sizes::measure(&build()?, &volumes)?,
        "speeds" => speeds::measure(&build()?, &volumes)?,
        "live" => live::measure(&build()?, &volumes)?,
        "convergence" => convergence::measure(&build()?, &volumes, backends.first().map_or("cpu", |b| b))?,
        "backends" => {
            let programs = build()?;
            let backends = if backends.is_empty() { backends::usable(&programs)? } else { backends };
            backends::measure(&programs, &volumes, &backends)?
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
