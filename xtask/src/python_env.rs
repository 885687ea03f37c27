//! Virtual environments of Python for the tests, under `target/`, each made from a requirements file with exact versions.
//!
//! An environment is kept until its requirements or the interpreter change. A stamp file, which is written last, records both.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::part::Outcome;
use crate::step::Step;

/// A virtual environment.
#[derive(Clone, Debug)]
pub(crate) struct Environment {
    /// Folder under `target/`.
    pub(crate) folder: String,
    /// Requirements file, relative to the repository's root.
    pub(crate) requirements: &'static str,
    /// A line of the requirements to replace: its beginning, and the new line.
    pub(crate) instead: Option<(&'static str, String)>,
    /// Names of interpreters to try in order; the first has the version that the requirements were made with.
    pub(crate) names: &'static [&'static str],
    /// Oldest accepted version (major, minor).
    pub(crate) oldest: (u32, u32),
    /// Newest accepted version; `None` for no limit.
    pub(crate) newest: Option<(u32, u32)>,
    /// Error text if no interpreter has an accepted version.
    pub(crate) no_python: &'static str,
}

impl Environment {
    /// The environment of the tests in Python.
    pub(crate) fn tests() -> Self {
        Self {
            folder: "venv".into(),
            requirements: "tests/python/requirements.txt",
            instead: None,
            names: &["python3.11", "python3.12", "python3.13", "python3.14", "python3"],
            oldest: (3, 11),
            newest: None,
            no_python: "no Python 3.11 or later on PATH: install it (Debian and Ubuntu: apt install python3 python3-venv)",
        }
    }

    /// The environment that builds portable wheels.
    pub(crate) fn wheels() -> Self {
        Self {
            folder: "venv-wheels".into(),
            requirements: "tests/python/requirements-wheels.txt",
            ..Self::tests()
        }
    }

    /// Path of the environment's interpreter, which may not exist yet.
    pub(crate) fn interpreter(&self, target: &Path) -> PathBuf {
        let inside = if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" };
        target.join(&self.folder).join(inside)
    }

    /// Steps that make the environment; none if it is up to date.
    pub(crate) fn steps(&self, root: &Path, target: &Path) -> Result<Vec<Step>, Outcome> {
        let requirements = root.join(self.requirements);
        let listed = std::fs::read_to_string(&requirements)
            .map_err(|e| Outcome::Failed(format!("{}: {e}", requirements.display())))?;
        let wanted = self.list(&listed);
        let (python, version) = self.find_python().ok_or_else(|| Outcome::Failed(self.no_python.into()))?;

        let venv = target.join(&self.folder);
        let stamp = venv.join("made-from.txt");
        let made_from = format!("Python {version}\n{wanted}");
        if std::fs::read_to_string(&stamp).is_ok_and(|s| s == made_from) && self.interpreter(target).exists()
        {
            println!("target/{} is up to date (Python {version})", self.folder);
            return Ok(Vec::new());
        }

        // Debian ships `venv` without `ensurepip`, which installs pip into a new environment.
        let complete = Command::new(&python).args(["-c", "import venv, ensurepip"]).output();
        if !complete.is_ok_and(|o| o.status.success()) {
            return Err(Outcome::Failed(format!(
                "{python} cannot make virtual environments: install its venv module (Debian and Ubuntu: apt install {python}-venv)"
            )));
        }
        let list = target.join(format!("{}-requirements.txt", self.folder));
        std::fs::create_dir_all(target)
            .and_then(|()| std::fs::write(&list, &wanted))
            .map_err(|e| Outcome::Failed(format!("{}: {e}", list.display())))?;
        let mut make = Command::new(&python);
        make.args(["-m", "venv", "--clear"]).arg(&venv);
        // The file lists every package with its version, so none may pull in others. Wheels only, because source packages may need a
        // compiler.
        let mut fill = self.pip(target);
        fill.args(["install", "--quiet", "--no-input", "--no-deps", "--only-binary", ":all:"])
            .arg("--requirement")
            .arg(&list);
        let fill = Step::or_say(
            fill,
            format!(
                "pip could not install the packages of {}: it says why above (no network? no wheel for Python {version} on this system?)",
                self.requirements
            ),
        );
        let mut check = self.pip(target);
        check.arg("check");
        let check = Step::or_say(
            check,
            format!("the versions in {} conflict: pip says which above", self.requirements),
        );
        let mut seal = Command::new(self.interpreter(target));
        seal.args(["-c", "import sys; open(sys.argv[1], 'w').write(sys.argv[2])"])
            .arg(&stamp)
            .arg(&made_from);
        Ok(vec![make.into(), fill, check, seal.into()])
    }

