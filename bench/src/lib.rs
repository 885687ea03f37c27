//! Benches: measurements of Pumice's time, memory and accuracy, as typed tables with Markdown, CSV and plots.
//!
//! Each module here is a subcommand of `pumice bench`, and the files that it writes have its name:
//!
//! | module | measures | compares with |
//! |---|---|---|
//! | [`sizes`], [`speeds`] | bytes by part and level; CPU seconds of each step, rays per second | |
//! | [`large`] | seconds, peak memory and bytes of compressing against voxels, within a limit on memory | the limit |
//! | [`residency`] | seconds of a picture against the bytes of its volume in memory | everything in memory |
//! | [`shaders`] | registers, spills, instructions of compiled shaders | |
//! | [`backends`], [`live`], [`instances`] | rays and frames; latency of an edit; many instances | |
//! | [`errors`], [`lod`] | relMSE over seconds; by level of detail | a picture of many samples |
//! | [`convergence`] | relMSE over CPU seconds; noise in real light | Cycles |
//! | [`denoise`] | relMSE and FLIP with and without a denoiser | Open Image Denoise |
//! | [`embree`], [`peers`], [`paper`] | rays; bytes and voxels; encodings | Embree; other programs; the paper |
//! | [`export`] | seconds, memory and bytes of exports; their import into Blender | other writers of USD |
//! | [`needs`] | the cost of building parts that a scene does not need | the same scene without them |
//! | [`stability`], [`extremes`] | errors in extreme scenes; bytes of extreme volumes | exact answers; bounds |
//!
//! The command `pumice bench` and the program `pumice-bench` both call [`Bench::run`].
#![forbid(unsafe_code)]

pub mod backends;
mod command;
mod console;
pub mod convergence;
pub mod denoise;
pub mod embree;
pub mod errors;
pub mod export;
pub mod extremes;
mod files;
pub mod instances;
mod itself;
pub mod large;
pub mod live;
pub mod lod;
pub mod machine;
mod mean_picture;
mod mirrored;
pub mod needs;
pub mod paper;
pub mod peers;
pub mod ray_sets;
pub mod residency;
pub mod shaders;
pub mod sizes;
pub mod speeds;
pub mod stability;
pub mod table;
pub mod timing;
pub mod types;
mod voxels;

pub use command::Bench;
pub use console::{BenchError, BenchResult, Outcome};
