//! What every renderer shares.
#![forbid(unsafe_code)]

mod atomic_file;
pub mod environment;
pub mod exr_file;
mod exr_read;
pub mod filter;
pub mod image;
pub mod metrics;
pub mod palette;
pub mod passes;
pub mod picture;
pub mod png_file;
mod provenance_text;
pub mod renderer;
#[cfg(test)]
mod sample_pictures;
pub mod sampler;
pub mod trace;

pub use environment::{EnvironmentMap, EnvironmentSample};
pub use exr_file::{read_exr, write_exr};
pub use filter::PixelFilter;
pub use image::Image;
pub use palette::assign_colors;
pub use passes::Passes;
pub use picture::{Picture, PictureError, Provenance};
pub use png_file::write_png;
pub use provenance_text::read_provenance;
pub use renderer::{Progress, RenderError, Renderer};
pub use trace::{Hit, PathOrigin, RayInWorld, Surface, Tracer};