    /// Makes the environment, with output on this terminal.
    pub(crate) fn made(&self, root: &Path, target: &Path) -> Result<(), String> {
        match self.steps(root, target) {
            Ok(steps) => steps.into_iter().try_for_each(Step::finish),
            Err(Outcome::Failed(what) | Outcome::LeftOut(what)) => Err(what),
            Err(Outcome::Passed) => Ok(()),
        }
    }

    /// A command that runs the environment's pip.
    pub(crate) fn pip(&self, target: &Path) -> Command {
        let mut pip = Command::new(self.interpreter(target));
        pip.args(["-m", "pip", "--disable-pip-version-check"]);
        pip
    }

    /// The text of the requirements, with the line of `instead` replaced.
    fn list(&self, listed: &str) -> String {
        let Some((begins, instead)) = &self.instead else { return listed.into() };
        let line = |line: &str| match line.starts_with(begins) {
            true => format!("{instead}\n"),
            false => format!("{line}\n"),
        };
        listed.lines().map(line).collect()
    }

    /// Name and version of the first interpreter with an accepted version.
    fn find_python(&self) -> Option<(String, String)> {
        self.names.iter().find_map(|name| {
            let print = "import sys; print('%d %d %d' % sys.version_info[:3])";
            let output = Command::new(name).args(["-c", print]).output().ok()?;
            let text = String::from_utf8(output.stdout).ok()?;
            let v: Vec<u32> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
            let &[major, minor, patch] = v.as_slice() else { return None };
            let good = (major, minor) >= self.oldest && self.newest.is_none_or(|n| (major, minor) <= n);
            good.then(|| (name.to_string(), format!("{major}.{minor}.{patch}")))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
    }

    /// The error text when the environment cannot be started, in which case no folder may be left.
    fn refusal(environment: &Environment) -> String {
        let nowhere = std::env::temp_dir().join(format!("xtask-env-{}", std::process::id()));
        let refused = environment.steps(&root(), &nowhere);
        assert!(!nowhere.exists(), "a refused environment leaves no folder");
        match refused {
            Err(Outcome::Failed(what)) => what,
            other => panic!("it was not refused: {other:?}"),
        }
    }

    #[test]
    fn one_line_of_the_list_can_be_replaced_and_no_other() {
        let mut environment = Environment::tests();
        let list = "# numpy==x\npytest==1\nnumpy==1\n";
        assert_eq!(environment.list(list), list);
        environment.instead = Some(("numpy==", "numpy==7".into()));
        assert_eq!(environment.list(list), "# numpy==x\npytest==1\nnumpy==7\n");
    }

    #[test]
    fn a_missing_python_is_named_with_the_way_to_get_it() {
        let none = Environment { names: &["python-that-is-not-there"], ..Environment::tests() };
        let what = refusal(&none);
        assert!(what.contains("Python 3.11") && what.contains("apt install"), "{what}");
        // An interpreter that is too old is treated as missing.
        let what = refusal(&Environment { oldest: (99, 0), ..Environment::tests() });
        assert!(what.contains("Python 3.11") && !what.contains('\n'), "{what}");
    }

    #[test]
    fn a_missing_list_is_named() {
        let what = refusal(&Environment { requirements: "tests/python/none.txt", ..Environment::tests() });
        assert!(what.contains("tests/python/none.txt") && !what.contains('\n'), "{what}");
    }

    /// After pip's own output comes one line that names the requirements file, and no stamp is written.
    #[test]
    fn packages_that_cannot_be_fetched_end_in_one_line() {
        let target = std::env::temp_dir().join(format!("xtask-no-network-{}", std::process::id()));
        let environment = Environment::tests();
        let python = environment.interpreter(&target);
        std::fs::create_dir_all(python.parent().unwrap()).unwrap();
        std::fs::write(&python, "#!/bin/sh\nfor i in 1 2 3; do echo 'WARNING: Retrying' >&2; done\nexit 1\n")
            .unwrap();
        std::fs::set_permissions(&python, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
        let steps = environment.steps(&root(), &target).unwrap();
        let is_fill = |s: &Step| s.command.get_args().any(|a| a == "install");
        let what = steps.into_iter().find(is_fill).unwrap().finish().unwrap_err();
        let sealed = target.join("venv/made-from.txt").exists();
        std::fs::remove_dir_all(&target).unwrap();
        assert!(what.contains("requirements.txt") && what.contains("no network?"), "{what}");
        assert!(!what.contains('\n') && !sealed, "{what}");
    }
}
