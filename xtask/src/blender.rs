//! Blender as a Python module (the wheel `bpy`): its environment, the system libraries that it needs, its extension tool.
//!
//! ```text
//! tests/python/requirements-bpy.txt ─► target/venv-bpy            the listed version; others are in target/venv-bpy-VERSION
//! xtask/private-libraries.sh ────────► target/libraries/lib       libraries that this system lacks; only Blender's processes see them
//! ```

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::part::Outcome;
use crate::python_env::Environment;
use crate::step::Step;

/// A version of Blender.
#[derive(Clone, Debug)]
pub(crate) struct Blender {
    pub(crate) environment: Environment,
}

impl Blender {
    /// The version in the requirements file, or another one that exists as a wheel for Python 3.11 (4.2 to 5.0).
    pub(crate) fn new(version: Option<&str>) -> Self {
        let environment = Environment {
            folder: version.map_or_else(|| "venv-bpy".into(), |v| format!("venv-bpy-{v}")),
            requirements: "tests/python/requirements-bpy.txt",
            instead: version.map(|v| ("bpy==", format!("bpy=={v}"))),
            names: &["python3.11", "python3"],
            oldest: (3, 11),
            newest: Some((3, 11)),
            no_python: "no Python 3.11 on PATH, the only version that Blender's module is built for: install it (Debian 12: apt install python3.11 python3.11-venv)",
        };
        Self { environment }
    }

    /// Steps that make the environment and unpack the libraries, and then check that Blender starts.
    pub(crate) fn steps(&self, root: &Path, target: &Path) -> Result<Vec<Step>, Outcome> {
        let mut steps = self.environment.steps(root, target)?;
        let mut libraries = Command::new(root.join("xtask/private-libraries.sh"));
        libraries.arg(target.join("libraries")).arg(self.packages(target).join("bpy/__init__.so"));
        let libraries = Step::or_say(libraries, "Blender's module lacks system libraries: see above");
        let mut probe = self.python(target);
        // `os._exit`, because some versions crash when the interpreter shuts down.
        probe.args([
            "-c",
            "import bpy, os; print('Blender', bpy.app.version_string, flush=True); os._exit(0)",
        ]);
        steps.extend([libraries, Step::or_say(probe, "Blender's module does not start")]);
        Ok(steps)
    }

    /// A command that runs this Blender's Python, with the private libraries on its library path.
    pub(crate) fn python(&self, target: &Path) -> Command {
        let mut command = Command::new(self.environment.interpreter(target));
        // The folder may be created after this command, or never.
        let folder = target.join("libraries/lib");
        let former = std::env::var_os("LD_LIBRARY_PATH").filter(|former| !former.is_empty());
        let folders = std::iter::once(folder.clone()).chain(former.iter().flat_map(std::env::split_paths));
        // A folder with a colon in its name cannot be in the list.
        command.env("LD_LIBRARY_PATH", std::env::join_paths(folders).unwrap_or_else(|_| folder.into()));
        command
    }

    /// Path of Blender's own extension tool, a Python script within the module.
    pub(crate) fn extension_tool(&self, target: &Path) -> Result<PathBuf, String> {
        let module = self.packages(target).join("bpy");
        let entries = std::fs::read_dir(&module).map_err(|e| format!("{}: {e}", module.display()))?;
        let tool = entries
            .flatten()
            .map(|e| e.path().join("scripts/addons_core/bl_pkg/cli/blender_ext.py"))
            .find(|path| path.exists());
        tool.ok_or_else(|| {
            format!(
                "{}: this Blender has no extension tool (scripts/addons_core/bl_pkg/cli/blender_ext.py)",
                module.display()
            )
        })
    }

    fn packages(&self, target: &Path) -> PathBuf {
        target.join(&self.environment.folder).join("lib/python3.11/site-packages")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_live_side_by_side() {
        let (listed, other) = (Blender::new(None).environment, Blender::new(Some("4.2.23")).environment);
        assert_eq!((listed.folder.as_str(), other.folder.as_str()), ("venv-bpy", "venv-bpy-4.2.23"));
        assert_eq!(other.instead, Some(("bpy==", "bpy==4.2.23".into())));
    }

    #[test]
    fn without_python_311_the_way_to_get_it_is_said() {
        let mut blender = Blender::new(None);
        blender.environment.names = &["python-that-is-not-there"];
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let Err(Outcome::Failed(what)) = blender.steps(&root, &std::env::temp_dir()) else {
            panic!("it was found")
        };
        assert!(
            what.contains("Python 3.11") && what.contains("apt install") && !what.contains('\n'),
            "{what}"
        );
    }

    #[test]
    fn a_blender_that_is_not_there_has_no_tool() {
        let what = Blender::new(None).extension_tool(Path::new("/folder/that/is/not/there")).unwrap_err();
        assert!(what.starts_with("/folder/that/is/not/there/venv-bpy/"), "{what}");
    }

    /// The script fails with one line that names what is missing, here the module itself.
    #[test]
    fn the_libraries_of_a_missing_module_are_refused() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let folder = std::env::temp_dir().join(format!("xtask-libraries-{}", std::process::id()));
        let mut script = Command::new(root.join("xtask/private-libraries.sh"));
        let output = script.arg(&folder).arg("/module/that/is/not/there.so").output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success());
        assert_eq!(said, "private-libraries: /module/that/is/not/there.so is missing\n");
        assert!(!folder.exists());
    }
}
