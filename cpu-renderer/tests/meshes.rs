//! Triangle meshes: hits compared with an exact oracle, and pictures of meshes compared with pictures of voxels of the same shape, which
//! share no code with them beyond the hierarchy.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail by panicking")]

#[path = "meshes/hits.rs"]
mod hits;
#[path = "meshes/pictures.rs"]
mod pictures;
#[path = "meshes/shapes.rs"]
mod shapes;
#[path = "meshes/smooth.rs"]
mod smooth;

fn renderer() -> pumice_cpu::CpuRenderer {
    pumice_cpu::CpuRenderer::new(|path| Err(format!("no picture at {}", path.display())))
}
