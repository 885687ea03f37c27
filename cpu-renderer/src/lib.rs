//! The reference path tracer: every machine can render.
#![deny(unsafe_code)]

pub mod bsdf;
pub mod camera_rays;
pub mod cpu_renderer;
pub mod crossing;
pub mod emitters;
pub mod lens;
pub mod lights;
pub mod looks;
pub mod path;
pub mod path_tracer;
pub mod scene_lights;
pub mod tally;
pub mod traverse;

pub use cpu_renderer::{CpuRenderer, emitters_of};
pub use emitters::Emitters;
pub use lights::{Finding, Lights, Sky};
pub use looks::Looks;
pub use path::Surroundings;
pub use path_tracer::PathTracer;
pub use scene_lights::{ReadImage, scene_lights};
