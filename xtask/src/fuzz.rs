//! `cargo xtask fuzz`: builds the fuzz targets with coverage instrumentation, and runs them.
//!
//! ```text
//! fuzz/ ──► target/fuzz/HOST/debug/TARGET ──► corpus (seeds, inputs that reached new code) in target/fuzz/corpus/TARGET
//!                                         └─► failing inputs                               in target/fuzz/findings/TARGET
//! ```
//! Stable Rust has no sanitizers, but it has LLVM's coverage pass. Cargo gets `--target` so that build scripts and macros are built
//! without instrumentation.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

/// Names of the targets, which are the files in `fuzz/targets`.
const TARGETS: [&str; 13] = [
    "pumice_file",
    "pumice_sections",
    "label_volume",
    "label_table",
    "raw_volume",
    "store",
    "server_answer",
    "hdf5_file",
    "relabel_table",
    "scene_json",
    "neuroglancer_state",
    "picture",
    "carried_scene",
];

/// The flags that cargo-fuzz passes to rustc, without the sanitizers.
const COVERAGE_FLAGS: [&str; 5] = [
    "-Cpasses=sancov-module",
    "-Cllvm-args=-sanitizer-coverage-level=4",
    "-Cllvm-args=-sanitizer-coverage-inline-8bit-counters",
    "-Cllvm-args=-sanitizer-coverage-pc-table",
    "-Cllvm-args=-sanitizer-coverage-trace-compares",
];

/// Seconds for one input after which it counts as failing.
const SLOW_INPUT_S: u32 = 10;
/// Resident memory in MiB above which an input counts as failing. The targets' allocator has tighter limits on allocations by Rust.
const RESIDENT_LIMIT_MIB: u32 = 2048;
/// Largest size of an input in bytes. Short inputs are fast, and all seeds fit.
const LONGEST_INPUT_BYTES: u32 = 8192;

/// Options of `cargo xtask fuzz`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Options {
    targets: Vec<&'static str>,
    seconds: u32,
    /// A single input to run instead of fuzzing.
    input: Option<PathBuf>,
}

impl Options {
    pub(crate) fn parse(args: &[String]) -> Result<Self, String> {
        let mut options = Self { targets: Vec::new(), seconds: 60, input: None };
        let mut args = args.iter();
        while let Some(arg) = args.next() {
            let mut value = || args.next().ok_or_else(|| format!("{arg} needs a value"));
            match arg.as_str() {
                "--seconds" => {
                    let text = value()?;
                    options.seconds = text
                        .parse()
                        .ok()
                        .filter(|&s| s > 0)
                        .ok_or_else(|| format!("--seconds {text}: expected a whole number above 0"))?;
                }
                "--input" => options.input = Some(value()?.into()),
                name => match TARGETS.into_iter().find(|&t| t == name) {
                    Some(target) => options.targets.push(target),
                    None => {
                        return Err(format!(
                            "unknown fuzz target {name}: expected one of {}",
                            TARGETS.join(", ")
                        ));
                    }
                },
            }
        }
        if options.input.is_some() && options.targets.len() != 1 {
            return Err("--input needs exactly one target: cargo xtask fuzz TARGET --input FILE".into());
        }
        if options.targets.is_empty() {
            options.targets = TARGETS.to_vec();
        }
        Ok(options)
    }
}

/// Builds and runs the targets; stops at the first failing input.
pub(crate) fn run(options: &Options) -> ExitCode {
    match build_and_fuzz(options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("xtask: {what}");
            ExitCode::FAILURE
        }
    }
}

