//! A Vulkan device as the choice of a backend sees it: plain data, so that the choice can be tested without a device.

use pumice_vulkan::device::{Backend, Candidate, DeviceKind};

/// Name, kind and missing features of a Vulkan device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Card {
    pub(super) name: String,
    pub(super) kind: DeviceKind,
    pub(super) driver: String,
    /// Features that it lacks for each of [`Backend::ALL`].
    pub(super) missing: [Vec<String>; 3],
    /// Whether it computes f64 itself.
    pub(super) native_f64: bool,
}

/// What [`Candidate::driver`] calls Mesa's driver for AMD cards.
const RADV: &str = ", radv ";

impl Card {
    pub(super) fn of(candidate: &Candidate) -> Self {
        Self {
            // The driver chooses this name; a control character in it could break the one-line texts that contain it.
            name: printable(&candidate.name),
            kind: candidate.kind,
            driver: printable(&candidate.driver),
            missing: Backend::ALL.map(|b| candidate.missing(b).to_vec()),
            native_f64: candidate.native_f64,
        }
    }

    /// All backends, in the order in which `auto` tries them on this device. What its compiler makes of the shaders decides where that is
    /// known (docs/vulkan.md, *How auto chooses*); otherwise it is the order of [`Backend::ALL`].
    pub(super) fn backends(&self) -> [Backend; 3] {
        if !self.native_f64 {
            [Backend::Compute, Backend::RayQuery, Backend::RayPipeline]
        } else if self.driver.contains(RADV) {
            [Backend::RayQuery, Backend::Compute, Backend::RayPipeline]
        } else {
            Backend::ALL
        }
    }

    /// Features that it lacks for a backend; empty if the backend can run on it.
    pub(super) fn missing(&self, backend: Backend) -> &[String] {
        let place = Backend::ALL.iter().position(|&b| b == backend);
        place.map_or(&[], |p| &self.missing[p])
    }

    pub(super) fn can(&self, backend: Backend) -> bool {
        self.missing(backend).is_empty()
    }

    /// Whether `auto` may take it: only graphics processors, not drivers that compute on the CPU, where our own path tracer is faster.
    pub(super) fn is_graphics_processor(&self) -> bool {
        matches!(self.kind, DeviceKind::Discrete | DeviceKind::Integrated | DeviceKind::Virtual)
    }

    /// Its kind as a word, as in [`super::Device::kind`].
    pub(super) fn kind_name(&self) -> &'static str {
        match self.kind {
            DeviceKind::Discrete => "discrete",
            DeviceKind::Integrated => "integrated",
            DeviceKind::Virtual => "virtual",
            DeviceKind::Other => "other",
            DeviceKind::Software => "software",
        }
    }
}

fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect()
}
