//! The CPU renderer behind the interface of all renderers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail by panicking")]

use pumice_scene::{Part, PartSet};

#[path = "renderer/carried.rs"]
mod carried;
#[path = "renderer/cases.rs"]
mod cases;
#[path = "renderer/catchers.rs"]
mod catchers;
#[path = "renderer/catching.rs"]
mod catching;
#[path = "renderer/coarse_frames.rs"]
mod coarse_frames;
#[path = "renderer/floor.rs"]
mod floor;
#[path = "renderer/passes.rs"]
mod passes;
#[path = "renderer/resting.rs"]
mod resting;
#[path = "renderer/showing.rs"]
mod showing;

fn besides() -> Vec<PartSet> {
    vec![PartSet::NONE.with(Part::HiddenLabels), PartSet::ALL]
}

/// Nothing is compiled here: all.
fn of_today<T: Clone>(things: &[T]) -> Vec<T> {
    things.to_vec()
}

fn renderer() -> pumice_cpu::CpuRenderer {
    pumice_cpu::CpuRenderer::new(|path| Err(format!("no picture at {}", path.display())))
}
