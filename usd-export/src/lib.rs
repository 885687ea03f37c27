//! Compressed volumes for other programs: exact surfaces, for those that know only meshes, and files of USD, glTF, PLY,
//! OBJ and STL.
//!
//! ```text
//! CompressedVolume ─► blocks of 64³ voxels ─► FaceBlock, FaceBlock, … ─► QuadMesh     a quad per voxel face
//!                     only those with boxes └► Rectangle, Rectangle, … ─► a file       merged, at a level of detail, sorted by material
//! ```
//! The surface is exactly the volume's own, without simplification or smoothing; only [`SmoothMesh`] and [`CoarseSurface`] are others. It is
//! in index space; the code that writes it applies the matrix.

mod budget;
mod cell_grid;
mod coarse_surface;
mod cut_surface;
mod drawn;
mod drawn_boxes;
mod error;
mod export_scene;
mod faces;
mod file_format;
mod form;
mod labelled_surface;
mod left_out;
mod notes;
mod quad_mesh;
mod reader;
mod scene_gltf;
mod scene_stage;
mod scene_triangles;
mod shear;
mod sky_picture;
mod smooth_mesh;
mod smooth_surface;
mod surface;
mod surface_net;
pub mod usd;
mod voxel_region;
mod whole_file;

pub use budget::{Budget, FaceBytes};
pub use coarse_surface::CoarseSurface;
pub use cut_surface::{CutPolygon, CutRegion, Faces, for_each_cut_block};
pub use error::{ExportError, Result};
pub use export_scene::{ExportOptions, ExportSize, export_scene};
pub use faces::{FaceBlock, Interfaces, for_each_face_block};
pub use file_format::FileFormat;
pub use form::Form;
pub use left_out::left_out_of;
pub use quad_mesh::{Corners, QuadMesh, count_surface_faces};
pub use reader::Reader;
pub use scene_stage::stage_of_scene;
pub use smooth_mesh::{SmoothMesh, SmoothVertex};
pub use surface::{Merging, Rectangle, for_each_surface_block};
pub use voxel_region::VoxelRegion;
