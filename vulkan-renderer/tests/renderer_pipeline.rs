//! Tests the ray tracing pipeline through the renderer interface: the test cases of the CPU renderer, edits and failures.
//!
//! This is a test program of its own, because a driver that computes on the CPU never frees compiled shaders.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod gpu;

use gpu::of_today;
use gpu::validated::Validated;
use pumice_vulkan::device::Backend;

#[path = "../../cpu-renderer/tests/renderer/cases.rs"]
mod cases;
#[path = "renderer/edits.rs"]
mod edits;
#[path = "renderer/failures.rs"]
mod failures;
#[path = "../../cpu-renderer/tests/renderer/floor.rs"]
mod floor;

fn renderer() -> Validated {
    Validated::open(Backend::RayPipeline)
}

fn bare() -> Validated {
    Validated::open_bare(Backend::RayPipeline)
}
