//! The Python module's wheel, built by maturin; and whether the types that it is published with are those of its source.
//!
//! ```text
//! python/ ─► target/wheels/dev       for the tests, with the profile that everything else of theirs is built with
//!         ├► target/wheels/release   for this machine
//!         └► target/wheels/portable  for others with this system
//! ```
//! A wheel that is linked on Linux asks for that machine's glibc or a newer one. The portable wheel is linked by zig against
//! [`OLDEST_GLIBC`], which is older than the oldest that Blender itself runs on.
//!
//! maturin builds the module alone. Its manifest asks for the features of dependencies that a build of the whole workspace has, so the wheel
//! for the tests is linked with what that build has compiled, and takes seconds.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::python_env::Environment;
use crate::step::Step;

/// Where wheels of a profile are put.
pub(crate) fn folder(target: &Path, profile: &str) -> PathBuf {
    target.join("wheels").join(profile)
}

/// Builds the wheel with a profile of cargo's: `dev` for the tests, `release` for users. Needs the tests' environment.
pub(crate) fn build(root: &Path, target: &Path, profile: &str) -> Step {
    let mut command = maturin(root, target, &Environment::tests().interpreter(target));
    command
        .args(["build", "--quiet", "--locked", "--strip", "--profile", profile])
        .arg("--out")
        .arg(folder(target, profile));
    Step::or_say(command, "the wheel of python/ could not be built")
}

/// maturin's name for the glibc of Ubuntu 18.04, where the wheel was run. Blender's builds run on 2.28 (RHEL 8 and its like) and newer.
const OLDEST_GLIBC: &str = "manylinux_2_27";

/// Options of `cargo xtask wheel`.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Options {
    pub(crate) out: Option<PathBuf>,
}

impl Options {
    pub(crate) fn parse(args: &[String]) -> Result<Self, String> {
        match args {
            [] => Ok(Self::default()),
            [out, folder] if out == "--out" => Ok(Self { out: Some(folder.into()) }),
            [out] if out == "--out" => Err("--out needs a value".into()),
            [first, ..] => Err(format!("unknown argument {first}")),
        }
    }
}

/// `cargo xtask wheel [--out FOLDER]`: builds the portable wheel and prints its path.
pub(crate) fn build_portable(root: &Path, target: &Path, out: Option<&Path>) -> Result<(), String> {
    let environment = Environment::wheels();
    environment.made(root, target)?;
    let interpreter = environment.interpreter(target);
    let folder = out.map_or_else(|| self::folder(target, "portable"), Path::to_path_buf);
    let folder = std::path::absolute(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut command = maturin(root, target, &interpreter);
    command.args(["build", "--quiet", "--locked", "--strip", "--release", "--out"]).arg(&folder);
    if cfg!(target_os = "linux") {
        command.args(["--zig", "--compatibility", OLDEST_GLIBC]);
        // maturin finds zig through a `python3` on the path.
        let former = std::env::var_os("PATH").unwrap_or_default();
        let bin = interpreter.parent().map(Path::to_path_buf);
        let path = std::env::join_paths(bin.into_iter().chain(std::env::split_paths(&former)));
        command.env("PATH", path.map_err(|e| e.to_string())?);
    }
    Step::or_say(command, "the portable wheel of python/ could not be built").finish()?;
    println!("{}", newest_in(&folder)?.display());
    Ok(())
}

/// The wheel of a profile that was built last.
pub(crate) fn newest(target: &Path, profile: &str) -> Result<PathBuf, String> {
    newest_in(&folder(target, profile))
}

fn newest_in(folder: &Path) -> Result<PathBuf, String> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let wheels = entries.flatten().filter(|e| e.path().extension().is_some_and(|x| x == "whl"));
    let newest = wheels.max_by_key(|e| e.metadata().and_then(|m| m.modified()).ok());
    newest.map(|e| e.path()).ok_or_else(|| format!("{}: no wheel was built", folder.display()))
}

