//! `cargo xtask extension`: the zip that users install in Blender, checked and packed by Blender's own tool.
//!
//! ```text
//! blender-addon/ (no tests) ─┐
//! wheel of python/ ──────────┴─► target/extension/PROFILE/pumice/ ─► validate, build ─► pumice-VERSION.zip
//! ```

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::part::Outcome;
use crate::python_env::{BLENDER, TESTS};
use crate::wheel;

/// What of `blender-addon/` is not for users.
const LEFT_OUT: [&str; 3] = ["tests", "__pycache__", "README.md"];

/// Where the zip of a profile is put.
pub(crate) fn zip(target: &Path, profile: &str) -> PathBuf {
    target.join("extension").join(format!("pumice-{profile}.zip"))
}

/// Stages the extension with the wheel of a profile, which must be built; gives the commands that check and pack it.
pub(crate) fn pack(root: &Path, target: &Path, profile: &str) -> Result<Vec<Command>, String> {
    let stage = target.join("extension").join(profile).join("pumice");
    let fault = |path: &Path| {
        let path = path.display().to_string();
        move |e: std::io::Error| format!("{path}: {e}")
    };
    if stage.exists() {
        std::fs::remove_dir_all(&stage).map_err(fault(&stage))?;
    }
    copy(&root.join("blender-addon"), &stage)?;

    let wheels = wheel::folder(target, profile);
    let name = newest_wheel(&wheels)?;
    let inside = stage.join("wheels");
    std::fs::create_dir_all(&inside).map_err(fault(&inside))?;
    std::fs::copy(wheels.join(&name), inside.join(&name)).map_err(fault(&inside))?;
    let manifest = stage.join("blender_manifest.toml");
    let text = std::fs::read_to_string(&manifest).map_err(fault(&manifest))?;
    let text = with_wheel(&text, &name, platform()?)
        .ok_or_else(|| format!("{}: no line `wheels = []` to fill", manifest.display()))?;
    std::fs::write(&manifest, text).map_err(fault(&manifest))?;

    let python = BLENDER.interpreter(target);
    let tool = blender_tool(target)?;
    let mut validate = Command::new(&python);
    private_libraries(target, &mut validate);
    validate.arg(&tool).arg("validate").arg(&stage);
    let mut build = Command::new(&python);
    private_libraries(target, &mut build);
    build
        .arg(&tool)
        .args(["build", "--source-dir"])
        .arg(&stage)
        .arg("--output-filepath")
        .arg(zip(target, profile));
    Ok(vec![validate, build])
}

/// `cargo xtask extension [--profile dev] [--out FOLDER]`: builds the wheel, packs, says where the zip is.
pub(crate) fn run(root: &Path, target: &Path, args: &[String]) -> Result<(), String> {
    let (mut profile, mut out) = ("release", None);
    let mut args = args.iter();
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or_else(|| format!("{arg} needs a value"));
        match arg.as_str() {
            "--out" => out = Some(PathBuf::from(value()?)),
            "--profile" => match value()?.as_str() {
                "dev" => profile = "dev",
                "release" => profile = "release",
                other => return Err(format!("--profile {other}: expected dev or release")),
            },
            _ => return Err(format!("unknown argument {arg}")),
        }
    }
    for environment in [TESTS, BLENDER] {
        match environment.commands(root, target, None) {
            Ok(commands)
                if environment.folder == TESTS.folder || !environment.interpreter(target).exists() =>
            {
                commands.into_iter().try_for_each(finish)?;
            }
            // Another Blender than the listed one packs as well.
            Ok(_) => {}
            Err(Outcome::Failed(what) | Outcome::LeftOut(what)) => return Err(what),
            Err(Outcome::Passed) => {}
        }
    }
    finish(wheel::build(root, target, profile))?;
    pack(root, target, profile)?.into_iter().try_for_each(finish)?;
    let mut made = zip(target, profile);
    if let Some(folder) = out {
        std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let to = folder.join(format!("pumice-{}.zip", env!("CARGO_PKG_VERSION")));
        std::fs::copy(&made, &to).map_err(|e| format!("{}: {e}", to.display()))?;
        made = to;
    }
    let bytes = std::fs::metadata(&made).map_err(|e| format!("{}: {e}", made.display()))?.len();
    println!("{}: {bytes} bytes", made.display());
    Ok(())
}

/// Runs a command to its end.
fn finish(mut command: Command) -> Result<(), String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let status = command.status().map_err(|e| format!("{name}: {e}"))?;
    if status.success() { Ok(()) } else { Err(format!("{status} of: {command:?}")) }
}

/// Lets a command that runs Blender find the libraries that were unpacked for it.
pub(crate) fn private_libraries(target: &Path, command: &mut Command) {
    let folder = target.join("libraries/lib");
    if !folder.is_dir() {
        return;
    }
    let path = match std::env::var_os("LD_LIBRARY_PATH") {
        Some(former) => {
            std::env::join_paths(std::iter::once(folder.clone()).chain(std::env::split_paths(&former)))
                .unwrap_or_else(|_| folder.into())
        }
        None => folder.into(),
    };
    command.env("LD_LIBRARY_PATH", path);
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

fn newest_wheel(folder: &Path) -> Result<String, String> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let wheels = entries.flatten().filter(|e| e.path().extension().is_some_and(|x| x == "whl"));
    let newest = wheels.max_by_key(|e| e.metadata().and_then(|m| m.modified()).ok());
    let name = newest.and_then(|e| e.file_name().into_string().ok());
    name.ok_or_else(|| format!("{}: no wheel was built", folder.display()))
}

/// The manifest with its wheel and the one platform that this is for.
fn with_wheel(manifest: &str, wheel: &str, platform: &str) -> Option<String> {
    let filled = format!("wheels = [\"./wheels/{wheel}\"]\nplatforms = [\"{platform}\"]");
    manifest.contains("\nwheels = []\n").then(|| manifest.replacen("wheels = []", &filled, 1))
}

/// Blender's name of this machine's kind.
fn platform() -> Result<&'static str, String> {
    match (std::env::consts::OS, std::env::consts::ARCH) {
        ("linux", "x86_64") => Ok("linux-x64"),
        ("linux", "aarch64") => Ok("linux-arm64"),
        ("macos", "aarch64") => Ok("macos-arm64"),
        ("macos", "x86_64") => Ok("macos-x64"),
        ("windows", "x86_64") => Ok("windows-x64"),
        (os, arch) => Err(format!("Blender has no name for {os} on {arch}")),
    }
}

/// Blender's extension tool: plain Python within the module `bpy`.
fn blender_tool(target: &Path) -> Result<PathBuf, String> {
    let packages = target.join(BLENDER.folder).join("lib/python3.11/site-packages/bpy");
    let entries = std::fs::read_dir(&packages).map_err(|e| format!("{}: {e}", packages.display()))?;
    let tool = entries
        .flatten()
        .map(|e| e.path().join("scripts/addons_core/bl_pkg/cli/blender_ext.py"))
        .find(|path| path.exists());
    tool.ok_or_else(|| format!("{}: this Blender has no extension tool", packages.display()))
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
}
