//! Vulkan on the CPU for the tests (Mesa's lavapipe, with ray tracing), the validation layer and the shader compiler, in a folder
//! of their own under `target`.
//!
//! ```text
//! xtask/private-mesa.sh ──► target/mesa/root     packages of the system's distributor, unpacked and not installed
//!                       └─► target/mesa/env      NAME=VALUE a line: what a process must be told to use them
//! ```

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::step::Step;

/// See the module.
#[derive(Clone, Debug)]
pub(crate) struct PrivateMesa {
    folder: PathBuf,
}

impl PrivateMesa {
    pub(crate) fn new(target: &Path) -> Self {
        Self { folder: target.join("mesa") }
    }

    /// Makes the folder where it is not there yet.
    pub(crate) fn step(&self, root: &Path) -> Step {
        let mut command = Command::new(root.join("xtask/private-mesa.sh"));
        command.arg(&self.folder);
        Step::or_say(command, "no Vulkan for the tests: see above")
    }

    /// Tells a process to use it: nothing where the user chose a driver, by the loader's own variables.
    ///
    /// Mesa is told not to optimise what it compiles: tests look at few pixels, and compiling for the CPU takes most of their time.
    /// Which numbers come out is the same. (Mesa keeps the compiled shaders of both ways apart.)
    pub(crate) fn surround(&self, command: &mut Command) {
        let chosen = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].iter().any(|v| std::env::var_os(v).is_some());
        if !chosen {
            self.environment(command);
            command.env("GALLIVM_PERF", "nopt");
        }
    }

    /// Besides, has every call of every program that it starts checked by the validation layer, whose settings end a process at what
    /// it finds, so that no test can pass with it. For programs that do not listen to the layer themselves; `test_cli_backends.py`
    /// proves that it is there and that it bites.
    pub(crate) fn surround_checked(&self, root: &Path, command: &mut Command) {
        self.surround(command);
        command
            .env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")
            .env("VK_LAYER_SETTINGS_PATH", root.join("xtask/validation"));
    }

    /// A program of the folder.
    pub(crate) fn tool(&self, name: &str) -> Command {
        let mut command = Command::new(self.folder.join("root/usr/bin").join(name));
        self.environment(&mut command);
        command
    }

    /// A folder that is not there yet says nothing; the step that should have made it has failed then.
    fn environment(&self, command: &mut Command) {
        let text = std::fs::read_to_string(self.folder.join("env")).unwrap_or_default();
        for (name, value) in text.lines().filter_map(|line| line.split_once('=')) {
            if name == "LD_LIBRARY_PATH" {
                // What the command was told already has its own, which must stay first: a program finds the libraries that it was
                // given, and only those that it lacks here.
                let told = command
                    .get_envs()
                    .find(|(told, _)| *told == name)
                    .map(|(_, value)| value.map(Into::into));
                let former: Option<OsString> = told.unwrap_or_else(|| std::env::var_os(name));
                let former = former.filter(|former| !former.is_empty());
                let folders = former.iter().flat_map(std::env::split_paths).chain([PathBuf::from(value)]);
                // A folder with a colon in its name cannot be said.
                let joined = std::env::join_paths(folders).unwrap_or_else(|_| value.into());
                command.env(name, joined);
            } else {
                command.env(name, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_command_was_told_before_stays_first() {
        let target = std::env::temp_dir().join(format!("xtask-mesa-{}", std::process::id()));
        std::fs::create_dir_all(target.join("mesa")).unwrap();
        std::fs::write(target.join("mesa/env"), "VK_DRIVER_FILES=/m/lvp.json\nLD_LIBRARY_PATH=/m/lib\n")
            .unwrap();
        let value = |command: &Command, name: &str| {
            let found = command.get_envs().find(|(n, _)| *n == name).and_then(|(_, value)| value);
            found.map(|v| v.to_string_lossy().into_owned())
        };
        let mut command = Command::new("blender");
        command.env("LD_LIBRARY_PATH", "/b/lib");
        PrivateMesa::new(&target).environment(&mut command);
        assert_eq!(value(&command, "LD_LIBRARY_PATH").as_deref(), Some("/b/lib:/m/lib"));
        assert_eq!(value(&command, "VK_DRIVER_FILES").as_deref(), Some("/m/lvp.json"));
        let mut command = Command::new("tool");
        command.env_remove("LD_LIBRARY_PATH");
        PrivateMesa::new(&target).environment(&mut command);
        assert_eq!(value(&command, "LD_LIBRARY_PATH").as_deref(), Some("/m/lib"));
        std::fs::remove_dir_all(&target).unwrap();
    }
}
