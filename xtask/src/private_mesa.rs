//! Vulkan on the CPU for the tests (Mesa's lavapipe, with ray tracing), the validation layer and the shader compiler, unpacked into a
//! folder under `target`.
//!
//! ```text
//! xtask/private-mesa.sh ──► target/mesa/root     packages of the system's distribution, unpacked and not installed
//!                       └─► target/mesa/env      environment variables of processes that use them, a line NAME=VALUE each
//! ```

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::step::Step;

/// Stack of each thread of a process that compiles shaders for the CPU without optimisation, in kB. Every value of a shader then has a place
/// in its frame: 9.9 MB in the largest of ours with vectors of 512 bits, where a thread's stack has 8 MB otherwise. The frame is taken
/// without a probe, so a stack that is too small is a fault of memory and no error.
const STACK_KB: u32 = 65_536;

/// The variable with the file of a driver that compiles for cards that are not there.
const COMPILER: &str = "PUMICE_SHADER_COMPILER";

/// The private folder with Vulkan on the CPU.
#[derive(Clone, Debug)]
pub(crate) struct PrivateMesa {
    folder: PathBuf,
}

impl PrivateMesa {
    pub(crate) fn new(target: &Path) -> Self {
        Self { folder: target.join("mesa") }
    }

    /// The step that makes the folder if it is missing.
    pub(crate) fn step(&self, root: &Path) -> Step {
        let mut command = Command::new(root.join("xtask/private-mesa.sh"));
        command.arg(&self.folder);
        Step::or_say(command, "Vulkan for the tests could not be unpacked: see above")
    }

    /// Sets the environment of a command so that it uses this driver, unless the user chose a driver through the loader's own variables.
    ///
    /// Also turns off Mesa's optimisation: tests render few pixels, and compiling for the CPU takes most of their time. The results are
    /// the same. (Mesa caches optimised and other shaders separately.) Stacks are larger for that ([`STACK_KB`]).
    pub(crate) fn surround(&self, command: &mut Command) {
        let chosen = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].iter().any(|v| std::env::var_os(v).is_some());
        if !chosen {
            self.environment(command);
            command.env("GALLIVM_PERF", "nopt");
            // Without AVX-512 LLVM takes gathers apart in a time that grows with the square of a function's length: at half the width of
            // AVX2 compiling takes a sixth less and drawing a little more, 801 CPU seconds instead of 864 in five test programs.
            #[cfg(target_arch = "x86_64")]
            if !std::is_x86_feature_detected!("avx512f") {
                command.env("LP_NATIVE_VECTOR_WIDTH", "128");
                // Mesa's cache does not know the width.
                command.env("MESA_SHADER_CACHE_DIR", self.folder.join("cache-128"));
            }
            *command = with_stacks(command);
        } else if let Some(driver) = self.shader_compiler() {
            command.env(COMPILER, driver);
        }
    }

    /// Like [`Self::surround`], and turns on the validation layer in every program that the command starts. Its settings end a process at
    /// its first message, so that the test fails. For programs that do not receive the layer's messages themselves;
    /// `test_cli_backends.py` tests that the layer is active and ends a process.
    pub(crate) fn surround_checked(&self, root: &Path, command: &mut Command) {
        self.surround(command);
        command
            .env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")
            .env("VK_LAYER_SETTINGS_PATH", root.join("xtask/validation"));
    }

    /// Sets the environment of a command so that Mesa's driver for AMD cards compiles for a card of this family, without a card. Programs
    /// can make pipelines with it and nothing else.
    pub(crate) fn compile_for_amd(&self, command: &mut Command, family: &str) -> Result<(), String> {
        self.environment(command);
        let driver = self.shader_compiler();
        let driver =
            driver.ok_or_else(|| format!("{} has no driver for AMD cards", self.folder.display()))?;
        command
            .env("VK_DRIVER_FILES", &driver)
            .env("VK_ICD_FILENAMES", &driver)
            .env("MESA_SHADER_CACHE_DISABLE", "true")
            .env("RADV_FORCE_FAMILY", family);
        Ok(())
    }

    /// A command that runs a program of the folder.
    pub(crate) fn tool(&self, name: &str) -> Command {
        let mut command = Command::new(self.folder.join("root/usr/bin").join(name));
        self.environment(&mut command);
        command
    }

    /// The file of Mesa's driver for AMD cards, which serves as a compiler.
    fn shader_compiler(&self) -> Option<String> {
        let text = std::fs::read_to_string(self.folder.join("env")).unwrap_or_default();
        let value = |line: &str| line.strip_prefix(COMPILER)?.strip_prefix('=').map(str::to_owned);
        text.lines().find_map(value)
    }

    /// Sets the variables of the file `env`. Without that file it sets none; the step that makes the folder has failed then.
    fn environment(&self, command: &mut Command) {
        let text = std::fs::read_to_string(self.folder.join("env")).unwrap_or_default();
        for (name, value) in text.lines().filter_map(|line| line.split_once('=')) {
            if name == "LD_LIBRARY_PATH" {
                // Folders that the command already has stay first, so that this one only provides libraries that they lack.
                let told = command
                    .get_envs()
                    .find(|(told, _)| *told == name)
                    .map(|(_, value)| value.map(Into::into));
                let former: Option<OsString> = told.unwrap_or_else(|| std::env::var_os(name));
                let former = former.filter(|former| !former.is_empty());
                let folders = former.iter().flat_map(std::env::split_paths).chain([PathBuf::from(value)]);
                // A folder with a colon in its name cannot be in the list.
                let joined = std::env::join_paths(folders).unwrap_or_else(|_| value.into());
                command.env(name, joined);
            } else {
                command.env(name, value);
            }
        }
    }
}

