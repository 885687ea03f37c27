//! Collects all faces in the arrays that mesh formats use.

use pumice_core::{CompressedVolume, Error, Job, Result};
use rustc_hash::FxHashMap;

use crate::{Interfaces, for_each_face_block};

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
    /// Those of [`for_each_face_block`], and [`Error::Limit`] for 2³² vertices or more.
    pub fn new(
        volume: &CompressedVolume,
        visible: &[bool],
        interfaces: Interfaces,
        corners: Corners,
        job: &Job,
    ) -> Result<Self> {
        let mut mesh = Self::default();
        let mut number_of: FxHashMap<[u32; 3], u32> = FxHashMap::default();
        for_each_face_block(volume, visible, interfaces, job, |block| {
            for quad in &block.quads {
                let mut numbers = [0; 4];
                for (number, corner) in numbers.iter_mut().zip(quad) {
                    let next = vertex_number(mesh.vertices.len())?;
                    *number = match corners {
                        Corners::Own => next,
                        Corners::Shared => *number_of.entry(*corner).or_insert(next),
                    };
                    if *number == next {
                        // A volume has at most 2²³ voxels along an axis.
                        mesh.vertices.push(corner.map(|c| c as i32));
                    }
                }
                mesh.quads.push(numbers);
            }
            mesh.labels.extend(block.labels);
            Ok(())
        })?;
        Ok(mesh)
    }
}

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
