//! Scenes as JSON text. Python has them as dictionaries; only `pumice_scene` defines and checks their fields.

use std::path::PathBuf;

use pumice_scene::Scene;
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::selection::select_labels;
use pyo3::prelude::*;

use crate::errors::{IntoException, input};
use crate::volume::Volume;
use crate::waiting::detached;

pub(crate) fn parse(text: &str) -> PyResult<Scene> {
    Scene::from_json(text).map_err(IntoException::into_exception)
}

fn write(scene: &Scene) -> PyResult<String> {
    scene.to_json().map_err(IntoException::into_exception)
}

/// Checks every field of a scene and returns it with every default written out.
#[pyfunction]
pub(crate) fn scene_checked(text: &str) -> PyResult<String> {
    write(&parse(text)?)
}

/// Reads a scene file; its paths become absolute.
#[pyfunction]
pub(crate) fn scene_load(path: PathBuf) -> PyResult<String> {
    let fault = |e| input(&format_args!("{}: {e}", path.display()));
    write(&Scene::load(&path).map_err(fault)?)
}

/// Writes a scene file, which appears complete or not at all.
#[pyfunction]
pub(crate) fn scene_save(text: &str, path: PathBuf) -> PyResult<()> {
    parse(text)?.save(&path).map_err(|e| input(&format_args!("{}: {e}", path.display())))
}

/// Composes a scene that shows a volume: places, frames and lights it.
#[pyfunction]
#[pyo3(signature = (volume, source, size, labels, pick, view_deg))]
pub(crate) fn figure(
    py: Python<'_>,
    volume: &Bound<'_, Volume>,
    source: PathBuf,
    size: [u32; 2],
    labels: Option<Vec<u64>>,
    pick: Option<usize>,
    view_deg: [f64; 2],
) -> PyResult<String> {
    let volume = &volume.get().0;
    let table = volume.labels();
    let labels = match labels {
        None => None,
        Some(_) if pick.is_some() => return Err(input(&"give labels or pick, not both")),
        Some(ids) => {
            let dense = |id| {
                table.index_of(id).ok_or_else(|| input(&format_args!("labels: the volume has no label {id}")))
            };
            Some(ids.into_iter().map(dense).collect::<PyResult<Vec<u32>>>()?)
        }
    };
    detached(py, || {
        let labels = labels.or_else(|| pick.map(|n| select_labels(volume, n)));
        compose(volume, source, &FigureOptions { size, labels, view_deg }).to_json()
    })
}
