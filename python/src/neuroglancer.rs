//! States of Neuroglancer.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use pumice_session::neuroglancer::{self, State};
use pumice_session::{OpenOptions, Residence};
use pyo3::prelude::*;

use crate::errors::{IntoException, input};
use crate::job::{Job, job_of};
use crate::scene::Scene;
use crate::volume::Volume;
use crate::waiting::released;

/// A state of Neuroglancer as a scene, its volumes, and what is left out of it, one line each. It is `text`, JSON or a link, or the content of the file
/// `path`, from whose folder relative URLs count, as those of a text do from the working folder. `layer_files` has copies of layers.
#[pyfunction]
#[pyo3(signature = (text, path, layer_files, size, job=None))]
pub(crate) fn open_state(
    py: Python<'_>,
    text: Option<String>,
    path: PathBuf,
    layer_files: Vec<(String, PathBuf)>,
    size: [u32; 2],
    job: Option<&Bound<'_, Job>>,
) -> PyResult<(Scene, Vec<Volume>, Vec<String>)> {
    let state = state_of(text, &path)?;
    let folder = path.parent().unwrap_or(&path);
    let job = job_of(job);
    let reading = OpenOptions::heeding(&job);
    let opened = released(py, &job, || {
        neuroglancer::open_state(&state, &layer_files, (folder, size), (&reading, Residence::Copied), &job)
    })?;
    opened.scene.validate().map_err(IntoException::into_exception)?;
    let volumes = opened.volumes.into_iter().map(Volume).collect();
    Ok((Scene(opened.scene), volumes, reading.warnings.list()))
}

/// The layers that a state shows, by name, and the path or URL of each one's volume. `text` and `path` as for [`open_state`].
#[pyfunction]
#[pyo3(signature = (text, path))]
pub(crate) fn state_layers(text: Option<String>, path: PathBuf) -> PyResult<Vec<(String, OsString)>> {
    let state = state_of(text, &path)?;
    let sources = state.sources(path.parent().unwrap_or(&path)).map_err(IntoException::into_exception)?;
    // A path object would make one slash of the two of a URL.
    Ok(sources.into_iter().map(|(name, source)| (name, source.into_os_string())).collect())
}

fn state_of(text: Option<String>, path: &Path) -> PyResult<State> {
    match text {
        Some(text) => State::parse(&text).map_err(|e| input(&format_args!("state: {e}"))),
        None => State::at(path)
            .and_then(|state| {
                state.ok_or_else(|| "expected a state of Neuroglancer, got another file".into())
            })
            .map_err(|e| input(&format_args!("{}: {e}", path.display()))),
    }
}
