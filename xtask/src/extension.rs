//! `cargo xtask extension`: the zip that users install in Blender, checked and packed by Blender's own tool.
//!
//! ```text
//! blender-addon/ (no tests) ─┐
//! wheel of python/ ──────────┴─► target/extension/NAME/pumice/ ─► validate, build ─► target/extension/pumice-NAME.zip
//! ```
//! NAME is the profile of the build, or Blender's name for the platform of a wheel that exists already:
//!
//! ```text
//! manylinux_2_27_x86_64   linux-x64        win_amd64            windows-x64
//! manylinux_2_27_aarch64  linux-arm64      macosx_11_0_arm64    macos-arm64
//! ```

use std::path::{Path, PathBuf};

use crate::blender::Blender;
use crate::python_env::Environment;
use crate::step::Step;
use crate::wheel;

/// Entries of `blender-addon/` that do not go into the zip.
const LEFT_OUT: [&str; 3] = ["tests", "__pycache__", "README.md"];

/// Path of the zip for a build profile or a platform.
pub(crate) fn zip(target: &Path, name: &str) -> PathBuf {
    target.join("extension").join(format!("pumice-{name}.zip"))
}

/// Stages the extension with the wheel of a build profile, which must be built already. Returns the steps that check and pack it with
/// Blender's tool.
pub(crate) fn pack(
    root: &Path,
    target: &Path,
    profile: &str,
    blender: &Blender,
) -> Result<Vec<Step>, String> {
    pack_wheel(root, target, profile, &wheel::newest(target, profile)?, blender)
}

/// Stages the extension with this wheel. Returns the steps that check and pack it with Blender's tool.
fn pack_wheel(
    root: &Path,
    target: &Path,
    name: &str,
    wheel: &Path,
    blender: &Blender,
) -> Result<Vec<Step>, String> {
    let stage = target.join("extension").join(name).join("pumice");
    let fault = |path: &Path| {
        let path = path.display().to_string();
        move |e: std::io::Error| format!("{path}: {e}")
    };
    if stage.exists() {
        std::fs::remove_dir_all(&stage).map_err(fault(&stage))?;
    }
    copy(&root.join("blender-addon"), &stage)?;

    let file_name = wheel.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let platform = platform_of(&file_name)?;
    let inside = stage.join("wheels");
    std::fs::create_dir_all(&inside).map_err(fault(&inside))?;
    std::fs::copy(wheel, inside.join(&file_name)).map_err(fault(wheel))?;
    let manifest = stage.join("blender_manifest.toml");
    let text = std::fs::read_to_string(&manifest).map_err(fault(&manifest))?;
    let text = with_wheel(&text, &file_name, platform)
        .ok_or_else(|| format!("{}: expected a line `wheels = []`, found none", manifest.display()))?;
    std::fs::write(&manifest, text).map_err(fault(&manifest))?;

    // Removes the zip of an earlier run, which must not be mistaken for this one's.
    let zip = zip(target, name);
    if zip.exists() {
        std::fs::remove_file(&zip).map_err(fault(&zip))?;
    }
    let tool = blender.extension_tool(target)?;
    let mut validate = blender.python(target);
    validate.arg(&tool).arg("validate").arg(&stage);
    let mut build = blender.python(target);
    build.arg(&tool).args(["build", "--source-dir"]).arg(&stage).arg("--output-filepath").arg(&zip);
    Ok(vec![
        Step::or_say(validate, "Blender's tool rejects the extension: it says why above"),
        Step::or_say(build, "Blender's tool did not pack the extension: it says why above"),
    ])
}

/// `cargo xtask extension [--profile dev] [--wheel FILE] [--out FOLDER]`: builds the wheel, or takes one that exists, packs the zip, prints
/// its path.
pub(crate) fn run(root: &Path, target: &Path, options: &Options) -> Result<(), String> {
    let Options { profile, wheel, out } = options;
    let blender = Blender::new(None);
    let (name, copied) = match wheel {
        None => (*profile, format!("pumice-{}.zip", env!("CARGO_PKG_VERSION"))),
        Some(wheel) => {
            let platform = platform_of(&wheel.file_name().unwrap_or_default().to_string_lossy())?;
            (platform, format!("pumice-{}-{platform}.zip", env!("CARGO_PKG_VERSION")))
        }
    };
    blender.environment.made(root, target)?;
    let steps = match wheel {
        None => {
            Environment::tests().made(root, target)?;
            wheel::build(root, target, profile).finish()?;
            pack(root, target, profile, &blender)?
        }
        Some(wheel) => pack_wheel(root, target, name, wheel, &blender)?,
    };
    steps.into_iter().try_for_each(Step::finish)?;
    let mut made = zip(target, name);
    if let Some(folder) = out {
        std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let to = folder.join(copied);
        std::fs::copy(&made, &to).map_err(|e| format!("{}: {e}", to.display()))?;
        made = to;
    }
    let bytes = std::fs::metadata(&made).map_err(|e| format!("{}: {e}", made.display()))?.len();
    println!("{}: {bytes} bytes", made.display());
    Ok(())
}

