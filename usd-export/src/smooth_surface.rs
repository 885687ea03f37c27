//! The smoothed surface of an instance, sorted by material: what every mesh format writes of it.

use std::ops::Range;

use pumice_core::reserve::sorted_by_group;
use pumice_core::{Error, Job};

use crate::budget::fits_32_bits;
use crate::drawn::Drawn;
use crate::labelled_surface::FACES;
use crate::{Budget, Result, SmoothMesh};

/// A smoothed surface whose faces of one material come after each other.
pub(crate) struct SmoothSurface {
    pub(crate) mesh: SmoothMesh,
    /// Places of the faces of each material, in the order of [`Drawn::materials`]; empty for a material that no face has.
    pub(crate) of_material: Vec<Range<u32>>,
}

impl SmoothSurface {
    /// The smoothed surface of what is drawn.
    ///
    /// # Errors
    /// [`Error::Limit`] where it takes more than is left of the budget; [`Error::Memory`]; [`Error::Cancelled`].
    pub(crate) fn new(drawn: &Drawn<'_>, budget: &mut Budget, job: &Job) -> Result<Self> {
        let take = |faces| budget.take_smooth_faces(faces);
        let mut mesh = SmoothMesh::new(drawn.volume, &drawn.visible, drawn.region, job, take)?;
        let vertices = &mesh.vertices;
        let material =
            |quad: &[u32; 4]| drawn.material_of[vertices[quad[0] as usize].label as usize] as usize;
        fits_32_bits(FACES, mesh.quads.len() as u64)?;
        let quads = std::mem::take(&mut mesh.quads);
        let (quads, of_material) =
            sorted_by_group(quads, drawn.materials.len(), material, FACES).map_err(Error::from)?;
        mesh.quads = quads;
        Ok(Self { mesh, of_material })
    }

    /// Lowest and highest position in index space; both 0 where there is no surface.
    pub(crate) fn bounds(&self) -> [[f32; 3]; 2] {
        let bounds = self.mesh.points.iter().fold(None, |bounds: Option<[[f32; 3]; 2]>, point| {
            let [low, high] = bounds.unwrap_or([*point; 2]);
            Some([[0, 1, 2].map(|a| low[a].min(point[a])), [0, 1, 2].map(|a| high[a].max(point[a]))])
        });
        bounds.unwrap_or_default()
    }
}
