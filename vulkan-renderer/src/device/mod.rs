//! The only part of the crate that calls Vulkan. The rest of the crate works with bytes, addresses and launches.
//!
//! ```text
//! Instance ──► survey: which device can run which backend, and what it lacks ──► Gpu ──► Buffer, ComputePipeline, RayPipeline,
//!    └ loader, validation layer                                                           Acceleration, launches that are timed
//! ```
//! It is headless: no surface, no window, and no queue but one for compute. Only one launch runs at a time and each is waited for, so a
//! launch may use whatever was made before it, and an object is never in use when it is dropped.
//!
//! # Unsafe code
//! Vulkan's functions are unsafe throughout, so this folder is the one place of the crate where unsafe code is allowed. Every handle
//! belongs to a type that destroys it and keeps its parents alive; nothing outside this folder sees a handle. The types cannot prove the
//! addresses that shaders follow: the caller of a launch must fill [`crate::layout::Launch`] from live buffers. A wrong address is a bug of
//! this crate. It shows as a lost device, never as a wrong access by the host.
#![allow(unsafe_code, reason = "Vulkan's functions are unsafe; see the module")]

mod acceleration;
mod backend;
mod buffer;
mod compute;
#[cfg(test)]
mod control;
mod error;
mod executables;
mod faults;
mod float_modes;
mod gpu;
mod initialised;
mod instance;
mod messages;
#[cfg(test)]
mod other_limits;
mod pipeline_cache;
mod ray_pipeline;
mod specialised;
mod survey;
mod unfinished;

pub use acceleration::{Acceleration, HardwareBox};
pub use backend::Backend;
pub use buffer::{Buffer, Piece};
pub use compute::ComputePipeline;
pub use error::DeviceError;
pub use executables::{Executable, Statistic};
pub use faults::InjectedFault;
pub use gpu::Gpu;
pub use instance::{Instance, InstanceOptions};
pub use messages::Messages;
pub use ray_pipeline::{RayPipeline, RayShaders};
pub use survey::{Candidate, DeviceKind, survey};
pub use unfinished::{Unfinished, abandon_compiling, unfinished};
