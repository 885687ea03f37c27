//! What every renderer shares.
#![forbid(unsafe_code)]

pub mod bvh;
pub mod environment;
pub mod film;
pub mod filter;
pub mod image;
pub mod metrics;
pub mod palette;
pub mod picture;
pub mod renderer;
pub mod sampler;
pub mod sun;
pub mod trace;

pub use bvh::{BoxBounds, Bvh, BvhRay};
pub use environment::EnvironmentTable;
pub use film::FilmBuffer;
pub use filter::FilterTable;
pub use image::Image;
pub use picture::{Picture, PictureError, Provenance};
pub use renderer::{Progress, RenderError, Renderer};
pub use sun::ReadySun;
pub use trace::{Hit, PathOrigin, RayInWorld, Surface, Tracer};
