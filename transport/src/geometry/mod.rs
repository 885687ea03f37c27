//! Geometry in the form that rays are traced through, shared by all tracers.
//!
//! ```text
//! placement       where an instance is: world ↔ index space, exact for whole numbers
//! bvh             a hierarchy over integer boxes, triangles or instances; instance_tree puts one over a whole scene
//! bricks          all drawn labels of a volume in one sparse grid of 64-bit masks; label_of_box finds the label of what was hit
//! drawn_pages     the same of a volume on disk, of which renderers keep some pages in memory
//! contacts        where instances touch; cuts: planes of the parts that are cut away
//! lod             the level of detail of each box
//! visible_boxes   the boxes that are drawn; neighbors and voxel_normals give them smooth shading
//! mesh_grid       triangles of a mesh in an integer grid; mesh_normals gives them smooth shading
//! ```

mod brick_fields;
pub mod bricks;
pub mod bvh;
pub mod contacts;
pub mod cuts;
pub mod drawn_pages;
pub mod instance_tree;
pub mod label_of_box;
pub mod lod;
pub mod mesh_grid;
pub mod mesh_normals;
pub mod neighbors;
pub mod placement;
pub mod power_of_two;
pub mod visible_boxes;
pub mod voxel_normals;

pub use bricks::{BLOCK, BRICK, Block, Brick, Bricks};
pub use contacts::Contacts;
pub use cuts::{CutPlane, Cuts};
pub use drawn_pages::{DrawnInPages, DrawnPage, DrawnPages};
pub use instance_tree::{InstanceTree, WorldBounds};
pub use lod::{ByDistance, Detail, DetailLevel, LodChoice};
pub use mesh_grid::{MeshGrid, mesh_placement};
pub use neighbors::{Neighbors, REACH};
pub use placement::Placement;
pub use visible_boxes::visible_boxes;

/// Largest difference in scaled t at which two planes of a voxel may count as a tie: t ≤ 16 in the walk through a box, 3 roundings of f32
/// each, times two for two planes. A surface may be reported this far before the ray reaches it.
pub const TIE: f64 = 2.0 * 16.0 * 3.0 / 16_777_216.0;

/// `f` of the three axes. Same as `[0, 1, 2].map(f)`, but always inlined: whether the compiler inlines `map` inside a walk depends on
/// unrelated lines, and the call costs a few per cent of the time of all rays.
#[inline(always)]
pub fn each_axis<T>(mut f: impl FnMut(usize) -> T) -> [T; 3] {
    [f(0), f(1), f(2)]
}
