//! What both renderers are made of: the interfaces that they implement, and everything that is computed before a ray is traced or
//! is the same whoever traces it.
//!
//! ```text
//! loaded_scene a scene with its volumes and meshes, valid as one  scene_plan  what an edit makes anew of it
//! renderer     what a caller asks of any renderer                 trace    what an integrator asks of geometry
//! camera_rays  rays through pixels (lens, filter, sampler)        bsdf     how surfaces scatter (looks, palette: which has which)
//! lights       which light is sampled (sun, lamp, environment, emitters)
//! geometry     where things are and what of them is drawn: placement, bvh, bricks, cuts, levels of detail, instance tree
//! ```
//! The integrators and the kernels that trace rays are `pumice-cpu`'s and `pumice-vulkan`'s.
#![forbid(unsafe_code)]

pub mod bsdf;
pub mod camera_rays;
pub mod emitters;
pub mod environment;
pub mod filter;
pub mod geometry;
pub mod lamp;
pub mod lens;
pub mod lights;
pub mod loaded_scene;
pub mod material_table;
pub mod palette;
pub mod renderer;
pub mod sampler;
pub mod scene_lights;
pub mod scene_plan;
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
pub use renderer::{Pick, Progress, Rebuilt, RenderError, Renderer};
pub use scene_lights::{ReadImage, scene_lights};
pub use scene_plan::{InstancePlan, MeshPlan, Reuse, ScenePlan, Source};
pub use sun::ReadySun;
pub use trace::{Hit, PathOrigin, RayInWorld, Surface, SurfaceKind, Tracer};