fn build_and_fuzz(options: &Options) -> Result<(), String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().ok_or("xtask lies in no folder")?;
    let folder = root.join("target/fuzz");

    // libFuzzer is C++. Check for a compiler first, since the errors of the build would fill a page.
    let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".into());
    let mut trial = Command::new(&compiler);
    let found = trial.arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    if !found.is_ok_and(|status| status.success()) {
        return Err(format!(
            "libFuzzer needs a C++ compiler, and {compiler} does not run: install g++ or clang++, or set CXX"
        ));
    }

    let host = host()?;
    let mut build = Command::new(env!("CARGO"));
    build.args(["build", "--locked", "--target", &host]);
    build.arg("--manifest-path").arg(root.join("fuzz/Cargo.toml"));
    build.arg("--target-dir").arg(&folder);
    build.env("RUSTFLAGS", COVERAGE_FLAGS.join(" ")).env_remove("CARGO_ENCODED_RUSTFLAGS");
    for target in &options.targets {
        build.args(["--bin", target]);
    }
    succeed(build)?;

    // Inputs go through files, in memory if /dev/shm exists. The folder is removed afterwards in any case.
    let memory = Path::new("/dev/shm");
    let scratch = if memory.is_dir() { memory.to_owned() } else { folder.clone() };
    let scratch = scratch.join(format!("pumice-fuzz-{}", std::process::id()));
    make(&scratch)?;
    let programs = folder.join(host).join("debug");
    let result = options.targets.iter().try_for_each(|target| {
        let mut command = Command::new(programs.join(target));
        command.env("PUMICE_FUZZ_SCRATCH", &scratch).env("RAYON_NUM_THREADS", "1");
        fuzz(command, target, options, root)
    });
    std::fs::remove_dir_all(&scratch).map_err(|e| format!("{}: {e}", scratch.display()))?;
    result
}

fn fuzz(mut command: Command, target: &str, options: &Options, root: &Path) -> Result<(), String> {
    let folder = root.join("target/fuzz");
    command.arg(format!("-timeout={SLOW_INPUT_S}")).arg(format!("-rss_limit_mb={RESIDENT_LIMIT_MIB}"));
    if let Some(input) = &options.input {
        return succeed({
            command.arg(input);
            command
        });
    }
    let (corpus, findings) = (folder.join("corpus").join(target), folder.join("findings").join(target));
    make(&corpus)?;
    make(&findings)?;
    command.env("PUMICE_FUZZ_SEEDS", &corpus);
    command.arg(format!("-max_total_time={}", options.seconds));
    command.arg(format!("-max_len={LONGEST_INPUT_BYTES}"));
    command.arg(format!("-artifact_prefix={}/", findings.display()));
    command.arg("-print_final_stats=1");
    let dictionary = root.join(format!("fuzz/dictionaries/{target}.dict"));
    if dictionary.exists() {
        command.arg(format!("-dict={}", dictionary.display()));
    }
    command.arg(&corpus);
    succeed(command).map_err(|what| {
        format!(
            "{what}\nThe failing input is in {}; cargo xtask fuzz {target} --input FILE runs it alone.",
            findings.display()
        )
    })
}

/// The target triple of the host.
fn host() -> Result<String, String> {
    let output = Command::new("rustc").arg("-vV").output().map_err(|e| format!("rustc -vV: {e}"))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).ok_or_else(|| "rustc -vV: expected a line `host: …`, found none".into())
}

fn make(folder: &Path) -> Result<(), String> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))
}

fn succeed(mut command: Command) -> Result<(), String> {
    let program =
        Path::new(command.get_program()).file_name().unwrap_or_default().to_string_lossy().into_owned();
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("{program}: {status}")),
        Err(e) => Err(format!("{program}: {e}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Options, String> {
        Options::parse(&line.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
    }

    #[test]
    fn options_are_understood_or_refused() {
        assert_eq!(parse("").unwrap().targets, TARGETS);
        let one = parse("picture --seconds 7").unwrap();
        assert_eq!((one.targets, one.seconds), (vec!["picture"], 7));
        for wrong in ["pictures", "--seconds", "--seconds 0", "--seconds x", "--input f"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }

    /// Each target is in the crate's manifest and has a source file, and no source file is missing from the list.
    #[test]
    fn the_list_is_the_crates() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("fuzz");
        let manifest = std::fs::read_to_string(root.join("Cargo.toml")).unwrap();
        for target in TARGETS {
            assert!(manifest.contains(&format!("path = \"targets/{target}.rs\"")), "{target}");
            assert!(root.join(format!("targets/{target}.rs")).is_file(), "{target}");
        }
        assert_eq!(std::fs::read_dir(root.join("targets")).unwrap().count(), TARGETS.len());
    }
}
