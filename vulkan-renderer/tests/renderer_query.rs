//! Ray queries behind the interface of all renderers: the cases of the CPU's test.
//!
//! In a program of its own: a driver that computes on the processor keeps all that it ever compiled, some gigabytes a backend.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod gpu;

use gpu::validated::Validated;
use pumice_vulkan::device::Backend;

#[path = "../../cpu-renderer/tests/renderer/cases.rs"]
mod cases;

fn renderer() -> Validated {
    Validated::open(Backend::RayQuery)
}
