//! The surface of a volume at a level of detail, as arrays.

use pumice_export::{Corners, Merging, QuadMesh, count_surface_faces};
use pumice_session::{DetailLevel, SessionError};
use pyo3::prelude::*;

use crate::array::{Array, Data};
use crate::errors::input;
use crate::job::{Job, job_of};
use crate::volume::Volume;
use crate::waiting::released;

/// Number of faces of the surface of the labels that are `visible`, by row of the table; an error where there are more than `limit`.
#[pyfunction]
#[pyo3(signature = (volume, visible, *, lod, merged, limit, job=None))]
pub(crate) fn count_faces(
    py: Python<'_>,
    volume: &Bound<'_, Volume>,
    visible: Vec<bool>,
    lod: u32,
    merged: bool,
    limit: u64,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<u64> {
    let (job, level, volume) = (job_of(job), level_of(lod)?, &volume.get().0);
    released(py, &job, || {
        count_surface_faces(volume, &visible, level, merging(merged), limit, &job).map_err(SessionError::from)
    })
}

/// The surface of the labels that are `visible`, by row of the table: vertices, quads, label of each quad.
#[pyfunction]
#[pyo3(signature = (volume, visible, *, lod, merged, shared_corners, job=None))]
pub(crate) fn surface(
    py: Python<'_>,
    volume: &Bound<'_, Volume>,
    visible: Vec<bool>,
    lod: u32,
    merged: bool,
    shared_corners: bool,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<(Array, Array, Array)> {
    let (job, level, volume) = (job_of(job), level_of(lod)?, &volume.get().0);
    let corners = if shared_corners { Corners::Shared } else { Corners::Own };
    let mesh = released(py, &job, || {
        QuadMesh::of_surface(volume, &visible, level, merging(merged), corners, &job)
            .map_err(SessionError::from)
    })?;
    let (vertices, quads) = (mesh.vertices.len(), mesh.quads.len());
    Ok((
        Array::new(Data::I32(mesh.vertices.into_flattened()), &[vertices, 3]),
        Array::new(Data::U32(mesh.quads.into_flattened()), &[quads, 4]),
        Array::new(Data::U32(mesh.labels), &[quads]),
    ))
}

fn merging(merged: bool) -> Merging {
    if merged { Merging::Merged } else { Merging::Plain }
}

fn level_of(lod: u32) -> PyResult<DetailLevel> {
    match lod {
        1 => Ok(DetailLevel::Voxels),
        4 => Ok(DetailLevel::Cells),
        16 => Ok(DetailLevel::Boxes),
        other => Err(input(&format_args!("lod: expected 1, 4 or 16, got {other}"))),
    }
}
