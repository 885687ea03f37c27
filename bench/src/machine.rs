//! Describes the machine and the build that measured.

use std::process::Command;

use pumice_session::measure::processor_name;

/// One line with version, processor, cores, system, compiler (if rustc is installed) and build profile.
pub fn description() -> String {
    let processor = processor_name().unwrap_or_else(|| "an unnamed processor".into());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let compiler = match Command::new("rustc").arg("--version").output() {
        Ok(said) if said.status.success() => format!("; {}", String::from_utf8_lossy(&said.stdout).trim()),
        _ => String::new(),
    };
    let build = if cfg!(debug_assertions) { "development build" } else { "release build" };
    format!(
        "Pumice {}; {processor}, {cores} cores, {} {}{compiler}; {build}.",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::OS,
        std::env::consts::ARCH
    )
}
