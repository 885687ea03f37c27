//! The three ways to trace rays on a GPU.

/// A way to trace rays on a GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Backend {
    /// Ray tracing pipeline with an intersection shader, as in the paper.
    RayPipeline,
    /// Ray queries in compute shaders.
    RayQuery,
    /// Compute shaders with a BVH of our own, for GPUs without ray tracing.
    Compute,
}

impl Backend {
    /// All backends, the preferred first.
    pub const ALL: [Self; 3] = [Self::RayPipeline, Self::RayQuery, Self::Compute];

    /// The name that `--backend` takes.
    pub fn name(self) -> &'static str {
        match self {
            Self::RayPipeline => "vulkan-rt",
            Self::RayQuery => "vulkan-query",
            Self::Compute => "vulkan-compute",
        }
    }

    /// The backend with that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|b| b.name() == name)
    }

    /// Whether it uses the device's own acceleration structures.
    pub fn uses_hardware_hierarchy(self) -> bool {
        self != Self::Compute
    }
}

impl std::fmt::Display for Backend {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
