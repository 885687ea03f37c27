//! A triangle mesh as plain data: positions of corners, three corners for each triangle, a material index for each triangle.
//!
//! A mesh stands beside volumes in a scene; nothing of it is compressed but its normals. Readers of mesh files call [`MeshData::new`],
//! which checks the data, so that renderers can use it without further checks.
//!
//! **Normals** of meshes that are shaded smooth are words of 32 bits, one for each corner of each triangle; [`crate::octahedral`] describes
//! them. A mesh that is flat everywhere has none. So an edge may be sharp on one side alone, and smoothness costs just twelve bytes a
//! triangle.

use xxhash_rust::xxh3::Xxh3;

use crate::octahedral;

/// Largest number of triangles, and of corners; greater indices are reserved for marks.
pub const MAX_TRIANGLES: usize = 1 << 31;

/// Reasons to refuse the data of a mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// A position is NaN or infinite.
    #[error("corner {corner}: expected finite numbers, got {position:?}")]
    NotFinite {
        /// Index of the corner.
        corner: usize,
        /// The position that was given.
        position: [f64; 3],
    },
    /// A triangle refers to a corner that does not exist.
    #[error("triangle {triangle}: expected corners below {corners}, got {corner}")]
    NoSuchCorner {
        /// Index of the triangle.
        triangle: usize,
        /// Index of the corner.
        corner: u32,
        /// Number of corners.
        corners: usize,
    },
    /// The number of materials differs from the number of triangles.
    #[error("expected a material for each of {triangles} triangles, got {materials}")]
    Materials {
        /// Number of triangles.
        triangles: usize,
        /// Number of materials.
        materials: usize,
    },
    /// The number of normals differs from the number of corners that need one.
    #[error("expected a normal for each of {places} {what}, got {normals}")]
    Normals {
        /// "corners" (of the mesh) or "corners of triangles".
        what: &'static str,
        /// Number of these corners.
        places: usize,
        /// Number of normals.
        normals: usize,
    },
    /// A normal is NaN or infinite.
    #[error("normal {number}: expected finite numbers, got {normal:?}")]
    NormalNotFinite {
        /// Index of the normal.
        number: usize,
        /// The normal that was given.
        normal: [f32; 3],
    },
    /// More triangles or corners than indices can address.
    #[error("{what}: expected at most 2^31, got {got}")]
    TooMany {
        /// "triangles" or "corners".
        what: &'static str,
        /// Their number.
        got: usize,
    },
}

/// A checked triangle mesh; see the module documentation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshData {
    positions: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    materials: Vec<u32>,
    /// Normals of each triangle's corners; empty where everything is flat.
    normals: Vec<[u32; 3]>,
}

/// A normal closer to its triangle's own normal than this counts as flat: rounding to single precision and to 32-bit words turns a normal
/// by less. It is the cosine of 1e-4 rad.
const FLAT_COSINE: f64 = 1.0 - 5e-9;

impl MeshData {
    /// A mesh of corners in its own space, of triangles with three corner indices each (counterclockwise as seen from outside), and of a
    /// material index for each triangle. Without material indices, all triangles have index 0.
    ///
    /// # Errors
    /// [`MeshError`], which gives the first number at fault.
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
        Ok(Self { positions, triangles, materials, normals: Vec::new() })
    }

    /// Makes the mesh smooth with a normal for each corner of the mesh. Normals point outward and may have any length. For a normal of
    /// length 0, the triangles that meet at the corner keep their own normals there.
    ///
    /// # Errors
    /// [`MeshError`] where the number of normals is wrong, or a normal is not finite.
    pub fn with_corner_normals(self, normals: &[[f32; 3]]) -> Result<Self, MeshError> {
        self.check_normals("corners", self.positions.len(), normals)?;
        let of_triangle = |t: &[u32; 3]| t.map(|c| normals[c as usize]);
        let all = self.triangles.iter().map(of_triangle).collect();
        Ok(self.smooth(all))
    }

    /// Makes the mesh smooth with a normal for each corner of each triangle, one triangle after the other. Where triangles that share a
    /// corner have different normals there, the edge between them is sharp.
    ///
    /// # Errors
    /// As [`MeshData::with_corner_normals`].
    pub fn with_triangle_normals(self, normals: &[[f32; 3]]) -> Result<Self, MeshError> {
        self.check_normals("corners of triangles", 3 * self.triangles.len(), normals)?;
        Ok(self.smooth(normals.as_chunks::<3>().0.to_vec()))
    }

    fn check_normals(
        &self,
        what: &'static str,
        places: usize,
        normals: &[[f32; 3]],
    ) -> Result<(), MeshError> {
        if normals.len() != places {
            return Err(MeshError::Normals { what, places, normals: normals.len() });
        }
        match normals.iter().position(|n| n.iter().any(|v| !v.is_finite())) {
            Some(number) => Err(MeshError::NormalNotFinite { number, normal: normals[number] }),
            None => Ok(()),
        }
    }

    fn smooth(mut self, normals: Vec<[[f32; 3]; 3]>) -> Self {
        self.normals = std::iter::zip(&self.triangles, normals)
            .map(|(triangle, normals)| {
                let flat = unit(normal_of(triangle.map(|c| self.positions[c as usize])));
                normals.map(|n| match (unit(n.map(f64::from)), flat) {
                    (None, _) => octahedral::FLAT,
                    (Some(n), Some(flat)) if dot(n, flat) > FLAT_COSINE => octahedral::FLAT,
                    (Some(n), _) => octahedral::encode(n),
                })
            })
            .collect();
        if self.normals.iter().flatten().all(|&n| n == octahedral::FLAT) {
            self.normals = Vec::new();
        }
        self
    }

    /// Normals at the corners of each triangle in the form of [`crate::octahedral`]; empty where everything is flat.
    pub fn normals(&self) -> &[[u32; 3]] {
        &self.normals
    }

    /// Whether some triangle is shaded smooth.
    pub fn is_smooth(&self) -> bool {
        !self.normals.is_empty()
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

    /// XXH3-128 of all corners, triangles, material indices and normals. Indices that were left out count as the zeros that they stand for, so
    /// that a mesh has the same hash when it is read from a file.
    pub fn content_hash(&self) -> u128 {
        let mut hasher = Xxh3::new();
        for count in [self.positions.len(), self.triangles.len(), self.triangles.len()] {
            hasher.update(&(count as u64).to_le_bytes());
        }
        for v in self.positions.iter().flatten() {
            hasher.update(&v.to_bits().to_le_bytes());
        }
        let materials = (0..self.triangles.len()).map(|triangle| self.material(triangle));
        let corners = self.triangles.iter().flatten().copied();
        for v in corners.chain(materials).chain(self.normals.iter().flatten().copied()) {
            hasher.update(&v.to_le_bytes());
        }
        hasher.digest128()
    }

    /// Bytes held on the heap.
    pub fn bytes(&self) -> u64 {
        let triangles = self.triangles.len() + self.normals.len();
        (self.positions.len() * 24 + triangles * 12 + self.materials.len() * 4) as u64
    }
}

