//! Development tasks of the project: `cargo xtask test` prepares and runs the tests, `cargo xtask fuzz` searches for inputs that break a
//! reader, and more; `HELP` lists them all.
#![forbid(unsafe_code)]

mod blender;
mod closing_lines;
mod cpu_seconds;
mod extension;
mod fuzz;
mod gpu_stats;
mod part;
mod private_mesa;
mod python_env;
mod seconds_table;
mod shaders;
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
       cargo xtask extension [--wheel FILE] [--out FOLDER]
       cargo xtask wheel [--out FOLDER]
       cargo xtask test-window [--suite trixie|sid] [--gpu opengl|vulkan] [--out FOLDER]
       cargo xtask stub
       cargo xtask shaders [--check [--share K]]
       cargo xtask gpu-stats [FAMILY]... [--scene NAME]... [--out FOLDER]
       cargo xtask fuzz [TARGET]... [--seconds N]
       cargo xtask fuzz TARGET --input FILE

test: prepares what the tests need and runs them, part by part; prints a table of seconds at the end.

  --full        run all tests, also those that take hours (marked `ignore = \"full: …\"` in Rust, `full` in Python),
                and those of import in Blender 4.2.23 too
  --only PART   run only this part (may be given more than once; build and python-env run if the part needs them)
  --share K     run the K-th share of the long tests beside the ordinary ones, instead of today's share
  --bpy VERSION test the extension in another Blender that exists as a wheel for Python 3.11 (4.2.23, 4.5.15)
  --list        print the parts and their time limits in seconds

extension: builds the zip that users install in Blender, with the Python module for this machine inside.

  --wheel FILE  put this wheel into it, which may be of another platform, instead of building one
  --out FOLDER  also copy it into this folder; it is always in target/extension

wheel: builds the Python module for all machines with this system; on Linux for glibc 2.27 and newer, by zig.

  --out FOLDER  write it into this folder instead of target/wheels/portable

test-window: drives the extension in a real Blender window without a screen; screenshots and measurements go to target/window. Needs root
and mmdebstrap: it builds a Debian with Blender, Xvfb and software OpenGL and Vulkan under target/ (365 MB to fetch, once).

  --suite NAME  trixie: Blender 4.3.2 (default); sid: Blender 5.2 or newer
  --gpu NAME    graphics API that Blender uses: opengl (default) or vulkan
  --out FOLDER  also copy screenshots and measurements into this folder

stub: regenerates python/pumice/_native.pyi from the source.

shaders: compiles vulkan-renderer/shaders to vulkan-renderer/spirv, with a compiler that it unpacks under target/ (Debian, Ubuntu).

  --check       do not write; fail if the compiled shaders do not match their sources
  --share K     compile again only the quarter of them whose turn it is in this share; the others are compared by their hashes

gpu-stats: prints registers, spills and instructions of the shaders, as Mesa's compiler counts them for AMD cards that are not there.

  FAMILY        navi21, navi31 or gfx1201 (default: all)
  --scene NAME  diffuse, principled or all, as of `pumice bench shaders` (default: each of them)
  --out FOLDER  also write shaders.md and shaders.json into this folder

fuzz: feeds one reader after another with inputs guided by coverage (needs a C++ compiler); stops at the first failing input.

  --seconds N   time for each target (default 60); its corpus is kept in target/fuzz for the next run
  --input FILE  run only this input, for example a failing one

Environment: VK_DRIVER_FILES selects the Vulkan driver of the tests; if it is not set, a driver for the CPU is unpacked under target/.
PUMICE_SHARED_DATA is the folder of volumes that may not be shipped (default: ../shared/data).
Exit codes: 0 success; 1 something failed, ran no test, or hit its time limit; 2 bad usage.";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let Some((command, rest)) = args.split_first() else { return misused(None) };
    match command.as_str() {
        "test" => parsed(test_command::Options::parse(rest), |o| test_command::run(&o)),
        "extension" => {
            parsed(extension::Options::parse(rest), |o| told(extension::run(&root(), &target(), &o)))
        }
        "test-window" => parsed(window::Options::parse(rest), |o| told(window::run(&root(), &target(), &o))),
        "wheel" => parsed(wheel::Options::parse(rest), |o| {
            told(wheel::build_portable(&root(), &target(), o.out.as_deref()))
        }),
        "stub" if rest.is_empty() => told(wheel::update_stub(&root(), &target())),
        "shaders" => parsed(shaders::Options::parse(rest), |o| told(shaders::run(&root(), &target(), &o))),
        "gpu-stats" => {
            parsed(gpu_stats::Options::parse(rest), |o| told(gpu_stats::run(&root(), &target(), &o)))
        }
        "fuzz" => parsed(fuzz::Options::parse(rest), |o| fuzz::run(&o)),
        "--help" | "-h" if rest.is_empty() => {
            println!("{HELP}");
            ExitCode::SUCCESS
        }
        _ => misused(None),
    }
}

/// Runs the command if its options could be parsed.
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

/// Prints the one line of a failure and returns the exit code.
fn told(result: Result<(), String>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("xtask: {what}");
            ExitCode::FAILURE
        }
    }
}

/// The root folder of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new(".")).to_path_buf()
}

/// Cargo's target folder.
fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}
