//! What every renderer shares.
#![forbid(unsafe_code)]

pub mod bvh;
pub mod image;
pub mod metrics;
pub mod renderer;
pub mod trace;

pub use bvh::{BoxBounds, Bvh, BvhRay};
pub use image::Image;
pub use renderer::{Progress, RenderError, Renderer};
pub use trace::{Hit, PathOrigin, RayInWorld, Surface, Tracer};
