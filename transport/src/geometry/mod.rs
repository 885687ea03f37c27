//! Geometry made ready for rays, whoever traces them.
//!
//! ```text
//! placement       where an instance is: world ↔ index space, exact for whole numbers
//! bvh             a hierarchy over integer boxes, triangles or instances; instance_tree puts one over a whole scene
//! bricks          all drawn labels of a volume in one sparse grid of 64-bit masks
//! cuts            planes of what is taken away
//! lod             which level of detail each box is drawn at
//! visible_boxes   which boxes are drawn; neighbors and voxel_normals shade them smooth
//! mesh_grid       triangles of a mesh as cells of a grid; mesh_normals shades them smooth
//! ```

pub mod bricks;
pub mod bvh;
pub mod cuts;
pub mod instance_tree;
pub mod lod;
pub mod mesh_grid;
pub mod mesh_normals;
pub mod neighbors;
pub mod placement;
pub mod power_of_two;
pub mod visible_boxes;
pub mod voxel_normals;

pub use bricks::{BLOCK, BRICK, Block, Brick, BrickPart, Bricks};
pub use cuts::{CutPlane, Cuts};
pub use instance_tree::{InstanceTree, WorldBounds};
pub use lod::{ByDistance, Detail, DetailLevel, LodChoice};
pub use mesh_grid::{MeshGrid, mesh_placement};
pub use neighbors::{Neighbors, REACH};
pub use placement::Placement;
pub use visible_boxes::visible_boxes;

/// Scaled t within which two planes of a voxel may be taken for a tie: of the walk through a box, t ≤ 16, 3 roundings of f32 each
/// and twice that for two planes. A surface may be reported this far before it is met.
pub const TIE: f64 = 2.0 * 16.0 * 3.0 / 16_777_216.0;

/// `f` of the three axes. (What `[0, 1, 2].map(f)` is, but for certain without a call: whether the compiler takes the one in a
/// walk for worth inlining hangs on unrelated lines, and the call costs some per cent of all rays.)
#[inline(always)]
pub fn each_axis<T>(mut f: impl FnMut(usize) -> T) -> [T; 3] {
    [f(0), f(1), f(2)]
}
