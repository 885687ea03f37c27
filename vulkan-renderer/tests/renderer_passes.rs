//! Tests render passes, shadow catchers and adaptive sampling with compute shaders through the [`pumice_transport::Renderer`] interface.
//! `radiance/films.rs` and `radiance/catchers.rs` check that the sums of other backends are the same to the bit.
//!
//! This is a test program of its own, because a driver that computes on the CPU never frees compiled shaders.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod gpu;

use gpu::validated::Validated;
use pumice_vulkan::device::Backend;

#[path = "../../cpu-renderer/tests/renderer/catchers.rs"]
mod catchers;
#[path = "renderer/caught_and_denoised.rs"]
mod caught_and_denoised;
#[path = "../../cpu-renderer/tests/renderer/floor.rs"]
mod floor;
#[path = "../../cpu-renderer/tests/renderer/passes.rs"]
mod passes;
#[path = "../../cpu-renderer/tests/renderer/resting.rs"]
mod resting;
#[path = "renderer/sums_stay.rs"]
mod sums_stay;

fn renderer() -> Validated {
    Validated::open_sorting(Backend::Compute)
}
