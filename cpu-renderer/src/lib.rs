//! The reference path tracer, which runs on the CPU of every machine.
#![deny(unsafe_code)]

pub mod cpu_renderer;
pub mod crossing;
pub mod film_sample;
pub mod path;
pub mod path_tracer;
pub mod traverse;

pub use cpu_renderer::{CpuRenderer, LEAVES_OUT, emitters_of};
pub use path::Surroundings;
pub use path_tracer::PathTracer;
