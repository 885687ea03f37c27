//! A graphics processor's own hierarchies behind the interface of all renderers: the cases of the CPU's test on each backend.
//!
//! In a program of their own: a driver that computes on the processor keeps all that it ever compiled, some gigabytes a backend.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]
#![allow(clippy::duplicate_mod, reason = "the same cases for each backend")]

mod gpu;

use gpu::validated::Validated;
use pumice_vulkan::device::Backend;

#[path = "."]
mod ray_pipeline {
    #[path = "../../cpu-renderer/tests/renderer/cases.rs"]
    mod cases;

    fn renderer() -> super::Validated {
        super::Validated::open(super::Backend::RayPipeline)
    }
}

#[path = "."]
mod ray_query {
    #[path = "../../cpu-renderer/tests/renderer/cases.rs"]
    mod cases;

    fn renderer() -> super::Validated {
        super::Validated::open(super::Backend::RayQuery)
    }
}