/// The same command with larger stacks for the threads of its programs, where the system allows that.
fn with_stacks(command: &Command) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-c", &format!("ulimit -s {STACK_KB} 2>/dev/null; exec \"$0\" \"$@\"")]);
    shell.arg(command.get_program()).args(command.get_args());
    for (name, value) in command.get_envs() {
        match value {
            Some(value) => shell.env(name, value),
            None => shell.env_remove(name),
        };
    }
    if let Some(folder) = command.get_current_dir() {
        shell.current_dir(folder);
    }
    shell
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_with_larger_stacks_is_the_same_otherwise() {
        let mut command = Command::new("sh");
        command
            .args(["-c", "ulimit -s; pwd; echo \"$A$B$1\"", "name", "two words"])
            .env("A", "a")
            .env_remove("B");
        command.current_dir("/");
        let said = with_stacks(&command).output().unwrap().stdout;
        assert_eq!(String::from_utf8_lossy(&said), format!("{STACK_KB}\n/\natwo words\n"));
    }

    #[test]
    fn what_a_command_was_told_before_stays_first() {
        let target = std::env::temp_dir().join(format!("xtask-mesa-{}", std::process::id()));
        std::fs::create_dir_all(target.join("mesa")).unwrap();
        let env = "VK_DRIVER_FILES=/m/lvp.json\nPUMICE_SHADER_COMPILER=/m/amd.json\nLD_LIBRARY_PATH=/m/lib\n";
        std::fs::write(target.join("mesa/env"), env).unwrap();
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
        PrivateMesa::new(&target).compile_for_amd(&mut command, "navi31").unwrap();
        assert_eq!(value(&command, "VK_DRIVER_FILES").as_deref(), Some("/m/amd.json"));
        assert_eq!(value(&command, "RADV_FORCE_FAMILY").as_deref(), Some("navi31"));
        std::fs::remove_dir_all(&target).unwrap();
        assert!(PrivateMesa::new(&target).compile_for_amd(&mut command, "navi31").is_err());
    }
}
