//! `cargo xtask test-window`: tests the extension in a real Blender window, driven by `blender-addon/tests/window_drive.py`.
//!
//! ```text
//! target/window/root-SUITE   a Debian root with Blender (made once)
//! target/window/SUITE-GPU    files that the run shares with it: the zip, the driver script, a volume; out/: screenshots, figures.json
//! ```

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::extension;
use crate::python_env::Environment;
use crate::step::Step;

/// Time limit of a run in seconds. With all rendering in software, 310 s were measured on two cores with other work on them.
const LIMIT_S: u32 = 3600;
/// The volume that is imported; small enough for software rendering.
const VOLUME: &str = "data/platynereis_nuclei.tif";

/// Options of `cargo xtask test-window`.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Options {
    suite: &'static str,
    gpu: &'static str,
    out: Option<PathBuf>,
}

impl Options {
    pub(crate) fn parse(args: &[String]) -> Result<Self, String> {
        let mut options = Self { suite: "trixie", gpu: "opengl", out: None };
        let mut args = args.iter();
        while let Some(arg) = args.next() {
            let mut one_of = |names: [&'static str; 2]| {
                let value = args.next().ok_or_else(|| format!("{arg} needs a value"))?;
                let name = names.into_iter().find(|n| n == value);
                name.ok_or_else(|| format!("{arg} {value}: expected {} or {}", names[0], names[1]))
            };
            match arg.as_str() {
                "--suite" => options.suite = one_of(["trixie", "sid"])?,
                "--gpu" => options.gpu = one_of(["opengl", "vulkan"])?,
                "--out" => {
                    options.out = Some(args.next().ok_or_else(|| format!("{arg} needs a value"))?.into());
                }
                _ => return Err(format!("unknown argument {arg}")),
            }
        }
        Ok(options)
    }
}

/// Makes the Debian root if it is missing, runs the driver in the window, and converts its screenshots to PNG.
pub(crate) fn run(root: &Path, target: &Path, options: &Options) -> Result<(), String> {
    let Options { suite, gpu, out } = options;
    // Check requirements before building, which takes minutes.
    needs_root(Command::new("id").arg("-u"))?;
    for (tool, package) in
        [("mmdebstrap", "mmdebstrap"), ("unshare", "util-linux"), ("mount", "mount"), ("chroot", "coreutils")]
    {
        needs(tool, package)?;
    }
    let scripts = root.join("xtask/window");
    let system = target.join("window").join(format!("root-{suite}"));
    make(&target.join("window"))?;
    let mut system_made = Command::new(scripts.join("make-root.sh"));
    system_made.arg(suite).arg(&system);
    Step::or_say(system_made, format!("the Debian {suite} with Blender could not be made: see above"))
        .finish()?;

    // Make the folder that is shared with that system from scratch.
    extension::run(root, target, &extension::Options::default())?;
    let shared = target.join("window").join(format!("{suite}-{gpu}"));
    if shared.exists() {
        std::fs::remove_dir_all(&shared).map_err(|e| format!("{}: {e}", shared.display()))?;
    }
    let made = shared.join("out");
    make(&made)?;
    for (from, name) in [
        (extension::zip(target, "release"), "pumice.zip"),
        (root.join("blender-addon/tests/window_drive.py"), "drive.py"),
        (root.join("blender-addon/tests/window_overlays.py"), "window_overlays.py"),
        (root.join("blender-addon/tests/window_pick.py"), "window_pick.py"),
        (root.join("blender-addon/tests/window_drop.py"), "window_drop.py"),
        (root.join("blender-addon/tests/window_series.py"), "window_series.py"),
        (root.join("blender-addon/tests/window_stores.py"), "window_stores.py"),
        (root.join("blender-addon/tests/xdnd_source.py"), "xdnd_source.py"),
        (scripts.join("drive.sh"), "drive.sh"),
        (root.join(VOLUME), "volume.tif"),
    ] {
        std::fs::copy(&from, shared.join(name)).map_err(|e| format!("{}: {e}", from.display()))?;
    }

    let mut drive = Command::new(scripts.join("in-root.sh"));
    drive.args([system.as_path(), &shared, Path::new("/w/drive.sh")]).args([gpu, &*LIMIT_S.to_string()]);
    let driven = Step::or_say(drive, "the driver script in Blender's window failed: see above").finish();

    // Convert screenshots before reporting a failure, when they help most.
    let shots = std::fs::read_dir(&made).map_err(|e| format!("{}: {e}", made.display()))?;
    let shots: Vec<PathBuf> =
        shots.flatten().map(|e| e.path()).filter(|p| p.extension().is_some_and(|x| x == "xwd")).collect();
    if !shots.is_empty() {
        let mut convert = Command::new(Environment::tests().interpreter(target));
        convert.arg(scripts.join("xwd2png.py")).args(&shots);
        Step::from(convert).finish()?;
    }
    let figures = std::fs::read_to_string(made.join("figures.json"));
    if let Ok(figures) = &figures {
        println!("{figures}");
    }
    if let Some(folder) = out {
        make(folder)?;
        let mut copy = Command::new("cp");
        copy.args(["-r", "--"]).arg(made.join(".")).arg(folder);
        Step::from(copy).finish()?;
    }
    driven?;
    // Without figures.json, which the driver writes last, Blender ended without running it to the end.
    figures
        .map(drop)
        .map_err(|e| format!("the driver script left no figures.json in {}: {e}", made.display()))
}

/// Checks that `id`, which prints the user's number, prints 0 for root.
fn needs_root(id: &mut Command) -> Result<(), String> {
    let number = id.output().map(|o| String::from_utf8_lossy(&o.stdout).trim().to_owned());
    match number.as_deref() {
        Ok("0") => Ok(()),
        _ => Err("test-window must be root, because it makes a Debian root below target/ and enters it: run it with sudo --preserve-env=PATH".into()),
    }
}

fn needs(tool: &str, package: &str) -> Result<(), String> {
    let found = Command::new(tool).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    found.map(drop).map_err(|_| {
        format!("test-window needs {tool}: install it (Debian and Ubuntu: apt install {package})")
    })
}

fn make(folder: &Path) -> Result<(), String> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Options, String> {
        Options::parse(&line.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
    }

    #[test]
    fn arguments_are_understood_or_refused() {
        assert_eq!(parse(""), Ok(Options { suite: "trixie", gpu: "opengl", out: None }));
        let other = Options { suite: "sid", gpu: "vulkan", out: Some("here".into()) };
        assert_eq!(parse("--gpu vulkan --suite sid --out here"), Ok(other));
        for wrong in ["--suite", "--suite bookworm", "--gpu metal", "--out", "here"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn whoever_is_not_root_is_told_so() {
        assert_eq!(needs_root(Command::new("echo").arg("0")), Ok(()));
        for mut id in [Command::new("true"), Command::new("/program/that/is/not/there")] {
            let what = needs_root(&mut id).unwrap_err();
            assert!(what.contains("must be root") && !what.contains('\n'), "{what}");
        }
        assert!(needs_root(Command::new("echo").arg("1000")).is_err());
    }

    #[test]
    fn a_missing_tool_is_named_with_its_package() {
        assert_eq!(needs("sh", "dash"), Ok(()));
        let what = needs("tool-that-is-not-there", "its-package").unwrap_err();
        assert!(
            what.contains("tool-that-is-not-there") && what.contains("apt install its-package"),
            "{what}"
        );
    }
}
