//! What every renderer shares.
#![forbid(unsafe_code)]

pub mod bvh;
pub mod renderer;
pub mod trace;

pub use bvh::{BoxBounds, Bvh, BvhRay};
pub use renderer::{Progress, RenderError, Renderer};
pub use trace::{Hit, PathOrigin, RayInWorld, Surface, Tracer};