/// Options of `cargo xtask extension`.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Options {
    profile: &'static str,
    wheel: Option<PathBuf>,
    out: Option<PathBuf>,
}

impl Default for Options {
    fn default() -> Self {
        Self { profile: "release", wheel: None, out: None }
    }
}

impl Options {
    pub(crate) fn parse(args: &[String]) -> Result<Self, String> {
        let mut options = Self::default();
        let mut args = args.iter();
        while let Some(arg) = args.next() {
            let mut value = || args.next().ok_or_else(|| format!("{arg} needs a value"));
            match arg.as_str() {
                "--out" => options.out = Some(value()?.into()),
                "--wheel" => options.wheel = Some(value()?.into()),
                "--profile" => {
                    options.profile = match value()?.as_str() {
                        "dev" => "dev",
                        "release" => "release",
                        other => return Err(format!("--profile {other}: expected dev or release")),
                    }
                }
                _ => return Err(format!("unknown argument {arg}")),
            }
        }
        Ok(options)
    }
}

fn copy(from: &Path, to: &Path) -> Result<(), String> {
    std::fs::create_dir_all(to).map_err(|e| format!("{}: {e}", to.display()))?;
    for entry in std::fs::read_dir(from).map_err(|e| format!("{}: {e}", from.display()))?.flatten() {
        let (name, path) = (entry.file_name(), entry.path());
        let text = name.to_string_lossy();
        if LEFT_OUT.contains(&text.as_ref()) || text.ends_with(".pyc") || text.starts_with('.') {
            continue;
        }
        if path.is_dir() {
            copy(&path, &to.join(&name))?;
        } else {
            std::fs::copy(&path, to.join(&name)).map_err(|e| format!("{}: {e}", path.display()))?;
        }
    }
    Ok(())
}

/// The manifest with its wheel and its platform filled in; `None` if it has no line `wheels = []`.
fn with_wheel(manifest: &str, wheel: &str, platform: &str) -> Option<String> {
    let filled = format!("wheels = [\"./wheels/{wheel}\"]\nplatforms = [\"{platform}\"]");
    manifest.contains("\nwheels = []\n").then(|| manifest.replacen("wheels = []", &filled, 1))
}

/// Blender's name for the platform of a wheel, by the last part of the wheel's file name.
fn platform_of(wheel: &str) -> Result<&'static str, String> {
    let tag = wheel.strip_suffix(".whl").and_then(|name| name.rsplit('-').next()).unwrap_or_default();
    let is_linux = tag.contains("linux_");
    let known = [
        (is_linux && tag.ends_with("_x86_64"), "linux-x64"),
        (is_linux && tag.ends_with("_aarch64"), "linux-arm64"),
        (tag.starts_with("macosx_") && tag.ends_with("_arm64"), "macos-arm64"),
        (tag.starts_with("macosx_") && tag.ends_with("_x86_64"), "macos-x64"),
        (tag == "win_amd64", "windows-x64"),
        (tag == "win_arm64", "windows-arm64"),
    ];
    let found = known.iter().find(|(is_it, _)| *is_it).map(|(_, platform)| *platform);
    found.ok_or_else(|| format!("{wheel}: expected a wheel (.whl) for a platform that Blender runs on"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manifest_is_filled_once_or_refused() {
        let manifest = "id = \"pumice\"\nwheels = []\n[permissions]\n";
        let filled = with_wheel(manifest, "pumice-0.1.0-cp311-abi3-linux_x86_64.whl", "linux-x64").unwrap();
        assert_eq!(
            filled,
            "id = \"pumice\"\nwheels = [\"./wheels/pumice-0.1.0-cp311-abi3-linux_x86_64.whl\"]\nplatforms = [\"linux-x64\"]\n[permissions]\n"
        );
        assert_eq!(with_wheel(&filled, "b.whl", "linux-x64"), None);
    }

    #[test]
    fn the_platform_is_that_of_the_wheel() {
        for (tag, platform) in [
            ("manylinux_2_27_x86_64", "linux-x64"),
            ("linux_x86_64", "linux-x64"),
            ("manylinux_2_27_aarch64", "linux-arm64"),
            ("macosx_11_0_arm64", "macos-arm64"),
            ("win_amd64", "windows-x64"),
        ] {
            assert_eq!(platform_of(&format!("pumice-0.1.0-cp311-abi3-{tag}.whl")), Ok(platform));
        }
        for wrong in ["pumice-0.1.0-py3-none-any.whl", "pumice.zip", "", "pumice-0.1.0-win_amd64.zip"] {
            assert!(platform_of(wrong).unwrap_err().contains("expected a wheel"), "{wrong}");
        }
    }
}
