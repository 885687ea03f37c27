//! Everything that talks to Vulkan: the rest of the crate sees bytes, addresses and launches.
//!
//! ```text
//! Instance ──► survey: which device can run which backend, and what it lacks ──► Gpu ──► Buffer, ComputePipeline, RayPipeline,
//!    └ loader, validation layer                                                           Acceleration, launches that are timed
//! ```
//! Headless: no surface, no window, no queue but one for compute. One launch is in flight at a time, so a launch may use
//! whatever was made before it, and what is dropped is never in use.
//!
//! # Unsafe code
//! Vulkan's functions are unsafe throughout, so this folder is the one place of the crate where unsafe code is allowed. Every
//! handle lies in a type that destroys it and holds what it was made from alive; nothing outside of this folder sees a handle.
//! What the types cannot prove are the addresses that shaders follow: whoever launches fills [`crate::layout::Launch`] from live
//! buffers. A wrong address is a fault of this crate and shows as a lost device, never as a wrong access by the host.
#![allow(unsafe_code, reason = "Vulkan's functions are unsafe; see the module")]

mod acceleration;
mod backend;
mod buffer;
mod compute;
#[cfg(test)]
mod control;
mod error;
mod faults;
mod float_modes;
mod gpu;
mod instance;
mod messages;
#[cfg(test)]
mod other_limits;
mod pipeline_cache;
mod ray_pipeline;
mod survey;

pub use acceleration::{Acceleration, HardwareBox};
pub use backend::Backend;
pub use buffer::Buffer;
pub use compute::ComputePipeline;
pub use error::DeviceError;
pub use faults::InjectedFault;
pub use gpu::Gpu;
pub use instance::{Instance, InstanceOptions};
pub use messages::Messages;
pub use ray_pipeline::{RayPipeline, RayShaders};
pub use survey::{Candidate, DeviceKind, survey};
