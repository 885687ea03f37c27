//! What every renderer shares.
#![forbid(unsafe_code)]

pub mod filter;
pub mod image;
pub mod metrics;
pub mod picture;
pub mod renderer;
pub mod sampler;
pub mod trace;

pub use filter::PixelFilter;
pub use image::Image;
pub use picture::{Picture, PictureError, Provenance};
pub use renderer::{Progress, RenderError, Renderer};
pub use trace::{Hit, PathOrigin, RayInWorld, Surface, Tracer};
