//! From volumes and a scene to the bytes that a device gets. No Vulkan here: the same on every machine, and tested without one.
//!
//! ```text
//! CompressedVolume ──► PackedNodes   nodes and leaves as compressed, those of wanted labels     changes when a label is shown
//!                  └─► PackedBoxes   boxes of drawn labels, in Morton order, with their levels  changes with visibility and LOD
//!        PackedBoxes └─► PackedBricks  the same, all labels in one                          changes with visibility and LOD
//! MeshData         ──► PackedMesh    corners and triangles                                        changes with the mesh
//! MaterialTable            ──► PackedMaterials   materials and which label has which                        changes with colours
//! Emitters         ──► PackedEmitters  surfaces that shine, and their tree                     changes with what shines and where
//! Lights, Camera…  ──► records       numbers of `layout`                                        changes with each of them
//! ```
//! Nothing is inflated: a box is the 8 bytes of its record and its label; a node is copied as it lies. What is not drawn is not
//! there. Where all boxes are drawn at one level of detail, rays go through bricks, which are bytes besides; else through a hierarchy of
//! boxes.

mod boxes;
mod bricks;
mod cuts;
mod emitters;
mod material_table;
mod meshes;
mod needs;
mod nodes;
mod scene;

pub use boxes::{PackedBoxes, place};
pub use bricks::PackedBricks;
pub use cuts::cut_planes;
pub use emitters::PackedEmitters;
pub use material_table::PackedMaterials;
pub use meshes::{PackedMesh, place_mesh};
pub use needs::{LEAVES_OUT, ShaderNeeds};
pub use nodes::PackedNodes;
pub use scene::{PackedSky, camera, header, instance_tree, lamps, lights, settings, suns};
