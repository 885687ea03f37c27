//! Vulkan on the CPU for the tests (Mesa's lavapipe, with ray tracing), the validation layer and the shader compiler, in a folder
//! of their own under `target`.
//!
//! ```text
//! xtask/private-mesa.sh ──► target/mesa/root     packages of the system's distributor, unpacked and not installed
//!                       └─► target/mesa/env      NAME=VALUE a line: what a process must be told to use them
//! ```

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
    pub(crate) fn surround(&self, command: &mut Command) {
        let chosen = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].iter().any(|v| std::env::var_os(v).is_some());
        if !chosen {
            self.environment(command);
        }
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
                let former = std::env::var_os(name).filter(|former| !former.is_empty());
                let folders = std::iter::once(PathBuf::from(value))
                    .chain(former.iter().flat_map(std::env::split_paths));
                // A folder with a colon in its name cannot be said.
                command.env(name, std::env::join_paths(folders).unwrap_or_else(|_| value.into()));
            } else {
                command.env(name, value);
            }
        }
    }
}
