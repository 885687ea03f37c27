//! Benches: what Pumice takes and how exact it is, measured, as typed tables with their Markdown, CSV and plots.
//!
//! A module is a subcommand of `pumice bench`, and the files that it writes have its name:
//!
//! | module | measures | beside |
//! |---|---|---|
//! | [`sizes`], [`speeds`] | bytes by part and level; CPU seconds of each step, rays | |
//! | [`backends`], [`live`], [`instances`] | rays and frames; how soon an edit is seen; many copies | |
//! | [`errors`], [`lod`] | relMSE by seconds; by level of detail | a picture of many samples |
//! | [`convergence`] | relMSE by CPU seconds | Cycles |
//! | [`embree`], [`peers`], [`paper`] | rays; bytes and voxels; encodings | Embree; other programs; the paper |
//! | [`needs`] | what it costs to build what a scene does not need | the same scene without it |
//! | [`stability`], [`extremes`] | extreme scenes and volumes | exact answers, bounds |
//!
//! The command `pumice bench` and the program `pumice-bench` are both [`Bench::run`].
#![forbid(unsafe_code)]

pub mod backends;
mod command;
mod console;
pub mod convergence;
pub mod embree;
pub mod errors;
pub mod extremes;
mod files;
pub mod instances;
pub mod live;
pub mod lod;
pub mod machine;
mod mean_picture;
pub mod needs;
pub mod paper;
pub mod peers;
pub mod plot;
pub mod ray_sets;
pub mod sizes;
pub mod speeds;
pub mod stability;
pub mod table;
pub mod timing;
mod voxels;

pub use command::Bench;
pub use console::{BenchError, BenchResult, Outcome};
