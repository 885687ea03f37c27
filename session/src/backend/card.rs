//! A Vulkan device as the choice of a backend sees it: plain words, so that choosing can be tested without any device.

use pumice_vulkan::device::{Backend, Candidate, DeviceKind};

/// See the module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Card {
    pub(super) name: String,
    pub(super) kind: DeviceKind,
    pub(super) driver: String,
    /// What it lacks for each of [`Backend::ALL`].
    pub(super) missing: [Vec<String>; 3],
}

impl Card {
    pub(super) fn of(candidate: &Candidate) -> Self {
        Self {
            // Drivers choose their names: a control character in one would break a line of ours in two.
            name: printable(&candidate.name),
            kind: candidate.kind,
            driver: printable(&candidate.driver),
            missing: Backend::ALL.map(|b| candidate.missing(b).to_vec()),
        }
    }

    /// What it lacks for a backend; empty: nothing.
    pub(super) fn missing(&self, backend: Backend) -> &[String] {
        let place = Backend::ALL.iter().position(|&b| b == backend);
        place.map_or(&[], |p| &self.missing[p])
    }

    pub(super) fn can(&self, backend: Backend) -> bool {
        self.missing(backend).is_empty()
    }

    /// Whether `auto` may take it: a graphics processor, and no driver that computes on the CPU, where our own path tracer is faster.
    pub(super) fn is_graphics_processor(&self) -> bool {
        matches!(self.kind, DeviceKind::Discrete | DeviceKind::Integrated | DeviceKind::Virtual)
    }

    /// What it is, in words.
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
