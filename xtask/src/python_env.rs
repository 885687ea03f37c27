//! The Pythons that the tests run in: virtual environments under `target/`, each made from a list of exact versions.
//!
//! An environment is kept until its list or the interpreter changes: a stamp file, written last, holds both.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::part::Outcome;

/// An environment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Environment {
    /// Folder under `target/`.
    pub(crate) folder: &'static str,
    /// Its list, from the project's root.
    requirements: &'static str,
    /// Interpreters to look for, the version that the list was made with first.
    names: &'static [&'static str],
    /// Newest version that will do, where it matters.
    newest: Option<(u32, u32)>,
}

/// Oldest Python that the pinned packages and the tests support.
const OLDEST: (u32, u32) = (3, 11);

/// For the tests in Python.
pub(crate) const TESTS: Environment = Environment {
    folder: "venv",
    requirements: "tests/python/requirements.txt",
    names: &["python3.11", "python3.12", "python3.13", "python3.14", "python3"],
    newest: None,
};

/// For the extension's tests, with Blender as a module: a wheel for one version of Python.
pub(crate) const BLENDER: Environment = Environment {
    folder: "venv-bpy",
    requirements: "tests/python/requirements-bpy.txt",
    names: &["python3.11", "python3"],
    newest: Some((3, 11)),
};

impl Environment {
    /// Its interpreter, whether it is there yet or not.
    pub(crate) fn interpreter(&self, target: &Path) -> PathBuf {
        target.join(self.folder).join("bin/python")
    }

    /// What must be run so that it is as its list says: nothing where it is already. `bpy` takes the place of the list's version of
    /// Blender.
    pub(crate) fn commands(
        &self,
        root: &Path,
        target: &Path,
        bpy: Option<&str>,
    ) -> Result<Vec<Command>, Outcome> {
        let requirements = root.join(self.requirements);
        let listed = std::fs::read_to_string(&requirements)
            .map_err(|e| Outcome::Failed(format!("{}: {e}", requirements.display())))?;
        let wanted = match bpy {
            Some(version) => with_bpy(&listed, version),
            None => listed,
        };
        let (python, version) = self.find_python().ok_or_else(|| Outcome::Failed(self.no_python()))?;

        let venv = target.join(self.folder);
        let stamp = venv.join("made-from.txt");
        let made_from = format!("Python {version}\n{wanted}");
        if std::fs::read_to_string(&stamp).is_ok_and(|s| s == made_from) && self.interpreter(target).exists()
        {
            println!("target/{} is up to date (Python {version})", self.folder);
            return Ok(Vec::new());
        }

        // Debian ships `venv` without the part that puts pip into a new environment.
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
        // Every package is named with its version, so none may pull in another; wheels only, because a source package would want a
        // compiler.
        let mut fill = self.pip(target);
        fill.args(["install", "--quiet", "--no-input", "--no-deps", "--only-binary", ":all:"])
            .arg("--requirement")
            .arg(&list);
        let mut check = self.pip(target);
        check.arg("check");
        let mut seal = Command::new(self.interpreter(target));
        seal.args(["-c", "import sys; open(sys.argv[1], 'w').write(sys.argv[2])"])
            .arg(&stamp)
            .arg(&made_from);
        Ok(vec![make, fill, check, seal])
    }

    /// Its pip.
    pub(crate) fn pip(&self, target: &Path) -> Command {
        let mut pip = Command::new(self.interpreter(target));
        pip.args(["-m", "pip", "--disable-pip-version-check"]);
        pip
    }

    /// Name and version of the first interpreter that will do.
    fn find_python(&self) -> Option<(String, String)> {
        self.names.iter().find_map(|name| {
            let print = "import sys; print('%d %d %d' % sys.version_info[:3])";
            let output = Command::new(name).args(["-c", print]).output().ok()?;
            let text = String::from_utf8(output.stdout).ok()?;
            let v: Vec<u32> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
            let &[major, minor, patch] = v.as_slice() else { return None };
            let good = (major, minor) >= OLDEST && self.newest.is_none_or(|newest| (major, minor) <= newest);
            good.then(|| (name.to_string(), format!("{major}.{minor}.{patch}")))
        })
    }

    fn no_python(&self) -> String {
        let (major, minor) = OLDEST;
        match self.newest {
            Some(_) => format!(
                "no Python {major}.{minor} on PATH, the one that Blender's module is made for: install it (Debian 12: apt install python3.11 python3.11-venv)"
            ),
            None => format!(
                "no Python {major}.{minor} or later on PATH: install it (Debian and Ubuntu: apt install python3 python3-venv)"
            ),
        }
    }
}

/// A list with another version of Blender.
fn with_bpy(list: &str, version: &str) -> String {
    let line = |line: &str| match line.starts_with("bpy==") {
        true => format!("bpy=={version}\n"),
        false => format!("{line}\n"),
    };
    list.lines().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_blender_changes_its_line_alone() {
        assert_eq!(
            with_bpy("# bpy==x\nbpy==5.0.1\nnumpy==1\n", "4.2.23"),
            "# bpy==x\nbpy==4.2.23\nnumpy==1\n"
        );
    }

    #[test]
    fn a_missing_python_is_named_with_the_way_to_get_it() {
        let none = Environment { names: &["python-that-is-not-there"], ..BLENDER };
        let folder = std::env::temp_dir();
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let Err(Outcome::Failed(what)) = none.commands(&root, &folder, None) else { panic!("it was found") };
        assert!(
            what.contains("Python 3.11") && what.contains("apt install") && !what.contains('\n'),
            "{what}"
        );
    }
}
