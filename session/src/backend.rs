//! The backends and devices that can render on this machine, which one is chosen, and why.
//!
//! ```text
//! name ──► choice: ways in order ──► fallback: opens the first, and the next where its device fails ──► Renderer
//!            ▲ cards: what each Vulkan device is and lacks
//! ```

mod cache_folder;
mod card;
mod choice;
mod fallback;
mod machine;

use std::io::Read as _;
use std::path::Path;

use cache_folder::pipeline_folder;
use card::Card;
use choice::Way;
use machine::Trust;
use pumice_core::open_input;
use pumice_cpu::CpuRenderer;
use pumice_picture::{Image, radiance_file};
use pumice_vulkan::device::{Backend, DeviceKind};
use serde::Serialize;

use crate::error::Result;
use crate::measure::processor_name;

pub use cache_folder::CACHE_VARIABLE;
pub use fallback::FallbackRenderer;
#[cfg(test)]
pub(crate) use fallback::tests as fakes;
pub use machine::LOADER_VARIABLE;

/// Note on graphics processors that nobody has tried.
const UNPROVED: &str = "not yet run on hardware by its developers: please report how it works";

/// One way to render: a backend on a device.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Device {
    /// Name for `--backend`.
    pub backend: &'static str,
    /// Name of the device that it runs on.
    pub device: String,
    /// Its number among the Vulkan devices, for `--backend NAME:NUMBER`; absent for the CPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub number: Option<usize>,
    /// `discrete`, `integrated`, `virtual`, `other` or `software`; `cpu` for our own path tracer.
    pub kind: &'static str,
    /// Versions of Vulkan and the driver; absent for the CPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub driver: Option<String>,
    /// Whether it can render at all.
    pub usable: bool,
    /// Whether `auto` takes it.
    pub chosen: bool,
    /// Why it is or is not chosen.
    pub reason: String,
}

/// All ways to render here: each Vulkan device with each backend, and the CPU.
pub fn devices() -> Vec<Device> {
    listed(machine::cards())
}

fn listed(cards: std::result::Result<Vec<Card>, String>) -> Vec<Device> {
    let why_cpu = match &cards {
        Err(why) => why.clone(),
        Ok(cards) if cards.is_empty() => "Vulkan finds no device here".into(),
        Ok(cards) if cards.iter().any(Card::is_graphics_processor) => {
            "no graphics processor here can run a Vulkan backend".into()
        }
        Ok(_) => "no graphics processor among the Vulkan devices here".into(),
    };
    let cards = cards.unwrap_or_default();
    let first = choice::automatic(&cards).first().copied().unwrap_or(Way::Cpu);
    let mut devices = Vec::new();
    for (number, card) in cards.iter().enumerate() {
        for backend in Backend::ALL {
            let chosen = first == Way::Vulkan { number, backend };
            devices.push(Device {
                backend: backend.name(),
                device: card.name.clone(),
                number: Some(number),
                kind: card.kind_name(),
                driver: Some(card.driver.clone()),
                usable: card.can(backend),
                chosen,
                reason: reason(card, backend, chosen),
            });
        }
    }
    let chosen = first == Way::Cpu;
    let reason = if chosen {
        format!("auto takes it: {why_cpu}")
    } else {
        "runs everywhere; auto takes a graphics processor first".into()
    };
    devices.push(Device {
        backend: "cpu",
        device: processor(),
        number: None,
        kind: "cpu",
        driver: None,
        usable: true,
        chosen,
        reason,
    });
    devices
}

/// Why a device is or is not chosen for a backend, in one line.
fn reason(card: &Card, backend: Backend, chosen: bool) -> String {
    let missing = card.missing(backend);
    if !missing.is_empty() {
        return format!("lacks {}", missing.join(", "));
    }
    match card.kind {
        DeviceKind::Software => "computes on the CPU: auto prefers our own CPU path tracer".into(),
        DeviceKind::Other => format!("not known to be a graphics processor: auto skips it; {UNPROVED}"),
        _ if chosen => format!("auto takes it; {}", experience(card, backend)),
        _ => format!("auto takes another first; {}", experience(card, backend)),
    }
}

/// What is known of a backend on a graphics processor of this make. (`docs/vulkan.md` has the measurements.)
fn experience(card: &Card, backend: Backend) -> &'static str {
    match backend {
        Backend::RayPipeline if card.name.contains("NVIDIA") => {
            "its developers ran it on an NVIDIA H100 and H200"
        }
        Backend::Compute if card.name.contains("NVIDIA") => {
            "on an NVIDIA H200 it hung where levels of detail follow the distance"
        }
        _ => UNPROVED,
    }
}

/// The model name of the processor (its architecture where the system does not say), and its number of threads.
fn processor() -> String {
    let name = processor_name().unwrap_or_else(|| format!("{} processor", std::env::consts::ARCH));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{name} on {threads} thread{}", if threads == 1 { "" } else { "s" })
}

