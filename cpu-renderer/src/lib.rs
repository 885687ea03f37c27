//! The reference path tracer: every machine can render.
//!
//! `traverse` answers where rays go; `path`, `bsdf` and `lighting` what light comes back; `cpu_renderer` makes a picture of it.
#![forbid(unsafe_code)]

pub mod bsdf;
pub mod camera_rays;
pub mod cpu_renderer;
mod film_store;
pub mod lighting;
pub mod path;
pub mod shading_frame;
pub mod traverse;

pub use cpu_renderer::CpuRenderer;
