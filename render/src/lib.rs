//! What every renderer shares.
#![forbid(unsafe_code)]

pub mod image;
pub mod metrics;
pub mod picture;
pub mod bvh;
pub mod renderer;
pub mod sampler;
pub mod trace;

pub use image::Image;
pub use picture::{Picture, PictureError, Provenance};
pub use bvh::{BoxBounds, Bvh, BvhRay};
pub use renderer::{Progress, RenderError, RenderReport, Renderer};
pub use trace::{Hit, PathOrigin, RayInWorld, Surface, Tracer};
