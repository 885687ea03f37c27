//! Traces rays through compressed volumes and meshes.
//!
//! ```text
//! world ray ──► IndexRay (f64, once an instance) ──► Bvh over the visible boxes (f32, conservative)
//!                                                        │ candidates
//!                                                        ▼
//!                              clip against the exact box (f64) ──► Walk: cells, voxels (f32, planes from integers)
//! ```
//! The result for a candidate depends on the ray and the box alone, candidates are compared by (t, label, voxel), and the hierarchy only
//! leaves out boxes that cannot win: the hit does not depend on the order of traversal.
//!
//! **Bricks** (`bricks`, `brick_walk`) are a second form of the drawn voxels, with all labels merged, for volumes whose boxes all have the
//! same level. A ray crosses space in order, and the first voxel is the hit. They answer queries that are not about one label, two to three
//! times as fast; the hierarchy answers the others, and all queries where levels differ. Both report the same surfaces, except for chords
//! that a walk skips and for the choice of the voxel at an edge.
//!
//! **Surfaces.** For a ray from outside, the hit is the first voxel of a visible label that the ray passes through with a chord above 0, at
//! the face through which it enters. On an edge, where it enters through several faces, the hit is at one with nothing visible in front of
//! it, if there is one. A ray that starts inside a voxel of label L sees the inside of L's surface, as in a closed mesh: the face through
//! which it leaves L, into empty space or into another label, with `from_inside` set and the outward normal along the ray. Seams between
//! boxes of one label are no surfaces. Nothing at t = 0 is reported; a ray that starts exactly on a face and points into the voxel is
//! inside it.
//!
//! **Cuts** remove parts of space from an instance. The remaining pieces of a ray are traced one by one (`cut_ray`), and a solid that ends
//! at a cut ends in a cap, as if the voxels themselves had been cut.
//!
//! **Instances** of volumes and meshes are asked in turn where they are few; otherwise a hierarchy over them selects them
//! (`instance_tree`). Either way the nearest hit is reported, of the first instance where several are equally near.
//!
//! **Meshes** have hierarchies of the same kind, over triangles in a grid of their own. They are never cut. Smooth normals from their
//! corners (`mesh_normals`) and of voxels (`voxel_normals`) affect shading only: hits, sides and path origins are those of the triangles
//! and voxels.

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
