//! Rays against compressed volumes.
//!
//! ```text
//! world ray ──► IndexRay (f64, once an instance) ──► Bvh over the visible boxes (f32, conservative)
//!                                                        │ candidates
//!                                                        ▼
//!                              clip against the exact box (f64) ──► Walk: cells, voxels (f32, planes from integers)
//! ```
//! A candidate's result depends on the ray and the box alone, candidates are compared by (t, label, voxel), and the hierarchy
//! only leaves out boxes that cannot win: the answer does not depend on the order of traversal.
//!
//! **Bricks** (`bricks`, `brick_walk`) are a second form of what is drawn, of all labels in one, where every box is at the same level: space
//! is met in order, and the first voxel there is the answer. They answer what does not ask for one label, two to three times as fast; the
//! hierarchy answers the rest, and all of it where levels differ. The two tell the same surfaces but for chords that a walk
//! skips and for which voxel stands at an edge.
//!
//! **Surfaces.** Where the ray comes from outside, the first voxel of a visible label that it passes through with a chord above
//! 0 is hit, at the face through which it enters; on an edge, where it enters through several, at one that has nothing visible
//! before it if there is one. A ray that starts inside a voxel of label L sees the inside of L's surface, as in a closed mesh: the
//! face through which it leaves L, whether into empty space or into another label, with `from_inside` set and the outward normal
//! along the ray. Seams between boxes of one label are no surfaces. Nothing at t = 0 is reported; a ray that starts exactly on a
//! face and points into the voxel is inside it.
//!
//! **Cuts** take parts of space away from an instance; what is left of a ray is traced piece by piece (`cuts`), and a solid that
//! ends at a cut ends in a cap: as if the voxels themselves had been cut.
//!
//! **Instances**, volumes and meshes, are asked in turn where they are few, else as a hierarchy over them finds them
//! (`instance_tree`). The nearest hit is told either way, of the first instance where several are as near.
//!
//! **Meshes** are hierarchies of the same kind, over triangles in a grid of their own. They are never cut. Smooth normals of their
//! corners (`mesh_normals`), and of voxels (`voxel_normals`), are for shading alone: hits, sides and what paths go on from are those of the
//! triangles and voxels.

mod avx;
mod box_walk;
mod brick_walk;
mod cut_ray;
mod f64x4;
mod index_ray;
mod mesh_tracer;
mod mirrored;
mod ray_box_mask;
mod scene_tracer;
mod triangle;
mod volume_tracer;

pub(crate) use index_ray::IndexRay;
pub use mesh_tracer::MeshTracer;
pub use scene_tracer::{SceneTracer, TracedInstance};
pub use volume_tracer::VolumeTracer;
