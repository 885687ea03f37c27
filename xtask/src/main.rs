//! The project's own errands: `cargo xtask test` makes ready what the tests need and runs them, `cargo xtask fuzz` looks for inputs
//! that a reader cannot bear.
#![forbid(unsafe_code)]

mod blender;
mod closing_lines;
mod cpu_seconds;
mod extension;
mod fuzz;
mod part;
mod python_env;
mod seconds_table;
mod share;
mod shared_data;
mod step;
mod test_command;
mod wheel;
mod window;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

const HELP: &str = "\
Usage: cargo xtask test [--full] [--only PART]... [--share K] [--bpy VERSION] [--list]
       cargo xtask extension [--out FOLDER]
       cargo xtask test-window [--suite trixie|sid] [--gpu opengl|vulkan] [--out FOLDER]
       cargo xtask stub
       cargo xtask fuzz [TARGET]... [--seconds N]
       cargo xtask fuzz TARGET --input FILE

test: makes ready what the tests need and runs them, part by part; prints a table of seconds at the end.

  --full        run everything, also what takes hours (tests marked `ignore = \"full: …\"` in Rust, `full` in Python)
  --only PART   run this part alone (may be given more than once; build and python-env run where the part needs them)
  --share K     the K-th share of the full set beside the ordinary tests, instead of today's
  --bpy VERSION another Blender for the extension's tests, of those that are wheels for Python 3.11 (4.2.23, 4.5.15)
  --list        name the parts and their caps in seconds

extension: builds the zip that users install in Blender, with the Python module for this platform inside.

  --out FOLDER  where to put it besides target/extension

test-window: drives the extension in a real Blender window without a screen; screenshots and figures go to target/window. Needs to be
root and mmdebstrap: it builds a Debian with Blender, Xvfb and software OpenGL and Vulkan under target/ (365 MB to fetch, once).

  --suite NAME  trixie: Blender 4.3.2 (default); sid: Blender 5.2 or newer
  --gpu NAME    what Blender draws with: opengl (default) or vulkan
  --out FOLDER  where to copy screenshots and figures

stub: writes python/pumice/_native.pyi anew from the source.

fuzz: gives inputs led by coverage to one reader after the other (needs a C++ compiler); stops at the first finding.

  --seconds N   how long each target runs (default 60); what it learns is kept in target/fuzz for the next run
  --input FILE  run one input, say a finding, alone

Environment: PUMICE_SHARED_DATA is the folder of volumes that may not be shipped (default: ../shared/data).
Exit codes: 0 all went well; 1 something failed, ran no test, or hit its cap; 2 bad usage.";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let Some((command, rest)) = args.split_first() else { return misused(None) };
    match command.as_str() {
        "test" => parsed(test_command::Options::parse(rest), |o| test_command::run(&o)),
        "extension" => {
            parsed(extension::Options::parse(rest), |o| told(extension::run(&root(), &target(), &o)))
        }
        "test-window" => parsed(window::Options::parse(rest), |o| told(window::run(&root(), &target(), &o))),
        "stub" if rest.is_empty() => told(wheel::update_stub(&root(), &target())),
        "fuzz" => parsed(fuzz::Options::parse(rest), |o| fuzz::run(&o)),
        "--help" | "-h" if rest.is_empty() => {
            println!("{HELP}");
            ExitCode::SUCCESS
        }
        _ => misused(None),
    }
}

/// Runs what was asked for, if it was understood.
fn parsed<O>(options: Result<O, String>, run: impl FnOnce(O) -> ExitCode) -> ExitCode {
    match options {
        Ok(options) => run(options),
        Err(what) => misused(Some(what)),
    }
}

fn misused(what: Option<String>) -> ExitCode {
    match what {
        Some(what) => eprintln!("xtask: {what}\n\n{HELP}"),
        None => eprintln!("{HELP}"),
    }
    ExitCode::from(2)
}

/// The exit code of an errand; its failure is one line.
fn told(result: Result<(), String>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("xtask: {what}");
            ExitCode::FAILURE
        }
    }
}

/// The project's folder.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new(".")).to_path_buf()
}

/// Where everything is built.
fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}
