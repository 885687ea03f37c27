//! A graphics processor behind the interface of all renderers: the cases of the CPU's test in compute shaders, and what edits and
//! failures do on each backend.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod gpu;

use gpu::validated::Validated;
use pumice_vulkan::device::Backend;

#[path = "."]
mod compute {
    #[path = "../../cpu-renderer/tests/renderer/cases.rs"]
    pub(super) mod cases;
    /// On one backend, as passes below; what more there is of them is seen sum by sum in `radiance/catchers.rs`.
    #[path = "../../cpu-renderer/tests/renderer/catchers.rs"]
    mod catchers;
    /// On one backend: that sums are alike on all, to the bit, is seen in `radiance/films.rs`.
    #[path = "../../cpu-renderer/tests/renderer/passes.rs"]
    mod passes;
    #[path = "../../cpu-renderer/tests/renderer/resting.rs"]
    mod resting;

    fn renderer() -> super::Validated {
        super::Validated::open(super::Backend::Compute)
    }
}

#[path = "renderer/edits.rs"]
mod edits;
#[path = "renderer/failures.rs"]
mod failures;
