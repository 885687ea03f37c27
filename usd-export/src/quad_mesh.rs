//! Collects all faces in the arrays that mesh formats use.

use pumice_core::reserve::make_room;
use pumice_core::{CompressedVolume, Error, Job, Result};
use pumice_transport::geometry::DetailLevel;
use rustc_hash::FxHashMap;

use crate::{Interfaces, Merging, for_each_face_block, for_each_surface_block};

/// What the memory is for, in errors.
const FACES: &str = "a mesh of the faces";

/// Whether faces share corners.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Corners {
    /// Four vertices for each quad: 4/1.02 times the vertices of shared ones on real surfaces, without a search.
    #[default]
    Own,
    /// One vertex at each position. Where labels or voxels touch along an edge, the mesh is not a manifold.
    Shared,
}

/// Quads in index space with the label of each.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct QuadMesh {
    /// Positions in index space, which are whole numbers.
    pub vertices: Vec<[i32; 3]>,
    /// Vertex indices, counter-clockwise as seen from outside the label.
    pub quads: Vec<[u32; 4]>,
    /// Dense label index of each quad.
    pub labels: Vec<u32>,
}

impl QuadMesh {
    /// The surface of the labels that are `visible`, in the order of [`for_each_face_block`]; shared vertices come in the order of their
    /// first quads.
    ///
    /// # Errors
    /// Those of [`for_each_face_block`], [`Error::Limit`] for 2³² vertices or more, and [`Error::Memory`].
    pub fn new(
        volume: &CompressedVolume,
        visible: &[bool],
        interfaces: Interfaces,
        corners: Corners,
        job: &Job,
    ) -> Result<Self> {
        let mut mesh = Self::default();
        let mut number_of = NumberOf::default();
        for_each_face_block(volume, visible, interfaces, job, |block| {
            mesh.make_room(block.quads.len(), corners)?;
            block.quads.iter().try_for_each(|quad| mesh.push(quad, corners, &mut number_of))?;
            mesh.labels.extend(block.labels);
            Ok(())
        })?;
        Ok(mesh)
    }

    /// The surface of the labels that are `visible` at a level of detail, in the order of [`for_each_surface_block`]; shared vertices come
    /// in the order of their first quads.
    ///
    /// # Errors
    /// Those of [`for_each_surface_block`], [`Error::Limit`] for 2³² vertices or more, and [`Error::Memory`].
    pub fn of_surface(
        volume: &CompressedVolume,
        visible: &[bool],
        level: DetailLevel,
        merging: Merging,
        corners: Corners,
        job: &Job,
    ) -> crate::Result<Self> {
        let mut mesh = Self::default();
        let mut number_of = NumberOf::default();
        for_each_surface_block(volume, visible, level, merging, job, |block| {
            mesh.make_room(block.len(), corners)?;
            for rectangle in block {
                mesh.push(&rectangle.corners(), corners, &mut number_of)?;
                mesh.labels.push(rectangle.label);
            }
            Ok(())
        })?;
        Ok(mesh)
    }

    /// Room for so many more quads. (Shared vertices, of which there are about as many as quads, come one by one.)
    fn make_room(&mut self, quads: usize, corners: Corners) -> Result<()> {
        make_room(&mut self.quads, quads, FACES)?;
        make_room(&mut self.labels, quads, FACES)?;
        let vertices = if corners == Corners::Own { 4 * quads } else { 0 };
        Ok(make_room(&mut self.vertices, vertices, FACES)?)
    }

    fn push(&mut self, quad: &[[u32; 3]; 4], corners: Corners, number_of: &mut NumberOf) -> Result<()> {
        let mut numbers = [0; 4];
        for (number, corner) in numbers.iter_mut().zip(quad) {
            let next = vertex_number(self.vertices.len())?;
            *number = match corners {
                Corners::Own => next,
                Corners::Shared => *number_of.entry(*corner).or_insert(next),
            };
            if *number == next {
                make_room(&mut self.vertices, 1, FACES)?;
                // A volume has at most 2²³ voxels along an axis.
                self.vertices.push(corner.map(|c| c as i32));
            }
        }
        self.quads.push(numbers);
        Ok(())
    }
}

/// Number of faces of the surface that [`QuadMesh::of_surface`] collects. It stops at the first block that brings more than `limit`.
///
/// # Errors
/// Those of [`for_each_surface_block`], and [`Error::Limit`] for more faces than `limit`.
pub fn count_surface_faces(
    volume: &CompressedVolume,
    visible: &[bool],
    level: DetailLevel,
    merging: Merging,
    limit: u64,
    job: &Job,
) -> crate::Result<u64> {
    let mut faces = 0;
    for_each_surface_block(volume, visible, level, merging, job, |block| {
        faces += block.len() as u64;
        if faces > limit {
            let what = "faces of the surface, counted so far".into();
            return Err(Error::Limit { what, limit, got: faces }.into());
        }
        Ok(())
    })?;
    Ok(faces)
}

/// Numbers of the vertices by position, where they are shared.
type NumberOf = FxHashMap<[u32; 3], u32>;

fn vertex_number(vertices: usize) -> Result<u32> {
    u32::try_from(vertices).map_err(|_| Error::Limit {
        what: "vertices of a mesh of voxel faces".into(),
        limit: 1 << 32,
        got: vertices as u64 + 1,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_beyond_32_bits_are_refused() {
        assert_eq!(vertex_number(u32::MAX as usize).unwrap(), u32::MAX);
        let error = vertex_number(1 << 32).unwrap_err().to_string();
        assert_eq!(
            error,
            "vertices of a mesh of voxel faces: 4294967297 is more than the limit of 4294967296"
        );
    }
}
