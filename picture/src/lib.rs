//! What every renderer shares.
#![forbid(unsafe_code)]

mod atomic_file;
pub mod bvh;
pub mod cryptomatte;
pub mod environment;
pub mod exr_file;
mod exr_header;
mod exr_read;
pub mod film;
pub mod filter;
pub mod image;
pub mod lamp;
pub mod metrics;
pub mod palette;
pub mod passes;
pub mod picture;
pub mod png_file;
pub mod preview;
mod provenance_text;
pub mod renderer;
pub mod resting;
#[cfg(test)]
mod sample_pictures;
pub mod sampler;
pub mod shadow_catcher;
pub mod sun;
pub mod trace;
pub mod view_transform;

pub use bvh::{BoxBounds, Bvh, BvhRay};
pub use cryptomatte::{Matte, name_mattes};
pub use environment::EnvironmentTable;
pub use exr_file::{read_exr, write_exr, write_exr_half};
pub use film::FilmBuffer;
pub use filter::FilterTable;
pub use image::Image;
pub use lamp::{ReadyLamp, Receiver};
pub use passes::PassSums;
pub use picture::{Picture, PictureError, Provenance};
pub use png_file::{write_png, write_png_shown};
pub use provenance_text::read_provenance;
pub use pumice_scene::{Pass, Passes, ViewTransform};
pub use renderer::{Pick, Progress, Rebuilt, RenderError, Renderer, check_counts};
pub use sun::ReadySun;
pub use trace::{Hit, PathOrigin, RayInWorld, Surface, SurfaceKind, Tracer};
