//! The path tracer on Vulkan.
//!
//! ```text
//! scene, volumes ──► pack (no Vulkan) ──► byte arrays ──► device memory ──► one address: SceneHeader
//!                                                                             ▲
//! shaders/*.glsl: line by line the twins of the CPU's files ──────────────────┘
//! ```
//! [`layout`] has every structure that host and shaders share. Whatever is computed before a ray is traced (levels of detail, selection
//! probabilities of lights, colours of labels) comes from the crate that the CPU renderer uses too, so the two cannot differ there.

pub mod denoise;
pub mod device;
mod film;
pub mod layout;
mod machine;
pub mod pack;
mod pages;
pub mod program;
mod programs;
mod renderer;
pub mod resolve;
mod scene;
mod sent;
mod shaders;
mod shown;
mod slices;
mod steps;

pub use programs::finish_compiling;
pub use renderer::VulkanRenderer;
pub use sent::Sent;
pub use shaders::{Entry, executables};
