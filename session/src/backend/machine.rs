//! The Vulkan devices of this machine, listed once per process: starting Vulkan loads every driver, which takes 0.1 s or more.

use std::path::PathBuf;
use std::sync::OnceLock;

use pumice_transport::{RenderError, Renderer};
use pumice_vulkan::VulkanRenderer;
use pumice_vulkan::device::{Backend, Candidate, DeviceError, Instance, InstanceOptions, survey, unfinished};

use super::card::Card;
use super::read_environment;

/// Environment variable with the path of another Vulkan loader than the system's; a path that does not exist switches Vulkan off.
pub const LOADER_VARIABLE: &str = "PUMICE_VULKAN_LOADER";

struct Vulkan {
    instance: Instance,
    candidates: Vec<Candidate>,
}

/// Vulkan, or the reason why it cannot be used. It lives as long as the process: drivers do not cope well with being started twice. A forked
/// process cannot use what its parent has started, because drivers' threads and handles do not come along.
fn vulkan() -> Result<&'static Vulkan, String> {
    static VULKAN: OnceLock<(u32, Result<Vulkan, String>)> = OnceLock::new();
    let process = std::process::id();
    let start = || -> Result<Vulkan, String> {
        let loader = std::env::var_os(LOADER_VARIABLE).filter(|l| !l.is_empty()).map(PathBuf::from);
        let options = InstanceOptions { loader, ..InstanceOptions::default() };
        // A driver that fails to list its devices is treated as missing.
        let none = |e: DeviceError| match e {
            DeviceError::NoVulkan(_) => e.to_string(),
            other => format!("no Vulkan here: {other}"),
        };
        let instance = Instance::new(&options).map_err(none)?;
        let candidates = survey(&instance).map_err(none)?;
        Ok(Vulkan { instance, candidates })
    };
    match VULKAN.get_or_init(|| (process, start())) {
        (owner, Ok(_)) if *owner != process => {
            Err("no Vulkan here: this process was forked from one that uses it".into())
        }
        (_, Ok(vulkan)) => Ok(vulkan),
        (_, Err(why)) => Err(why.clone()),
    }
}

/// The devices, best kind first; a device's index is its number in `pumice devices`.
///
/// # Errors
/// One line that says why Vulkan cannot be used.
pub(super) fn cards() -> Result<Vec<Card>, String> {
    Ok(vulkan()?.candidates.iter().map(Card::of).collect())
}

/// Whether a backend is tried that did not come back from an earlier start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Trust {
    /// The user named it, so it is tried, and what was known against it is forgotten.
    Named,
    /// `auto` came to it, so it is not tried.
    Auto,
}

/// Opens the device with this number. `folder` keeps what the driver compiles, and what did not come back.
pub(super) fn open(
    number: usize,
    backend: Backend,
    folder: Option<PathBuf>,
    trust: Trust,
) -> Result<Box<dyn Renderer>, RenderError> {
    let failed = |e: &dyn std::fmt::Display| RenderError::Device(e.to_string());
    let vulkan = vulkan().map_err(|e| failed(&e))?;
    let candidate = vulkan.candidates.get(number).ok_or_else(|| failed(&"the device is gone"))?;
    if let Some(folder) = &folder {
        let left = unfinished(&vulkan.instance, candidate, backend, folder);
        match (left.why(), trust) {
            (Some(why), Trust::Auto) => {
                return Err(failed(&format!("{why}; name the backend to try it again")));
            }
            (Some(_), Trust::Named) => left.forget(),
            (None, _) => {}
        }
    }
    let renderer = VulkanRenderer::open(&vulkan.instance, candidate, backend, folder, read_environment);
    Ok(Box::new(renderer.map_err(|e| failed(&e))?))
}
