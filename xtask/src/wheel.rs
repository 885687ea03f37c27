//! The Python module's wheel, built by maturin; and whether the types that it is published with are those of its source.
//!
//! ```text
//! python/ ─► target/wheels/dev      for the tests, with the profile that everything else of theirs is built with
//!         └► target/wheels/release  for users
//! ```
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
    let mut command = maturin(root, target);
    command
        .args(["build", "--quiet", "--locked", "--strip", "--profile", profile, "--out"])
        .arg(folder(target, profile));
    Step::or_say(command, "the wheel of python/ could not be built")
}

/// The wheel of a profile that was built last.
pub(crate) fn newest(target: &Path, profile: &str) -> Result<PathBuf, String> {
    let folder = folder(target, profile);
    let entries = std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
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
    let mut command = maturin(root, target);
    command
        .args(["generate-stubs", "--quiet", "--locked", "--profile", "dev", "--out"])
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

fn maturin(root: &Path, target: &Path) -> Command {
    let interpreter = Environment::tests().interpreter(target);
    let mut command = Command::new(&interpreter);
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
