//! Triangle meshes built from Python arrays.

use std::path::PathBuf;
use std::sync::Arc;

use pumice_core::MeshData;
use pumice_formats::{open_mesh, write_mesh};
use pumice_session::SessionError;
use pyo3::buffer::{Element, PyBuffer};
use pyo3::prelude::*;

use crate::errors::input;
use crate::waiting::detached;

/// A validated, immutable triangle mesh.
#[pyclass(frozen, module = "pumice._native")]
pub(crate) struct Mesh(pub(crate) Arc<MeshData>);

#[pymethods]
impl Mesh {
    /// Corners (n, 3) as 64-bit floats, triangles (m, 3) and materials (m,) as unsigned 32-bit integers; without materials all are 0.
    /// Normals as 32-bit floats, of corners (n, 3) or, with `of_triangles`, (m, 3, 3); without normals all is flat.
    #[new]
    #[pyo3(signature = (positions, triangles, materials, normals, of_triangles))]
    fn new(
        py: Python<'_>,
        positions: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        materials: &Bound<'_, PyAny>,
        normals: Option<&Bound<'_, PyAny>>,
        of_triangles: bool,
    ) -> PyResult<Self> {
        let positions = threes(numbers::<f64>(positions)?)?;
        let triangles = threes(numbers::<u32>(triangles)?)?;
        let materials = numbers::<u32>(materials)?;
        let normals = normals.map(|all| threes(numbers::<f32>(all)?)).transpose()?;
        let made = || {
            let mesh = MeshData::new(positions, triangles, materials)?;
            match normals {
                None => Ok(mesh),
                Some(all) if of_triangles => mesh.with_triangle_normals(&all),
                Some(all) => mesh.with_corner_normals(&all),
            }
        };
        detached(py, made).map(|data| Self(Arc::new(data)))
    }

    /// (corners, triangles, bytes in memory).
    fn counts(&self) -> (usize, usize, u64) {
        (self.0.positions().len(), self.0.triangles().len(), self.0.bytes())
    }

    /// Whether some triangle is shaded smooth.
    fn is_smooth(&self) -> bool {
        self.0.is_smooth()
    }

    /// Reads a PLY file, as a scene's meshes are read.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        detached(py, || open_mesh(&path).map_err(SessionError::from)).map(|data| Self(Arc::new(data)))
    }

    /// Writes a PLY file, which appears complete or not at all.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        detached(py, || write_mesh(&path, &self.0))
    }

    /// Hash of all its numbers, 32 hexadecimal digits.
    fn content_hash(&self) -> String {
        format!("{:032x}", self.0.content_hash())
    }
}

fn numbers<T: Element>(array: &Bound<'_, PyAny>) -> PyResult<Vec<T>> {
    PyBuffer::<T>::get(array)?.to_vec(array.py())
}

fn threes<T: Copy>(numbers: Vec<T>) -> PyResult<Vec<[T; 3]>> {
    let (threes, rest) = numbers.as_chunks::<3>();
    if !rest.is_empty() {
        return Err(input(&format_args!("mesh: expected three numbers each, got {} in all", numbers.len())));
    }
    Ok(threes.to_vec())
}
