//! Tests compute shaders through the [`pumice_transport::Renderer`] interface: the test cases of the CPU renderer, edits and failures, and
//! what is the same on all backends.
//!
//! Each backend has a test program of its own, because a driver that computes on the CPU never frees compiled shaders.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod gpu;

use gpu::of_today;
use gpu::validated::Validated;
use pumice_scene::{Part, PartSet};
use pumice_vulkan::device::Backend;

/// The other backends are compared by pictures of the Cycles ladder, of which a part runs each day (`python/tests`).
#[path = "../../cpu-renderer/tests/renderer/carried.rs"]
mod carried;
#[path = "../../cpu-renderer/tests/renderer/cases.rs"]
mod cases;
#[path = "renderer/denoise.rs"]
mod denoise;
#[path = "renderer/edits.rs"]
mod edits;
#[path = "renderer/failures.rs"]
mod failures;
#[path = "../../cpu-renderer/tests/renderer/floor.rs"]
mod floor;
#[path = "renderer/labels.rs"]
mod labels;
#[path = "renderer/lost.rs"]
mod lost;
#[path = "renderer/pages.rs"]
mod pages;
#[path = "renderer/resolve.rs"]
mod resolve;

/// A program with all parts takes a minute to compile for a CPU, so it has one day in eight: an odd one, on which this program has its turn.
fn besides() -> Vec<PartSet> {
    let all = of_today(&[None, None, None, None, None, Some(PartSet::ALL), None, None]);
    std::iter::once(PartSet::NONE.with(Part::HiddenLabels)).chain(all.into_iter().flatten()).collect()
}

fn renderer() -> Validated {
    Validated::open(Backend::Compute)
}

fn bare() -> Validated {
    Validated::open_bare(Backend::Compute)
}