/// Normal of a triangle, of any length, on the side from which its corners appear counterclockwise.
fn normal_of([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    let from_a = |p: [f64; 3]| [0, 1, 2].map(|i| p[i] - a[i]);
    let (u, v) = (from_a(b), from_a(c));
    // The sides are scaled to one length first, because products of tiny sides would be 0.
    let (Some(u), Some(v)) = (unit(u), unit(v)) else { return [0.0; 3] };
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

/// The vector scaled to length 1; `None` for a zero or infinite one.
fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let largest = v.iter().fold(0.0f64, |m, c| m.max(c.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return None;
    }
    let v = v.map(|c| c / largest);
    let length = dot(v, v).sqrt();
    Some(v.map(|c| c / length))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
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
            "triangle 1: expected corners below 3, got 3"
        );
        assert_eq!(
            text(&corners, vec![[0, 1, 2]], vec![1, 2]),
            "expected a material for each of 1 triangles, got 2"
        );
        let mesh = MeshData::new(corners, vec![[0, 1, 2], [2, 1, 0]], vec![4, 5]).unwrap();
        assert_eq!([mesh.material(0), mesh.material(1), mesh.material(2)], [4, 5, 0]);
        let hash = |materials| {
            let [a, b] = [[0, 1, 2], [2, 1, 0]];
            MeshData::new(mesh.positions.clone(), vec![a, b], materials).unwrap().content_hash()
        };
        assert_eq!(hash(vec![]), hash(vec![0, 0]));
        assert_ne!(hash(vec![]), hash(vec![0, 1]));
    }

    #[test]
    fn normals_are_counted_checked_and_left_out_where_flat() {
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        let mesh = || MeshData::new(corners.clone(), vec![[0, 1, 2], [1, 3, 2]], vec![]).unwrap();
        let up = [0.0, 0.0, 2.0];
        let fault = |n: &[[f32; 3]]| mesh().with_corner_normals(n).unwrap_err().to_string();
        assert_eq!(fault(&[up; 3]), "expected a normal for each of 4 corners, got 3");
        assert_eq!(
            fault(&[up, [0.0, f32::NAN, 1.0], up, up]),
            "normal 1: expected finite numbers, got [0.0, NaN, 1.0]"
        );
        let told = mesh().with_triangle_normals(&[up; 5]).unwrap_err().to_string();
        assert_eq!(told, "expected a normal for each of 6 corners of triangles, got 5");
        // Zero normals, and normals that the triangles have anyway.
        for same in [[0.0; 3], up, [0.0, 5e-5, 1.0], [-0.0, 0.0, f32::MIN_POSITIVE]] {
            assert_eq!(mesh().with_corner_normals(&[same; 4]).unwrap(), mesh(), "{same:?}");
        }
        let bent = mesh().with_corner_normals(&[up, up, [0.3, 0.0, 1.0], up]).unwrap();
        assert!(bent.is_smooth() && bent.content_hash() != mesh().content_hash());
        assert_eq!(bent.bytes(), mesh().bytes() + 24);
        let word = bent.normals()[0][2];
        assert_eq!(
            bent.normals(),
            [[octahedral::FLAT, octahedral::FLAT, word], [octahedral::FLAT, octahedral::FLAT, word]]
        );
        let by_triangle = [up, up, [0.3, 0.0, 1.0], up, up, up];
        let sharp = mesh().with_triangle_normals(&by_triangle).unwrap();
        assert_eq!(sharp.normals(), [[octahedral::FLAT, octahedral::FLAT, word], [octahedral::FLAT; 3]]);
        // A normal on the other side of a triangle is not the triangle's own.
        assert!(mesh().with_corner_normals(&[[0.0, 0.0, -1.0]; 4]).unwrap().is_smooth());
        // A triangle without area has no normal of its own.
        let line = MeshData::new(corners[..2].to_vec(), vec![[0, 1, 1]], vec![]).unwrap();
        assert!(line.with_corner_normals(&[up; 2]).unwrap().is_smooth());
    }
}
