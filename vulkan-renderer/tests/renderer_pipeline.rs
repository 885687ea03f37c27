//! The ray tracing pipeline behind the interface of all renderers: the cases of the CPU's test, and what edits and failures do.
//!
//! In a program of its own: a driver that computes on the processor keeps all that it ever compiled.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod gpu;

use gpu::validated::Validated;
use pumice_vulkan::device::Backend;

#[path = "../../cpu-renderer/tests/renderer/cases.rs"]
mod cases;
#[path = "renderer/edits.rs"]
mod edits;
#[path = "renderer/failures.rs"]
mod failures;

fn renderer() -> Validated {
    Validated::open(Backend::RayPipeline)
}

fn bare() -> Validated {
    Validated::open_bare(Backend::RayPipeline)
}
