//! Writes a triangle mesh as binary PLY, from which [`crate::open_mesh`] reads the same surface.
//!
//! ```text
//! header (text)   element vertex n: double x y z, and float nx ny nz where the mesh is smooth
//!                 element face m: list uchar uint vertex_indices, uint material_index
//! n times         3 × f64, and 3 × f32: little-endian
//! m times         3 (u8), 3 × u32, u32
//! ```
//! A PLY file has one normal per vertex. A mesh with one normal at each corner comes back equal, with the same content hash. Where the
//! triangles at a corner have different normals, each corner of each triangle becomes a vertex of its own: the surface is the same, the hash
//! is another.

use std::io::Write;
use std::path::Path;

use pumice_core::octahedral::{self, FLAT};
use pumice_core::{Error, MeshData, write_atomically};

use crate::error::FormatError;

/// Writes the mesh. The file appears complete or not at all.
///
/// # Errors
/// When the system refuses, or the name is taken by something else than a file.
pub fn write_mesh(path: &Path, mesh: &MeshData) -> pumice_core::Result<()> {
    let vertices = Vertices::of(mesh);
    write_atomically(path, |file| {
        vertices.write(mesh, file).map_err(|e| Error::from(FormatError::io(path)(e)))
    })
}

/// The vertices of the file, and the vertices of each triangle.
struct Vertices {
    positions: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    /// One a vertex, 0 where a triangle keeps its own; empty for a flat mesh.
    normals: Vec<[f32; 3]>,
}

impl Vertices {
    fn of(mesh: &MeshData) -> Self {
        let (positions, triangles) = (mesh.positions().to_vec(), mesh.triangles().to_vec());
        if !mesh.is_smooth() {
            return Self { positions, triangles, normals: Vec::new() };
        }
        // One normal a corner, if this is the same mesh once it is read.
        let mut words = vec![FLAT; positions.len()];
        for (triangle, normals) in triangles.iter().zip(mesh.normals()) {
            let named = triangle.iter().zip(normals).filter(|(_, word)| **word != FLAT);
            named.for_each(|(&corner, &word)| words[corner as usize] = word);
        }
        let normals: Vec<[f32; 3]> = words.into_iter().map(direction).collect();
        let materials = (0..triangles.len()).map(|t| mesh.material(t)).collect();
        let read = MeshData::new(positions.clone(), triangles.clone(), materials)
            .and_then(|read| read.with_corner_normals(&normals));
        if read.is_ok_and(|read| read.content_hash() == mesh.content_hash()) {
            return Self { positions, triangles, normals };
        }
        // Otherwise a vertex for each corner of each triangle.
        let corners = triangles.iter().flatten().map(|&c| positions[c as usize]).collect();
        let triangles = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let normals = mesh.normals().iter().flatten().map(|&word| direction(word)).collect();
        Self { positions: corners, triangles, normals }
    }

    fn write(&self, mesh: &MeshData, file: &mut impl Write) -> std::io::Result<()> {
        write!(file, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", self.positions.len())?;
        for axis in ["x", "y", "z"] {
            writeln!(file, "property double {axis}")?;
        }
        for axis in ["nx", "ny", "nz"].iter().filter(|_| !self.normals.is_empty()) {
            writeln!(file, "property float {axis}")?;
        }
        write!(file, "element face {}\nproperty list uchar uint vertex_indices\n", self.triangles.len())?;
        write!(file, "property uint material_index\nend_header\n")?;
        for (i, position) in self.positions.iter().enumerate() {
            position.iter().try_for_each(|v| file.write_all(&v.to_le_bytes()))?;
            let normal = self.normals.get(i).into_iter().flatten();
            normal.into_iter().try_for_each(|v| file.write_all(&v.to_le_bytes()))?;
        }
        for (i, triangle) in self.triangles.iter().enumerate() {
            file.write_all(&[3])?;
            let numbers = triangle.iter().copied().chain([mesh.material(i)]);
            numbers.into_iter().try_for_each(|n| file.write_all(&n.to_le_bytes()))?;
        }
        Ok(())
    }
}

/// The direction of a word; 0 where the surface keeps its own normal.
fn direction(word: u32) -> [f32; 3] {
    if word == FLAT { [0.0; 3] } else { octahedral::decode(word) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::open_mesh;

    /// Two triangles that share an edge, with numbers that no 32-bit float holds.
    fn flat(materials: Vec<u32>) -> MeshData {
        let positions = vec![[0.1, 0.0, 1e-300], [1.0 + 1e-12, 0.0, 0.0], [1.0, 1.0, 0.3], [0.0, 1.0, 0.0]];
        MeshData::new(positions, vec![[0, 1, 2], [0, 2, 3]], materials).unwrap()
    }

    fn back(mesh: &MeshData) -> MeshData {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        write_mesh(&path, mesh).unwrap();
        open_mesh(&path).unwrap()
    }

    #[test]
    fn what_is_written_is_read_to_the_last_bit() {
        for mesh in [flat(vec![]), flat(vec![0, 0]), flat(vec![4, u32::MAX])] {
            assert_eq!(
                (back(&mesh).positions(), back(&mesh).triangles()),
                (mesh.positions(), mesh.triangles())
            );
            assert_eq!([0, 1].map(|t| back(&mesh).material(t)), [0, 1].map(|t| mesh.material(t)));
            assert_eq!(back(&mesh).content_hash(), mesh.content_hash());
        }
        let tilted = [[0.3f32, 0.1, 1.0], [0.0, 0.5, 0.9], [-0.7, 0.2, 0.4], [0.0; 3]];
        let smooth = flat(vec![1, 2]).with_corner_normals(&tilted).unwrap();
        assert!(smooth.is_smooth());
        assert_eq!(back(&smooth), smooth);
        assert_ne!(back(&flat(vec![1, 2])), smooth);
    }

    /// Where normals differ at a corner, each triangle keeps its places and its normals.
    #[test]
    fn a_sharp_edge_stays_sharp() {
        let of_triangles = [
            [0.3f32, 0.1, 1.0],
            [0.0, 0.5, 0.9],
            [0.7, 0.2, 0.4],
            [0.1, 0.9, 0.3],
            [0.2, 0.2, 0.9],
            [0.0; 3],
        ];
        let sharp = flat(vec![1, 2]).with_triangle_normals(&of_triangles).unwrap();
        let read = back(&sharp);
        assert_eq!(read.normals(), sharp.normals());
        let places = |mesh: &MeshData| -> Vec<[f64; 3]> {
            mesh.triangles().iter().flatten().map(|&c| mesh.positions()[c as usize]).collect()
        };
        assert_eq!(places(&read), places(&sharp));
        assert_eq!([read.material(0), read.material(1)], [1, 2]);
    }
}
