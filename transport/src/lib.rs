//! The code that both renderers share: the interfaces that they implement, and all computations that take place before a ray is traced or
//! that are the same in each renderer.
//!
//! ```text
//! loaded_scene a scene with its volumes and meshes, validated     scene_plan  which data an edit rebuilds
//! renderer     the interface of a renderer to its caller          trace       the interface of geometry to an integrator
//! camera_rays  rays through pixels (lens, filter, sampler)        bsdf        how surfaces scatter (material_table, palette,
//!                                                                             farthest_colors: materials and colours of labels)
//! lights       choice of a light to sample (sun, lamp, environment with sky_irradiance, emitters; light_tree: one of many)
//! geometry     placement, bvh, bricks, cuts, levels of detail, instance tree
//! ```
//! The integrators and the kernels that trace rays are in `pumice-cpu` and `pumice-vulkan`.
#![forbid(unsafe_code)]

pub mod bsdf;
pub mod camera_rays;
mod cdf_guide;
pub mod emitters;
pub mod environment;
pub mod farthest_colors;
pub mod filter;
pub mod geometry;
pub mod lamp;
pub mod lens;
pub mod light_tree;
pub mod lights;
pub mod loaded_scene;
pub mod material_table;
pub mod palette;
pub mod renderer;
pub mod sampler;
pub mod scene_lights;
pub mod scene_plan;
pub mod sky_irradiance;
pub mod sun;
pub mod trace;

pub use emitters::Emitters;
pub use environment::EnvironmentTable;
pub use filter::FilterTable;
pub use geometry::bvh::{BoxBounds, Bvh, BvhRay};
pub use lamp::{ReadyLamp, Receiver};
pub use lights::{LightStrategy, Lights, Sky};
pub use loaded_scene::{LoadedEdit, LoadedScene};
pub use material_table::MaterialTable;
pub use renderer::{CoarseFrame, Pick, Progress, Rebuilt, RenderError, Renderer, SeenSurface};
pub use scene_lights::{ReadImage, scene_lights};
pub use scene_plan::{InstancePlan, MeshPlan, Reuse, ScenePlan, Source};
pub use sky_irradiance::SkyIrradiance;
pub use sun::ReadySun;
pub use trace::{Hit, PathOrigin, RayInWorld, Surface, SurfaceKind, Tracer};
