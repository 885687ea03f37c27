//! The Python module's wheel, built by maturin; and whether the types that it is published with are those of its source.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::part::Outcome;
use crate::python_env::{Environment, TESTS};

/// Where wheels of a profile are put.
pub(crate) fn folder(target: &Path, profile: &str) -> PathBuf {
    target.join("wheels").join(profile)
}

/// Builds the wheel with a profile of Cargo's: `dev` for the tests, `release` for users. Needs the tests' environment.
pub(crate) fn build(root: &Path, target: &Path, profile: &str) -> Command {
    let mut command = maturin(root, target);
    command
        .args(["build", "--quiet", "--locked", "--strip", "--profile", profile, "--out"])
        .arg(folder(target, profile));
    command
}

/// Installs the wheel into an environment.
pub(crate) fn install(environment: &Environment, target: &Path, profile: &str) -> Command {
    let mut command = environment.pip(target);
    command
        .args(["install", "--quiet", "--force-reinstall", "--no-deps", "--no-index", "--find-links"])
        .arg(folder(target, profile))
        .arg("pumice");
    command
}

/// Writes the stub that the source asks for.
pub(crate) fn generate_stub(root: &Path, target: &Path) -> Command {
    let mut command = maturin(root, target);
    command
        .args(["generate-stubs", "--quiet", "--locked", "--profile", "dev", "--out"])
        .arg(target.join("stubs"));
    command
}

/// Fails where the stub in the tree is not the one that [`generate_stub`] wrote.
pub(crate) fn compare_stub(root: &Path, target: &Path) -> Command {
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
    command
}

/// Puts the stub that the source asks for into the tree.
pub(crate) fn update_stub(root: &Path, target: &Path) -> Result<(), Outcome> {
    let status = generate_stub(root, target).status();
    if !status.is_ok_and(|s| s.success()) {
        return Err(Outcome::Failed(
            "maturin failed (cargo xtask test --only python-module makes it ready)".into(),
        ));
    }
    let to = root.join("python/pumice/_native.pyi");
    std::fs::copy(target.join("stubs/pumice/_native.pyi"), &to)
        .map(drop)
        .map_err(|e| Outcome::Failed(format!("{}: {e}", to.display())))
}

fn maturin(root: &Path, target: &Path) -> Command {
    let interpreter = TESTS.interpreter(target);
    let mut command = Command::new(&interpreter);
    command
        .args(["-m", "maturin"])
        .current_dir(root.join("python"))
        .env("PYO3_PYTHON", interpreter)
        .env("CARGO_TARGET_DIR", target);
    command
}
