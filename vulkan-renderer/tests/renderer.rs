//! Compute shaders behind the interface of all renderers: the cases of the CPU's test, what edits and failures do, and what all backends
//! have alike.
//!
//! A program for each backend: a driver that computes on the processor keeps all that it ever compiled.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod gpu;

use gpu::validated::Validated;
use pumice_vulkan::device::Backend;

/// What there is of it on other backends is seen in pictures of rungs, each day another part of them (`python/tests`).
#[path = "../../cpu-renderer/tests/renderer/carried.rs"]
mod carried;
#[path = "../../cpu-renderer/tests/renderer/cases.rs"]
mod cases;
#[path = "renderer/edits.rs"]
mod edits;
#[path = "renderer/failures.rs"]
mod failures;
#[path = "renderer/labels.rs"]
mod labels;
#[path = "renderer/lost.rs"]
mod lost;
/// With passes, on one backend: that sums are alike on others, to the bit, is seen in `radiance/films.rs` and `radiance/catchers.rs`.
#[path = "."]
mod sorting {
    use super::cases;
    #[path = "../../cpu-renderer/tests/renderer/catchers.rs"]
    mod catchers;
    #[path = "../../cpu-renderer/tests/renderer/passes.rs"]
    mod passes;
    #[path = "../../cpu-renderer/tests/renderer/resting.rs"]
    mod resting;

    fn renderer() -> super::Validated {
        super::Validated::open_sorting(super::Backend::Compute)
    }
}

fn renderer() -> Validated {
    Validated::open(Backend::Compute)
}

fn bare() -> Validated {
    Validated::open_bare(Backend::Compute)
}
