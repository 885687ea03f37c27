//! The project's own errands: `cargo xtask test` makes ready what the tests need and runs them, `cargo xtask fuzz` looks for inputs
//! that a reader cannot bear.
#![forbid(unsafe_code)]

mod closing_lines;
mod cpu_seconds;
mod extension;
mod fuzz;
mod part;
mod python_env;
mod seconds_table;
mod share;
mod shared_data;
mod test_command;
mod wheel;
mod window;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use crate::part::Outcome;

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
  --bpy VERSION another Blender for the extension's tests, of those that are wheels for Python 3.11
  --list        name the parts and their caps in seconds

extension: builds the zip that users install in Blender, with the Python module for this platform inside.

test-window: drives the extension in a real Blender window without a screen (as root on Debian: builds a root with Blender, Xvfb and
             software OpenGL and Vulkan under target/, 365 MB to fetch); screenshots and figures go to target/window.

stub: writes python/pumice/_native.pyi anew from the source.

fuzz: gives inputs led by coverage to one reader after the other (needs a C++ compiler); stops at the first finding.

  --seconds N   how long each target runs (default 60); what it learns is kept in target/fuzz for the next run
  --input FILE  run one input, say a finding, alone

Environment: PUMICE_SHARED_DATA is the folder of volumes that may not be shipped (default: ../shared/data).
Exit codes: 0 all passed; 1 a part failed, ran no test, or hit its cap; 2 bad usage.";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.split_first() {
        Some((command, rest)) if command == "test" => match test_command::Options::parse(rest) {
            Ok(options) => test_command::run(&options),
            Err(what) => {
                eprintln!("xtask: {what}\n\n{HELP}");
                ExitCode::from(2)
            }
        },
        Some((command, rest)) if command == "extension" => told(extension::run(&root(), &target(), rest)),
        Some((command, rest)) if command == "test-window" => told(window::run(&root(), &target(), rest)),
        Some((command, [])) if command == "stub" => told(match wheel::update_stub(&root(), &target()) {
            Err(Outcome::Failed(what)) => Err(what),
            _ => Ok(()),
        }),
        Some((command, rest)) if command == "fuzz" => match fuzz::Options::parse(rest) {
            Ok(options) => fuzz::run(&options),
            Err(what) => {
                eprintln!("xtask: {what}\n\n{HELP}");
                ExitCode::from(2)
            }
        },
        Some((flag, [])) if flag == "--help" || flag == "-h" => {
            println!("{HELP}");
            ExitCode::SUCCESS
        }
        _ => {
            eprintln!("{HELP}");
            ExitCode::from(2)
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

fn told(result: Result<(), String>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("xtask: {what}");
            ExitCode::from(2)
        }
    }
}
