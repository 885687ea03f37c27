//! A triangle mesh as plain data: where its corners are, which three make a triangle, which material each triangle has.
//!
//! A mesh stands beside volumes in a scene and is no volume: nothing here is compressed. Whoever reads a mesh file fills
//! [`MeshData::new`]; what it lets through, renderers may index and compute with unasked.

use xxhash_rust::xxh3::Xxh3;

/// Most triangles, and most corners: numbers above are kept for marks.
pub const MAX_TRIANGLES: usize = 1 << 31;

/// Why numbers make no mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// A place is NaN or infinite.
    #[error("corner {corner}: expected finite numbers, got {position:?}")]
    NotFinite {
        /// Which.
        corner: usize,
        /// What was given.
        position: [f64; 3],
    },
    /// A triangle names a corner that is not there.
    #[error("triangle {triangle} names corner {corner}, but there are {corners}")]
    NoSuchCorner {
        /// Which triangle.
        triangle: usize,
        /// The corner's number.
        corner: u32,
        /// How many corners there are.
        corners: usize,
    },
    /// Not one material for each triangle.
    #[error("expected a material for each of {triangles} triangles, got {materials}")]
    Materials {
        /// Number of triangles.
        triangles: usize,
        /// Number of materials.
        materials: usize,
    },
    /// More than numbers can name.
    #[error("{what}: {got} are more than the limit of 2^31")]
    TooMany {
        /// Triangles or corners.
        what: &'static str,
        /// How many.
        got: usize,
    },
}

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshData {
    positions: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    materials: Vec<u32>,
}

impl MeshData {
    /// A mesh of corners in its own space, triangles that name three of them each (counterclockwise as seen from outside), and a
    /// material index for each triangle; no material indices: all have 0.
    ///
    /// # Errors
    /// [`MeshError`] names the first number at fault.
    pub fn new(
        positions: Vec<[f64; 3]>,
        triangles: Vec<[u32; 3]>,
        materials: Vec<u32>,
    ) -> Result<Self, MeshError> {
        for (what, got) in [("corners", positions.len()), ("triangles", triangles.len())] {
            if got > MAX_TRIANGLES {
                return Err(MeshError::TooMany { what, got });
            }
        }
        if let Some(corner) = positions.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
            return Err(MeshError::NotFinite { corner, position: positions[corner] });
        }
        let corners = positions.len();
        for (triangle, &named) in triangles.iter().enumerate() {
            if let Some(&corner) = named.iter().find(|&&c| c as usize >= corners) {
                return Err(MeshError::NoSuchCorner { triangle, corner, corners });
            }
        }
        if !materials.is_empty() && materials.len() != triangles.len() {
            return Err(MeshError::Materials { triangles: triangles.len(), materials: materials.len() });
        }
        Ok(Self { positions, triangles, materials })
    }

    /// Corners, in the mesh's own space.
    pub fn positions(&self) -> &[[f64; 3]] {
        &self.positions
    }

    /// Corners of each triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Material index of a triangle.
    pub fn material(&self, triangle: usize) -> u32 {
        self.materials.get(triangle).copied().unwrap_or(0)
    }

    /// XXH3-128 of all its numbers: of a mesh with other corners, triangles or material indices it is another.
    pub fn content_hash(&self) -> u128 {
        let mut hasher = Xxh3::new();
        for count in [self.positions.len(), self.triangles.len(), self.materials.len()] {
            hasher.update(&(count as u64).to_le_bytes());
        }
        for v in self.positions.iter().flatten() {
            hasher.update(&v.to_bits().to_le_bytes());
        }
        for v in self.triangles.iter().flatten().chain(&self.materials) {
            hasher.update(&v.to_le_bytes());
        }
        hasher.digest128()
    }

    /// Heap bytes.
    pub fn bytes(&self) -> u64 {
        (self.positions.len() * 24 + self.triangles.len() * 12 + self.materials.len() * 4) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_the_number_at_fault() {
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let text =
            |p: &[[f64; 3]], t: Vec<[u32; 3]>, m| MeshData::new(p.to_vec(), t, m).unwrap_err().to_string();
        assert_eq!(
            text(&[[0.0; 3], [0.0, f64::NAN, 1.0]], vec![], vec![]),
            "corner 1: expected finite numbers, got [0.0, NaN, 1.0]"
        );
        assert_eq!(
            text(&corners, vec![[0, 1, 2], [0, 3, 1]], vec![]),
            "triangle 1 names corner 3, but there are 3"
        );
        assert_eq!(
            text(&corners, vec![[0, 1, 2]], vec![1, 2]),
            "expected a material for each of 1 triangles, got 2"
        );
        let mesh = MeshData::new(corners, vec![[0, 1, 2], [2, 1, 0]], vec![4, 5]).unwrap();
        assert_eq!([mesh.material(0), mesh.material(1), mesh.material(2)], [4, 5, 0]);
    }
}