/// Installs the wheel into the tests' environment. There must be one.
pub(crate) fn install(target: &Path, profile: &str) -> Result<Step, String> {
    let mut command = Environment::tests().pip(target);
    command
        .args(["install", "--quiet", "--force-reinstall", "--no-deps", "--no-index"])
        .arg(newest(target, profile)?);
    Ok(command.into())
}

/// Writes the stub that the source asks for.
pub(crate) fn generate_stub(root: &Path, target: &Path) -> Step {
    let mut command = maturin(root, target, &Environment::tests().interpreter(target));
    command
        .args(["generate-stubs", "--quiet", "--locked", "--profile", "dev"])
        .arg("--out")
        .arg(target.join("stubs"));
    command.into()
}

/// Fails where the stub in the tree is not the one that [`generate_stub`] wrote.
pub(crate) fn compare_stub(root: &Path, target: &Path) -> Step {
    let mut command = Command::new("diff");
    command
        .args([
            "--unified",
            "--label",
            "python/pumice/_native.pyi",
            "--label",
            "what the source asks for (cargo xtask stub)",
        ])
        .arg(root.join("python/pumice/_native.pyi"))
        .arg(target.join("stubs/pumice/_native.pyi"));
    Step::or_say(command, "python/pumice/_native.pyi is stale: cargo xtask stub writes it anew")
}

/// `cargo xtask stub`: puts the stub that the source asks for into the tree.
pub(crate) fn update_stub(root: &Path, target: &Path) -> Result<(), String> {
    Environment::tests().made(root, target)?;
    generate_stub(root, target).finish()?;
    let to = root.join("python/pumice/_native.pyi");
    std::fs::copy(target.join("stubs/pumice/_native.pyi"), &to)
        .map(drop)
        .map_err(|e| format!("{}: {e}", to.display()))
}

fn maturin(root: &Path, target: &Path, interpreter: &Path) -> Command {
    let mut command = Command::new(interpreter);
    command
        .args(["-m", "maturin"])
        .current_dir(root.join("python"))
        .env("PYO3_PYTHON", interpreter)
        .env("CARGO_TARGET_DIR", target);
    // What `cargo run` told this program about itself is not for others.
    command.env_remove("CARGO_MANIFEST_DIR").env_remove("CARGO_MANIFEST_PATH");
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_wheel_nothing_is_installed() {
        let target = std::env::temp_dir().join(format!("xtask-wheels-{}", std::process::id()));
        assert!(install(&target, "dev").unwrap_err().contains("wheels/dev"));
        std::fs::create_dir_all(folder(&target, "dev")).unwrap();
        assert!(install(&target, "dev").unwrap_err().ends_with("no wheel was built"));
        std::fs::write(folder(&target, "dev").join("notes.txt"), "").unwrap();
        assert!(newest(&target, "dev").is_err());
        std::fs::write(folder(&target, "dev").join("pumice-1-cp311-abi3-any.whl"), "").unwrap();
        assert!(newest(&target, "dev").unwrap().ends_with("pumice-1-cp311-abi3-any.whl"));
        std::fs::remove_dir_all(&target).unwrap();
    }

    /// The gate notices a stub of which one line is gone.
    #[test]
    fn a_stale_stub_is_noticed() {
        let folder = std::env::temp_dir().join(format!("xtask-stub-{}", std::process::id()));
        let (tree, fresh) = (folder.join("python/pumice"), folder.join("target/stubs/pumice"));
        for (path, text) in [(&tree, "class A: ...\n"), (&fresh, "class A: ...\nclass B: ...\n")] {
            std::fs::create_dir_all(path).unwrap();
            std::fs::write(path.join("_native.pyi"), text).unwrap();
        }
        let stale = compare_stub(&folder, &folder.join("target")).finish().unwrap_err();
        assert!(stale.contains("cargo xtask stub"), "{stale}");
        std::fs::copy(fresh.join("_native.pyi"), tree.join("_native.pyi")).unwrap();
        assert_eq!(compare_stub(&folder, &folder.join("target")).finish(), Ok(()));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
