//! `cargo xtask test-window`: the extension in a real Blender window, driven by `blender-addon/tests/window_drive.py`.
//!
//! ```text
//! target/window/root-SUITE   a Debian root with Blender (made once)
//! target/window/SUITE-GPU    what the run shares with it: the zip, the driver, a volume; out/ has screenshots and figures.json
//! ```

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::extension;
use crate::python_env::TESTS;

/// Seconds that a run may take: software drawing on two cores is slow.
const LIMIT_S: u32 = 1200;
/// What is looked at: small enough for software drawing.
const VOLUME: &str = "data/platynereis_nuclei.tif";

pub(crate) fn run(root: &Path, target: &Path, args: &[String]) -> Result<(), String> {
    let (mut suite, mut gpu, mut out) = ("trixie", "opengl", None);
    let mut args = args.iter();
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or_else(|| format!("{arg} needs a value"));
        match arg.as_str() {
            "--suite" => {
                suite = match value()?.as_str() {
                    "trixie" => "trixie",
                    "sid" => "sid",
                    other => return Err(format!("--suite {other}: expected trixie or sid")),
                }
            }
            "--gpu" => {
                gpu = match value()?.as_str() {
                    "opengl" => "opengl",
                    "vulkan" => "vulkan",
                    other => return Err(format!("--gpu {other}: expected opengl or vulkan")),
                }
            }
            "--out" => out = Some(PathBuf::from(value()?)),
            _ => return Err(format!("unknown argument {arg}")),
        }
    }
    let scripts = root.join("xtask/window");
    let system = target.join("window").join(format!("root-{suite}"));
    if !system.join("usr/bin/blender").exists() {
        std::fs::create_dir_all(target.join("window")).map_err(|e| format!("target/window: {e}"))?;
        finish(Command::new(scripts.join("make-root.sh")).arg(suite).arg(&system))?;
    }

    // What the run shares with the root, anew each time.
    extension::run(root, target, &[])?;
    let shared = target.join("window").join(format!("{suite}-{gpu}"));
    let _ = std::fs::remove_dir_all(&shared);
    std::fs::create_dir_all(shared.join("out")).map_err(|e| format!("{}: {e}", shared.display()))?;
    for (from, name) in [
        (extension::zip(target, "release"), "pumice.zip"),
        (root.join("blender-addon/tests/window_drive.py"), "drive.py"),
        (scripts.join("drive.sh"), "drive.sh"),
        (root.join(VOLUME), "volume.tif"),
    ] {
        std::fs::copy(&from, shared.join(name)).map_err(|e| format!("{}: {e}", from.display()))?;
    }

    let driven = finish(
        Command::new(scripts.join("in-root.sh"))
            .args([system.as_path(), &shared, Path::new("/w/drive.sh")])
            .args([gpu, &LIMIT_S.to_string()]),
    );
    // Screenshots are worth the most where it failed.
    let shots = std::fs::read_dir(shared.join("out")).map_err(|e| format!("{}: {e}", shared.display()))?;
    let shots: Vec<PathBuf> =
        shots.flatten().map(|e| e.path()).filter(|p| p.extension().is_some_and(|x| x == "xwd")).collect();
    if !shots.is_empty() {
        finish(Command::new(TESTS.interpreter(target)).arg(scripts.join("xwd2png.py")).args(&shots))?;
    }
    if let Ok(figures) = std::fs::read_to_string(shared.join("out/figures.json")) {
        println!("{figures}");
    }
    if let Some(folder) = out {
        finish(Command::new("cp").arg("-r").arg("--").arg(shared.join("out")).arg(&folder))?;
    }
    driven
}

/// Runs a command to its end.
fn finish(command: &mut Command) -> Result<(), String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let status = command.status().map_err(|e| format!("{name}: {e}"))?;
    if status.success() { Ok(()) } else { Err(format!("{status} of {name}")) }
}
