//! Converts volumes and a scene to the bytes that the device gets. It needs no Vulkan, so it gives the same bytes on every machine and is
//! tested without a GPU.
//!
//! ```text
//! CompressedVolume ──► PackedNodes      nodes and leaves as compressed, of the wanted labels        changes when a label is first shown
//!                  └─► PackedBoxes      boxes of drawn labels, in Morton order, with their levels   changes with visibility and LOD
//!      PackedBoxes └─► PackedBricks     the same voxels, all labels together                        changes with visibility and LOD
//! DrawnPages       ──► PackedPage       boxes, nodes and bricks of a page of a volume on disk    changes with visibility and LOD
//! MeshData         ──► PackedMesh       vertices and triangles                                      changes with the mesh
//! MaterialTable    ──► PackedMaterials  materials, and the material of each label                   changes with colours
//! Emitters         ──► PackedEmitters   emissive surfaces and their light tree                      changes with emission and placements
//! Lights           ──► lamp_tree        the tree over many lamps                                    changes with lamps
//! Lights, Camera…  ──► records          plain structures of `layout`                                changes with each of them
//! ```
//! Nothing is decompressed: a box is the 8 bytes of its record and its label, and nodes are copied unchanged. Only what is drawn is packed.
//! Where all boxes are drawn at one level of detail, rays traverse bricks, which need memory in addition; otherwise they traverse a
//! hierarchy over boxes.

mod boxes;
mod bricks;
mod cuts;
mod emitters;
mod light_tree;
mod material_table;
mod meshes;
mod needs;
mod nodes;
mod page;
mod scene;

pub(crate) use boxes::take_voxels;
pub use boxes::{PackedBoxes, place};
pub use bricks::PackedBricks;
pub(crate) use bricks::level_of;
pub use cuts::cut_planes;
pub use emitters::PackedEmitters;
pub use light_tree::lamp_tree;
pub use material_table::PackedMaterials;
pub use meshes::{PackedMesh, place_mesh};
pub use needs::{CONSTANTS, FLOATS_FIRST, LEAVES_OUT, ShaderNeeds};
pub use nodes::PackedNodes;
pub use page::{MOST_PAGE_BYTES, PAGE_ALIGNMENT, PackedPage};
pub use scene::{PackedSky, camera, instance_tree, lamps, lights, settings, suns};
