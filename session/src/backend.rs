//! What can render on this machine, what would be chosen, and why.

use std::path::Path;

use pumice_cpu::CpuRenderer;
use pumice_render::{Image, Renderer};
use serde::Serialize;

use crate::error::{Result, SessionError};

/// A way to render.
#[derive(Clone, Debug, Serialize)]
pub struct Device {
    /// Name for `--backend`.
    pub backend: &'static str,
    /// What it runs on.
    pub device: String,
    /// Whether `auto` takes it.
    pub chosen: bool,
    /// Why it is or is not chosen.
    pub reason: String,
}

/// All ways to render here, best first.
pub fn devices() -> Vec<Device> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    vec![Device {
        backend: "cpu",
        device: format!("{} on {threads} thread{}", processor(), if threads == 1 { "" } else { "s" }),
        chosen: true,
        reason: "the only backend of this version: it needs no graphics processor".into(),
    }]
}

/// The processor's own name, where the system tells.
fn processor() -> String {
    let linux = || {
        let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
        let line = text.lines().find(|l| l.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_string())
    };
    linux().unwrap_or_else(|| format!("{} processor", std::env::consts::ARCH))
}

/// Makes the renderer that `name` asks for; `auto` takes the best.
///
/// # Errors
/// When there is no such backend here.
pub fn make_renderer(name: &str) -> Result<Box<dyn Renderer>> {
    match name {
        "auto" | "cpu" => Ok(Box::new(CpuRenderer::new(read_environment))),
        "vulkan-rt" | "vulkan-query" | "vulkan-compute" => Err(SessionError::Caller(format!(
            "--backend {name}: this version of pumice has no Vulkan backend; use auto or cpu"
        ))),
        _ => Err(SessionError::Caller(format!(
            "--backend {name}: no such backend; expected auto, cpu, vulkan-rt, vulkan-query or vulkan-compute"
        ))),
    }
}

/// The scene-linear colours of an environment picture.
fn read_environment(path: &Path) -> std::result::Result<Image, String> {
    pumice_render::read_exr(path).map(|picture| picture.color).map_err(|e| e.to_string())
}
