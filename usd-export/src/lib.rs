//! Compressed volumes for other programs: exact surfaces, for those that know only meshes, and files of USD.
//!
//! ```text
//! CompressedVolume ─► blocks of 64³ voxels ─► FaceBlock, FaceBlock, … ─► QuadMesh
//!                     only those with boxes   a quad per voxel face       corners shared, or separate for each quad
//! ```
//! The surface is exactly the volume's own, without simplification or smoothing. It is in index space; the code that writes it applies the
//! matrix.

mod error;
mod faces;
mod quad_mesh;
mod scene_stage;
mod surface;
pub mod usd;

pub use error::{ExportError, Result};
pub use faces::{FaceBlock, Interfaces, for_each_face_block};
pub use quad_mesh::{Corners, QuadMesh};
pub use scene_stage::{Form, StageOptions, stage_of_scene};
pub use surface::{Merging, Rectangle, for_each_surface_block};
