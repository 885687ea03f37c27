//! Packs a mesh as an instance whose items are triangles.
//!
//! ```text
//! field of the instance   of a volume     of a mesh
//! nodes                   nodes           vertices in the mesh's grid, 3 floats each
//! boxes, box_count        boxes           vertex numbers of triangles, 3 words each; number of triangles
//! labels                  labels          material index of each triangle
//! leaves                  leaves          vertex normals of triangles, 3 words each; 0 where all are flat
//! lod                     level           LOD_TRIANGLES, or LOD_CATCHER for a shadow catcher
//! chunks, dims            …               0
//! the others              the same, of the mesh's grid
//! ```

use pumice_core::reserve::collected;
use pumice_core::{MeshData, NoMemory};
use pumice_transport::geometry::{MeshGrid, Placement};
use pumice_transport::{BoxBounds, RenderError};

use super::boxes::aabbs_of;
use crate::layout::{Instance, LOD_TRIANGLES};

/// A mesh in the layout of the table above.
#[derive(Clone, Debug)]
pub struct PackedMesh {
    /// The vertices, in the mesh's grid.
    pub grid: MeshGrid,
    /// Material index of each triangle.
    pub materials: Vec<u32>,
    /// Bounds and number of each triangle: what `pumice_transport::Bvh::build` takes.
    pub bounds: Vec<(BoxBounds, u32)>,
    all: BoxBounds,
}

impl PackedMesh {
    /// Packs the mesh at a place of the scene.
    ///
    /// # Errors
    /// As [`MeshGrid::new`].
    pub fn new(place: u32, mesh: &MeshData) -> Result<Self, RenderError> {
        let grid = MeshGrid::new(place, mesh)?;
        let bounds = grid.bounds(mesh)?;
        let all = bounds.iter().map(|b| b.0).reduce(BoxBounds::union);
        let all = all.unwrap_or(BoxBounds { lo: [0; 3], hi: [0; 3] });
        let count = mesh.triangles().len();
        let materials = (0..count).map(|t| mesh.material(t));
        let materials = collected(count, materials, "the materials of a mesh's triangles")?;
        Ok(Self { grid, materials, bounds, all })
    }

    /// Bounds for hardware's hierarchies; see [`super::PackedBoxes::aabbs`].
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn aabbs(&self) -> Result<Vec<[f32; 6]>, NoMemory> {
        aabbs_of(self.bounds.iter().map(|b| b.0), self.all)
    }

    /// The instance's record; addresses, materials and placement are 0.
    pub fn record(&self) -> Instance {
        Instance {
            lo: self.all.lo,
            hi: self.all.hi,
            pad: self.all.pad(),
            box_count: self.bounds.len() as u32,
            lod: LOD_TRIANGLES,
            ..Instance::default()
        }
    }
}

/// Writes the placement of the mesh's grid into its record.
pub fn place_mesh(record: &mut Instance, placement: &Placement) {
    record.translation = placement.world_from_index.translation.to_array();
    record.adjugate = placement.adjugate.map(|row| row.to_array());
    record.determinant = placement.determinant;
}
