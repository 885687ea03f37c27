//! Surfaces of compressed volumes for programs that know meshes alone.
//!
//! ```text
//! CompressedVolume ─► blocks of 64³ voxels ─► FaceBlock, FaceBlock, … ─► QuadMesh
//!                     only those with boxes   a quad a voxel face         corners shared or each quad's own
//! ```
//! The surface is the volume's own, exactly: no simplification, no smoothing. It is in index space; whoever writes it applies the matrix.

mod faces;
mod quad_mesh;

pub use faces::{FaceBlock, Interfaces, for_each_face_block};
pub use quad_mesh::{Corners, QuadMesh};
