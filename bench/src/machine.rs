//! What the figures were measured on.

use std::process::Command;

/// Processor, cores, system, compiler, version, in one line.
pub(crate) fn description() -> String {
    let cpu = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|l| l.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    });
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let rustc = Command::new("rustc").arg("--version").output().ok();
    let rustc = rustc.map(|o| String::from_utf8_lossy(&o.stdout).trim().to_owned());
    let unknown = || "unknown".to_owned();
    format!(
        "Pumice {}; {} ({cores} cores), {} {}; {}; release build.",
        env!("CARGO_PKG_VERSION"),
        cpu.unwrap_or_else(unknown),
        std::env::consts::OS,
        std::env::consts::ARCH,
        rustc.unwrap_or_else(unknown),
    )
}