/// Makes the renderer that `name` asks for: `auto`, `cpu`, or a Vulkan backend, which may name its device: `vulkan-rt:0`. A device
/// is opened only when the first scene is set.
///
/// # Errors
/// When this machine has no such backend.
pub fn make_renderer(name: &str) -> Result<FallbackRenderer> {
    let ways = choice::choose(name, machine::cards)?;
    let trust = if name == "auto" { Trust::Auto } else { Trust::Named };
    let renderer = FallbackRenderer::new(ways.into_iter().map(|way| opener(way, trust)).collect());
    Ok(renderer.with_stand_in(Box::new(|| FallbackRenderer::new(vec![opener(Way::Cpu, Trust::Named)]))))
}

fn opener(way: Way, trust: Trust) -> fallback::Way {
    match way {
        Way::Cpu => fallback::Way {
            backend: "cpu",
            device: processor(),
            open: Box::new(|| Ok(Box::new(CpuRenderer::new(read_environment)))),
        },
        Way::Vulkan { number, backend } => fallback::Way {
            backend: backend.name(),
            device: machine::cards()
                .ok()
                .and_then(|c| c.get(number).map(|c| c.name.clone()))
                .unwrap_or_default(),
            open: Box::new(move || machine::open(number, backend, pipeline_folder(), trust)),
        },
    }
}

/// The scene-linear colours of an environment picture, OpenEXR or Radiance by its first bytes.
///
/// # Errors
/// One line with the path and what is wrong with the file.
pub fn read_environment(path: &Path) -> std::result::Result<Image, String> {
    let mut first = [0; radiance_file::MAGIC.len()];
    // A file that cannot be opened, or is shorter, is the next reader's to name.
    let is_radiance = open_input(path).and_then(|mut file| file.read_exact(&mut first)).is_ok()
        && first == *radiance_file::MAGIC;
    let image = match is_radiance {
        true => pumice_picture::read_hdr(path),
        false => pumice_picture::read_exr(path).map(|picture| picture.color),
    };
    image.map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::choice::tests::card;
    use super::*;

    #[test]
    fn one_way_is_chosen_and_every_reason_is_said() {
        let lists = [
            (Err("no Vulkan here: no loader (gone)".into()), "cpu"),
            (Ok(vec![]), "cpu"),
            (Ok(vec![card("llvmpipe", DeviceKind::Software, ["", "", ""])]), "cpu"),
            (Ok(vec![card("Radeon", DeviceKind::Discrete, ["a", "b", "c"])]), "cpu"),
            (Ok(vec![card("Radeon", DeviceKind::Integrated, ["VK_KHR_x", "", ""])]), "vulkan-query"),
        ];
        for (cards, expected) in lists {
            let devices = listed(cards);
            let chosen: Vec<_> = devices.iter().filter(|d| d.chosen).collect();
            assert!(chosen.len() == 1 && chosen[0].backend == expected, "{devices:?}");
            assert!(devices.iter().all(|d| !d.reason.is_empty() && !d.device.is_empty()));
            // Only graphics processors carry the note that they are untested.
            for d in &devices {
                let real = d.usable && d.kind != "software" && d.kind != "cpu";
                assert_eq!(d.reason.contains(UNPROVED), real, "{d:?}");
            }
        }
        let tried = listed(Ok(vec![card("NVIDIA H100", DeviceKind::Discrete, ["", "VK_KHR_ray_query", ""])]));
        let said = ["ran it on an NVIDIA H100", "lacks VK_KHR_ray_query", "it hung where"];
        assert!(tried.iter().zip(said).all(|(d, said)| d.reason.contains(said)), "{tried:?}");
    }

    #[test]
    fn reasons_name_what_stands_in_the_way() {
        let none = listed(Err("no Vulkan here: no loader (gone)".into()));
        assert_eq!(none.len(), 1);
        assert_eq!(none[0].reason, "auto takes it: no Vulkan here: no loader (gone)");
        let devices = listed(Ok(vec![
            card("Radeon", DeviceKind::Discrete, ["VK_KHR_ray_tracing_pipeline", "", ""]),
            card("llvmpipe", DeviceKind::Software, ["", "", ""]),
        ]));
        let rows: Vec<_> = devices.iter().map(|d| (d.backend, d.number, d.usable, d.chosen)).collect();
        let expected = [
            ("vulkan-rt", Some(0), false, false),
            ("vulkan-query", Some(0), true, true),
            ("vulkan-compute", Some(0), true, false),
            ("vulkan-rt", Some(1), true, false),
            ("vulkan-query", Some(1), true, false),
            ("vulkan-compute", Some(1), true, false),
            ("cpu", None, true, false),
        ];
        assert_eq!(rows, expected);
        assert_eq!(devices[0].reason, "lacks VK_KHR_ray_tracing_pipeline");
        assert!(devices[3].reason.contains("computes on the CPU"));
    }
}
