//! The Python that the tests run in: a virtual environment under `target/`, made from `tests/python/requirements.txt`.
//!
//! It is kept until the requirements or the interpreter change: a stamp file, written last, holds both.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::part::Outcome;

/// Oldest Python that the pinned packages and the tests support.
const OLDEST: (u32, u32) = (3, 11);
/// Where to look, the version that the pins were made with first.
const NAMES: [&str; 5] = ["python3.11", "python3.12", "python3.13", "python3.14", "python3"];

/// The environment's interpreter, whether it is there yet or not.
pub(crate) fn interpreter(target: &Path) -> PathBuf {
    target.join("venv/bin/python")
}

/// What must be run so that the environment is as the requirements say: nothing where it is already.
pub(crate) fn commands(root: &Path, target: &Path) -> Result<Vec<Command>, Outcome> {
    let requirements = root.join("tests/python/requirements.txt");
    let wanted = std::fs::read_to_string(&requirements)
        .map_err(|e| Outcome::Failed(format!("{}: {e}", requirements.display())))?;
    let (python, version) = find_python().ok_or_else(|| {
        Outcome::Failed(format!(
            "no Python {}.{} or later on PATH: install it (Debian and Ubuntu: apt install python3 python3-venv)",
            OLDEST.0, OLDEST.1
        ))
    })?;

    let venv = target.join("venv");
    let stamp = venv.join("made-from.txt");
    let made_from = format!("Python {version}\n{wanted}");
    if std::fs::read_to_string(&stamp).is_ok_and(|s| s == made_from) && interpreter(target).exists() {
        println!("target/venv is up to date (Python {version})");
        return Ok(Vec::new());
    }

    // Debian ships `venv` without the part that puts pip into a new environment.
    let complete = Command::new(&python).args(["-c", "import venv, ensurepip"]).output();
    if !complete.is_ok_and(|o| o.status.success()) {
        return Err(Outcome::Failed(format!(
            "{python} cannot make virtual environments: install its venv module (Debian and Ubuntu: apt install {python}-venv)"
        )));
    }
    let mut make = Command::new(&python);
    make.args(["-m", "venv", "--clear"]).arg(&venv);
    // Every package is named with its version, so none may pull in another; wheels only, because a source package would want a
    // compiler.
    let mut fill = Command::new(interpreter(target));
    fill.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input", "--no-deps"])
        .args(["--only-binary", ":all:", "--requirement"])
        .arg(&requirements);
    let mut check = Command::new(interpreter(target));
    check.args(["-m", "pip", "--disable-pip-version-check", "check"]);
    let mut seal = Command::new(interpreter(target));
    seal.args(["-c", "import sys; open(sys.argv[1], 'w').write(sys.argv[2])"]).arg(&stamp).arg(&made_from);
    Ok(vec![make, fill, check, seal])
}

/// Name and version of the first interpreter that is new enough.
fn find_python() -> Option<(String, String)> {
    NAMES.iter().find_map(|name| {
        let print = "import sys; print('%d %d %d' % sys.version_info[:3])";
        let output = Command::new(name).args(["-c", print]).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        let v: Vec<u32> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
        let &[major, minor, patch] = v.as_slice() else { return None };
        ((major, minor) >= OLDEST).then(|| (name.to_string(), format!("{major}.{minor}.{patch}")))
    })
}
