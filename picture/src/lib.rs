//! Pictures, from the film that samples are added to, to the files that a picture is kept in and the metrics that compare two.
//!
//! ```text
//! film ──► passes, variance ──► Picture ──► EXR (with Cryptomatte and provenance), PNG (through a view transform)
//!                                  │  ▲ annotate: scale bar, legend
//!                                  └─────► metrics: relMSE, PSNR, SSIM, FLIP, a statistical test
//! pictures of several seeds, of two renderers ──► agreement: do they converge to the same picture
//! ```
#![forbid(unsafe_code)]

pub mod agreement;
pub mod annotate;
mod coarse_pixels;
pub mod cryptomatte;
pub mod denoise;
pub mod exr_file;
mod exr_header;
mod exr_read;
pub mod film;
pub mod film_memory;
pub mod image;
pub mod metrics;
pub mod passes;
pub mod picture;
mod picture_labels;
pub mod png_file;
pub mod provenance_paths;
mod provenance_text;
pub mod radiance_file;
pub mod resting;
#[cfg(test)]
mod sample_pictures;
pub mod shadow_catcher;
pub mod view_transform;

pub use annotate::{Annotations, ScaleBar};
pub use coarse_pixels::CoarsePixels;
pub use cryptomatte::{Matte, name_mattes};
pub use denoise::{Denoiser, GuideSurface, Guides};
pub use exr_file::{read_exr, write_exr, write_exr_as, write_exr_half};
pub use film::FilmBuffer;
pub use image::Image;
pub use passes::PassSums;
pub use picture::{Picture, PictureError, Provenance};
pub use picture_labels::{InstanceLabels, SeenInPicture, name_labels};
pub use png_file::{display_pixels, png_bytes, write_png, write_png_as, write_png_shown};
pub use provenance_paths::PicturePaths;
pub use provenance_text::read_provenance;
pub use pumice_scene::{Pass, Passes, ViewTransform};
pub use radiance_file::read_hdr;
