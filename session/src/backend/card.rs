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
}

impl Card {
    pub(super) fn of(candidate: &Candidate) -> Self {
        Self {
            // The driver chooses this name; a control character in it could break the one-line texts that contain it.
            name: printable(&candidate.name),
            kind: candidate.kind,
            driver: printable(&candidate.driver),
            missing: Backend::ALL.map(|b| candidate.missing(b).to_vec()),
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
